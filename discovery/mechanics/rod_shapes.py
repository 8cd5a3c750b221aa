"""Shape functions of the rod and the quadrature that turns its slope into a path.

The slope angle is theta(s) = theta_m + sum_k q_k phi_k(s). A rich polynomial space p_k = (k+1) s^k - k s^(k+1) (each
vanishes at the base and has no curvature at the free end) is reduced to the few shapes that matter: the static shape
under a tip force, the second bending mode, and the direction in which the static shape bends away at large deflection.
Three of these do what four plain polynomials do, with a highest frequency half as high.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.linalg import eigh
from scipy.special import roots_jacobi

from discovery.foundation.arrays import FloatArray

#: Size of the polynomial space.
RICH = 7
#: Part of a rod's mass that moves as if it were at the tip, where a force there bends it (Rayleigh).
AT_THE_TIP = 33 / 140
#: Mass ratio at which the second mode is computed; its shape hardly depends on it.
_MU = 0.15
#: Static shapes are learnt up to this deflection [rad].
_LARGE = 1.0


def polynomials(at: FloatArray) -> FloatArray:
    """Return p_k at arc lengths `at` (n,), shape (RICH, n)."""
    k = np.arange(1, RICH + 1)[:, None]
    return (k + 1) * at**k - k * at ** (k + 1)


def curvatures(at: FloatArray) -> FloatArray:
    """Return p_k' at arc lengths `at` (n,), shape (RICH, n)."""
    k = np.arange(1, RICH + 1)[:, None]
    return k * (k + 1) * (at ** (k - 1) - at**k)


def quadrature(nodes: int, *, rooted: bool = False) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return nodes and weights on [0, 1], and the matrix that integrates from 0 to each node and to 1.

    They are those of Gauss and Legendre, or `rooted` those of Gauss and Radau, the first of which is at 0: what is
    known there costs nothing (Davis and Rabinowitz, Methods of Numerical Integration, 2nd ed. (1984), section 2.7.1.1).
    """
    # The others of Radau's are the zeros of the Jacobi polynomial.
    x = np.append(-1.0, roots_jacobi(nodes - 1, 0, 1)[0]) if rooted else np.polynomial.legendre.leggauss(nodes)[0]
    # Interpolate by Legendre polynomials; the integral of P_k from -1 is (P_{k+1} - P_{k-1}) / (2k + 1).
    vandermonde = np.polynomial.legendre.legvander(x, nodes - 1)
    ends = np.append(x, 1.0)
    upper = np.polynomial.legendre.legvander(ends, nodes)
    integrals = np.empty((nodes + 1, nodes))
    integrals[:, 0] = ends + 1
    for k in range(1, nodes):
        integrals[:, k] = (upper[:, k + 1] - upper[:, k - 1]) / (2 * k + 1)
    path = integrals @ np.linalg.inv(vandermonde) / 2
    return (x + 1) / 2, path[-1], path


def bending_matrix(weights: FloatArray) -> FloatArray:
    """Return the integral of phi_i' phi_j' for shapes phi = weights @ p, shape (n, n)."""
    s, w, _ = quadrature(RICH + 4)
    slope = weights @ curvatures(s)
    return (slope * w) @ slope.T


def rod_share(mu: float) -> float:
    """Return the rod's mass per unit of effective tip mass, from that over the tip's own."""
    return mu / (1 + AT_THE_TIP * mu)


def mass_matrix(weights: FloatArray, mu: float) -> FloatArray:
    """Return the mass matrix of the straight rod per unit of effective tip mass, shape (n, n)."""
    s, w, cumulative = quadrature(RICH + 4)
    path = cumulative @ (weights @ polynomials(s)).T
    return (path.T * np.append(mu * w, 1.0)) @ path / (1 + AT_THE_TIP * mu)


def rod_masses(weights: FloatArray, nodes: int, *, rooted: bool = False) -> FloatArray:
    """Return the mass of the rod that its pieces at two nodes carry together, over its own, shape (nodes, nodes).

    Quadrature of a few nodes errs by percents in the inertia of the highest shape. What it lacks of the inertia of the
    straight rod, in every shape and as the whole rod turns, is added: so small motions are exact.
    """
    at, w, cumulative = quadrature(nodes, rooted=rooted)
    s, fine, path = quadrature(RICH + 4)
    masses = (cumulative[:-1].T * w) @ cumulative[:-1]
    turned, turns = (np.vstack([weights @ polynomials(x), np.ones_like(x)]) for x in (at, s))
    moved = path[:-1] @ turns.T
    lacking = (moved.T * fine) @ moved - turned @ masses @ turned.T
    back = np.linalg.pinv(turned)
    return masses + back @ lacking @ back.T


def end_residual(weights: FloatArray) -> tuple[float, float]:
    """Return how a moment at the end bends the rod beyond what the shapes can show.

    Returned: `compliance`: turn of the end beyond that of the shapes, over that of a rod under this moment, l / EI;
    `inertia`: integral of the squared deflection of that bending, per squared turn of the end and per length.
    """
    s, w, cumulative = quadrature(RICH + 4)
    bends, ends = weights @ curvatures(s), weights.sum(axis=1)
    # A moment bends the rod uniformly; the rest does not move the end, for a force there is shown without it.
    rest = 1.0 - np.linalg.solve(bending_matrix(weights), ends) @ bends
    compliance = float(rest @ w)
    path = cumulative @ (cumulative @ rest)[:-1] / compliance
    return compliance, float(w @ path[:-1] ** 2)


def static_shapes(weights: FloatArray, deflections: FloatArray) -> FloatArray:
    """Return the static q, shape (n, m), with tip angles `deflections` (m,) under a force across the radius.

    Newton's method on energy balance and angle, continued along increasing deflection.
    """
    s, w, _ = quadrature(RICH + 4)
    phi, bending = weights @ polynomials(s), bending_matrix(weights)
    n = len(weights)
    q, force = np.zeros(n), 0.0
    shapes = np.zeros((n, deflections.size))
    for column, target in enumerate(deflections):
        for _ in range(30):
            sine, cosine = np.sin(phi.T @ q), np.cos(phi.T @ q)
            x, y = w @ cosine, w @ sine
            jx, jy = -(phi * sine) @ w, (phi * cosine) @ w
            rho = np.hypot(x, y)
            direction = (x * jy - y * jx) / rho
            # Curvature of y and x in q, with the direction of a force that stays across the radius.
            hx, hy = -(phi * (w * cosine)) @ phi.T, -(phi * (w * sine)) @ phi.T
            turn = (np.outer(jy, jx) - np.outer(jx, jy) + x * hy - y * hx) / rho
            turn -= np.outer(direction, x * jx + y * jy) / rho**2
            tangent = np.block(
                [[bending - force * turn, -direction[:, None]], [(direction / rho)[None], np.zeros((1, 1))]]
            )
            step = np.linalg.solve(tangent, -np.append(bending @ q - force * direction, np.arctan2(y, x) - target))
            q, force = q + step[:-1], force + step[-1]
            if np.abs(step).max() < 1e-13:
                break
        shapes[:, column] = q
    return shapes


@lru_cache(maxsize=8)
def reduced_shapes(count: int) -> FloatArray:
    """Return the weights (count, RICH) of the shapes that matter most, in polynomials.

    `count`: 2: the static shape and the second bending mode; 3: the large-deflection correction as well; 4: and the
    third bending mode.
    """
    everything = np.eye(RICH)
    bending = bending_matrix(everything)
    _, modes = eigh(bending / 3, mass_matrix(everything, _MU))
    second, third = (modes[:, k] / np.abs(modes[:, k]).max() for k in (1, 2))
    chosen = np.array([everything[0], second])
    if count == 2:
        return chosen
    deflections = np.linspace(0.05, _LARGE, 20)
    shapes = static_shapes(everything, deflections)
    # The part of the static shapes that the chosen ones cannot show, in the norm of bending energy.
    rest = shapes - chosen.T @ np.linalg.solve(chosen @ bending @ chosen.T, chosen @ bending @ shapes)
    root = np.linalg.cholesky(bending)
    left, _, _ = np.linalg.svd(root.T @ rest)
    correction = np.linalg.solve(root.T, left[:, 0])
    # A fixed sign and size make the coordinates reproducible.
    correction *= np.sign(correction[np.argmax(np.abs(correction))]) / np.abs(correction).max()
    return np.vstack([chosen, correction, third])[:count]
