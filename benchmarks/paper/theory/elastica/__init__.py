"""The static elastica under any force, from force to tip and back, and in its limits.

What the package needs of it, a force across the radius, is in `discovery.theory.elastica`.
"""
