"""Sparse regression: candidate terms on smoothed motion, the best equations of them, and how sure they are.

Here belongs what proposes the structure of an equation. What simulates one does not.
"""
