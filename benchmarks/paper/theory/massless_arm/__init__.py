"""The general dynamic model: a point mass on a massless elastica, equations (7) to (9) of the paper.

`model` says what it is, `simulation` moves it, `radau` explains how its stiffness near the straight arm is treated.
"""
