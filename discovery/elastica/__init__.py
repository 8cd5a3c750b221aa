"""The static elastica: a clamped, inextensible rod bent by a force at its tip, equations (1) to (6) of the paper.

`beam` and `force_map` are its two directions, from force to tip and back; both stand on the elliptic integrals of
`integrals`. `series` and `small_deflection` are its limits, `static_law` its best cubic spring and radius law.
"""
