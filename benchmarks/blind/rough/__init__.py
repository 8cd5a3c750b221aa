"""Rough cases: beside the hidden effect there are errors of the model that no effect of the catalogue holds."""
