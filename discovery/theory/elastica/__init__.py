"""The static elastica: a clamped, inextensible rod bent by a force across the radius of its tip.

`beam` solves it by the elliptic integrals of `integrals`; `static_law` is its best cubic spring and radius law.
"""
