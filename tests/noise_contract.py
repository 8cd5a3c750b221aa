"""What every noise model keeps: its readings' densities are its likelihood, and its draws follow them."""

from __future__ import annotations

import numpy as np
import pytest
from driven_oscillator import NOISE, TIME, clean, experiment, linear_model

from discovery.estimation.fit import fit
from discovery.posterior.noise import errors_of, is_independent, noise_of
from discovery.posterior.noise.model import instruments

#: Readings come in such steps, so that every model applies.
STEP = 0.5 * NOISE


def check_noise(name: str) -> None:
    """Check the noise model of a name on rounded readings of a driven oscillator, with a gap."""
    errors = NOISE * np.random.default_rng(1).standard_normal(TIME.size)
    errors = STEP * np.round((clean() + errors) / STEP) - clean()
    errors[50:80] = np.nan
    problem = fit(linear_model(), [experiment(errors)]).problem
    (recording,) = (e.recording for e in problem.bench.experiments)
    model, law = noise_of(name, problem, instruments(problem.bench.experiments))[0], errors_of(name)
    noise = np.array([0.3, *(p.starts[0] for p in model.parameters)])
    own = {p.name: np.array([float(p.value(np.asarray(p.starts[0])))]) for p in model.parameters}
    rng, size = np.random.default_rng(2), np.exp(noise[0])
    if is_independent(name):
        seen = problem.bench.experiments[0].weights()[..., None] > 0
        residual = np.where(seen, 1.3 * rng.standard_normal(seen.shape), 0.0)
        steps = np.broadcast_to(recording.steps[:, None] / recording.noise[:, None], residual.shape)
        each = law.density(residual, np.full(residual.shape, size), own, steps)[seen]
        found = model.log_likelihood(0, residual, np.zeros((3, 1)), noise[:, None])[0]
        assert each.sum() == pytest.approx(found, rel=1e-9)
        # As finely read, draws lie where the density says.
        drawn = np.sort(size * law.drawn(rng, (40_000, 1, 1), own).ravel())
        grid = np.linspace(drawn[2_000], drawn[-2_000], 4_001)[:, None, None]
        fine = np.full(grid.shape, 1e-3)
        inside = np.trapezoid(np.exp(law.density(grid, np.full(grid.shape, size), own, fine)).ravel(), grid.ravel())
        assert inside == pytest.approx(0.9, abs=0.005)
    # Several draws of its parameters, each for the errors of one draw; single errors are of size one.
    three = law.drawn(rng, (20_000, 2, 3), {name: np.repeat(value, 3) for name, value in own.items()})
    assert three.shape == (20_000, 2, 3)
    assert is_independent(name) or three.std(axis=(0, 1)) == pytest.approx(1.0, abs=0.03)
    # Scaled residuals are those of which half the squares are the likelihood, where cells are narrow.
    residual = np.where(np.isfinite(recording.output)[..., None], rng.standard_normal((TIME.size, 1, 3)), 0.0)
    spread = [np.repeat(np.asarray(v)[:, None], 3, axis=1) for v in (np.zeros(3), noise)]
    scaled = model.scaled(0, 3 * residual, np.zeros(3), noise)
    expected = np.diff(model.log_likelihood(0, 3 * residual, *spread))
    assert np.diff(-0.5 * np.sum(scaled**2, axis=(0, 1))) == pytest.approx(
        expected, rel=0.05 if name == "quantised" else 1e-9
    )
