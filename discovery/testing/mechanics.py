"""What an effect must fulfil as mechanics: the equations are those of its energy, in sympy, numpy and the kernel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import sympy as sp
from scipy.interpolate import BPoly

from discovery.declarations import symbols as s
from discovery.declarations.effect import Joint, Memory, Mode, Shape
from discovery.declarations.registry import get_effect
from discovery.foundation.arrays import FloatArray
from discovery.mechanics import get_base
from discovery.recordings.drive import Drive
from discovery.simulation.grid import Grid
from discovery.simulation.kernel.compile import compile_kernel
from discovery.testing.equations import (
    accelerations,
    bare_base,
    energy,
    evaluator,
    loaded_end_of,
    memory_states,
    shaken,
    slopes_by_sympy,
    slopes_of,
)
from discovery.testing.hinge import elastic_pull, hinge_residual, joint_power, push_of, turning_energy
from discovery.testing.states import Sample, derivative, every_effect, sample_states, whole, without

#: Laws may be shares of these.
_BESIDE = ("linear_stiffness", "viscous_damping")


def _weights(x: FloatArray) -> FloatArray:
    """Return 1 / e(x), and phi_1 to phi_3 of -x that belong to it, for e(x) = 1 + x + ... + x^4 / 24."""
    series = [(1, 1, 1 / 2, 1 / 6, 1 / 24), (1, 1 / 2, 1 / 6, 1 / 24), (1 / 2, 1 / 3, 1 / 8, 1 / 24)]
    e, *phi = (np.polynomial.polynomial.polyval(x, c) for c in (*series, (1 / 6, 1 / 8, 1 / 24, 1 / 48)))
    return np.stack([np.ones_like(x), *phi]) / e


def _plain_step(base: str, sample: Sample, drive: Drive, h: float) -> FloatArray:
    """Return the reading (r, k) half way through one step of length h, by numpy.

    By the classical Runge-Kutta method, or where states forget fast, by Cox and Matthews' equations 26 to 29.
    """
    program = whole(base)
    n = program.n_coordinates
    slopes, p = evaluator(program), sample.parameters
    start, half, stop = sample.time, sample.time + 0.5 * h, sample.time + h
    r0, r1, r2 = (drive.evaluate(t) for t in (start, half, stop))
    y = sample.state
    g = np.zeros_like(y)
    if program.relaxation:
        own = [program.states.index(z) for z, _ in program.relaxation]
        g[own] = evaluator(replace(program, slopes=tuple(e for _, e in program.relaxation)))(start, r0, y, p)
    (u, v, *_), (decay, *phi) = _weights(0.5 * h * g), _weights(h * g)
    k1 = slopes(start, r0, y, p)
    first = k1 + g * y
    a = u * y + 0.5 * h * v * first
    second = slopes(half, r1, a, p) + g * a
    b = u * y + 0.5 * h * v * second
    third = slopes(half, r1, b, p) + g * b
    c = u * a + 0.5 * h * v * (2 * third - first)
    fourth = slopes(stop, r2, c, p) + g * c
    end = decay * y + h * (phi[0] - 3 * phi[1] + 4 * phi[2]) * first
    end += h * (2 * (phi[1] - 2 * phi[2]) * (second + third) + (4 * phi[2] - phi[1]) * fourth)
    k5 = slopes(stop, r2, end, p)
    read = evaluator(replace(program, derivative=(), slopes=program.reading))
    out = np.empty((len(program.reading), y.shape[1]))
    for i, late in enumerate(bare_base(base, replace(sample, time=half)).of(program.lateness)):
        ends = [np.stack([a[:n, i], b[:n, i], c[n : 2 * n, i]]) for a, b, c in ((y, k1, k1), (end, k5, k5))]
        state = np.zeros((len(program.states), 1))
        state[:n, 0] = BPoly.from_derivatives([0.0, h], ends)(0.5 * h - late)
        memory = [np.stack([a[2 * n :, i], b[2 * n :, i]]) for a, b in ((y, k1), (end, k5))]
        if memory[0].size:
            state[2 * n :, 0] = BPoly.from_derivatives([0.0, h], memory)(0.5 * h - late)
        state[n : 2 * n, 0] = BPoly.from_derivatives([0.0, h], [e[1:] for e in ends])(0.5 * h - late)
        out[:, i] = read(half - late, drive.evaluate(half - late), state, p[:, i : i + 1])[:, 0]
    return out


def _needs_motion(base: str) -> None:
    """Skip a law of motion where the motion is given."""
    if get_base(base).prescribed:
        _skip(f"the motion of {base} is prescribed: no force moves it")


def _skip(reason: str) -> None:
    """Skip a test; who only declares effects needs no pytest."""
    import pytest

    pytest.skip(reason)


def _round_off(base: str, sample: Sample) -> float:
    """Return the relative error of accelerations, as the inertia of four shapes passes round-off on."""
    mass = bare_base(base, sample).mass
    return float(np.finfo(float).eps * max(np.linalg.cond(mass[:, :, k]) for k in range(mass.shape[2])))


class MechanicsContract:
    """Laws of mechanics, at random states and parameters."""

    def test_sympy_and_numpy_agree(self, effect: str, base: str) -> None:
        """The printed text evaluates to what sympy evaluates the equations to."""
        program, sample = whole(base), sample_states(base, (*_BESIDE, effect), count=2)
        slopes, apart = slopes_of(base, sample), shaken(base, sample)
        for k in range(2):
            expected = np.array(slopes_by_sympy(program, sample, k))
            # Round-off of a solve is a share of all accelerations together: a small one has fewer digits of its own.
            solved = np.arange(expected.size) // program.n_coordinates == 1
            near = 1e-13 + 1e1 * (_round_off(base, sample) * np.abs(expected[solved]).max() + apart[solved, k].max())
            for rows, atol in ((solved, near), (~solved, 1e-13)):
                np.testing.assert_allclose(slopes[rows, k], expected[rows], rtol=1e-10, atol=atol)

    def test_numpy_and_kernel_agree(self, effect: str, base: str) -> None:
        """One step of the compiled kernel is one step of the plain method on the printed equations."""
        kernel = compile_kernel(base, every_effect(base))
        program, h = kernel.program, 0.2
        sample = sample_states(base, (*_BESIDE, effect), count=kernel.lanes)
        time = np.array([sample.time, sample.time + 0.5 * h, sample.time + h])
        angle, rate, change = sample.recorded[:, :1]
        parabola = np.array([0.5 * change, rate - change, angle - rate + 0.5 * change])
        drive = Drive(sample.time + np.array([-1.0, 1.0]), parabola, np.empty(0))
        grid = Grid.build(time[[0, 2]], drive, h)
        n = len(program.reading)
        out, sums = np.empty((1, n, kernel.lanes)), np.empty((n + 1, kernel.lanes))
        plain = (0, np.zeros((1, n)), np.ones((1, n)))
        middle = (np.zeros(1, np.int64), np.array([0.5]), time[1:2], drive.evaluate(time[1:2]).T.copy())
        steps = (grid.times, grid.steps, grid.restart, grid.drive, 1.0)
        given = (sample.parameters, sample.state.copy())
        left = (out, sums, 0, 1, 0, np.empty((0, 0)), False)
        kernel.run(*steps, *middle, *plain, *given, *left)

        expected = _plain_step(base, sample, drive, h)
        if np.abs(out[0] - expected).max() < 1e-12:
            return
        # Round-off of a stiff step grows as a small disturbance of the state does.
        disturbed = _plain_step(base, replace(sample, state=sample.state * (1 + 1e-13)), drive, h)
        allowed = 1e-12 + 100 * np.abs(disturbed - expected).max(axis=0)
        np.testing.assert_array_less(np.abs(out[0] - expected), np.broadcast_to(allowed, expected.shape))

    def test_force_is_the_gradient_of_the_energy(self, effect: str, base: str) -> None:
        """What the effect adds to Euler-Lagrange's row is the numerical derivative of its energy or power."""
        _needs_motion(base)
        instance = get_effect(effect)
        # What turns the rod or its root is checked by energies alone.
        conservative = isinstance(instance, Shape | Joint)
        sample = sample_states(base, (*(_BESIDE[:1] if conservative else _BESIDE), effect))
        absent = without(sample, base, effect)
        if instance.kind == "drive":
            absent = replace(absent, recorded=self._received(base, sample))
        acceleration = accelerations(base, sample)
        mass = bare_base(base, sample).mass
        added = np.einsum("ijk,jk->ik", mass, acceleration - accelerations(base, absent))
        if instance.kind in ("closure", "sensor", "drive"):
            np.testing.assert_allclose(added, 0.0, atol=1e-12 * np.abs(mass).max())
            return
        if not isinstance(instance, Mode):
            assert np.abs(added).max() > 1e-6, f"{effect} does nothing on {base}"
        if isinstance(instance, Shape):
            # The rod's own inertia and elastic energy change: the whole of Lagrange's equation is checked.
            pull = np.einsum("ijk,jk->ik", mass, acceleration) - bare_base(base, sample).force
            large = np.einsum("ijk,jk->ik", np.abs(mass), np.abs(acceleration)).max()
            atol = max(1e-9, 1e2 * _round_off(base, sample) * large)
            np.testing.assert_allclose(pull, elastic_pull(base, sample), rtol=1e-7, atol=atol)
            return
        if isinstance(instance, Joint):
            np.testing.assert_allclose(hinge_residual(base, sample), 0.0, atol=1e-6 * np.abs(added).max())
            return
        if isinstance(instance, Memory):
            bare, slopes, states = bare_base(base, sample), slopes_of(base, sample), whole(base).states
            for state, slope in memory_states(instance, base).items():
                np.testing.assert_allclose(slopes[states.index(state)], bare.of(slope), rtol=1e-12, atol=1e-14)
        if isinstance(instance, Mode):
            np.testing.assert_array_equal(added, 0.0)
            self._read_mode(instance, base, sample)
            return
        expected = push_of(instance, base, sample, acceleration)
        np.testing.assert_allclose(added, expected, rtol=1e-5, atol=1e-7 * np.abs(added).max())

    def _read_mode(self, mode: Mode, base: str, sample: Sample) -> None:
        """Check that the displacement of a mode, or its second derivative, is read beside the coordinate."""
        program = whole(base)
        rows = [program.states.index(z) for z in memory_states(mode, base)]
        state = sample.state.copy()
        state[rows] = 0.0
        still = replace(sample, state=state)
        read = evaluator(replace(program, slopes=program.reading))
        more, less = (read(at.time, at.recorded, at.state, at.parameters)[0] for at in (sample, still))
        added = sample.state if get_base(base).reads_state else slopes_of(base, sample) - slopes_of(base, still)
        at = rows[0 if get_base(base).reads_state else 1]
        np.testing.assert_allclose(more - less, added[at], rtol=1e-9)

    def _received(self, base: str, sample: Sample) -> FloatArray:
        """Return the input that the system receives (3, k), whose rows are derivatives of one another."""
        names = [x.name for x, _ in whole(base).drive if x in (s.u, s.theta_m, s.omega_m, s.alpha_m)]
        nothing = np.zeros_like(sample.state[:0])

        def later(tau: float) -> FloatArray:
            known = bare_base(base, replace(sample.along(tau, nothing, 0), time=sample.time + tau)).symbols
            return np.array([known[name] for name in names])

        received = later(0.0)
        np.testing.assert_allclose(derivative(later)[:-1], received[1:], rtol=1e-7, atol=1e-9)
        assert np.abs(received - sample.recorded[: len(names)]).max() > 1e-6, "the drive does not change the input"
        return np.concatenate([received, sample.recorded[len(names) :]])

    def test_energy(self, effect: str, base: str) -> None:
        """With the drive at rest, energy is conserved, or only lost by a dissipation, or fed by the power of a load.

        A base that pulls on its coordinate feeds it by that.
        """
        _needs_motion(base)
        instance, n = get_effect(effect), get_base(base).n_coordinates
        if instance.kind == "drive":
            return
        # A spring makes it swing, where there is a place to tie one to.
        tied = "linear_stiffness" in every_effect(base)
        sample = sample_states(base, ("linear_stiffness", effect) if tied else (effect,), static=True)
        acceleration = accelerations(base, sample)
        stored, end = s.alpha * s.U if tied else sp.Integer(0), None
        if instance.kind in ("kinetic", "potential") and effect != "linear_stiffness":
            end = loaded_end_of(instance, base)
            own = energy(instance, base)
            stored += own if end is None else end.kinetic(own) + end.energy

        hinged = isinstance(instance, Joint)
        drift = slopes_of(base, sample)[2 * n :]

        def total(tau: float) -> FloatArray:
            at = sample.along(tau, acceleration, n, drift)
            bare, rate = bare_base(base, at), at.state[n : 2 * n]
            kinetic = np.einsum("ik,ijk,jk->k", rate, bare.mass, rate) / 2
            return kinetic + bare.of(stored) + (turning_energy(base, at) if hinged else 0.0)

        pull = 0.0 if get_base(base).input_moves else bare_base(base, sample).force
        fed = (pull * sample.state[n : 2 * n]).sum(axis=0)
        gained = derivative(total) - fed
        # The end of the rod vibrates fast against the steps of the difference.
        small = max(1e-8 if end is None else 1e-7, 2e1 * _round_off(base, sample))
        scale = small * max(np.abs(total(0.0)).max(), np.abs(fed).max())
        if instance.kind == "dissipation":
            assert (gained < scale).all(), f"{effect} adds energy"
            assert gained.min() < -1e3 * scale, f"{effect} loses no energy"
        elif hinged:
            np.testing.assert_allclose(gained, joint_power(base, sample), rtol=5e-3, atol=1e2 * scale)
        elif instance.kind in ("load", "memory"):
            power = bare_base(base, sample).of(energy(instance, base))
            np.testing.assert_allclose(gained, power, rtol=1e-7, atol=scale)
        else:
            np.testing.assert_allclose(gained, 0.0, atol=scale)

    def test_inertia_is_that_of_the_tip_path(self, base: str) -> None:
        """Without a rod's mass, a base has the kinetic energy and the inertial force of a point on its path.

        The path of `constant_radius` is its circle: a radius law is output only there, as in the source paper, and the
        inertia of the changing radius is left out. The rod's mass adds its own terms, which are absent here.
        """
        _needs_motion(base)
        if get_base(base).pivots:
            _skip(f"the coordinate of {base} is an angle about a pivot that is shifted: it tells no path")
        n = get_base(base).n_coordinates
        shapes = tuple(e for e in every_effect(base) if isinstance(get_effect(e), Shape))
        still, moving = sample_states(base, shapes, static=True), sample_states(base, shapes)
        for sample in (still, moving):
            if "mu" in whole(base).parameters:
                sample.parameters[whole(base).parameters.index("mu")] = 0.0
        acceleration = np.random.default_rng(2).uniform(-1, 1, (n, still.state.shape[1]))

        def velocity(at: Sample) -> FloatArray:
            return derivative(lambda tau: bare_base(base, at.along(tau, acceleration, n)).path)

        rate = still.state[n : 2 * n]
        energy = np.einsum("ik,ijk,jk->k", rate, bare_base(base, still).mass, rate) / 2
        np.testing.assert_allclose(energy, (velocity(still) ** 2).sum(axis=0) / 2, rtol=1e-9)

        bare = bare_base(base, moving)
        # A force, the input's or a constant one, is no inertia.
        inertial = bare.force if get_base(base).input_moves else 0.0
        inertia = np.einsum("ijk,jk->ik", bare.mass, acceleration) - inertial

        def along(row: int) -> FloatArray:
            return derivative(lambda by: bare_base(base, moving.moved(row, by)).path)

        pull = derivative(lambda tau: velocity(moving.along(tau, acceleration, n)))
        expected = np.array([(along(i) * pull).sum(axis=0) for i in range(n)])
        np.testing.assert_allclose(inertia, expected, rtol=1e-7, atol=1e-7)
