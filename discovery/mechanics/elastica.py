"""The exact arm: an inextensible rod with distributed mass in a few curvature modes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property, lru_cache
from typing import ClassVar

import numpy as np
import sympy as sp
from scipy.linalg import eigh

from discovery.declarations import symbols as s
from discovery.declarations.parameters import HalfNormal, Normal, Parameter
from discovery.mechanics.base import RADIUS_LAWS, SHORTENING_RADIUS, ArmBase, Channel, Mechanics, RodEnd, Strand
from discovery.mechanics.rod import STRAIGHT, Rod
from discovery.mechanics.rod_shapes import (
    bending_matrix,
    curvatures,
    end_residual,
    mass_matrix,
    polynomials,
    quadrature,
    reduced_shapes,
    rod_masses,
    static_shapes,
)

#: Retardation time [s] below which the ringing of a light rod may be chaotic: no step would be small enough.
_CALM = 1.5e-4
#: The rod's inertia in the turn of its end, over that of the turn alone: it moves with the shapes too. With this, the
#: second frequency of a rod that ends in a rotary inertia is that of a beam to 0.1 %, and none is far above the others.
_END_SHARE = 3.0
__all__ = [
    "BASE",
    "CALM",
    "FOUR_MODES",
    "ONE_MODE",
    "TWO_MODES",
    "Elastica",
    "ElasticaCalm",
    "ElasticaFourModes",
    "ElasticaOneMode",
    "ElasticaTwoModes",
]


@lru_cache(maxsize=64)
def _derived(arm: Elastica, rod: Rod) -> Mechanics:
    """Derive the mathematics of an arm once: it is the same with all effects that leave the rod as it is."""
    return arm.derive(rod)


def _over_three(curvature: np.ndarray, q: Sequence[sp.Symbol], qd: Sequence[sp.Symbol]) -> Strand:
    """Return a third of the curvature at a place, from that of each shape there (n,)."""
    third = [float(c) / 3 for c in curvature]
    value, rate = (sum(c * x for c, x in zip(third, own, strict=True)) for own in (q, qd))
    return value, rate, tuple(sp.Float(c) for c in third)


class Elastica(ArmBase):
    r"""The rod of (1) and the tip mass of (7), with the rod's mass: theta(s, t) = theta_m + sum_k q_k phi_k(s).

    Lagrange's equations of the q_k; the shapes are those of `discovery.mechanics.rod_shapes`.

    Large deflection, radius, tension, centrifugal and Coriolis terms, the rod's mass and the second bending mode are
    all contained; bending stiffness enters through `linear_stiffness` (alpha = 3 EI / (m_eff l^3),
    m_eff = m + 33 m_r / 140), the rod through mu = m_r / m. Positions are integrated by cumulative Gauss-Legendre
    quadrature. Every material damps the ringing of the rod a little: tau_r is the retardation time of a Kelvin-Voigt
    rod (Banks and Inman, Journal of Applied Mechanics 58 (1991) 716). All vectors are in the frame of the hub: inner
    products do not care, and the bending angles stay small. A rest angle adds to the slope, a compliant root turns the
    whole rod with its curvature there, q_k (phi_k(s) + c phi_k'(0)), see `discovery.mechanics.rod`; its spring stores
    energy, but only the rod's own bending relaxes or loses any.
    """

    name = "elastica"
    n_coordinates = 3
    nodes = 6
    #: Whether one of the nodes is at the root: one that does not turn costs nothing.
    rooted: ClassVar[bool] = False
    lanes = 8
    #: Inertia that the last shape has more than the straight rod's, over that.
    heavier: ClassVar[float] = 0.0
    #: Against a converged beam, over arms and manoeuvres of the blind benchmark's kind without any effect.
    accuracy = 3e-5
    provides = frozenset({"cubic_stiffness", "quintic_stiffness", "distributed_mass", *RADIUS_LAWS, *SHORTENING_RADIUS})

    mu = Parameter("1", "rod mass over tip mass", (0.005, 2.0), Normal(0.2, 0.2), fixed=True, latex=r"\mu")

    tau_r = Parameter(
        "s", "retardation time of the rod's material", (0.0, math.inf), HalfNormal(1e-3), fixed=True, latex=r"\tau_r"
    )

    @cached_property
    def _weights(self) -> np.ndarray:
        return reduced_shapes(max(2, self.n_coordinates))[: self.n_coordinates]

    @cached_property
    def _quadrature(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Arc lengths, weights, and the cumulative matrix."""
        return quadrature(self.nodes, rooted=self.rooted)

    @cached_property
    def _symbols(self) -> tuple[tuple[sp.Symbol, ...], tuple[sp.Symbol, ...]]:
        n = self.n_coordinates
        return sp.symbols(f"q_1:{n + 1}", real=True), sp.symbols(f"qd_1:{n + 1}", real=True)

    @cached_property
    def _root_curvature(self) -> np.ndarray:
        """Curvature phi_k'(0) of each shape at the root, shape (n,)."""
        return self._weights @ curvatures(np.zeros(1))[:, 0]

    @cached_property
    def _own_inertia(self) -> float:
        """Inertia of the last shape of the straight rod over the rod's mass: it does not move the tip."""
        return float(mass_matrix(self._weights, 1.0)[-1, -1] * (1 + 33 / 140))

    def _slopes(self, rod: Rod) -> tuple[list[list[sp.Expr]], list[sp.Expr]]:
        """Return how the slope at each node changes with each q_k, and what it is at rest."""
        at, _, _ = self._quadrature
        phi, turn = self._weights @ polynomials(at), [rod.root * float(g) for g in self._root_curvature]
        changes = [[float(phi[k, a]) + turn[k] for a in range(self.nodes)] for k in range(self.n_coordinates)]
        return changes, [rod.rest_at(float(a)) for a in at]

    def mechanics(self, rod: Rod = STRAIGHT) -> Mechanics:
        """Return the mathematics."""
        return _derived(self, rod)

    def derive(self, rod: Rod) -> Mechanics:
        """Return the mathematics, derived anew."""
        n, nodes = self.n_coordinates, self.nodes
        q, qd = self._symbols
        at, weights, cumulative = self._quadrature
        program: list[tuple[sp.Symbol, sp.Expr]] = []

        def name(label: str, expression: sp.Expr) -> sp.Symbol:
            symbol = sp.Symbol(label, real=True)
            program.append((symbol, sp.sympify(expression)))
            return symbol

        tip_share = name("m_t", 1 / (1 + sp.Rational(33, 140) * self.mu))
        phi, rest = self._slopes(rod)
        sine, cosine, rate = [], [], []
        for a in range(nodes):
            bend = sum(phi[k][a] * q[k] for k in range(n)) + rest[a]
            # A clamped root does not turn.
            bend = name(f"psi_{a}", bend) if bend != 0 else sp.S.Zero
            sine.append(name(f"sn_{a}", sp.sin(bend)) if bend != 0 else sp.S.Zero)
            cosine.append(name(f"cs_{a}", sp.cos(bend)) if bend != 0 else sp.S.One)
            rate.append(name(f"rt_{a}", s.omega_m + sum(phi[k][a] * qd[k] for k in range(n))))
        # The mass that two pieces of the rod carry together: what lies beyond both, the tip included.
        both = rod_masses(self._weights, self.nodes, rooted=self.rooted)
        carried = {
            (b, c): name(f"W_{b}{c}", tip_share * (float(both[b, c]) * self.mu + float(weights[b] * weights[c])))
            for b in range(nodes)
            for c in range(b + 1)
        }
        # Along a turn of the other piece, and along its centripetal acceleration.
        along = [[carried[max(b, c), min(b, c)] for c in range(nodes)] for b in range(nodes)]
        across = [[sp.Integer(0)] * nodes for _ in range(nodes)]
        for b in range(nodes):
            for c in range(b):
                turn = name(f"cc_{b}{c}", cosine[b] * cosine[c] + sine[b] * sine[c])
                along[b][c] = along[c][b] = name(f"G_{b}{c}", carried[b, c] * turn)
                turn = name(f"ss_{b}{c}", sine[b] * cosine[c] - cosine[b] * sine[c])
                across[b][c] = name(f"E_{b}{c}", carried[b, c] * turn)
                across[c][b] = -across[b][c]
        square = [name(f"rr_{b}", rate[b] ** 2) for b in range(nodes)]
        whole = [name(f"G_{b}", sum(along[b])) for b in range(nodes)]
        # Inertial forces at zero q'': base acceleration and centripetal part.
        pull = [
            name(f"P_{b}", s.alpha_m * whole[b] + sum(across[b][c] * square[c] for c in range(nodes)))
            for b in range(nodes)
        ]

        def shaped(k: int, at: Sequence[sp.Expr]) -> sp.Expr:
            return sum(phi[k][b] * at[b] for b in range(nodes))

        mass = [[sp.Integer(0)] * n for _ in range(n)]
        for j in range(n):
            row = [name(f"G{j}_{b}", shaped(j, along[b])) for b in range(nodes)]
            for i in range(j, n):
                mass[i][j] = mass[j][i] = name(f"M_{i}{j}", shaped(i, row))
        if self.heavier:
            mass[-1][-1] = name("M_last", mass[-1][-1] + tip_share * self.heavier * self._own_inertia * self.mu)
        stiffness = bending_matrix(self._weights) / 3
        # Kelvin-Voigt: the bending moment follows the curvature rate a little; it calms the ringing of the rod.
        loss = [s.alpha * self.tau_r * sum(float(stiffness[i, j]) * qd[j] for j in range(n)) for i in range(n)]
        force = tuple(name(f"B_{i}", -shaped(i, pull) - loss[i]) for i in range(n))

        def total(label: str, share: Sequence[sp.Expr], at: Sequence[sp.Expr]) -> sp.Symbol:
            return name(label, sum(share[b] * at[b] for b in range(nodes)))

        ends = [sp.Float(float(w)) for w in weights]
        tip_x, tip_y = total("tip_x", ends, cosine), total("tip_y", ends, sine)
        jx = [total(f"px_{k}", ends, [-phi[k][b] * sine[b] for b in range(nodes)]) for k in range(n)]
        jy = [total(f"py_{k}", ends, [phi[k][b] * cosine[b] for b in range(nodes)]) for k in range(n)]
        ax = total("ax", ends, [-s.alpha_m * sine[b] - square[b] * cosine[b] for b in range(nodes)])
        ay = total("ay", ends, [s.alpha_m * cosine[b] - square[b] * sine[b] for b in range(nodes)])
        vx = name("hub_vx", -s.omega_m * tip_y + sum(jx[k] * qd[k] for k in range(n)))
        vy = name("hub_vy", s.omega_m * tip_x + sum(jy[k] * qd[k] for k in range(n)))
        channels = self._channels(tip_x, tip_y, vx=vx, vy=vy, jx=jx, jy=jy, ax=ax, ay=ay, q=q, qd=qd)
        curved = self._weights @ curvatures(at)
        kappa = [name(f"kp_{a}", sum(float(curved[k, a]) * q[k] for k in range(n))) for a in range(nodes)]
        cube = [name(f"kc_{a}", float(weights[a] / 3) * kappa[a] ** 3) for a in range(nodes)]
        quartic = sum(kappa[a] * cube[a] for a in range(nodes)) / 4
        hardening = tuple(sum(float(curved[k, a]) * cube[a] for a in range(nodes)) for k in range(n))
        channels |= {s.U_4: Channel(quartic, hardening), **self._rod_channels(rod)}
        beyond = weights @ cumulative[:nodes]
        first = [name(f"W_{b}", tip_share * (float(beyond[b]) * self.mu + float(weights[b]))) for b in range(nodes)]
        moment_x, moment_y = total("mx", first, cosine), total("my", first, sine)
        lever_x = [total(f"lx_{k}", first, [-phi[k][b] * sine[b] for b in range(nodes)]) for k in range(n)]
        lever_y = [total(f"ly_{k}", first, [phi[k][b] * cosine[b] for b in range(nodes)]) for k in range(n)]
        c, sn = sp.cos(s.theta_m), sp.sin(s.theta_m)
        channels[s.x_g] = Channel(
            c * moment_x - sn * moment_y, tuple(c * a - sn * b for a, b in zip(lever_x, lever_y, strict=True))
        )
        channels[s.y_g] = Channel(
            sn * moment_x + c * moment_y, tuple(sn * a + c * b for a, b in zip(lever_x, lever_y, strict=True))
        )
        # Angular momentum, the sum of p x v; its rate is that of p x a.
        arms = [name(f"h_{k}", shaped(k, whole)) for k in range(n)]
        momentum = s.omega_m * sum(whole) + sum(arms[k] * qd[k] for k in range(n))
        channels[s.h] = Channel(momentum, tuple(arms), sum(pull))
        # U = |L^T q|^2 / 2 with L L^T the bending matrix: its components relax, each by itself.
        root = np.linalg.cholesky(stiffness)
        components = tuple(
            (
                sum(float(root[j, i]) * q[j] for j in range(i, n)),
                sum(float(root[j, i]) * qd[j] for j in range(i, n)),
                tuple(sp.Float(float(root[j, i])) if j >= i else sp.Integer(0) for j in range(n)),
            )
            for i in range(n)
        )
        fibres = tuple((3 * float(weights[a]), _over_three(curved[:, a], q, qd)) for a in range(nodes))
        return Mechanics(
            q,
            qd,
            assignments=tuple(program),
            channels=channels,
            mass=tuple(map(tuple, mass)),
            force=force,
            bending=components,
            fibres=fibres,
            root=_over_three(self._root_curvature, q, qd),
            end=self._end(),
        )

    def _end(self) -> RodEnd | None:
        """Return how the end gives way to a moment; the slow motion of one mode has no use for it."""
        if self.n_coordinates == 1:
            return None
        compliance, inertia = end_residual(self._weights)
        stiffness = s.alpha / (3 * compliance)
        moving = _END_SHARE * inertia * self.mu / (1 + sp.Rational(33, 140) * self.mu)
        return RodEnd(stiffness, stiffness * self.tau_r, moving)

    def _channels(self, tip_x, tip_y, vx, vy, jx, jy, ax, ay, q, qd) -> dict[sp.Symbol, Channel]:
        """Return the channels from the tip's motion, given along the axes of the hub."""
        n = self.n_coordinates
        c, sn = sp.cos(s.theta_m), sp.sin(s.theta_m)
        radius2 = tip_x**2 + tip_y**2
        deflection = sp.atan2(tip_y, tip_x)
        turning = (tip_x * vy - tip_y * vx) / radius2
        j_angle = tuple((tip_x * jy[k] - tip_y * jx[k]) / radius2 for k in range(n))
        # d/dt of (x v_y - y v_x)/rho^2 is (x a_y - y a_x)/rho^2 - 2 (rho rho'/rho^2) theta'.
        angle_bias = (tip_x * ay - tip_y * ax) / radius2 - 2 * turning * (tip_x * vx + tip_y * vy) / radius2
        stiffness = bending_matrix(self._weights) / 3
        bending = [[float(stiffness[i, j]) for j in range(n)] for i in range(n)]
        drag = tuple(sum(bending[i][j] * qd[j] for j in range(n)) for i in range(n))
        j_x = tuple(c * jx[k] - sn * jy[k] for k in range(n))
        j_y = tuple(sn * jx[k] + c * jy[k] for k in range(n))
        zero = (sp.Integer(0),) * n
        return {
            s.theta: Channel(s.theta_m + deflection, j_angle),
            s.omega: Channel(turning, j_angle, angle_bias),
            s.delta: Channel(deflection, j_angle),
            s.delta_dot: Channel(turning - s.omega_m, j_angle, angle_bias - s.alpha_m),
            s.x: Channel(c * tip_x - sn * tip_y, j_x),
            s.y: Channel(sn * tip_x + c * tip_y, j_y),
            s.v_x: Channel(c * vx - sn * vy, j_x, c * ax - sn * ay),
            s.v_y: Channel(sn * vx + c * vy, j_y, sn * ax + c * ay),
            s.v2: Channel(vx**2 + vy**2, tuple(2 * (vx * jx[k] + vy * jy[k]) for k in range(n))),
            s.w2: Channel(sum(qd[i] * drag[i] for i in range(n)), tuple(2 * drag[i] for i in range(n))),
            s.rho: Channel(sp.sqrt(radius2), zero),
        }

    def _rod_channels(self, rod: Rod) -> dict[sp.Symbol, Channel]:
        """Return the channels of the rod's own shape: its energy, with the spring's, and the slope of its end."""
        n, (q, qd) = self.n_coordinates, self._symbols
        stiffness, root = bending_matrix(self._weights) / 3, self._root_curvature
        spring = np.outer(root, root) / 3
        pull = tuple(
            sum((float(stiffness[i, j]) + rod.root * float(spring[i, j])) * q[j] for j in range(n)) for i in range(n)
        )
        # Every shape ends with the slope p_k(1) = 1 of its polynomials.
        end = tuple(float(self._weights[k].sum()) + rod.root * float(root[k]) for k in range(n))
        return {
            s.U: Channel(sum(q[i] * pull[i] for i in range(n)) / 2, pull),
            s.slope: Channel(s.theta_m + rod.rest_at(1) + sum(end[k] * q[k] for k in range(n)), end),
            s.slope_dot: Channel(s.omega_m + sum(end[k] * qd[k] for k in range(n)), end, s.alpha_m),
        }

    def reading(self, closure, rod=STRAIGHT):
        """Return the tip position in lengths of the arm."""
        q, _ = self._symbols
        _, weights, _ = self._quadrature
        phi, rest = self._slopes(rod)
        bend = [sum(phi[k][a] * q[k] for k in range(self.n_coordinates)) + rest[a] for a in range(self.nodes)]
        tip_x = sum(float(weights[a]) * sp.cos(bend[a]) for a in range(self.nodes))
        tip_y = sum(float(weights[a]) * sp.sin(bend[a]) for a in range(self.nodes))
        c, sn = sp.cos(s.theta_m), sp.sin(s.theta_m)
        return c * tip_x - sn * tip_y, sn * tip_x + c * tip_y

    @cached_property
    def _static_fit(self) -> np.ndarray:
        """Coefficients (n, 6) of the static q_k(delta) in delta, delta^3, ..., delta^11: where slow motion runs."""
        deflections = np.linspace(0.05, 1.3, 26)
        powers = deflections[:, None] ** np.arange(1, 12, 2)
        return np.linalg.lstsq(powers, static_shapes(self._weights, deflections).T, rcond=None)[0].T

    def initial_coordinates(self, deflection, rate, drive, form=(0, 0)):
        """Return the shape of a slow motion through this deflection at this rate."""
        rest, root = form
        deflection, rate = np.atleast_1d(deflection) - rest, np.atleast_1d(rate)
        exponents = np.arange(1, 12, 2)[:, None]
        # The whole rod turns with its root, bent as in a rigid clamp: Newton's method on the bending.
        curvature = self._root_curvature @ self._static_fit
        bend = deflection / (1 + root * curvature[0])
        for _ in range(2):
            ahead = bend + root * (curvature @ bend**exponents) - deflection
            bend = bend - ahead / (1 + root * (curvature @ (exponents * bend ** (exponents - 1))))
        slope = exponents * bend ** (exponents - 1)
        return self._static_fit @ bend**exponents, self._static_fit @ slope * rate / (1 + root * (curvature @ slope))

    def calmed(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the values with the least damping of the rod at which its ringing has a converged solution."""
        return {**values, "tau_r": max(values.get("tau_r", 0.0), _CALM)}

    def highest_frequency(self, values: Mapping[str, float]) -> float:
        """Return the highest small-amplitude angular frequency over sqrt(alpha)."""
        mass = mass_matrix(self._weights, values["mu"])
        mass[-1, -1] *= 1 + self.heavier
        return float(np.sqrt(eigh(bending_matrix(self._weights) / 3, mass, eigvals_only=True)[-1]))


class ElasticaFourModes(Elastica):
    """The exact arm with four curvature modes: also where violent moves make a light rod ring."""

    name = "elastica_4"
    n_coordinates = 4
    nodes = 7


class ElasticaCalm(Elastica):
    """The exact arm with a heavier third shape, for searches: on steps 1.7 times as long the same motion.

    That shape only follows the others, slowly: its inertia hardly matters, but its ringing would set the step. A node
    at the root makes up for two inside.
    """

    name = "elastica_calm"
    heavier = 2.0
    nodes = 5
    rooted = True
    finer = ("elastica_4", "elastica")


class ElasticaTwoModes(Elastica):
    """The exact arm with two curvature modes: faster, but its static shape is off at large deflection."""

    name = "elastica_2"
    n_coordinates = 2
    accuracy = 0.0


class ElasticaOneMode(Elastica):
    """The exact arm in the static shape of a small force alone: one coordinate, no ringing, all of its inertia."""

    name = "elastica_1"
    n_coordinates = 1
    accuracy = 0.0


BASE, CALM, FOUR_MODES = Elastica(), ElasticaCalm(), ElasticaFourModes()
TWO_MODES, ONE_MODE = ElasticaTwoModes(), ElasticaOneMode()
