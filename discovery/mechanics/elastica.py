"""The exact arm: an inextensible rod with distributed mass in a few curvature modes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from typing import ClassVar

import numpy as np
import sympy as sp
from scipy.linalg import eigh

from discovery.declarations import symbols as s
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import HalfStudent, Normal
from discovery.mechanics.base import RADIUS_LAWS, SHORTENING_RADIUS, ArmBase, Mechanics, RodEnd
from discovery.mechanics.elastica_motion import Derivation
from discovery.mechanics.rod import STRAIGHT, Rod
from discovery.mechanics.rod_shapes import (
    bending_matrix,
    curvatures,
    end_residual,
    mass_matrix,
    polynomials,
    reduced_shapes,
    rod_share,
    static_shapes,
)
from discovery.mechanics.rod_shapes import quadrature as nodes_and_weights

#: Retardation time [s] below which the ringing of a light rod may be chaotic: no step would be small enough.
_CALM = 1.5e-4
#: The rod's inertia in the turn of its end, over that of the turn alone: it moves with the shapes too. With this, the
#: second frequency of a rod that ends in a rotary inertia is that of a beam to 0.1 %, and none is far above the others.
_END_SHARE = 3.0
#: Rod mass over tip mass at which the fastest mode is made heavier.
_LIGHT = 0.1


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
    lanes, blocks = 8, 2
    #: Inertia that the fastest mode has more than the straight rod's, over that.
    heavier: ClassVar[float] = 0.0
    #: Against a converged beam, over arms and manoeuvres of the blind benchmark's kind without any effect.
    accuracy = 3e-5
    provides = frozenset({"cubic_stiffness", "quintic_stiffness", "distributed_mass", *RADIUS_LAWS, *SHORTENING_RADIUS})

    mu = Parameter("1", "rod mass over tip mass", (0.005, 2.0), Normal(0.2, 0.2), fixed=True, latex=r"\mu")

    tau_r = Parameter(
        "s", "retardation time of the rod's material", (0.0, math.inf), HalfStudent(1e-3), fixed=True, latex=r"\tau_r"
    )

    @cached_property
    def weights(self) -> np.ndarray:
        """Coefficients of each shape in the polynomials of `discovery.mechanics.rod_shapes`, shape (n, m)."""
        return reduced_shapes(max(2, self.n_coordinates))[: self.n_coordinates]

    @cached_property
    def quadrature(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Arc lengths, weights, and the cumulative matrix."""
        return nodes_and_weights(self.nodes, rooted=self.rooted)

    @cached_property
    def symbols(self) -> tuple[tuple[sp.Symbol, ...], tuple[sp.Symbol, ...]]:
        """Coordinates and rates."""
        n = self.n_coordinates
        return sp.symbols(f"q_1:{n + 1}", real=True), sp.symbols(f"qd_1:{n + 1}", real=True)

    @cached_property
    def root_curvature(self) -> np.ndarray:
        """Curvature phi_k'(0) of each shape at the root, shape (n,)."""
        return self.weights @ curvatures(np.zeros(1))[:, 0]

    @cached_property
    def ballast(self) -> np.ndarray:
        """Inertia that makes the fastest mode heavier and no other, over the rod's mass, shape (n, n).

        That of a light rod: where the tip hardly moves, modes are the same for any.
        """
        mass = mass_matrix(self.weights, _LIGHT)
        _, modes = eigh(bending_matrix(self.weights) / 3, mass)
        momentum = mass @ modes[:, -1]
        return self.heavier * np.outer(momentum, momentum) / rod_share(_LIGHT)

    def slopes(self, rod: Rod) -> tuple[list[list[sp.Expr]], list[sp.Expr]]:
        """Return how the slope at each node changes with each q_k, and what it is at rest."""
        at, _, _ = self.quadrature
        phi, turn = self.weights @ polynomials(at), [rod.root * float(g) for g in self.root_curvature]
        changes = [[float(phi[k, a]) + turn[k] for a in range(self.nodes)] for k in range(self.n_coordinates)]
        return changes, [rod.rest_at(float(a)) for a in at]

    def derive(self, rod: Rod) -> Mechanics:
        """Return the mathematics, derived anew."""
        return Derivation(self, rod).mechanics()

    def end(self) -> RodEnd | None:
        """Return how the end gives way to a moment; the slow motion of one mode has no use for it."""
        if self.n_coordinates == 1:
            return None
        compliance, inertia = end_residual(self.weights)
        stiffness = s.alpha / (3 * compliance)
        moving = _END_SHARE * inertia * self.mu / (1 + sp.Rational(33, 140) * self.mu)
        return RodEnd(stiffness, stiffness * self.tau_r, moving)

    def reading(self, closure, rod=STRAIGHT):
        """Return the tip position in lengths of the arm."""
        q, _ = self.symbols
        _, weights, _ = self.quadrature
        phi, rest = self.slopes(rod)
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
        return np.linalg.lstsq(powers, static_shapes(self.weights, deflections).T, rcond=None)[0].T

    def initial_coordinates(self, deflection, rate, drive, form=(0, 0)):
        """Return the shape of a slow motion through this deflection at this rate."""
        rest, root = form
        deflection, rate = np.atleast_1d(deflection) - rest, np.atleast_1d(rate)
        exponents = np.arange(1, 12, 2)[:, None]
        # The whole rod turns with its root, bent as in a rigid clamp: Newton's method on the bending.
        curvature = self.root_curvature @ self._static_fit
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
        mu = values["mu"]
        mass = mass_matrix(self.weights, mu) + rod_share(mu) * self.ballast
        return float(np.sqrt(eigh(bending_matrix(self.weights) / 3, mass, eigvals_only=True)[-1]))


class ElasticaFourModes(Elastica):
    """The exact arm with four curvature modes: also where violent moves make a light rod ring.

    Its fastest mode is no mode of a beam yet, and would set the step: it is heavier, of half the frequency.
    """

    name = "elastica_4"
    n_coordinates = 4
    nodes = 7
    heavier = 3.0


class ElasticaCalm(Elastica):
    """The exact arm with a heavier third mode, for searches: on steps 1.7 times as long the same motion.

    Its shape only follows the others, slowly: its inertia hardly matters, but its ringing would set the step. A node
    at the root makes up for two inside.
    """

    name = "elastica_calm"
    heavier = 2.0
    nodes = 5
    rooted = True
    approximates = ("elastica_4", "elastica")


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
