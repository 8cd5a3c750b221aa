"""A discovered model to take along: as sympy, LaTeX, a Python file that needs numpy alone, C, an FMU, and JSON.

Here belongs what writes a model or reads it again. What fits or shows one does not.
"""

from __future__ import annotations

from discovery.export.c_source import to_c as to_c
from discovery.export.feed_forward import FeedForward as FeedForward
from discovery.export.feed_forward import feed_forward as feed_forward
from discovery.export.files import FORMATS as FORMATS
from discovery.export.files import export_feed_forward as export_feed_forward
from discovery.export.files import export_linear as export_linear
from discovery.export.files import export_model as export_model
from discovery.export.files import read_draws as read_draws
from discovery.export.files import read_fitted as read_fitted
from discovery.export.fitted import FittedModel as FittedModel
from discovery.export.fmu import to_fmu as to_fmu
from discovery.export.json_file import from_json as from_json
from discovery.export.json_file import to_json as to_json
from discovery.export.latex import to_latex as to_latex
from discovery.export.linear import LinearModel as LinearModel
from discovery.export.linear import linearise as linearise
from discovery.export.linear_file import discretise as discretise
from discovery.export.linear_file import linear_to_json as linear_to_json
from discovery.export.linear_file import linear_to_python as linear_to_python
from discovery.export.source import to_numpy as to_numpy
from discovery.export.symbolic import SymbolicModel as SymbolicModel
from discovery.export.symbolic import to_sympy as to_sympy
from discovery.export.sympy_file import to_sympy_file as to_sympy_file
