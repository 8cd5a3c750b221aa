"""A fit that starts far from the truth and must find it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from discovery.declarations.effect import ARM, ROTOR
from discovery.declarations.registry import get_effect
from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.fit import Fit, fit
from discovery.estimation.natural_units import NaturalUnits
from discovery.foundation.arrays import FloatArray
from discovery.mechanics import get_base
from discovery.recordings.drive import Drive
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Columns, InputColumn, OutputColumn, Quantity, Rig, TimeColumn
from discovery.testing.states import every_effect

#: Of the typical size of its prior, the part that an amplitude has.
_AMPLITUDE = 0.25
#: Integration step [s]; stable for the fastest memory that the bounds allow, and for the ringing of the rod below.
_STEP = 0.008
#: Standard deviations of chi-square above its mean that noise alone may leave.
_NOISE = 4.0
#: By less chi-square than this two fits differ that ended in the same minimum.
_SAME = 0.1
#: Where a base has a rod of its own: its mass over the tip's, and the retardation time of its material [s].
_ROD = {"mu": 0.5, "tau_r": 1e-3}


def _experiment(base: str, drive: Drive, time: FloatArray, output: FloatArray, noise: float) -> Experiment:
    system = get_base(base).system
    arm, channels = system.has_rod, system.channels
    unit = "m" if arm else "q"
    columns = Columns(TimeColumn(), InputColumn("input", unit, "spline"), OutputColumn("output", unit))
    rig = Rig("contract", get_base(base).system, Quantity(1.2, 0.0) if arm else None, columns=columns)
    recording = Recording(
        "contract",
        time,
        input=drive.evaluate(time)[0],
        output=output,
        channels=channels,
        units=(unit,) * len(channels),
        noise=np.full(len(channels), noise),
        sha256="",
        source="",
    )
    return Experiment(recording, drive, rig)


def _there_in_a_second() -> Drive:
    """Return one radian there within a second, at constant accelerations; then the arm rings."""
    edges = np.array([0.0, 0.2, 0.4, 1.0, 1.2, 5.0])
    return Drive(
        edges,
        np.array([[0.0, 3.125, 0.0, -3.125, 0.0], [0.0, 0.0, 1.25, 1.25, 0.0], [0.0, 0.0, 0.125, 0.875, 1.0]]),
        edges[1:-1],
    )


def recover(effect: str, base: str = "") -> tuple[Fit, dict[str, float]]:
    """Simulate a manoeuvre with one effect, fit it, and return the fit with the true values.

    Without a base, it is the simplest one on which the effect means something.
    """
    arms = ARM in get_effect(effect).systems
    bases = ("constant_radius", "reduced", "elastica_1") if arms else ("oscillator", "servo", "base_excited")
    base = base or next(b for b in bases if effect in every_effect(b))
    # What is offered where nothing ties the body is told apart there.
    laws = ("viscous_damping",) if get_effect(effect).needs == ROTOR else ("viscous_damping", "linear_stiffness")
    # Beside a law that contains it, one has nothing of its own.
    context = tuple(law for law in laws if law not in get_effect(effect).reduces_to)
    rod = {n: v for n, v in _ROD.items() if n in {p.name for p in get_base(base).parameters()}}
    known = {"length": 1.2, **rod} if get_base(base).system.has_rod else {"g": 1.0}
    model = Model(base, (*context, *({effect} - set(context))), known)
    units = NaturalUnits(time=1 / 3, coordinate=1.0, length=1.2)
    truth = {}
    for name in model.free:
        p = model.parameters[name]
        size = p.default if p.shape else _AMPLITUDE * p.prior.width
        truth[name] = {"alpha": 9.0, "xi": 0.1}.get(name, size * units.scale(p))
    drive = _there_in_a_second()
    time, noise = np.linspace(0.0, 5.0, 401), 1e-4
    nothing = _experiment(base, drive, time, np.zeros((time.size, len(get_base(base).system.channels))), noise)
    bench = Bench(base, every_effect(base), [nothing], _STEP)
    defaults = {n: p.default * units.scale(p) for n, p in Model(base, every_effect(base)).parameters.items()}
    values = np.array([[{**defaults, **known, **truth}[n]] for n in bench.names])
    (clean,) = bench.predict(values, np.array([[[0.1], [0.2]]]))
    rng = np.random.default_rng(list(effect.encode()))
    experiment = _experiment(
        base, drive, time, clean[:, :, 0] + noise * rng.standard_normal(clean[:, :, 0].shape), noise
    )
    bench = Bench(base, every_effect(base), [experiment], _STEP)
    return _best(_fits(model, Model(base, context, known), experiment, bench, units, truth), clean[:, :, 0].size), truth


def _best(fits: Iterator[Fit], n_data: int) -> Fit:
    """Return the best of the fits; the rest are not made once two in one minimum leave no more than noise."""
    best = next(fits)
    for trial in fits:
        again = abs(trial.chi2 - best.chi2) < _SAME
        best = min(best, trial, key=lambda f: f.chi2)
        if again and best.chi2 < n_data + _NOISE * np.sqrt(2 * n_data):
            break
    return best


def _fits(
    model: Model, declared: Model, experiment: Experiment, bench: Bench, units: NaturalUnits, truth: Mapping[str, float]
) -> Iterator[Fit]:
    """Return the fits from every start beside the truth."""
    shapes = [n for n in truth if model.parameters[n].shape]
    # Residuals have many minima in a frequency: a grid of starts, none of them the truth.
    grid = np.linspace(0.5, 1.5, 10) if shapes else np.ones(1)
    for off in (0.5, 1.5):
        start = {n: v * off for n, v in truth.items()}
        known = {n: v for n, v in start.items() if n in declared.parameters}
        before = fit(declared, [experiment], start=known, bench=bench, units=units).values
        # All at once, and as a user does: what is declared first, then the effect on top of it.
        for first in ({}, {n: before[n] for n in declared.free}):
            for shape in grid:
                trial = {**start, **first, **{n: truth[n] * shape for n in shapes}}
                yield fit(model, [experiment], start=trial, bench=bench, units=units)


def check_recovery(effect: str, base: str = "") -> None:
    """Assert that what is recovered lies within 4 sds of the truth, and that the recording tells it from the start."""
    fitted, truth = recover(effect, base)
    declared = fitted.model.parameters
    for name, value in truth.items():
        sd = fitted.sd[name]
        assert name not in fitted.reasons, f"{name}: {fitted.reasons.get(name)}"
        off = fitted.values[name] - value
        if declared[name].unit == "rad" and declared[name].shape:
            # A phase is the same after a whole turn.
            off = np.remainder(off + np.pi, 2 * np.pi) - np.pi
        assert abs(off) < 4 * sd, f"{name}: {fitted.values[name]} +- {sd}, true {value}"
        assert 4 * sd < 0.5 * abs(value), f"{name}: the recording does not tell the start from the truth"
        low, high = np.array(declared[name].bounds) * fitted.problem.units.scale(declared[name])
        assert low <= fitted.values[name] <= high
