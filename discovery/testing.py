"""What every effect must fulfil: a pytest class that another package can run over its own effects.

>>> from discovery.testing import EffectContract
>>> class TestMyEffects(EffectContract):
...     effects = ("cubic_stiffness",)

Each test runs for every effect on every base on which it means something. Random states and parameters come from fixed
seeds, in units where times, angles and lengths are of order one. All cases of a base share one compiled kernel, in
which the effects that are not under test are at their defaults, that is absent.
"""

from __future__ import annotations

import inspect
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from discovery import symbols as s
from discovery.effect import ARM, OSCILLATOR, Effect, Memory, Sensor
from discovery.mechanics import base_names, get_base
from discovery.model import Model
from discovery.parameters import Parameter, natural_scale
from discovery.program import RECORDED, Program, build_program
from discovery.registry import catalogue, get_effect

if TYPE_CHECKING:
    import sympy as sp

    from discovery.drive import Drive
    from discovery.experiment import Experiment
    from discovery.fit import Fit

__all__ = ["EffectContract", "every_effect"]

FloatArray = NDArray[np.float64]
#: Evaluates named expressions: time, recorded input (3, k), state (n, k), parameters (p, k) -> one row each.
_Evaluate = Callable[[float, FloatArray, FloatArray, FloatArray], FloatArray]

_KIND_UNITS = {
    "kinetic": "q^2 s^-2",
    "potential": "q^2 s^-2",
    "dissipation": "q^2 s^-3",
    "load": "q^2 s^-3",
    "memory": "q^2 s^-3",
    "closure": "1",
    "drive": "q",
}
_SYMBOL_UNITS = {
    **{s.t: "s", s.theta: "q", s.omega: "q s^-1", s.delta: "q", s.delta_dot: "q s^-1", s.v2: "q^2 s^-2", s.U: "q^2"},
    **{s.rho: "1", s.theta_m: "q", s.omega_m: "q s^-1", s.alpha_m: "q s^-2", s.alpha: "s^-2", s.length: "m", s.u: "q"},
}
#: Lengths along the axes are relative to the arm; those of an oscillator are its coordinate.
_CARTESIAN_UNITS = {
    ARM: {s.x: "1", s.y: "1", s.v_x: "s^-1", s.v_y: "s^-1"},
    OSCILLATOR: {s.x: "q", s.y: "q", s.v_x: "q s^-1", s.v_y: "q s^-1"},
}
#: Of the typical size of its prior, the part that an amplitude has in the recovery test.
_AMPLITUDE = 0.25
_STEP = 2e-3


@dataclass(frozen=True)
class _Sample:
    """Random states of a program at one time: recorded input (3, k), state (n, k), parameters (p, k)."""

    time: float
    recorded: FloatArray
    state: FloatArray
    parameters: FloatArray

    def along(self, tau: float, acceleration: FloatArray, n: int) -> _Sample:
        """Return the same motion a little later; explicit time stands still."""
        q, rate, rest = self.state[:n], self.state[n : 2 * n], self.state[2 * n :]
        state = np.concatenate([q + tau * rate + 0.5 * tau**2 * acceleration, rate + tau * acceleration, rest])
        angle, speed, change = self.recorded
        return replace(
            self,
            recorded=np.stack([angle + tau * speed + 0.5 * tau**2 * change, speed + tau * change, change]),
            state=state,
        )

    def moved(self, row: int, by: float) -> _Sample:
        """Return the sample with one state shifted."""
        state = self.state.copy()
        state[row] += by
        return replace(self, state=state)


def every_effect(base_name: str) -> tuple[str, ...]:
    """Return the ids of all effects that mean something on a base and that it does not contain already."""
    base = get_base(base_name)
    return tuple(e for e, effect in catalogue().items() if base.system in effect.systems and e not in base.provides)


def _derivative(f: Callable[[float], FloatArray]) -> FloatArray:
    """Slope of f at zero by the five-point formula."""
    return (f(-2 * _STEP) - 8 * f(-_STEP) + 8 * f(_STEP) - f(2 * _STEP)) / (12 * _STEP)


@lru_cache(maxsize=64)
def _evaluator(program: Program) -> _Evaluate:
    """Return a numpy function of the slopes of a program."""
    from discovery.compile import numpy_derivative

    function = numpy_derivative(program)

    def evaluate(time: float, recorded: FloatArray, state: FloatArray, parameters: FloatArray) -> FloatArray:
        rows = function(time, recorded, state, parameters)
        return np.array([np.broadcast_to(row, state.shape[1:]) for row in rows], float)

    return evaluate


def _whole(base_name: str) -> Program:
    """Return the program of a base with every effect."""
    return build_program(base_name, every_effect(base_name))


def _slopes(base_name: str, sample: _Sample) -> FloatArray:
    return _evaluator(_whole(base_name))(sample.time, sample.recorded, sample.state, sample.parameters)


def _accelerations(base_name: str, sample: _Sample) -> FloatArray:
    n = get_base(base_name).n_coordinates
    return _slopes(base_name, sample)[n : 2 * n]


@dataclass(frozen=True)
class _Bare:
    """A base in given states: values of the symbols by name, mass matrix (n, n, k), inertial force (n, k), tip (r, k)."""

    symbols: Mapping[str, Any]
    mass: FloatArray
    force: FloatArray
    tip: FloatArray

    def of(self, expression: sp.Expr) -> FloatArray:
        """Return the value (k,) of an expression in symbols of effects."""
        value = _function(expression)(*(self.symbols[name.name] for name in _order(expression)))
        return np.broadcast_to(value, self.mass.shape[2:])


def _order(expression: sp.Expr) -> list[sp.Symbol]:
    return sorted(expression.free_symbols, key=str)


@lru_cache(maxsize=256)
def _function(expression: sp.Expr) -> Callable[..., FloatArray]:
    import sympy as sp

    return sp.lambdify(_order(expression), expression, "numpy")


@lru_cache
def _mechanics(base_name: str) -> tuple[tuple[str, ...], _Evaluate]:
    """Return the names of drive and channels, and a function of their values, mass matrix, force and path."""
    base, program = get_base(base_name), _whole(base_name)
    mechanics = base.mechanics()
    channels = tuple((symbol, channel.value) for symbol, channel in mechanics.channels.items())
    received = tuple(symbol for symbol, _ in program.drive)
    named = (*received, *(symbol for symbol, _ in channels))
    mass = (entry for row in mechanics.mass for entry in row)
    rows = (*named, *mass, *mechanics.force, *base.reading(None))
    shown = replace(program, derivative=(*mechanics.assignments, *channels), slopes=rows)
    return tuple(symbol.name for symbol in named), _evaluator(shown)


def _bare(base_name: str, sample: _Sample) -> _Bare:
    program, n = _whole(base_name), get_base(base_name).n_coordinates
    names, evaluate = _mechanics(base_name)
    rows = evaluate(sample.time, sample.recorded, sample.state, sample.parameters)
    known: dict[str, Any] = {"t": sample.time}
    for labels, values in (
        (program.parameters, sample.parameters),
        ([z.name for z in program.states], sample.state),
        (names, rows),
    ):
        known.update(zip(labels, values, strict=False))
    mass, rest = rows[len(names) :][: n * n], rows[len(names) + n * n :]
    return _Bare(known, mass.reshape(n, n, -1), rest[:n], rest[n:])


def _at_rest(program: Program, values: Mapping[sp.Symbol, Any]) -> tuple[Any, ...]:
    """Return the mathematics of a program with parameters replaced, without what is zero and what nothing uses."""
    known = dict(values)
    kept = []
    for symbol, expression in (*program.drive, *program.derivative):
        value = expression.xreplace(known)
        if value == 0:
            known[symbol] = value
        else:
            kept.append((symbol, value))
    n = 2 * program.n_coordinates
    results = tuple(e.xreplace(known) for e in (*program.slopes[:n], *program.reading, program.lateness))
    used = set().union(*[e.free_symbols for e in results])
    lines = []
    for symbol, value in reversed(kept):
        if symbol in used:
            used |= value.free_symbols
            lines.append((symbol, value))
    return (*results, *lines)


def _declared(base_name: str, effects: Sequence[str]) -> dict[str, Parameter]:
    return Model(base_name, tuple(effects)).parameters


def _sample(base_name: str, active: Sequence[str], *, count: int = 8, static: bool = False, seed: int = 0) -> _Sample:
    """Return random states of the program of every effect; parameters of effects that are not `active` are absent."""
    rng = np.random.default_rng(seed)
    effects = every_effect(base_name)
    program = build_program(base_name, effects)
    declared = _declared(base_name, effects)
    on = {p.name for e in active for p in get_effect(e).parameters()}
    rows = []
    for name in program.parameters:
        p = declared[name]
        spread = rng.uniform(0.5, 1.5, count)
        if name == "alpha":
            rows.append(0.1 * spread)
        elif name in on:
            rows.append(np.clip((p.default if p.shape else p.prior.width) * spread, *p.bounds))
        elif name == "length":
            rows.append(1.2 * spread)
        elif name == "mu":
            rows.append(0.3 * spread)
        else:
            rows.append(np.full(count, p.default))
    n = program.n_coordinates
    size = np.full(len(program.states), 0.3)
    # Higher coordinates of a rod are small beside the first.
    size[1:n], size[n], size[n + 1 : 2 * n] = 0.05, 0.8, 0.2
    # Away from zero: a rate of zero is a kink of dry friction and of drag.
    state = size[:, None] * rng.uniform(0.3, 1, (size.size, count)) * rng.choice([-1, 1], (size.size, count))
    recorded = rng.uniform(-1, 1, (3, count)) * (np.array([[0.3], [0.0], [0.0]]) if static else 1.0)
    if static and get_base(base_name).system == OSCILLATOR:
        recorded[:] = 0.0
    return _Sample(float(rng.uniform(1, 2)), recorded, state, np.array(rows))


def _without(sample: _Sample, base_name: str, effect: str) -> _Sample:
    program = build_program(base_name, every_effect(base_name))
    parameters = sample.parameters.copy()
    for p in get_effect(effect).parameters():
        parameters[program.parameters.index(p.name)] = p.default
    return replace(sample, parameters=parameters)


def _expressions(effect: Effect, system: str) -> Iterator[tuple[sp.Expr, str, Mapping[sp.Symbol, str]]]:
    """Yield every expression of an effect with its unit and the units of symbols that only it has."""
    import sympy as sp

    if isinstance(effect, Sensor):
        if system == ARM:
            tip = sp.symbols("read_x read_y", real=True)
            for expression in effect.arm_reading(*tip):
                yield sp.sympify(expression), "m", {tip[0]: "m", tip[1]: "m"}
        else:
            output = sp.Symbol("read", real=True)
            yield sp.sympify(effect.oscillator_reading(output)), "q", {output: "q"}
        yield sp.sympify(effect.lateness()), "s", {}
        return
    own: dict[sp.Symbol, str] = {}
    if isinstance(effect, Memory):
        states = effect.states()
        own = {z: "q" for z in states}
        for slope in states.values():
            yield slope, "q s^-1", own
    yield effect.expression(), _KIND_UNITS[effect.kind], own  # type: ignore[attr-defined]


class EffectContract:
    """Tests of effects by law; subclass it in a test module, under a name that starts with ``Test``.

    Attributes
    ----------
    effects : tuple of str or None
        Ids of the effects under test; None: the whole catalogue.
    bases : tuple of str or None
        Bases on which they are tested, where they apply; None: all.
    constants : mapping of float to str
        Dimensional constants that an expression may hold as numbers, with their units.
    """

    effects: ClassVar[tuple[str, ...] | None] = None
    bases: ClassVar[tuple[str, ...] | None] = None
    constants: ClassVar[Mapping[float, str]] = {9.80665: "m s^-2"}

    def pytest_generate_tests(self, metafunc) -> None:
        """Run every test for each effect, or for each effect on each base."""
        ids = tuple(catalogue()) if self.effects is None else self.effects
        if "base" not in metafunc.fixturenames and "effect" in metafunc.fixturenames:
            metafunc.parametrize("effect", ids)
            return
        cases = [(e, b) for b in (self.bases or base_names()) for e in ids if e in every_effect(b)]
        if "effect" in metafunc.fixturenames:
            metafunc.parametrize(("effect", "base"), cases, ids=[f"{e}-{b}" for e, b in cases])
        elif "base" in metafunc.fixturenames:
            metafunc.parametrize("base", sorted({b for _, b in cases}))

    def test_declaration(self, effect: str) -> None:
        """Words, units, source and formula are there; no parameter shares its name with another one."""
        from discovery.units import dimension

        instance = get_effect(effect)
        text = inspect.getdoc(type(instance)) or ""
        assert instance.id() == effect
        assert instance.cite, f"{effect} cites no source"
        assert ".. math::" in text, f"the docstring of {effect} shows no formula"
        assert instance.title(), f"{effect} has no title"
        others = [p.name for e in catalogue().values() if e.id() != effect for p in e.parameters()]
        others += [p.name for b in base_names() for p in get_base(b).parameters()]
        for p in instance.parameters():
            dimension(p.unit)
            assert p.meaning, f"{p.name} of {effect} has no meaning"
            assert p.latex in text, f"the docstring of {effect} does not show {p.latex}"
            assert p.name.isidentifier(), f"{p.name} of {effect} is no word"
            assert p.name not in others, f"another effect or base has a parameter named {p.name}"

    def test_prior(self, effect: str) -> None:
        """Starts lie inside the bounds, where the prior is finite; an amplitude is absent at zero."""
        for p in get_effect(effect).parameters():
            low, high = p.bounds
            assert low < high
            usual = (*p.starts, p.default) if p.shape else p.starts
            assert all(low <= x <= high for x in usual), f"{p.name}: a default or start lies outside its bounds"
            assert p.shape or p.default == 0.0, f"{p.name} is no shape, but the effect is not absent by default"
            assert p.fixed or p.shape or p.starts, f"{p.name} has no start for a fit"
            assert 0 < p.prior.width < math.inf
            inside = np.linspace(max(low, -1e3), min(high, 1e3), 202)[1:-1]
            assert np.isfinite(p.prior.log_density(inside)).all(), (
                f"{p.name}: the prior is not finite inside the bounds"
            )

    def test_dimensions(self, effect: str, base: str) -> None:
        """Expressions scale as their kind when the units of time, length and coordinate change."""
        import sympy as sp

        instance, system = get_effect(effect), get_base(base).system
        rng = np.random.default_rng(1)
        cartesian = _CARTESIAN_UNITS[system]
        for expression, unit, own in _expressions(instance, system):
            numbers = {
                f: self.constants[abs(float(f))] for f in expression.atoms(sp.Float) if abs(float(f)) in self.constants
            }
            named = {f: sp.Symbol(f"constant_{k}", positive=True) for k, f in enumerate(numbers)}
            units = {
                **_SYMBOL_UNITS,
                **cartesian,
                **own,
                **{sp.Symbol(p.name, real=True): p.unit for p in instance.parameters()},
            }
            units.update({named[f]: u for f, u in numbers.items()})
            scaled = expression.xreplace(named)
            # On an arm, angles are ratios of lengths: their unit is free only where no length meets them.
            tied = system == ARM and (isinstance(instance, Sensor) or scaled.has(*cartesian, s.length))
            size = {"time": 1.7, "coordinate": 1.0 if tied else 0.6, "length": 2.3}
            assert scaled.free_symbols <= units.keys(), f"{effect} uses {scaled.free_symbols - units.keys()}"
            values = {x: float(rng.uniform(0.3, 1.2)) for x in sorted(scaled.free_symbols, key=str)}
            changed = {x: v * natural_scale(units[x], **size) for x, v in values.items()}
            expected = float(scaled.subs(values)) * natural_scale(unit, **size)
            np.testing.assert_allclose(
                float(scaled.subs(changed)), expected, rtol=1e-12, err_msg=f"{expression} is not in {unit}"
            )

    def test_sympy_and_numpy_agree(self, effect: str, base: str) -> None:
        """The printed text evaluates to what sympy evaluates the equations to."""
        import sympy as sp

        program, sample = _whole(base), _sample(base, ("linear_stiffness", effect), count=2)
        slopes = _slopes(base, sample)
        for k in range(2):
            symbols = [s.t, *RECORDED, *program.states, *(sp.Symbol(p, real=True) for p in program.parameters)]
            numbers = [sample.time, *sample.recorded[:, k], *sample.state[:, k], *sample.parameters[:, k]]
            known = {symbol: sp.Float(float(value)) for symbol, value in zip(symbols, numbers, strict=True)}
            for symbol, expression in (*program.drive, *program.derivative):
                known[symbol] = sp.Float(expression.xreplace(known).evalf())
            expected = [float(slope.xreplace(known).evalf()) for slope in program.slopes]
            np.testing.assert_allclose(slopes[:, k], expected, rtol=1e-11, atol=1e-13)

    def test_numpy_and_kernel_agree(self, effect: str, base: str) -> None:
        """One step of the compiled kernel is one step of a plain Runge-Kutta method on the printed equations."""
        from scipy.interpolate import BPoly

        from discovery.compile import compile_kernel
        from discovery.simulate import Grid

        kernel = compile_kernel(base, every_effect(base))
        program, n, h = kernel.program, kernel.program.n_coordinates, 0.2
        sample = _sample(base, ("linear_stiffness", effect), count=kernel.lanes)
        time = np.array([sample.time, sample.time + 0.5 * h, sample.time + h])
        drive = _Parabola(sample.recorded[:, 0], sample.time)
        grid = Grid.build(time[[0, 2]], drive, h)
        out = np.empty((1, len(program.reading), kernel.lanes))
        middle = (np.zeros(1, np.int64), np.array([0.5]), time[1:2], drive.evaluate(time[1:2]).T.copy())
        kernel.run(
            grid.times, grid.steps, grid.restart, grid.drive, *middle, sample.parameters, sample.state.copy(), out, 0, 1
        )

        slopes = _evaluator(program)
        r0, r1, r2 = (drive.evaluate(time[k : k + 1]) for k in range(3))
        y = sample.state
        k1 = slopes(time[0], r0, y, sample.parameters)
        k2 = slopes(time[1], r1, y + 0.5 * h * k1, sample.parameters)
        k3 = slopes(time[1], r1, y + 0.5 * h * k2, sample.parameters)
        k4 = slopes(time[2], r2, y + h * k3, sample.parameters)
        end = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        k5 = slopes(time[2], r2, end, sample.parameters)
        lateness = _bare(base, sample).of(program.lateness)
        read = _evaluator(replace(program, derivative=(), slopes=program.reading))
        expected = np.empty(out.shape[1:])
        for i, late in enumerate(lateness):
            ends = [np.stack([a[:n, i], b[:n, i], c[n : 2 * n, i]]) for a, b, c in ((y, k1, k1), (end, k5, k5))]
            q = BPoly.from_derivatives([0.0, h], ends)(0.5 * h - late)
            state = np.concatenate([q, np.zeros(len(program.states) - n)])[:, None]
            recorded = drive.evaluate(time[1:2] - late)
            expected[:, i] = read(time[1], recorded, state, sample.parameters[:, i : i + 1])[:, 0]
        np.testing.assert_allclose(out[0], expected, rtol=1e-11, atol=1e-12)

    def test_force_is_the_gradient_of_the_energy(self, effect: str, base: str) -> None:
        """What the effect adds to Euler-Lagrange's row is the numerical derivative of its energy or power."""
        instance, n = get_effect(effect), get_base(base).n_coordinates
        sample = _sample(base, ("linear_stiffness", effect))
        without = _without(sample, base, effect)
        if instance.kind == "drive":
            without = replace(without, recorded=self._received(base, sample))
        acceleration = _accelerations(base, sample)
        mass = _bare(base, sample).mass
        added = np.einsum("ijk,jk->ik", mass, acceleration - _accelerations(base, without))
        if instance.kind in ("closure", "sensor", "drive"):
            np.testing.assert_allclose(added, 0.0, atol=1e-12 * np.abs(mass).max())
            return
        energy = instance.expression()  # type: ignore[attr-defined]

        def push(row: int, at: _Sample) -> FloatArray:
            return _derivative(lambda by: _bare(base, at.moved(row, by)).of(energy))

        def momentum_rate(i: int) -> FloatArray:
            return _derivative(lambda tau: push(n + i, sample.along(tau, acceleration, n)))

        rows = {
            "potential": lambda i: -push(i, sample),
            "dissipation": lambda i: -push(n + i, sample),
            "kinetic": lambda i: push(i, sample) - momentum_rate(i),
            "load": lambda i: push(n + i, sample),
            "memory": lambda i: push(n + i, sample),
        }
        assert np.abs(added).max() > 1e-6, f"{effect} does nothing on {base}"
        expected = np.array([rows[instance.kind](i) for i in range(n)])
        np.testing.assert_allclose(added, expected, rtol=1e-7, atol=1e-9 * np.abs(mass).max())

    def _received(self, base: str, sample: _Sample) -> FloatArray:
        """Return the input that the system receives (3, k), whose rows are derivatives of one another."""
        names = [symbol.name for symbol, _ in _whole(base).drive]
        nothing = np.zeros_like(sample.state[:0])

        def later(tau: float) -> FloatArray:
            known = _bare(base, replace(sample.along(tau, nothing, 0), time=sample.time + tau)).symbols
            return np.array([known[name] for name in names])

        received = later(0.0)
        np.testing.assert_allclose(_derivative(later)[:-1], received[1:], rtol=1e-7, atol=1e-9)
        assert np.abs(received - sample.recorded[: len(names)]).max() > 1e-6, "the drive does not change the input"
        return np.concatenate([received, sample.recorded[len(names) :]])

    def test_energy(self, effect: str, base: str) -> None:
        """With the drive at rest, energy is conserved, or only lost by a dissipation, or fed by the power of a load."""
        instance, n = get_effect(effect), get_base(base).n_coordinates
        if instance.kind == "drive":
            return
        sample = _sample(base, ("linear_stiffness", effect), static=True)
        acceleration = _accelerations(base, sample)
        stored = s.alpha * s.U
        if instance.kind in ("kinetic", "potential") and effect != "linear_stiffness":
            stored += instance.expression()  # type: ignore[attr-defined]

        def total(tau: float) -> FloatArray:
            at = sample.along(tau, acceleration, n)
            bare, rate = _bare(base, at), at.state[n : 2 * n]
            return np.einsum("ik,ijk,jk->k", rate, bare.mass, rate) / 2 + bare.of(stored)

        gained = _derivative(total)
        scale = 1e-9 * np.abs(total(0.0)).max()
        if instance.kind == "dissipation":
            assert (gained < scale).all(), f"{effect} adds energy"
            assert gained.min() < -1e3 * scale, f"{effect} loses no energy"
        elif instance.kind in ("load", "memory"):
            power = _bare(base, sample).of(instance.expression())  # type: ignore[attr-defined]
            np.testing.assert_allclose(gained, power, rtol=1e-7, atol=scale)
        else:
            np.testing.assert_allclose(gained, 0.0, atol=scale)

    def test_inertia_is_that_of_the_tip_path(self, base: str) -> None:
        """Without a rod's mass, a base has the kinetic energy and the inertial force of a point on the path it reports.

        The path of `constant_radius` is its circle: a radius law is output only there, as in the source paper, and the
        inertia of the changing radius is left out. The rod's mass adds its own terms, which are absent here.
        """
        n = get_base(base).n_coordinates
        still, moving = _sample(base, (), static=True), _sample(base, ())
        for sample in (still, moving):
            if "mu" in _whole(base).parameters:
                sample.parameters[_whole(base).parameters.index("mu")] = 0.0
        acceleration = np.random.default_rng(2).uniform(-1, 1, (n, still.state.shape[1]))

        def velocity(at: _Sample) -> FloatArray:
            return _derivative(lambda tau: _bare(base, at.along(tau, acceleration, n)).tip)

        rate = still.state[n : 2 * n]
        energy = np.einsum("ik,ijk,jk->k", rate, _bare(base, still).mass, rate) / 2
        np.testing.assert_allclose(energy, (velocity(still) ** 2).sum(axis=0) / 2, rtol=1e-9)

        bare = _bare(base, moving)
        inertia = np.einsum("ijk,jk->ik", bare.mass, acceleration) - bare.force
        if "g" in _whole(base).parameters:
            inertia += bare.symbols["g"] * bare.symbols["u"]
        along = np.array([_derivative(lambda by, i=i: _bare(base, moving.moved(i, by)).tip) for i in range(n)])
        pull = _derivative(lambda tau: velocity(moving.along(tau, acceleration, n)))
        np.testing.assert_allclose(inertia, np.einsum("irk,rk->ik", along, pull), rtol=1e-7, atol=1e-7)

    def test_absent_by_default(self, effect: str, base: str) -> None:
        """With its amplitudes at zero the effect is exactly absent: the same equations, reading and age remain."""
        import sympy as sp

        context = ("viscous_damping",) if effect == "linear_stiffness" else ("linear_stiffness", "viscous_damping")
        context = tuple(e for e in context if e != effect)
        defaults = {sp.Symbol(p.name, real=True): sp.Integer(0) for p in get_effect(effect).parameters() if not p.shape}
        without = _at_rest(build_program(base, context), {})
        assert _at_rest(build_program(base, (*context, effect)), defaults) == without

    def test_round_trip(self, effect: str, base: str) -> None:
        """A model survives JSON with the same parameters and the same equations."""
        model = Model(base, ("linear_stiffness", "viscous_damping"), {"alpha": 8.79}).with_effect(
            *({effect} - {"linear_stiffness", "viscous_damping"})
        )
        copy = Model.from_dict(json.loads(json.dumps(model.to_dict())))
        assert copy == model
        assert copy.free == model.free
        first = build_program(model.base, model.effects)
        build_program.cache_clear()
        assert build_program(copy.base, copy.effects) == first

    def test_recovery(self, effect: str) -> None:
        """A fit to a simulated recording with little noise, started 50 % off, returns within four standard deviations."""
        fitted, truth = _recovered(effect)
        declared = fitted.model.parameters
        for name, value in truth.items():
            sd = fitted.sd[name]
            assert name not in fitted.reasons, f"{name}: {fitted.reasons.get(name)}"
            assert abs(fitted.values[name] - value) < 4 * sd, f"{name}: {fitted.values[name]} +- {sd}, true {value}"
            assert 4 * sd < 0.5 * abs(value), f"{name}: the recording does not tell the start from the truth"
            low, high = np.array(declared[name].bounds) * fitted.problem.units.scale(declared[name])
            assert low <= fitted.values[name] <= high


@dataclass(frozen=True)
class _Parabola:
    """A drive of constant acceleration."""

    start: FloatArray
    time: float
    kinks: FloatArray = field(default_factory=lambda: np.empty(0))

    def evaluate(self, t: FloatArray, side: str = "right") -> FloatArray:
        tau = np.asarray(t, float) - self.time
        angle, rate, change = self.start
        return np.stack([angle + rate * tau + 0.5 * change * tau**2, rate + change * tau, change + 0.0 * tau])


def _experiment(base: str, drive: Drive, time: FloatArray, output: FloatArray, noise: float) -> Experiment:
    from discovery.experiment import Experiment
    from discovery.recording import Recording
    from discovery.rig import Columns, InputColumn, OutputColumn, Quantity, Rig, TimeColumn

    arm = get_base(base).system == ARM
    unit = "m" if arm else "q"
    channels = ("tip_x", "tip_y") if arm else ("output",)
    columns = Columns(TimeColumn(), InputColumn("input", unit, "spline"), OutputColumn("output", unit))
    rig = Rig("contract", get_base(base).system, Quantity(1.2, 0.0) if arm else None, columns=columns)
    recording = Recording(
        "contract",
        time,
        drive.evaluate(time)[0],
        output,
        channels,
        (unit,) * len(channels),
        np.full(len(channels), noise),
        "",
        "",
    )
    return Experiment(recording, drive, rig)


def _recovered(effect: str) -> tuple[Fit, dict[str, float]]:
    """Simulate a manoeuvre with one effect, fit it, and return the fit with the true values."""
    from discovery.drive import Drive
    from discovery.fit import fit
    from discovery.problem import Bench, NaturalUnits

    base = "constant_radius" if ARM in get_effect(effect).systems else "oscillator"
    context = ("viscous_damping", "linear_stiffness")
    known = {"length": 1.2} if base == "constant_radius" else {"g": 1.0}
    model = Model(base, (*context, *({effect} - set(context))), known)
    units = NaturalUnits(time=1 / 3, coordinate=1.0, length=1.2)
    truth = {}
    for name in model.free:
        p = model.parameters[name]
        size = p.default if p.shape else _AMPLITUDE * p.prior.width
        truth[name] = {"alpha": 9.0, "xi": 0.1}.get(name, size * units.scale(p))
    # One radian there within a second, at constant accelerations; then the arm rings.
    edges = np.array([0.0, 0.2, 0.4, 1.0, 1.2, 5.0])
    drive = Drive(
        edges,
        np.array([[0.0, 3.125, 0.0, -3.125, 0.0], [0.0, 0.0, 1.25, 1.25, 0.0], [0.0, 0.0, 0.125, 0.875, 1.0]]),
        edges[1:-1],
    )
    time, noise = np.linspace(0.0, 5.0, 401), 1e-4
    nothing = _experiment(base, drive, time, np.zeros((time.size, 2 if base == "constant_radius" else 1)), noise)
    bench = Bench(base, every_effect(base), [nothing], 0.02)
    defaults = {n: p.default * units.scale(p) for n, p in _declared(base, every_effect(base)).items()}
    values = np.array([[{**defaults, **known, **truth}[n]] for n in bench.names])
    (clean,) = bench.predict(values, np.array([[[0.1], [0.2]]]))
    rng = np.random.default_rng(list(effect.encode()))
    experiment = _experiment(
        base, drive, time, clean[:, :, 0] + noise * rng.standard_normal(clean[:, :, 0].shape), noise
    )
    bench = Bench(base, every_effect(base), [experiment], 0.02)
    context_names = [p.name for e in context for p in get_effect(e).parameters()]
    shapes = [n for n in truth if model.parameters[n].shape]
    # Residuals have many minima in a frequency: a grid of starts, none of them the truth.
    factors = np.linspace(0.5, 1.5, 8) if shapes else np.array([0.5])
    fits = []
    for factor in factors:
        start = {n: v * (factor if n in shapes else 1.5 if n in context_names else 0.5) for n, v in truth.items()}
        fits.append(fit(model, [experiment], start=start, bench=bench, units=units))
    return min(fits, key=lambda f: f.chi2), truth
