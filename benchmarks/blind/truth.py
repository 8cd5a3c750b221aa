"""What the twin's physical parameters are called in the catalogue, and what they are worth there."""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, pi, sin
from typing import Any

ROD_SHARE = 33 / 140


def catalogue_values(effect: str, p: Mapping[str, Any], rig: Mapping[str, float]) -> dict[str, float]:
    """Return the parameters that an effect of the twin has in the catalogue, per unit of m l^2; none without a mapping.

    Parameters
    ----------
    effect : str
        Id.
    p : mapping
        Parameters of the twin's disturbance, SI.
    rig : mapping
        Fields of the twin's ArmRig.
    """
    mass = rig["tip_mass"] + ROD_SHARE * rig["beam_mass"]
    length, rigidity = rig["length"], rig["flexural_rigidity"]
    force = 1 / (mass * length)
    alpha = 3 * rigidity / (mass * length**3)
    match effect:
        case "coulomb_friction":
            return {"f_c": p["force"] * force}
        case "stribeck_friction":
            return {"f_k": p["force"] * force, "f_b": p["breakaway"] * force, "v_s": p["stribeck"] / length}
        case "quadratic_drag":
            return {"c_2": p["coefficient"] * length / mass}
        case "structural_damping":
            return {"c_s": alpha * p["time"]}
        case "asymmetric_viscous_damping":
            return {"a_v": p["coefficient"] / rig["disc_friction"]}
        case "material_nonlinearity":
            return {"b_3": p["cubic"] / length**2}
        case "stiffness_drift":
            return {"r": p["rate"]}
        case "initial_curvature":
            return {"kappa_0": p["curvature"] * length}
        case "tip_rotary_inertia":
            return {"J": p["inertia"] / (mass * length**2)}
        case "viscoelastic_relaxation":
            return {"v": p["ratio"], "tau_v": p["time"]}
        case "hysteresis":
            return {"h_b": p["moment"] / (p["curvature"] * rigidity)}
        case "base_compliance":
            return {"c_b": rigidity / (p["stiffness"] * length)}
        case "base_hysteresis":
            sticking = 1 + p["moment"] / (p["stiffness"] * p["angle"])
            stuck = rigidity / (p["stiffness"] * length * sticking)
            slips = p["stiffness"] * p["angle"] * sticking * length / (3 * rigidity)
            return {"c_c": stuck, "e_c": (sticking - 1) * stuck, "w_c": slips}
        case "base_backlash":
            return {"w_p": p["half_width"]}
        case "encoder_ripple":
            a, phase = p["amplitude"], p["phase"]
            return {"r_s": a * cos(phase), "r_c": a * sin(phase), "N_e": p["cycles"]}
        case "input_gain":
            return {"k_h": p["error"]}
        case "table_tilt":
            return {"phi_x": p["x"], "phi_y": p["y"]}
        case "periodic_disturbance":
            x, y = p["amplitude"] * force * cos(p["direction"]), p["amplitude"] * force * sin(p["direction"])
            c, s = cos(p["phase"]), sin(p["phase"])
            return {"a_s": x * c, "a_c": x * s, "b_s": y * c, "b_c": y * s, "Omega": p["frequency"]}
        case "sensor_delay":
            return {"tau": p["delay"]}
        case "angle_offset":
            return {"theta_0": p["angle"]}
        case "position_scale":
            return {"s": p["error"]}
        case "camera_origin_offset":
            return {"x_0": p["x"], "y_0": p["y"]}
        case "time_base_error":
            return {"j_t": p["wait"], "Omega_j": 2 * pi / p["period"]} if p["wait"] else {"d_t": p["drift"]}
    return {}
