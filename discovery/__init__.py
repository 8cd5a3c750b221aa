"""Discover equations of motion, say how sure they are, and find the effect that a model lacks."""
