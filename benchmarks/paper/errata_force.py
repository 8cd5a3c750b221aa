"""What (7), (10) and (11) of the source paper leave unsaid: the frame of the force, and the side of the gear."""

from __future__ import annotations

import numpy as np
from discovery_datasets.twin import PAPER_RIG, static_tip
from scipy.interpolate import make_interp_spline

from benchmarks.paper.erratum import Erratum
from benchmarks.paper.stand import Stand
from benchmarks.paper.theory.elastica.force_map import load_at_tip


def force_frame(hub: float = 0.7, force: float = 0.3, direction: float = 2.0) -> Erratum:
    """Erratum g: (7) sets the force of (4), in the frame that turns with the motor, equal to m p'' in the fixed frame.

    Parameters
    ----------
    hub : float
        Angle of the motor [rad].
    force, direction : float
        Load on the tip of the twin at rest [N], and its orientation in the fixed frame [rad].
    """
    tip = static_tip(PAPER_RIG, base_angle=hub, tip_force=force * np.exp(1j * direction))
    found, phi = load_at_tip(abs(tip) / PAPER_RIG.length, np.angle(tip) - hub)
    magnitude = float(found) * PAPER_RIG.flexural_rigidity / PAPER_RIG.length**2
    off = [float(abs(phi + turn - direction)) for turn in (0.0, hub)]
    numbers = {
        "force_error_N": abs(magnitude - force),
        "direction_error_printed_rad": off[0],
        "direction_error_rotated_rad": off[1],
    }
    sentence = (
        f"With the motor at {hub:g} rad the force of (4) points {off[0]:.2f} rad off the one that acts; rotated by "
        f"theta_m it is right to {off[1]:.0e} rad. Phi in (7) and (9) must be rotated by theta_m."
    )
    return Erratum("misprint 1", "(7), (9)", "-Phi = m p''", "-R(theta_m) Phi = m p''", numbers, sentence)


def coupling_torque_frame(stand: Stand) -> Erratum:
    """Erratum h: the sign of (11) is right, with phi of the fixed frame and F = -m p''; phi of (3) is from the hub.

    The torque of the tip mass is compared with the motor's torque on the root, which the rod's own mass adds to.
    """
    motion = stand.motion
    tip = motion.tip_x + 1j * motion.tip_y
    acceleration = make_interp_spline(motion.time, stand.tip, k=5)(motion.time, 2)
    force = -stand.arm.tip_mass * (acceleration[:, 0] + 1j * acceleration[:, 1])

    def share(phi: np.ndarray) -> tuple[float, float]:
        torque = -np.abs(force) * np.abs(tip) * np.sin(phi - np.angle(tip))
        slope = float(torque @ motion.base_torque / (torque @ torque))
        return slope, float(np.corrcoef(torque, motion.base_torque)[0, 1])

    right, printed = share(np.angle(force)), share(np.angle(force) - motion.base_angle)
    numbers = {
        "torque_over_11": right[0],
        "correlation": right[1],
        "torque_over_11_with_phi_of_3": printed[0],
        "correlation_with_phi_of_3": printed[1],
    }
    sentence = (
        f"With phi in the fixed frame (11) has the right sign and the motor's torque is {right[0]:.2f} times it, the "
        f"rest being the rod's mass (correlation {right[1]:.3f}); with phi of (3), counted from the hub, the "
        f"correlation is {printed[1]:.2f}."
    )
    return Erratum("misprint 2", "(11)", "phi as defined for (3)", "that phi plus theta_m", numbers, sentence)


def motor_constant(gear_ratio: float = 50.0) -> Erratum:
    """Erratum i: the torque K i of (10) acts on the output side of the gear, so that K = n k_t.

    A rotor of inertia J spins up under k_t i while the hub turns n times slower; (10) without friction and arm must
    return the torque that did it. n has no unit: the dimensions cannot show the factor.
    """
    inertia, torque, time = 1.0, 1.0, np.linspace(0.0, 1.0, 11)
    rotor = torque / inertia * time**2 / 2
    hub_acceleration = 2 * np.polyfit(time, rotor / gear_ratio, 2)[0]
    required = float(inertia * gear_ratio**2 * hub_acceleration / torque)
    numbers = {"gear_ratio": gear_ratio, "constant_over_rotor_constant": required}
    sentence = (
        f"(10) balances torques on the arm's side of the gear: Gamma_m is {required:.0f} times the rotor's torque. K "
        "is the motor's own constant times n."
    )
    return Erratum("misprint 3", "(10)", "K of the motor", "K = n k_t", numbers, sentence)
