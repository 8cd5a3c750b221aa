"""Recordings for `discovery`: a simulated arm of its own code path, and a registry of public measurements.

Nothing here imports the package that fits these data, so that what generates a recording and what explains it share
no line of code. Modules: `manoeuvres` (motion of the motor), `beam` (spatial discretisation), `disturbances`
(undeclared effects), `twin` (simulation), `recordings` (the named recordings), `registry` (public measured data).
"""
