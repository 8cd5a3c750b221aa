"""The static elastica: a clamped, inextensible rod bent by a force at its tip, equations (1) to (6) of the paper.

`beam` goes from force to tip by the elliptic integrals of `integrals`; `static_law` is the best cubic spring and radius
law.
"""
