"""Samplers of one posterior, each as its users write it, for `benchmarks/posterior.py`."""
