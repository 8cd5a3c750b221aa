r"""The arm with every effect of the twin, integrated in compiled code: fast enough for hundreds of random arms.

Space is discretised as in `beam`; here the root may turn in a joint, the material may be nonlinear or hysteretic, and
the table may act on the disc in ways that depend on its place. All that depends on time alone (the motion of the hub,
a drifting stiffness, a gust) is tabulated before; what depends on the state is written out below, in SI units.
Time is stepped by the classical Runge-Kutta method, with steps short against the fastest vibration and no step across
a kink of the motor's acceleration.
"""

from __future__ import annotations

from math import exp, sqrt, tanh
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from discovery_datasets.compiled import compiled

FloatArray = NDArray[np.float64]


class Physics(NamedTuple):
    """Coefficients of everything that depends on the state; zero is absent."""

    #: Material: M = EI (kappa + quadratic kappa^2 + cubic kappa^3), [m], [m^2].
    quadratic: float = 0.0
    cubic: float = 0.0
    #: Rigidity over its mean at the root, less one; it falls in a straight line to as much less at the tip.
    taper: float = 0.0
    #: Kelvin-Voigt time [s]; relaxing part of the rigidity [-] and its time [s].
    retardation: float = 0.0
    relaxing: float = 0.0
    relaxation_time: float = 1.0
    #: Friction between the fibres: M += fibre_moment z, Bouc-Wen z of the curvature over fibre_yield, [N m], [1/m].
    fibre_moment: float = 0.0
    fibre_yield: float = 1.0
    #: Joint at the root: torque of the angle beyond a play, its damping in contact, a hysteretic part.
    joint: float = 0.0  # 1 where the root may turn
    joint_stiffness: float = 0.0  # N m/rad
    joint_play: float = 0.0  # half width, rad
    joint_damping: float = 0.0  # N m s/rad
    joint_moment: float = 0.0  # N m
    joint_yield: float = 1.0  # rad
    #: Disc: rotary inertia that the rod's end must turn [kg m^2].
    rotary_inertia: float = 0.0
    #: Disc on the table: viscous and direction-dependent friction [N s/m], drag [N s^2/m^2]; friction on its velocity,
    #: and loss against that in the hub's frame, which grow with the square of the deflection [N s/(m rad^2)].
    viscous: float = 0.0
    asymmetry: float = 0.0
    deflection_friction: float = 0.0
    deflection_loss: float = 0.0
    drag: float = 0.0
    #: Friction of the disc power_loss * v^power [N], v in m/s.
    power_loss: float = 0.0
    power: float = 1.0
    #: Dry friction [N], its further part at rest [N] that falls over stribeck_speed, and the width of its sign [m/s].
    dry: float = 0.0
    breakaway: float = 0.0
    stribeck_speed: float = 1.0
    dry_speed: float = 2e-3
    #: A place on the table (x, y, radius) [m]: dry friction there [N], pull towards it [N].
    place_x: float = 0.0
    place_y: float = 0.0
    place_radius: float = 1.0
    place_friction: float = 0.0
    place_pull: float = 0.0
    #: Point [m] towards which a cable pulls; its tension is tabulated.
    anchor_x: float = 0.0
    anchor_y: float = 0.0
    #: Gravity in the plane [m/s^2].
    gravity_x: float = 0.0
    gravity_y: float = 0.0


class Rod(NamedTuple):
    """Constant arrays of a discretised rod with K curvature coordinates and n nodes; the tip is the last node."""

    length: float
    rigidity: float
    shapes: FloatArray  # (n, K + 1), angle with each coordinate
    curvatures: FloatArray  # (n, K), curvature times length
    weights: FloatArray  # (n,)
    integral: FloatArray  # (n, n)
    levers: FloatArray  # (K + 1, n, n), length times integral times shapes
    mass: FloatArray  # (n,), mass at each node, the tip's included
    rest_angle: FloatArray  # (n,)
    position: FloatArray  # (n,), of the nodes, from 0 to 1


#: Columns of the tabulated inputs: motion of the hub, rigidity over nominal, force on the disc, friction over nominal,
#: mass that the tip has lost, tension of a cable.
INPUTS = ("angle", "rate", "acceleration", "rigidity", "force_x", "force_y", "friction", "lost_mass", "tension")


#: Stiffness in the play of a joint over that of its contact.
GREASE = 1e-4


@compiled()
def solve_spd(a: FloatArray, b: FloatArray, first: int) -> None:
    """Solve a x = b from row `first` on, in place, by Cholesky's method."""
    n = b.size
    for j in range(first, n):
        for k in range(first, j):
            a[j, j] -= a[j, k] * a[j, k]
        a[j, j] = sqrt(a[j, j])
        for i in range(j + 1, n):
            for k in range(first, j):
                a[i, j] -= a[i, k] * a[j, k]
            a[i, j] /= a[j, j]
    for i in range(first, n):
        for k in range(first, i):
            b[i] -= a[i, k] * b[k]
        b[i] /= a[i, i]
    for i in range(n - 1, first - 1, -1):
        for k in range(i + 1, n):
            b[i] -= a[k, i] * b[k]
        b[i] /= a[i, i]


@compiled()
def bouc_wen(z: float, rate: float) -> float:
    """Rate of a Bouc-Wen variable, exponent 2, equal shares, for a rate over the yield value (Wen, ASCE 102, 1976)."""
    return rate * (1.0 - z * z) if z * rate > 0 else rate


@compiled()
def joint_torque(p: Physics, turn: float, rate: float, z: float) -> float:
    """Torque of the joint on the hub side [N m] for a turn of the root against the hub."""
    beyond = turn - p.joint_play if turn > p.joint_play else turn + p.joint_play if turn < -p.joint_play else 0.0
    torque = p.joint_stiffness * (beyond + GREASE * turn) + p.joint_moment * z
    # Contact pushes and never pulls; in the gap a film of grease is all that resists.
    damping = p.joint_damping if beyond != 0.0 or p.joint_play == 0.0 else 1e-2 * p.joint_damping
    return torque + damping * rate


@compiled()
def disc_force(
    p: Physics, x: float, y: float, vx: float, vy: float, friction: float, tension: float
) -> tuple[float, float]:
    """Force of table and cable on the disc [N]."""
    v = sqrt(vx * vx + vy * vy)
    turning = 1.0 if x * vy - y * vx > 0 else -1.0
    near = exp(-((x - p.place_x) ** 2 + (y - p.place_y) ** 2) / (2 * p.place_radius**2))
    dry = p.dry + p.breakaway * exp(-((v / p.stribeck_speed) ** 2)) + p.place_friction * near
    sign = tanh(v / p.dry_speed) / v if v > 1e-12 else 1 / p.dry_speed
    resist = friction * p.viscous + p.asymmetry * turning + p.drag * v + dry * sign
    if p.power_loss != 0.0:
        resist += p.power_loss * (v * v + p.dry_speed * p.dry_speed) ** (0.5 * (p.power - 1.0))
    pull = p.place_pull * near / p.place_radius
    fx = -resist * vx + pull * (p.place_x - x)
    fy = -resist * vy + pull * (p.place_y - y)
    if tension != 0.0:
        away = sqrt((p.anchor_x - x) ** 2 + (p.anchor_y - y) ** 2)
        fx += tension * (p.anchor_x - x) / away
        fy += tension * (p.anchor_y - y) / away
    return fx, fy


@compiled()
def taper_load(rod: Rod, strength: float, coordinates: FloatArray, load: FloatArray) -> None:
    """Add the moments of a rigidity that falls along the rod to the load on each coordinate."""
    modes = rod.curvatures.shape[1]
    for a in range(rod.weights.size):
        moment = 0.0
        for k in range(modes):
            moment += rod.curvatures[a, k] * coordinates[1 + k]
        moment *= strength * (1.0 - 2.0 * rod.position[a]) * rod.weights[a]
        for k in range(modes):
            load[1 + k] -= moment * rod.curvatures[a, k]


@compiled(fastmath={"contract", "reassoc", "nsz"})
def slope(rod: Rod, p: Physics, inputs: FloatArray, state: FloatArray, change: FloatArray, work: FloatArray) -> None:
    """Write the rate of the state into `change`.

    The state holds the K + 1 coordinates (absolute angle of the root, then q_k), their rates, the K relaxed q_k, the
    joint's hysteresis and that of the fibres at each node. `work` is (4 K + 12, n) scratch.
    """
    size, n = rod.levers.shape[0], rod.weights.size
    modes = size - 1
    free = p.joint != 0.0
    coordinates, rates = work[0, :size], work[1, :size]
    for i in range(size):
        coordinates[i], rates[i] = state[i], state[size + i]
    if not free:
        coordinates[0], rates[0] = inputs[0], inputs[1]
    s, c, square = work[2], work[3], work[4]
    for a in range(n):
        theta, omega = rod.rest_angle[a], 0.0
        for i in range(size):
            theta += rod.shapes[a, i] * coordinates[i]
            omega += rod.shapes[a, i] * rates[i]
        s[a], c[a], square[a] = np.sin(theta), np.cos(theta), omega * omega
    # Lever arms of every node and its acceleration at zero acceleration of the coordinates, gravity taken off.
    jx, jy = work[5 : 5 + size], work[5 + size : 5 + 2 * size]
    for i in range(size):
        for b in range(n):
            sx, sy = 0.0, 0.0
            for a in range(n):
                sx -= rod.levers[i, b, a] * s[a]
                sy += rod.levers[i, b, a] * c[a]
            jx[i, b], jy[i, b] = sx, sy
    px, py, mass = work[5 + 2 * size], work[6 + 2 * size], work[7 + 2 * size]
    x, y = 0.0, 0.0
    for b in range(n):
        ax, ay = -p.gravity_x, -p.gravity_y
        for a in range(n):
            lever = rod.length * rod.integral[b, a] * square[a]
            ax -= lever * c[a]
            ay -= lever * s[a]
        mass[b] = rod.mass[b] if b < n - 1 else rod.mass[b] - inputs[7]
        px[b], py[b] = mass[b] * ax, mass[b] * ay
    vx, vy = 0.0, 0.0
    for a in range(n):
        x += rod.length * rod.weights[a] * c[a]
        y += rod.length * rod.weights[a] * s[a]
    for i in range(size):
        vx += jx[i, n - 1] * rates[i]
        vy += jy[i, n - 1] * rates[i]
    fx, fy = disc_force(p, x, y, vx, vy, inputs[6], inputs[8])
    if p.deflection_loss + p.deflection_friction != 0.0:
        deflection = np.arctan2(
            y * np.cos(inputs[0]) - x * np.sin(inputs[0]), x * np.cos(inputs[0]) + y * np.sin(inputs[0])
        )
        turned = p.deflection_loss * inputs[1]
        fx -= deflection**2 * ((p.deflection_friction + p.deflection_loss) * vx + turned * y)
        fy -= deflection**2 * ((p.deflection_friction + p.deflection_loss) * vy - turned * x)
    fx, fy = fx + inputs[4], fy + inputs[5]
    inertia, load = np.empty((size, size)), np.empty(size)
    for i in range(size):
        load[i] = fx * jx[i, n - 1] + fy * jy[i, n - 1]
        for b in range(n):
            load[i] -= jx[i, b] * px[b] + jy[i, b] * py[b]
        for j in range(i + 1):
            total = p.rotary_inertia * rod.shapes[n - 1, i] * rod.shapes[n - 1, j]
            for b in range(n):
                total += mass[b] * (jx[i, b] * jx[j, b] + jy[i, b] * jy[j, b])
            inertia[i, j] = inertia[j, i] = total
    scale = rod.rigidity * inputs[3] / rod.length
    relaxed = state[2 * size : 2 * size + modes]
    for k in range(modes):
        q = coordinates[1 + k]
        load[1 + k] -= scale * (q + p.relaxing * (q - relaxed[k]) + p.retardation * rates[1 + k])
    fibres = state[2 * size + modes + 1 :]
    for a in range(n):
        bend, bending = 0.0, 0.0
        for k in range(modes):
            bend += rod.curvatures[a, k] * coordinates[1 + k] / rod.length
            bending += rod.curvatures[a, k] * rates[1 + k] / rod.length
        stress = scale * rod.length * bend * (p.quadratic * bend + p.cubic * bend**2)
        stress += p.fibre_moment * fibres[a]
        change[2 * size + modes + 1 + a] = bouc_wen(fibres[a], bending / p.fibre_yield) if p.fibre_moment else 0.0
        for k in range(modes):
            load[1 + k] -= rod.weights[a] * stress * rod.curvatures[a, k]
    if p.taper != 0.0:
        taper_load(rod, p.taper * scale, coordinates, load)
    z = state[2 * size + modes]
    change[2 * size + modes] = 0.0
    if free:
        turn, rate = coordinates[0] - inputs[0], rates[0] - inputs[1]
        load[0] -= joint_torque(p, turn, rate, z)
        if p.joint_moment != 0.0:
            change[2 * size + modes] = bouc_wen(z, rate / p.joint_yield)
        solve_spd(inertia, load, 0)
    else:
        for i in range(1, size):
            load[i] -= inertia[i, 0] * inputs[2]
        solve_spd(inertia, load, 1)
        load[0] = inputs[2]
    for i in range(size):
        change[i], change[size + i] = rates[i], load[i]
    for k in range(modes):
        change[2 * size + k] = (coordinates[1 + k] - relaxed[k]) / p.relaxation_time


@compiled()
def integrate(
    rod: Rod, p: Physics, state: FloatArray, steps: FloatArray, inputs: FloatArray, keep: NDArray[np.bool_]
) -> FloatArray:
    """States after those of the m steps that are to be kept, shape (kept, size); `inputs` (m, 3, 9) at each stage."""
    size = state.size
    out = np.empty((keep.sum(), size))
    k1, k2, k3, k4, at = np.empty(size), np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    work = np.empty((2 * rod.levers.shape[0] + 8, rod.weights.size))
    row = 0
    for m in range(steps.size):
        h = steps[m]
        slope(rod, p, inputs[m, 0], state, k1, work)
        for i in range(size):
            at[i] = state[i] + 0.5 * h * k1[i]
        slope(rod, p, inputs[m, 1], at, k2, work)
        for i in range(size):
            at[i] = state[i] + 0.5 * h * k2[i]
        slope(rod, p, inputs[m, 1], at, k3, work)
        for i in range(size):
            at[i] = state[i] + h * k3[i]
        slope(rod, p, inputs[m, 2], at, k4, work)
        for i in range(size):
            state[i] += h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i])
        if keep[m]:
            out[row] = state
            row += 1
    return out
