"""The Bode plot of a driven system: the response is found where there is one, and stands on the page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import synthetic_run
import xarray as xr
from scipy.signal import butter, sosfilt, sosfreqz

from discovery.report.figures.residual import draw_bode, response
from discovery.report.results import Run
from discovery.results.curves import save_groups


def test_the_response_of_a_filter_is_found_where_the_input_has_power() -> None:
    time = np.arange(20_000) / 200.0
    rng = np.random.default_rng(2)
    given = sosfilt(butter(4, 20.0, fs=200.0, output="sos"), rng.standard_normal(time.size))
    low_pass = butter(2, 5.0, fs=200.0, output="sos")
    frequency, found = response(time, given, sosfilt(low_pass, given))
    assert frequency.max() < 60.0
    here = (frequency > 0.5) & (frequency < 15.0)
    expected = sosfreqz(low_pass, frequency[here], fs=200.0)[1]
    assert found[here] == pytest.approx(expected, rel=0.1)
    unrelated = response(time, given, rng.standard_normal(time.size))[1]
    assert np.isnan(unrelated).mean() > 0.9


def test_a_driven_oscillator_has_a_bode_plot(tmp_path: Path) -> None:
    results = synthetic_run.write_oscillator_run(tmp_path)
    time = np.arange(6000) / 600.0
    given = np.random.default_rng(1).standard_normal(time.size)
    read = sosfilt(butter(2, 20.0, fs=600.0, output="sos"), given)[:, None]
    both = ("time", "channel")
    variables = {"measured": (both, read), "deflection": ("time", read[:, 0]), "input": ("time", given)}
    variables |= {name: (both, size * read) for name, size in (("before", 0.5), ("after", 1.0))}
    save_groups(
        tmp_path / "trajectories.nc",
        {"train_a": xr.Dataset(variables, {"time": time, "channel": ["output"]})},
    )
    picture = draw_bode(Run(tmp_path, results))
    assert picture
    gains = {line.get_label(): line.get_ydata() for line in picture.figure.axes[0].lines}
    assert set(gains) == {"measured", "before: declared model", "after: final model"}
    assert gains["before: declared model"][:9] == pytest.approx(0.5 * gains["after: final model"][:9])
