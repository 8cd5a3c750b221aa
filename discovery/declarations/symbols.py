"""The words in which effects are written: sympy symbols of the state, the drive and the channels on which forces act.

An effect never knows the base that it acts on. It is an expression in these symbols; the base says what they are in its
own coordinates and how a force on each of them moves the system. Lengths of the arm are in units of its length l, and
energies per unit of effective inertia (m + 33 m_r / 140) l^2, so that forces carry s^-2 as in the paper's (15).
"""

from __future__ import annotations

import sympy as sp

#: Time [s].
t = sp.Symbol("t", real=True)
#: Absolute angle of the tip, theta_t [rad]; the coordinate of an oscillator [q].
theta = sp.Symbol("theta", real=True)
#: Its rate [q/s].
omega = sp.Symbol("omega", real=True)
#: Deflection theta_t - theta_m [rad]; the coordinate itself for an oscillator.
delta = sp.Symbol("delta", real=True)
#: Its rate [q/s].
delta_dot = sp.Symbol("delta_dot", real=True)
#: Position of the tip in the fixed frame, in lengths of the arm [-]; for an oscillator x = theta and y = 0.
x, y = sp.symbols("x y", real=True)
#: First moment of the moving mass, over effective mass and length [-]: what uniform gravity pulls on. It equals x, y
#: where the rod is taken as massless; for an oscillator it is the coordinate.
x_g, y_g = sp.symbols("x_g y_g", real=True)
#: Velocity of the tip [1/s].
v_x, v_y = sp.symbols("v_x v_y", real=True)
#: Squared speed of the tip, v_x^2 + v_y^2 [s^-2 q^2].
v2 = sp.Symbol("v2", real=True, nonnegative=True)
#: Squared rate of the bending, 2 U with rates in place of coordinates [s^-2 q^2]; delta_dot^2 for a linear spring.
w2 = sp.Symbol("w2", real=True, nonnegative=True)
#: One component of the bending and its rate [q], [q/s]: the elastic energy is alpha/2 times the sum of the components'
#: squares (for a linear spring the only one is delta). What is written for one acts on each.
bend, bend_dot = sp.symbols("bend bend_dot", real=True)
#: Bending at the root of the rod [q]: its curvature there over three, the deflection of a rod that a small force at its
#: tip bends as much; and its rate [q/s].
root, root_dot = sp.symbols("root root_dot", real=True)
#: Angular momentum of the arm about its hub, over effective mass and length squared [1/s]; an oscillator's momentum.
#: Nothing pushes on it: with the external torques it gives what the arm asks of its motor.
h = sp.Symbol("h", real=True)
#: Distance of the tip from the hub, in lengths of the arm [-].
rho = sp.Symbol("rho", real=True)
#: Elastic energy of the base per unit of linear stiffness [q^2]; delta^2/2 for a linear spring.
U = sp.Symbol("U", real=True)
#: The same for the fourth power of the curvature: the integral of kappa^4 along the rod, over 12 [q^4]; q^4/4 for an
#: oscillator. alpha (U + b U_4) is the energy of a rod whose moment is EI (kappa + b kappa^3).
U_4 = sp.Symbol("U_4", real=True)
#: Slope of the rod's end in the fixed frame, the angle of whatever is clamped to it [rad]; an oscillator's coordinate.
slope = sp.Symbol("slope", real=True)
#: Its rate [q/s].
slope_dot = sp.Symbol("slope_dot", real=True)
#: Arc length along the rod from its root, in lengths of the arm [-].
arc = sp.Symbol("arc", real=True)
#: Angle of the motor [rad] with its first two derivatives, as the system receives them.
theta_m, omega_m, alpha_m = sp.symbols("theta_m omega_m alpha_m", real=True)
#: Measured input of an oscillator, in its own unit.
u = sp.Symbol("u", real=True)
#: What the input alone does to an oscillator, g u [s^-2 q].
push = sp.Symbol("push", real=True)
#: Acceleration of the coordinate of an oscillator [s^-2 q], as its equation of motion gives it: for readings only.
acceleration = sp.Symbol("acceleration", real=True)
#: Linear stiffness per unit inertia [s^-2], declared by `linear_stiffness`; relative effects scale with it.
alpha = sp.Symbol("alpha", real=True)
#: Linear damping per unit inertia [s^-1], declared by `viscous_damping`; relative effects scale with it.
xi = sp.Symbol("xi", real=True)
#: Length of the arm [m].
length = sp.Symbol("length", real=True)
#: Keeps a law defined where its parameter is zero: less than anything that is measured, in any unit.
LEAST = sp.Float(1e-30)

#: Position-like channels: a potential V pushes on each with -dV/dc.
POSITION_CHANNELS = (theta, delta, x, y, x_g, y_g, slope, U, U_4)
#: Rate-like channels: a dissipation D pushes with -dD/dc', a load of power P with +dP/dc';
#: `v2` and `w2` act through their gradients.
RATE_CHANNELS = (omega, delta_dot, v_x, v_y, slope_dot, v2, w2)
#: The rate of each position-like channel that has one.
RATES = {theta: omega, delta: delta_dot, x: v_x, y: v_y, slope: slope_dot}


def readable(expression: sp.Expr) -> sp.Expr:
    """Return what is written of an expression: without `LEAST`, which computing alone needs."""
    return sp.sympify(expression).xreplace({LEAST: sp.Integer(0)})
