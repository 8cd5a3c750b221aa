"""The source paper, whole: each of its equations, figures and claims beside this project's own numbers.

The paper's recordings were never published; the twin of `discovery_datasets` stands in for its rig. This package alone
may use both the twin and the models that are fitted. Run it as ``python -m benchmarks.paper FOLDER``.
"""
