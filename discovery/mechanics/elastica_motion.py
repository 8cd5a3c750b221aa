"""Lagrange's equations of the exact arm, written out in named parts: what each node turns, carries and pulls."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import sympy as sp

from discovery.declarations import symbols as s
from discovery.mechanics.base import Channel, Mechanics, Strand
from discovery.mechanics.rod import Rod
from discovery.mechanics.rod_shapes import bending_matrix, curvatures, rod_masses

if TYPE_CHECKING:
    from discovery.mechanics.elastica import Elastica


def over_three(curvature: np.ndarray, q: Sequence[sp.Symbol], qd: Sequence[sp.Symbol]) -> Strand:
    """Return a third of the curvature at a place, from that of each shape there (n,)."""
    third = [float(c) / 3 for c in curvature]
    value, rate = (sum(c * x for c, x in zip(third, own, strict=True)) for own in (q, qd))
    return value, rate, tuple(sp.Float(c) for c in third)


class Derivation:
    """The mathematics of one arm with one rod, derived part after part; `program` names what is used again."""

    def __init__(self, arm: Elastica, rod: Rod) -> None:
        self.arm, self.rod = arm, rod
        self.n, self.nodes = arm.n_coordinates, arm.nodes
        self.q, self.qd = arm.symbols
        self.at, self.weights, self.cumulative = arm.quadrature
        self.stiffness = bending_matrix(arm.weights) / 3
        self.program: list[tuple[sp.Symbol, sp.Expr]] = []
        self.tip_share = self._name("m_t", 1 / (1 + sp.Rational(33, 140) * arm.mu))
        self.phi, rest = arm.slopes(rod)
        self.sine, self.cosine, self.rate = self._turns(rest)

    def mechanics(self) -> Mechanics:
        """Return mass matrix, force and channels."""
        arm, q, qd, n = self.arm, self.q, self.qd, self.n
        along, across = self._carried()
        square = [self._name(f"rr_{b}", self.rate[b] ** 2) for b in range(self.nodes)]
        whole = [self._name(f"G_{b}", sum(along[b])) for b in range(self.nodes)]
        # Inertial forces at zero q'': base acceleration and centripetal part.
        pull = [
            self._name(f"P_{b}", s.alpha_m * whole[b] + sum(across[b][c] * square[c] for c in range(self.nodes)))
            for b in range(self.nodes)
        ]
        mass = self._mass(along)
        # Kelvin-Voigt: the bending moment follows the curvature rate a little; it calms the ringing of the rod.
        loss = [s.alpha * arm.tau_r * sum(float(self.stiffness[i, j]) * qd[j] for j in range(n)) for i in range(n)]
        force = tuple(self._name(f"B_{i}", -self._shaped(i, pull) - loss[i]) for i in range(n))
        channels = self._tip(square)
        fibres, hardening = self._fibres()
        channels |= {s.U_4: hardening, **self._rod_channels()} | self._centre()
        # Angular momentum, the sum of p x v; its rate is that of p x a.
        arms = [self._name(f"h_{k}", self._shaped(k, whole)) for k in range(n)]
        momentum = s.omega_m * sum(whole) + sum(arms[k] * qd[k] for k in range(n))
        channels[s.h] = Channel(momentum, tuple(arms), sum(pull))
        return Mechanics(
            q,
            qd,
            assignments=tuple(self.program),
            channels=channels,
            mass=tuple(map(tuple, mass)),
            force=force,
            bending=self._components(),
            fibres=fibres,
            root=over_three(arm.root_curvature, q, qd),
            end=arm.end(),
        )

    def _name(self, label: str, expression: sp.Expr) -> sp.Symbol:
        symbol = sp.Symbol(label, real=True)
        self.program.append((symbol, sp.sympify(expression)))
        return symbol

    def _shaped(self, k: int, at: Sequence[sp.Expr]) -> sp.Expr:
        return sum(self.phi[k][b] * at[b] for b in range(self.nodes))

    def _total(self, label: str, share: Sequence[sp.Expr], at: Sequence[sp.Expr]) -> sp.Symbol:
        return self._name(label, sum(share[b] * at[b] for b in range(self.nodes)))

    def _turns(self, rest: Sequence[sp.Expr]) -> tuple[list[sp.Expr], list[sp.Expr], list[sp.Expr]]:
        """Return sine and cosine of the bending at each node, and its whole turning rate."""
        sine, cosine, rate = [], [], []
        for a in range(self.nodes):
            bend = sum(self.phi[k][a] * self.q[k] for k in range(self.n)) + rest[a]
            # A clamped root does not turn.
            bend = self._name(f"psi_{a}", bend) if bend != 0 else sp.S.Zero
            sine.append(self._name(f"sn_{a}", sp.sin(bend)) if bend != 0 else sp.S.Zero)
            cosine.append(self._name(f"cs_{a}", sp.cos(bend)) if bend != 0 else sp.S.One)
            turning = s.omega_m + sum(self.phi[k][a] * self.qd[k] for k in range(self.n))
            rate.append(self._name(f"rt_{a}", turning))
        return sine, cosine, rate

    def _carried(self) -> tuple[list[list[sp.Expr]], list[list[sp.Expr]]]:
        """Return the mass that two pieces carry together, along the turn of the other and its centripetal pull."""
        arm, nodes, weights = self.arm, self.nodes, self.weights
        sine, cosine = self.sine, self.cosine
        # What lies beyond both, the tip included.
        both = rod_masses(arm.weights, nodes, rooted=arm.rooted)
        carried = {
            (b, c): self._name(
                f"W_{b}{c}", self.tip_share * (float(both[b, c]) * arm.mu + float(weights[b] * weights[c]))
            )
            for b in range(nodes)
            for c in range(b + 1)
        }
        along = [[carried[max(b, c), min(b, c)] for c in range(nodes)] for b in range(nodes)]
        across = [[sp.Integer(0)] * nodes for _ in range(nodes)]
        for b in range(nodes):
            for c in range(b):
                turn = self._name(f"cc_{b}{c}", cosine[b] * cosine[c] + sine[b] * sine[c])
                along[b][c] = along[c][b] = self._name(f"G_{b}{c}", carried[b, c] * turn)
                turn = self._name(f"ss_{b}{c}", sine[b] * cosine[c] - cosine[b] * sine[c])
                across[b][c] = self._name(f"E_{b}{c}", carried[b, c] * turn)
                across[c][b] = -across[b][c]
        return along, across

    def _mass(self, along: Sequence[Sequence[sp.Expr]]) -> list[list[sp.Expr]]:
        arm, n, phi = self.arm, self.n, self.phi
        mass = [[sp.Integer(0)] * n for _ in range(n)]
        rod = self._name("m_r", self.tip_share * arm.mu) if arm.heavier else sp.S.Zero
        for j in range(n):
            for i in range(j, n):
                shares = [
                    (phi[i][b] * phi[j][c] + phi[i][c] * phi[j][b] if b != c else phi[i][b] * phi[j][b]) * along[b][c]
                    for b in range(self.nodes)
                    for c in range(b + 1)
                ]
                shares += [rod * float(arm.ballast[i, j])] if arm.heavier else []
                mass[i][j] = mass[j][i] = self._name(f"M_{i}{j}", sum(shares))
        return mass

    def _tip(self, square: Sequence[sp.Expr]) -> dict[sp.Symbol, Channel]:
        """Return the channels of the tip, from its motion along the axes of the hub."""
        n, nodes, phi, qd = self.n, self.nodes, self.phi, self.qd
        sine, cosine = self.sine, self.cosine
        ends = [sp.Float(float(w)) for w in self.weights]
        tip_x, tip_y = self._total("tip_x", ends, cosine), self._total("tip_y", ends, sine)
        jx = [self._total(f"px_{k}", ends, [-phi[k][b] * sine[b] for b in range(nodes)]) for k in range(n)]
        jy = [self._total(f"py_{k}", ends, [phi[k][b] * cosine[b] for b in range(nodes)]) for k in range(n)]
        ax = self._total("ax", ends, [-s.alpha_m * sine[b] - square[b] * cosine[b] for b in range(nodes)])
        ay = self._total("ay", ends, [s.alpha_m * cosine[b] - square[b] * sine[b] for b in range(nodes)])
        vx = self._name("hub_vx", -s.omega_m * tip_y + sum(jx[k] * qd[k] for k in range(n)))
        vy = self._name("hub_vy", s.omega_m * tip_x + sum(jy[k] * qd[k] for k in range(n)))
        c, sn = sp.cos(s.theta_m), sp.sin(s.theta_m)
        radius2 = tip_x**2 + tip_y**2
        deflection = sp.atan2(tip_y, tip_x)
        turning = (tip_x * vy - tip_y * vx) / radius2
        j_angle = tuple((tip_x * jy[k] - tip_y * jx[k]) / radius2 for k in range(n))
        # d/dt of (x v_y - y v_x)/rho^2 is (x a_y - y a_x)/rho^2 - 2 (rho rho'/rho^2) theta'.
        angle_bias = (tip_x * ay - tip_y * ax) / radius2 - 2 * turning * (tip_x * vx + tip_y * vy) / radius2
        bending = [[float(self.stiffness[i, j]) for j in range(n)] for i in range(n)]
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

    def _fibres(self) -> tuple[tuple[tuple[float, Strand], ...], Channel]:
        """Return the curvature at each node, and the energy of its fourth power."""
        weights, curved = self.weights, self.arm.weights @ curvatures(self.at)
        n, nodes = self.n, self.nodes
        kappa = [self._name(f"kp_{a}", sum(float(curved[k, a]) * self.q[k] for k in range(n))) for a in range(nodes)]
        cube = [self._name(f"kc_{a}", float(weights[a] / 3) * kappa[a] ** 3) for a in range(nodes)]
        quartic = sum(kappa[a] * cube[a] for a in range(nodes)) / 4
        hardening = tuple(sum(float(curved[k, a]) * cube[a] for a in range(nodes)) for k in range(n))
        fibres = tuple((3 * float(weights[a]), over_three(curved[:, a], self.q, self.qd)) for a in range(nodes))
        return fibres, Channel(quartic, hardening)

    def _centre(self) -> dict[sp.Symbol, Channel]:
        """Return the first moment of all masses in the fixed frame, on which gravity acts."""
        n, nodes, phi, sine, cosine = self.n, self.nodes, self.phi, self.sine, self.cosine
        beyond = self.weights @ self.cumulative[:nodes]
        first = [
            self._name(f"W_{b}", self.tip_share * (float(beyond[b]) * self.arm.mu + float(self.weights[b])))
            for b in range(nodes)
        ]
        moment_x, moment_y = self._total("mx", first, cosine), self._total("my", first, sine)
        lever_x = [self._total(f"lx_{k}", first, [-phi[k][b] * sine[b] for b in range(nodes)]) for k in range(n)]
        lever_y = [self._total(f"ly_{k}", first, [phi[k][b] * cosine[b] for b in range(nodes)]) for k in range(n)]
        c, sn = sp.cos(s.theta_m), sp.sin(s.theta_m)
        levers = list(zip(lever_x, lever_y, strict=True))
        return {
            s.x_g: Channel(c * moment_x - sn * moment_y, tuple(c * a - sn * b for a, b in levers)),
            s.y_g: Channel(sn * moment_x + c * moment_y, tuple(sn * a + c * b for a, b in levers)),
        }

    def _components(self) -> tuple[Strand, ...]:
        """Return the components of the bending, which relax each by itself: U = |L^T q|^2 / 2, L L^T the stiffness."""
        n, root = self.n, np.linalg.cholesky(self.stiffness)
        return tuple(
            (
                sum(float(root[j, i]) * self.q[j] for j in range(i, n)),
                sum(float(root[j, i]) * self.qd[j] for j in range(i, n)),
                tuple(sp.Float(float(root[j, i])) if j >= i else sp.Integer(0) for j in range(n)),
            )
            for i in range(n)
        )

    def _rod_channels(self) -> dict[sp.Symbol, Channel]:
        """Return the channels of the rod's own shape: its energy, with the spring's, and the slope of its end."""
        n, q, qd, rod = self.n, self.q, self.qd, self.rod
        stiffness, root = self.stiffness, self.arm.root_curvature
        spring = np.outer(root, root) / 3
        pull = tuple(
            sum((float(stiffness[i, j]) + rod.root * float(spring[i, j])) * q[j] for j in range(n)) for i in range(n)
        )
        # Every shape ends with the slope p_k(1) = 1 of its polynomials.
        end = tuple(float(self.arm.weights[k].sum()) + rod.root * float(root[k]) for k in range(n))
        return {
            s.U: Channel(sum(q[i] * pull[i] for i in range(n)) / 2, pull),
            s.slope: Channel(s.theta_m + rod.rest_at(1) + sum(end[k] * q[k] for k in range(n)), end),
            s.slope_dot: Channel(s.omega_m + sum(end[k] * qd[k] for k in range(n)), end, s.alpha_m),
        }
