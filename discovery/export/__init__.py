"""A discovered model to take along: as sympy, LaTeX, a Python file that needs numpy alone, C, an FMU, and JSON.

Here belongs what writes a model or reads it again. What fits or shows one does not.
"""

from __future__ import annotations

from discovery.export.c_source import to_c
from discovery.export.discrete import discretise
from discovery.export.feed_forward import FeedForward, feed_forward
from discovery.export.files import FORMATS, export_feed_forward, export_linear, export_model, read_draws, read_fitted
from discovery.export.fitted import FittedModel
from discovery.export.fmu import to_fmu
from discovery.export.json_file import from_json, to_json
from discovery.export.latex import to_latex
from discovery.export.linear import LinearModel, linearise
from discovery.export.linear_file import linear_to_json, linear_to_python
from discovery.export.source import to_numpy
from discovery.export.symbolic import SymbolicModel, to_sympy
from discovery.export.sympy_file import to_sympy_file

__all__ = [
    "FORMATS",
    "FeedForward",
    "FittedModel",
    "LinearModel",
    "SymbolicModel",
    "discretise",
    "export_feed_forward",
    "export_linear",
    "export_model",
    "feed_forward",
    "from_json",
    "linear_to_json",
    "linear_to_python",
    "linearise",
    "read_draws",
    "read_fitted",
    "to_c",
    "to_fmu",
    "to_json",
    "to_latex",
    "to_numpy",
    "to_sympy",
    "to_sympy_file",
]
