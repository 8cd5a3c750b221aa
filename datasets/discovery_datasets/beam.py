r"""Space discretisation of an inextensible planar Euler-Bernoulli beam of any deflection.

The elastic curvature is :math:`\kappa(\sigma) = \frac1l \sum_k q_k \psi_k(\sigma)`, :math:`\sigma = s/l`, with
:math:`\psi_k = \sqrt{2k+3}\,(1-\sigma) P_k^{(2,0)}(2\sigma - 1)`: every function is free of moment at the tip, and the
bending energy is diagonal, :math:`V = \frac{EI}{2l} \sum_k q_k^2`, because the Jacobi polynomials are orthogonal under
:math:`(1-\sigma)^2`. Where the tip bears a moment, as from a disc that must turn with it, the functions are plain
Legendre polynomials :math:`\psi_k = \sqrt{2k+1}\, P_k(2\sigma - 1)`, orthogonal too: those that vanish at the tip would
converge with 1 / K only. Angle and position follow by integration on Chebyshev-Lobatto (Clenshaw-Curtis) nodes.

Positions are complex numbers :math:`z = x + i y`. With :math:`z' = l e^{i\theta}` the kinetic energy is

.. math:: T = \tfrac12 \sum_{ij} G_{ij} \cos(\theta_i - \theta_j)\, \dot\theta_i \dot\theta_j,

where the constant matrix `G` holds the mass outboard of two points of the beam, rod and tip mass together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray
from scipy.special import eval_jacobi

from discovery_datasets.compiled import compiled

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Beam:
    """Constant matrices of a discretised beam.

    Attributes
    ----------
    position : (n,) array
        Nodes sigma = s / l, from 0 to 1.
    angle_shapes : (n, K + 1) array
        Change of the angle at each node with the base's angle (first column, ones) and with each q_k.
    weights : (n,) array
        Quadrature weights over the beam; they give the tip: ``z = length * sum(weights * exp(1j * theta))``.
    inertia : (n, n) array
        Matrix G of the kinetic energy [kg m^2].
    outboard : (n,) array
        First moment of mass outboard of each node, for a uniform field of gravity [kg m].
    length : float
        Length of the rod [m].
    """

    position: FloatArray
    angle_shapes: FloatArray
    weights: FloatArray
    inertia: FloatArray
    outboard: FloatArray
    length: float


def integration_matrix(nodes: int) -> tuple[FloatArray, FloatArray]:
    """Chebyshev-Lobatto nodes on [0, 1] and the matrix that integrates from 0 to each of them, exact for polynomials.

    Parameters
    ----------
    nodes : int
        Number of nodes n, at least 2.

    Returns
    -------
    position : (n,) array
        Nodes in ascending order.
    integral : (n, n) array
        ``integral @ f`` are the integrals of the interpolant of `f` from 0 to each node; the last row is the
        Clenshaw-Curtis rule.
    """
    x = -np.cos(np.pi * np.arange(nodes) / (nodes - 1))
    cardinal = np.linalg.inv(chebyshev.chebvander(x, nodes - 1))
    integral = chebyshev.chebvander(x, nodes) @ chebyshev.chebint(cardinal, lbnd=-1) / 2
    integral[0] = 0.0
    return (x + 1) / 2, integral


def curvature_shapes(position: FloatArray, modes: int, *, tip_moment: bool = False) -> FloatArray:
    """Functions psi_k (n, K) of the curvature times length at positions sigma (n,)."""
    order = np.arange(modes)
    if tip_moment:
        return np.sqrt(2 * order + 1) * eval_jacobi(order, 0, 0, 2 * position[:, None] - 1)
    return np.sqrt(2 * order + 3) * (1 - position[:, None]) * eval_jacobi(order, 2, 0, 2 * position[:, None] - 1)


def discretise(
    length: float, beam_mass: float, tip_mass: float, *, modes: int, nodes: int, tip_moment: bool = False
) -> Beam:
    """Matrices of a beam of given length [m], rod mass [kg] and tip mass [kg], whose tip may bear a moment.

    Raises
    ------
    ValueError
        If there are fewer than ``modes + 2`` nodes: the shapes would not be integrated exactly.
    """
    if modes < 1 or nodes < modes + 2:
        raise ValueError(f"{modes} modes need at least {modes + 2} nodes (and at least one mode), not {nodes}")
    position, integral = integration_matrix(nodes)
    curvature = curvature_shapes(position, modes, tip_moment=tip_moment)
    weights = integral[-1]
    rod = integral.T @ (weights[:, None] * integral)
    return Beam(
        position=position,
        angle_shapes=np.column_stack([np.ones(nodes), integral @ curvature]),
        weights=weights.copy(),
        inertia=length**2 * (beam_mass * rod + tip_mass * np.outer(weights, weights)),
        outboard=length * (beam_mass * weights @ integral + tip_mass * weights),
        length=length,
    )


@compiled()
def kinematics(
    shapes: FloatArray,
    rest_angle: FloatArray,
    weights: FloatArray,
    length: float,
    coordinates: FloatArray,
    rates: FloatArray,
) -> tuple[FloatArray, FloatArray, complex, complex]:
    """Angles (n,) [rad], their rates (n,) [rad/s], tip position [m] and tip velocity [m/s], complex.

    `coordinates` and `rates` are (K + 1,): angle of the base, then q_k.
    """
    theta = rest_angle + shapes @ coordinates
    omega = shapes @ rates
    tip = 0j
    velocity = 0j
    for i in range(theta.size):
        slope = length * weights[i] * complex(np.cos(theta[i]), np.sin(theta[i]))
        tip += slope
        velocity += 1j * omega[i] * slope
    return theta, omega, tip, velocity


@compiled()
def inertia_and_load(
    shapes: FloatArray,
    weights: FloatArray,
    inertia: FloatArray,
    outboard: FloatArray,
    length: float,
    theta: FloatArray,
    omega: FloatArray,
    force: complex,
    gravity: complex,
) -> tuple[FloatArray, FloatArray]:
    """Mass matrix (K + 1, K + 1) and load (K + 1,) of ``mass @ acceleration = load`` without elastic forces.

    `force` [N] acts on the tip, `gravity` [m/s^2] on all mass, both complex; the load also holds the centripetal terms.
    """
    c, s = np.cos(theta), np.sin(theta)
    along = shapes * c.reshape(-1, 1)
    across = shapes * s.reshape(-1, 1)
    mass = along.T @ (inertia @ along) + across.T @ (inertia @ across)
    square = omega * omega
    load = along.T @ (inertia @ (s * square)) - across.T @ (inertia @ (c * square))
    push_x = length * force.real * weights + gravity.real * outboard
    push_y = length * force.imag * weights + gravity.imag * outboard
    load += along.T @ push_y - across.T @ push_x
    return mass, load


@compiled()
def solve_free(mass: FloatArray, load: FloatArray, base_acceleration: float) -> NDArray[np.floating]:
    """Accelerations (K,) of the q_k under a given acceleration of the base [rad/s^2]."""
    return np.linalg.solve(mass[1:, 1:], load[1:] - base_acceleration * mass[1:, 0])
