"""From a base and a sum of effects to a model, its equation of motion and its program.

Here belongs symbolic mathematics alone. What computes with numbers of a recording does not.
"""
