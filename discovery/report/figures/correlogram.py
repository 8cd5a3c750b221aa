"""Residual tests of the field: autocorrelation, and cross-correlation with the input, with 99 % bands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from discovery.foundation.arrays import FloatArray
from discovery.foundation.sampling import median_step
from discovery.report.figures.phase import main_period
from discovery.report.numbers import fixed
from discovery.report.results import Run, Trajectory
from discovery.report.style import GREY, LINES, Picture, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Periods of the motion and samples that the lags span at least; the part of the recording that they may not exceed.
_PERIODS, _FEWEST, _PART = 2.0, 60, 4
#: Standard normal quantile of a two-sided 99 % band (Ljung, System Identification, 2nd ed., section 16.6).
_BAND = 2.576


def correlation(a: FloatArray, b: FloatArray, most: int) -> FloatArray:
    """Return the correlation (most + 1,) of a (n,) with b so many samples earlier, for lags 0 to `most`.

    NaN marks gaps, which count as the mean; it is zero where either series does not vary.
    """
    x, y = (np.nan_to_num(v - np.nanmean(v)) for v in (a, b))
    size = np.sqrt(np.sum(x**2) * np.sum(y**2))
    if not size:
        return np.zeros(most + 1)
    return np.array([np.sum(x[lag:] * y[: y.size - lag]) for lag in range(most + 1)]) / size


def fit_per_cent(measured: FloatArray, left: FloatArray) -> float:
    """Return the fit [%]: 100 where nothing is left, 0 where the mean of the measurement would do as well."""
    both = np.isfinite(measured) & np.isfinite(left)
    spread = np.linalg.norm(measured[both] - measured[both].mean())
    return float(100 * (1 - np.linalg.norm(left[both]) / spread)) if spread else float("nan")


def draw(run: Run) -> Picture | None:
    """Return both correlations of the first held-out recording, of the first one otherwise, on its first channel."""
    shown = run.judged
    if shown is None or not np.isfinite(shown.measured[:, 0]).any():
        return None
    left = {m: shown.models[m][:, 0] - shown.measured[:, 0] for m in ("before", "after")}
    left = {m: values for m, values in left.items() if np.isfinite(values).any()}
    if not left:
        return None
    driven = shown.input is not None and float(np.nanstd(shown.input)) > 0
    figure = new_figure(4.2 if driven else 2.5)
    axes = np.atleast_1d(figure.subplots(1 + driven, 1, sharex=True))
    _panel(axes[0], shown, {m: (values, values) for m, values in left.items()}, "with itself")
    if shown.input is not None and driven:
        _panel(axes[1], shown, {m: (values, shown.input) for m, values in left.items()}, f"with the {run.input_name}")
    axes[-1].set_xlabel("lag [s]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=2)
    fits = " → ".join(f"{fixed(fit_per_cent(shown.measured[:, 0], values), 2)} %" for values in left.values())
    also = ", and its correlation with earlier input" if driven else ""
    return Picture(
        "correlogram",
        figure,
        f"Autocorrelation of the residual on {shown.name}{also}; in the grey band, 99 % of a white residual that does "
        f"not depend on the input. Fit, before → after: {fits}.",
        f"Correlation of the residual of {shown.name} against the lag, before and after. Fit: {fits}.",
    )


def _panel(axes: Axes, shown: Trajectory, pairs: dict[str, tuple[FloatArray, FloatArray]], what: str) -> None:
    """Draw one kind of correlation against the lag."""
    step = median_step(shown.time)
    reference = shown.measured[:, 0] if shown.deflection is None else shown.deflection
    most = int(min(max(_FEWEST, _PERIODS * main_period(shown.time, reference) / step), shown.time.size // _PART))
    lags = step * np.arange(most + 1)
    wide = _BAND / np.sqrt(np.isfinite(shown.measured[:, 0]).sum())
    axes.axhspan(-wide, wide, color=GREY, alpha=0.25, linewidth=0)
    for model, (a, b) in pairs.items():
        axes.plot(lags, correlation(a, b, most), **LINES[model])
    axes.set_ylabel(f"correlation\n{what}")
    axes.set_xlim(0, lags[-1])
