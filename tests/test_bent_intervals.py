"""Intervals to first order beside the odds of their effect."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from discovery.estimation.declared import declared_model
from discovery.estimation.fit import Fit, fit
from discovery.estimation.generalised import without_bent
from discovery.recordings.dataset import load_dataset

BENCH = Path(__file__).parents[1] / "datasets" / "spring_bench" / "rig.toml"


@pytest.fixture(scope="module")
def rubbing() -> Fit:
    train = load_dataset(BENCH).train
    return fit(
        declared_model(train[0]).with_effect("stribeck_friction"), train, start={"f_k": 0.1, "f_b": 0.05, "v_s": 0.02}
    )


def told(found: Fit, sds: dict[str, float], together: float = 0.0) -> Fit:
    """Return a fit with standard deviations in units of the estimates, and a correlation of the amplitudes."""
    names = found.problem.names
    size = np.array([sds.get(n, 0.01) * max(abs(found.values[n]), 1e-9) for n in names])
    covariance = np.diag(size**2)
    a, b = names.index("f_k"), names.index("f_b")
    covariance[a, b] = covariance[b, a] = together * size[a] * size[b]
    return replace(found, covariance=covariance, reasons={})


@pytest.mark.parametrize(
    ("sds", "together", "kept"),
    [
        ({"f_k": 1.0, "f_b": 3.0}, 0.0, False),
        ({"f_k": 0.1, "f_b": 3.0}, 0.0, True),
        # Their sum is known well.
        ({"f_k": 1.0, "f_b": 1.0}, -0.999, True),
    ],
)
def test_an_interval_that_holds_no_effect_contradicts_its_odds(
    rubbing: Fit, sds: dict[str, float], together: float, kept: bool
) -> None:
    before = told(rubbing, sds, together)
    after = without_bent(before, ["stribeck_friction"])
    gone = set() if kept else {"f_k", "f_b", "v_s"}
    assert set(after.reasons) == gone
    assert {n for n, sd in after.sd.items() if np.isnan(sd)} == gone
    assert after.sd["xi"] == before.sd["xi"]
    assert without_bent(before, []).reasons == {}
