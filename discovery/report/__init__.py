"""The report of a run: one HTML page, its figures and its tables, from result files alone.

Here belongs what is shown. What computes a number does not.
"""

from __future__ import annotations

from discovery.report.page import build_report as build_report
