"""The static elastica: a clamped, inextensible rod bent by a force across the radius of its tip.

`static_law` has its laws and their best cubic and cosine; they stand on the elliptic integrals of `integrals`.
"""
