"""The source paper's misprints and contradictions, each with a computed check.

`errata` runs them all. Those of the formulas and of the tables are here, the others in `errata_motion` and
`errata_force`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from discovery_datasets.twin import PAPER_RIG, static_tip
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from benchmarks.paper.errata_force import coupling_torque_frame, force_frame, motor_constant
from benchmarks.paper.errata_motion import largest_deflection, time_scale
from benchmarks.paper.erratum import Erratum
from benchmarks.paper.stand import Stand
from discovery.declarations.units import si_factor
from discovery.foundation.errors import InputError

FloatArray = NDArray[np.float64]

#: Tables I and II: diameter [m], Young's modulus [Pa], area moment [m^4], density [kg/m^3], disc [kg]; l = 1 m.
_DIAMETER, _MODULUS, _MOMENT, _DENSITY, _DISC = 3e-3, 31.65e9, 3.98e-12, 1761.7, 0.04376
#: Fitted alpha [s^-2] and gamma (18), (19), largest deflection [rad], and the errors of Fig. 8 as printed [m].
_ALPHA, _GAMMA, _REACHED, _CONSTANT, _LAW = 8.7907, 0.4462, 0.85, 17.6e-3, 1.8e-3


def errata(stand: Stand) -> tuple[Erratum, ...]:
    """Return errata a to f and further misprints, each computed: a, e and (11) on this recording of the manoeuvre."""
    return (
        centripetal_term(stand),
        time_scale(),
        stiffness_unit(),
        rod_mass(),
        radius_error(stand),
        largest_deflection(),
        force_frame(),
        coupling_torque_frame(stand),
        motor_constant(),
    )


def rms(error: FloatArray) -> float:
    """Return the root mean square of all elements."""
    return float(np.sqrt(np.mean(np.abs(error) ** 2)))


def polar_acceleration(time: FloatArray, tip: FloatArray, *, centripetal_order: int = 1) -> FloatArray:
    """Acceleration of the tip by eq. (8), from splines of its polar coordinates.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Times [s].
    tip : ndarray, shape (n, 2)
        Position [m].
    centripetal_order : {1, 2}
        Derivative of theta_t whose square stands in the centripetal term: 1 is right, 2 is printed.

    Returns
    -------
    ndarray, shape (n, 2)
        Acceleration [m/s^2].
    """
    theta_spline = make_interp_spline(time, np.unwrap(np.arctan2(tip[:, 1], tip[:, 0])), k=5)
    rho_spline = make_interp_spline(time, np.hypot(*tip.T), k=5)
    theta, theta1, theta2 = (theta_spline(time, order) for order in range(3))
    rho, rho1, rho2 = (rho_spline(time, order) for order in range(3))
    turning = theta_spline(time, centripetal_order) ** 2
    radial, across = rho2 - rho * turning, 2 * rho1 * theta1 + rho * theta2
    c, s = np.cos(theta), np.sin(theta)
    return np.column_stack([radial * c - across * s, radial * s + across * c])


def centripetal_term(stand: Stand) -> Erratum:
    """Erratum a: (8) has theta_t''^2 in its centripetal terms; compare with the second derivative of the position."""
    time = stand.motion.time
    direct = make_interp_spline(time, stand.tip, k=5)(time, 2)
    inner = slice(5, -5)  # A spline's second derivative is poor at its ends.
    errors = [rms((polar_acceleration(time, stand.tip, centripetal_order=o) - direct)[inner]) for o in (1, 2)]
    size = rms(direct[inner])
    numbers = {"rms_acceleration": size, "rms_error_right": errors[0], "rms_error_printed": errors[1]}
    sentence = (
        f"Against the second derivative of the tip's position the printed term is wrong by {errors[1] / size:.1f} "
        f"times the acceleration, the right one by {errors[0] / size:.1g} of it."
    )
    return Erratum("a", "(8a), (8b)", "rho theta_t''^2", "rho theta_t'^2", numbers, sentence)


def _convertible(unit: str, wanted: str) -> bool:
    try:
        si_factor(unit, wanted)
    except InputError:
        return False
    return True


def stiffness_unit(length: float = 2.0, deflection: float = 1e-3) -> Erratum:
    """Erratum c: 3 EI/l theta in (12) is a torque, by its unit and by the stiffness of an arm of another `length` [m].

    With (14) a force, alpha = alpha_hat / (m l) of (15) is right; with (12) as printed its unit is not s^-2.
    """
    torque, force_passes = (_convertible("N m^2 / m", unit) for unit in ("N m", "N"))
    alphas = [_convertible(f"{unit} / (kg m)", "s^-2") for unit in ("N", "N m^2 / m")]
    arm = replace(PAPER_RIG, length=length)
    force = 3 * arm.flexural_rigidity / length**2 * deflection
    stiffness = force / float(np.angle(static_tip(arm, tip_force=1j * force)))
    ratios = stiffness / (3 * arm.flexural_rigidity / length**2), stiffness / (3 * arm.flexural_rigidity / length)
    numbers = {
        "printed_is_torque": float(torque),
        "printed_is_force": float(force_passes),
        "alpha_15_from_force_is_per_s2": float(alphas[0]),
        "alpha_15_from_printed_12_is_per_s2": float(alphas[1]),
        "length_m": length,
        "stiffness_over_right": ratios[0],
        "stiffness_over_printed": ratios[1],
    }
    sentence = (
        f"EI/l is in N m. An arm of {length:g} m has {ratios[0]:.4f} times the right and {ratios[1]:.4f} times "
        "the printed stiffness; l = 1 m hides the difference."
    )
    return Erratum("c", "(12)", "3 EI/l delta", "3 EI/l^2 delta", numbers, sentence)


def rod_mass() -> Erratum:
    """Erratum d: stiffness over mass of Tables I and II against the fitted alpha, without and with the rod's mass."""
    rigidity, rod = _MODULUS * _MOMENT, _DENSITY * np.pi / 4 * _DIAMETER**2
    effective = _DISC + 33 / 140 * rod
    numbers = {
        "rod_mass_g": 1e3 * rod,
        "rod_over_disc": rod / _DISC,
        "alpha_massless": 3 * rigidity / _DISC,
        "alpha_with_rod": 3 * rigidity / effective,
        "alpha_fitted": _ALPHA,
        "modulus_needed_massless_GPa": 1e-9 * _ALPHA * _DISC / (3 * _MOMENT),
        "modulus_needed_with_rod_GPa": 1e-9 * _ALPHA * effective / (3 * _MOMENT),
        "rod_mass_needed_g": 1e3 * (3 * rigidity / _ALPHA - _DISC) * 140 / 33,
        "moment_from_diameter": np.pi / 64 * _DIAMETER**4,
    }
    sentence = (
        f"The tables give alpha = {numbers['alpha_massless']:.3f} 1/s^2, and {numbers['alpha_with_rod']:.2f} with "
        f"33/140 of the rod's {numbers['rod_mass_g']:.2f} g; the fit {_ALPHA:.3f} needs E = "
        f"{numbers['modulus_needed_massless_GPa']:.2f} GPa (massless) or "
        f"{numbers['modulus_needed_with_rod_GPa']:.2f} GPa (with the rod) instead of "
        f"{1e-9 * _MODULUS:.2f}. At the printed E it needs a rod of {numbers['rod_mass_needed_g']:.1f} g."
    )
    return Erratum("d", "Tables I, II; (18)", "massless rod", "rod of 28 % of the tip's mass", numbers, sentence)


def radius_error(stand: Stand) -> Erratum:
    """Erratum e: a radius that varies by 70 mm cannot have a constant-radius error of 17.6 mm at most."""
    length = stand.arm.length
    shortening = 1e3 * np.abs(length - np.hypot(*stand.tip.T))
    law = 1e3 * (1 - np.cos(_GAMMA * _REACHED))
    numbers = {
        "largest_mm": float(shortening.max()),
        "mean_mm": float(shortening.mean()),
        "printed_mm": 1e3 * _CONSTANT,
        "largest_by_law_16_mm": float(law),
        "printed_ratio": _CONSTANT / _LAW,
    }
    sentence = (
        f"The paper's own law (16) shortens the arm by {law:.0f} mm at {_REACHED} rad; simulated, the constant radius "
        f"is wrong by {numbers['largest_mm']:.0f} mm at most and by {numbers['mean_mm']:.1f} mm on average, so "
        f"{1e3 * _CONSTANT:.1f} mm is most likely a mean. It is {_CONSTANT / _LAW:.1f} times 1.8 mm, not seven."
    )
    return Erratum("e", "Fig. 8 and its text", "maximum 17.6 mm, seven times", "a mean", numbers, sentence)
