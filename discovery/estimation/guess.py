"""Where a fit starts: equation-error regression with an input, a scan of the stiffness, what the rig states held."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import qmc

from discovery.equations.model import Model
from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.least_squares import Minimum
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.problem import Problem
from discovery.estimation.residual import explains
from discovery.foundation.arrays import FloatArray
from discovery.foundation.sampling import median_step
from discovery.recordings.experiment import Experiment

#: Stiffness over the square of the dominant frequency.
_STIFFNESS = np.concatenate(
    [np.geomspace(0.3, 0.8, 12, endpoint=False), np.geomspace(0.8, 1.5, 140), np.geomspace(1.55, 4, 12)]
)
_DAMPING = (0.003, 0.03)
#: Samples of each recording that the regression uses.
_REGRESSED = 8192
#: Starts of a parameter that the rig hardly knows, in its stated values.
_WIDE = (0.2, 0.5, 1.0, 1.5, 2.0, 3.0)
#: Starts, a power of two, and by which factor they lie about a guess at most; so many of the best are followed.
_STARTS, _SCATTER, _FOLLOWED = 512, 12.0, 8
#: Periods of the dominant frequency in the first part, and by how much each part is longer than the one before.
_SWINGS, _LONGER = 3.0, 3.0
_FEWEST, _ITERATIONS = 64, 15
#: Steps in the time in which the fastest motion seen turns by one radian.
_STEPS = 10.0
#: A fit that leaves less than this part of the variance of the motion explains it.
_EXPLAINED = 0.1


def restoring(model: Model) -> str | None:
    """Return the free parameter that sets the frequency: the stiffness of a spring or of gravity; None without one."""
    return next((name for name in ("alpha", "g_c") if name in model.free), None)


def pushed(model: Model, experiments: Sequence[Experiment], units: NaturalUnits) -> dict[str, float]:
    """Return start values of a system whose position an input pushes on and no linear spring pulls back; else none."""
    if "g" not in model.free or restoring(model) is not None or model.mechanics.order != 0:
        return {}
    return {n: value for n, value in _regression(experiments, units, sprung=False).items() if n in model.free}


def _regression(experiments: Sequence[Experiment], units: NaturalUnits, *, sprung: bool = True) -> dict[str, float]:
    """Return g, xi, alpha of q'' = g u - xi q' - alpha q by least squares on smoothed derivatives.

    Where it is not `sprung`, there is no alpha.
    """
    from discovery.signals.differentiate import smooth

    rows, targets = [], []
    for e in experiments:
        r = e.recording
        assert r.input is not None
        part = slice(0, min(_REGRESSED, len(r.time[e.fitted])))
        trajectory = smooth(r.time[part], r.output[part, 0], float(r.noise[0]))
        # An acceleration obeys the same equation under the second derivative of the input.
        push = e.drive.evaluate(r.time[part])[2] if e.reads_acceleration and e.drive is not None else r.input[part]
        finite = np.isfinite(r.output[part, 0])
        rows.append(np.column_stack([push[finite], -trajectory.q_dot, -trajectory.q])[:, : 2 + sprung])
        targets.append(trajectory.q_ddot)
    matrix, target = np.concatenate(rows), np.concatenate(targets)
    # An input that has not begun says nothing of its gain.
    size = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    least = {"g": -np.inf, "xi": 1e-4 / units.time, "alpha": (0.1 / units.time) ** 2}
    found = np.linalg.lstsq(matrix / size, target, rcond=None)[0] / size
    return {name: max(float(value), low) for (name, low), value in zip(least.items(), found, strict=False)}


def scan(
    model: Model, experiments: Sequence[Experiment], units: NaturalUnits, given: Mapping[str, float]
) -> dict[str, float]:
    """Return start values for `fit`.

    Free-run residuals have many minima in the stiffness (whole periods slip), so a grid of stiffnesses and dampings is
    simulated at once and the best one is returned; with a measured input, the grid is centred on the regression of the
    smoothed acceleration.

    `model`: with a free stiffness, see `restoring`. `given`: values that are not guessed.
    """
    values = dict(given)
    name = restoring(model)
    assert name is not None
    centre = units.time**-2
    damping = [d / units.time for d in _DAMPING]
    if "g" in model.free:
        regressed = _regression(experiments, units)
        values = {**regressed, **values}
        centre = regressed["alpha"]
        values = values if name == "alpha" else {n: v for n, v in values.items() if n != "alpha"}
        damping.append(regressed["xi"])
    coarse = min(0.1 * units.time, 0.5 / (centre**0.5 * model.mechanics.highest_frequency({**model.known, **values})))
    if "g" in model.free:
        coarse = min(coarse, median_step(experiments[0].recording.time))
    problem = Problem(model, Bench(model.base, model.effects, experiments, coarse), units, {})
    start = problem.start(values)
    alphas = centre * _STIFFNESS
    grid = np.repeat(start[:, None], alphas.size * len(damping), axis=1)
    stiffness = np.tile(alphas, len(damping))
    if name == "g_c":
        # A link swings about the direction in which it hangs.
        hanging = float(np.mean([np.nanmean(e.deflection[e.fitted]) for e in experiments]))
        grid[problem.free.index("g_s")] = stiffness * np.sin(hanging)
        stiffness *= np.cos(hanging)
    grid[problem.free.index(name)] = stiffness
    if "xi" in problem.free:
        grid[problem.free.index("xi")] = np.repeat(damping, alphas.size)
    cost = np.empty(grid.shape[1])
    for first in range(0, grid.shape[1], 64):
        part = slice(first, first + 64)
        residual = problem.bench.residuals(*problem.expand(grid[:, part]))
        with np.errstate(over="ignore", invalid="ignore"):
            cost[part] = np.einsum("nk,nk->k", residual, residual)
    best = grid[:, int(np.nanargmin(cost))]
    return {**dict(zip(problem.free, best.tolist(), strict=False)), **given}


def staged_start(problem: Problem, values: Mapping[str, float]) -> dict[str, float]:
    """Return start values from fits in which what the rig states is held.

    The ringing of the rod has local minima in its mass while the stiffness is off. Where the rig hardly knows the mass,
    several are tried and the best one is kept. Its damping is held at a usual size: undamped ringing has no smooth
    answer to a change of stiffness.
    """
    known = {**{n: mean for n, (mean, _) in problem.gaussian.items()}, **problem.model.known}
    vague = [n for n, (mean, sd) in problem.gaussian.items() if sd > 0.3 * mean]
    wide = [n for n in vague if n in problem.model.known and n not in values]
    grids = [{n: known[n] * f for n in wide} for f in (_WIDE if wide else (1.0,))]
    held = [
        Problem(replace(problem.model, known={**known, **grid}), problem.bench, problem.units, {}) for grid in grids
    ]
    minima = fit_problems(held, [p.start(values) for p in held])
    best = min(range(len(minima)), key=lambda i: minima[i].cost)
    return {**known, **values, **grids[best], **held[best].named(minima[best].x)}


def start_of_system(
    model: Model, experiments: Sequence[Experiment], units: NaturalUnits, gaussian: Mapping[str, tuple[float, float]]
) -> dict[str, float]:
    """Return start values of a declared system: its guesses where a fit leads anywhere from there, else others.

    A free run with a stiffness or a loss that is off by several times has minima that explain nothing, or blows up.
    Over the first swings there are few, and one batched simulation of some hundred starts costs no more than a step of
    a fit.

    `model`: its free constants keep the sign of their guesses. `gaussian`: constants that are known within a standard
    deviation: they stay there. Returned: empty where the guesses are the best start there is.
    """
    step = min([units.time / _STEPS, *(median_step(e.recording.time) for e in experiments)])
    known = {n: g for n, g in gaussian.items() if n in model.parameters}
    lengths = [e.recording.time[e.fitted].size for e in experiments]

    def begun(count: int) -> Problem:
        """Return the problem of the first readings of every recording."""
        sizes = [min(max(count, _FEWEST), size) for size in lengths]
        first = [e.first(n) for e, n in zip(experiments, sizes, strict=True)]
        return Problem(model, Bench(model.base, model.effects, first, step), units, known)

    whole = begun(max(lengths))
    (guessed,) = _followed(whole, [whole.start({})])
    if explains(whole, 2 * guessed.cost, _EXPLAINED):
        return {}
    samples = _SWINGS * 2 * np.pi * units.time / median_step(experiments[0].recording.time)
    count, problem = round(samples), begun(round(samples))
    points = _points(problem)
    while True:
        with np.errstate(over="ignore", invalid="ignore"):
            costs = problem.bench.chi2(*problem.expand(points)).sum(axis=0)
        best = [i for i in np.argsort(costs)[:_FOLLOWED] if np.isfinite(costs[i])]
        minima = [m for m in _followed(problem, list(points[:, best].T)) if np.isfinite(m.cost)]
        if not minima:
            return {}
        if count >= max(lengths):
            found = min(minima, key=lambda m: m.cost)
            return problem.named(found.x) if not guessed.cost <= found.cost else {}
        points, count = np.array([m.x for m in minima]).T, round(_LONGER * count)
        problem = begun(count)


def _followed(problem: Problem, starts: Sequence[FloatArray]) -> list[Minimum]:
    """Return where some steps of a fit lead from starts."""
    return fit_problems([problem] * len(starts), starts, iterations=_ITERATIONS, tolerance=1e-3, rough=True)


def _points(problem: Problem) -> FloatArray:
    """Return starts about the guesses, shape (m, k), the guesses themselves first."""
    start = problem.start({})
    own = [i for i, n in enumerate(problem.free) if problem.model.parameters[n].physical and n not in problem.gaussian]
    points = np.repeat(start[:, None], _STARTS, axis=1)
    powers = 2 * qmc.Sobol(len(own), seed=1).random(_STARTS).T - 1
    powers[:, 0] = 0.0
    points[own] *= _SCATTER**powers
    lower, upper = problem.bounds
    return np.clip(points, lower[:, None], upper[:, None])
