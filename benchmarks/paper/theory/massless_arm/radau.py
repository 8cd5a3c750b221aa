r"""Implicit integration of a point mass on the massless elastica, through the straight beam.

In units of length, mass and :math:`T = \sqrt{m l^3 / EI}` the equations (7), (8) of the paper with viscous friction are

.. math:: \theta_t' = L / \rho^2, \quad L' = -M - \xi L, \quad \rho' = v, \quad v' = L^2 / \rho^3 - F_r - \xi v,
          \quad \rho = R(\delta, G), \quad M = W_\delta(\delta, G) - (F_r - G) R_\delta, \quad \tau G' = F_r - G

with angular momentum :math:`L`, moment of the tip force :math:`M = \rho F_t` and
`massless_arm.potential`.

*Stiffness.* Near the straight arm :math:`1 - \rho = \delta^2 (1/10 - G / 175 + ...)`, a radial spring of stiffness
:math:`175 / \delta^2`; solved for the force the law is useless there. So the radial force is an unknown of its own and
the radius a function: a differential-algebraic equation whose index rises to 3 at :math:`\delta = 0`, where the arm is
a pendulum of fixed length. Radau's method IIA of three stages (Hairer, Wanner, Solving Ordinary Differential Equations
II, 1996, IV.8) passes through: of order 5 where the radial oscillation is resolved, it goes over to the constraint
where it is not (Lubich, ZAMP 44 (1993) 724).

*Which solution.* With :math:`\tau_r = 0`, where :math:`G = F_r`, the model is the paper's, and singular: on the way to
:math:`\delta = 0` any radial ringing, of frequency :math:`13 / |\delta|`, keeps its action, so that its force grows
like :math:`|\delta|^{-3/2}` until the rod buckles or is taut; only the motion without ringing passes smoothly. Every
kink of the motor's acceleration excites some, if only 0.01 mm of radius; in a real rod its mass bounds the frequency.
Here the rod is of Kelvin-Voigt material for changes of the radial load (Rayleigh's function
:math:`\tau R_G G'^2 / 2`), with a retardation time that is longest in the straight arm,
:math:`\tau = \tau_r / (1 + \delta^2 / \delta_r^2)`, :math:`\delta_r = 0.15`. It calms the ringing at the rate
:math:`88 \tau / \delta^2`, before it has grown, and costs the slow motion little, whose change of radius is of order
:math:`\delta^2` there. The tip computed is that of the slow motion and of the ringing that is left away from the
straight arm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from benchmarks.paper.theory.massless_arm.potential import DEFLECTION_LIMIT, RADIAL_LIMITS, TipPotential, tip_potential

FloatArray = npt.NDArray[np.float64]

_R = np.sqrt(6.0)
STAGES = np.array([(4.0 - _R) / 10.0, (4.0 + _R) / 10.0, 1.0])
"""Nodes of the method as parts of a step; the last is its end."""
_A = np.array(
    [
        [(88.0 - 7.0 * _R) / 360.0, (296.0 - 169.0 * _R) / 1800.0, (-2.0 + 3.0 * _R) / 225.0],
        [(296.0 + 169.0 * _R) / 1800.0, (88.0 + 7.0 * _R) / 360.0, (-2.0 - 3.0 * _R) / 225.0],
        [(16.0 - _R) / 36.0, (16.0 + _R) / 36.0, 1.0 / 9.0],
    ]
)
_EACH = np.arange(3)
_ITERATIONS = 20
_RUNAWAY = 1e3
_CALMED = 0.15  # delta_r [rad]
# Newton's method converges quadratically: the error after a move is far below the move.
_TOLERANCE = np.array([1e-8, 1e-8, 1e-8, 1e-4, 1e-4])[:, None]


@dataclass(frozen=True)
class Path:
    """Motion of the tip on the stages of the steps, in units of l, m and T.

    Parameters
    ----------
    states : ndarray, shape (n + 1, 5)
        ``theta_t, L, rho, rho', G`` at the edges of the steps.
    stages : ndarray, shape (n, 5, 3)
        The same at the three stages of each step.
    radial : ndarray, shape (n, 3)
        Radial force ``F_r`` at the stages.
    reached : int
        Steps that were done; fewer than n where the motion left the domain of the tip potential.
    """

    states: FloatArray
    stages: FloatArray
    radial: FloatArray
    reached: int

    def at(self, step: npt.NDArray[np.int64], fraction: FloatArray) -> tuple[FloatArray, FloatArray]:
        """States (5, k) and radial forces (k,) at parts of steps, on the polynomials through the stages."""
        ends = np.concatenate([self.states[step][:, :, None], self.stages[step]], axis=2)
        weights = _lagrange(np.concatenate([[0.0], STAGES]), fraction)
        radial = np.einsum("ki,ik->k", self.radial[step], _lagrange(STAGES, fraction))
        return np.einsum("kmi,ik->mk", ends, weights), radial


def integrate_tip(hub: FloatArray, steps: FloatArray, start: FloatArray, xi: float, tau_r: float) -> Path:
    """Integrate the motion with the given steps.

    Parameters
    ----------
    hub : ndarray, shape (n, 3)
        Hub angle ``theta_m`` [rad] at the stages of each step.
    steps : ndarray, shape (n,)
        Lengths of the steps [T].
    start : ndarray, shape (5,)
        ``theta_t, L, rho, rho', G`` at the beginning.
    xi : float
        Friction over mass [1/T].
    tau_r : float
        Retardation time of the straight rod under radial load [T].

    Returns
    -------
    Path
        It ends early where Newton's method fails or the tip leaves the domain of the potential.
    """
    potential, count = tip_potential(), steps.size
    states, stages, radial = np.empty((count + 1, 5)), np.empty((count, 5, 3)), np.empty((count, 3))
    states[0] = start
    z = np.repeat(start[[0, 1, 3, 4, 4]][:, None], 3, axis=1)
    last = 1.0
    for n in range(count):
        if n:
            z = _extrapolated(stages[n - 1], radial[n - 1], steps[n] / last)
        last = float(steps[n])
        solved = _solve_step(potential, z, states[n], hub[n], last, (xi, tau_r))
        if solved is None:
            return Path(states, stages, radial, n)
        stages[n], radial[n] = solved
        states[n + 1] = stages[n][:, 2]
    return Path(states, stages, radial, count)


def _extrapolated(stages: FloatArray, radial: FloatArray, ratio: float) -> FloatArray:
    """First guess of ``theta_t, L, rho', G, F_r`` (5, 3): the last step's polynomials, continued."""
    known = np.stack([stages[0], stages[1], stages[3], stages[4], radial])
    guess: FloatArray = known @ _lagrange(STAGES, 1.0 + ratio * STAGES)
    return guess


def _solve_step(
    potential: TipPotential, z: FloatArray, state: FloatArray, hub: FloatArray, step: float, rates: tuple[float, float]
) -> tuple[FloatArray, FloatArray] | None:
    """Newton's method for one step from the guess ``z`` (5, 3); None where it fails or ends outside the domain."""
    before = state * np.array([1.0, 1.0, 1.0, 1.0, rates[1]])
    for _ in range(_ITERATIONS):
        y, slope, y_z, slope_z = _equations(potential, z, hub, *rates)
        residual = y - before[:, None] - step * slope @ _A.T
        jacobian = -step * _A[None, :, None, :] * slope_z[:, None, :, :]
        jacobian[:, _EACH, :, _EACH] += y_z.transpose(2, 0, 1)
        move = np.linalg.solve(jacobian.reshape(15, 15), residual.ravel()).reshape(5, 3)
        z = z - move
        if not np.abs(z).max() < _RUNAWAY:
            return None
        if np.all(np.abs(move) < _TOLERANCE):
            delta, load = z[0] - hub, z[3]
            if not _inside(delta, load):
                return None
            return np.stack([z[0], z[1], potential.tip(delta, load)[0], z[2], load]), z[4]
    return None


def _inside(delta: FloatArray, load: FloatArray) -> bool:
    """Tell whether deflections [rad] and radial loads [EI / l^2] are all in the domain of the tip potential."""
    low, high = RADIAL_LIMITS
    return bool(np.abs(delta).max() <= DEFLECTION_LIMIT and low <= load.min() and load.max() <= high)


def _equations(
    potential: TipPotential, z: FloatArray, hub: FloatArray, xi: float, tau_r: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return ``theta_t, L, rho, rho', tau_r G``, their slopes, and the derivatives of both by the unknowns.

    The unknowns are ``theta_t, L, rho', G, F_r``; shapes (5, 3) and, with the unknowns second, (5, 5, 3).
    """
    theta, momentum, speed, load, radial = z
    delta, excess = theta - hub, radial - load
    rho, rho_d, rho_f, moment, moment_d, rho_dd, rho_df = potential.tip(delta, load)
    turning, quicker = momentum / rho**2, 1.0 + (delta / _CALMED) ** 2
    y = np.stack([theta, momentum, rho, speed, tau_r * load])
    slope = np.stack(
        [
            turning,
            excess * rho_d - moment - xi * momentum,
            speed,
            momentum * turning / rho - radial - xi * speed,
            excess * quicker,
        ]
    )
    y_z, slope_z = np.zeros((5, 5, 3)), np.zeros((5, 5, 3))
    y_z[0, 0] = y_z[1, 1] = y_z[3, 2] = 1.0
    y_z[2, 0], y_z[2, 3], y_z[4, 3] = rho_d, rho_f, tau_r
    by_rho = -2.0 * turning / rho
    slope_z[0, 0], slope_z[0, 1], slope_z[0, 3] = by_rho * rho_d, 1.0 / rho**2, by_rho * rho_f
    slope_z[1, 0], slope_z[1, 1] = excess * rho_dd - moment_d, -xi
    slope_z[1, 3], slope_z[1, 4] = excess * rho_df, rho_d
    slope_z[2, 2] = 1.0
    by_rho = -3.0 * turning**2
    slope_z[3, 0], slope_z[3, 1] = by_rho * rho_d, 2.0 * turning / rho
    slope_z[3, 2], slope_z[3, 3], slope_z[3, 4] = -xi, by_rho * rho_f, -1.0
    slope_z[4, 0], slope_z[4, 3], slope_z[4, 4] = 2.0 * excess * delta / _CALMED**2, -quicker, quicker
    return y, slope, y_z, slope_z


def _lagrange(nodes: FloatArray, at: FloatArray) -> FloatArray:
    """Values (nodes, k) of the Lagrange polynomials of the nodes at the points ``at`` (k,)."""
    return np.stack(
        [np.prod([(at - b) / (a - b) for b in nodes if b != a], axis=0) for a in nodes],
    )
