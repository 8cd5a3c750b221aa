"""The tables of the single studies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from discovery.report.numbers import GREEK, significant, uncertain, unit_text
from discovery.report.tables import Table
from discovery.report.words import effect_name


def ladder_table(steps: Mapping[str, Any]) -> Table:
    """Return the error of every model, from the rig file alone and fitted."""
    rows, raw = [], []
    deflection = steps["deflection"]
    for r in steps["ladder"]:
        e = [1e3 * r["errors"][n][k] for n in ("trained", "inside", "beyond") for k in ("mean", "peak")]
        how = "rig file, ξ fitted" if r["how"] == "rig" else "fitted"
        fitted = ", ".join(f"{GREEK[n]} {uncertain(r['values'][n], s)}" for n, s in r["sd"].items())
        rows.append((r["model"], how, *(significant(v, 3) for v in e), fitted))
        raw.append((r["model"], r["how"], *e, fitted))
    reach = {n: significant(deflection[n], 2) for n in deflection}
    head = (
        "model", "parameters",
        f"trained ({reach['trained']} rad), mean", "peak",
        f"inside ({reach['inside']} rad), mean", "peak",
        f"beyond ({reach['beyond']} rad), mean", "peak",
        "fitted [SI]",
    )  # fmt: skip
    keys = (
        "model",
        "how",
        *(f"{n}_{k}_mm" for n in ("trained", "inside", "beyond") for k in ("mean", "peak")),
        "fitted",
    )
    caption = (
        "Distance to the noise-free tip [mm] over 30 s from rest, nothing adjusted but what the last column holds."
    )
    return Table("ladder", caption, head, rows, keys, raw, (0, 1, 8))


def freed_table(steps: Mapping[str, Any]) -> Table:
    """Return what single, held and freed inertial coefficients do."""
    rows, raw = [], []
    for r in steps["freed"]:
        v = r["values"]
        numbers = [v["alpha"], v["beta"], *(v.get(n) for n in ("c_cen", "c_cor", "c_rad", "A"))]
        e = [1e3 * r["errors"][n]["mean"] for n in ("trained", "inside", "beyond")]
        rows.append((r["model"], *(significant(x, 4) for x in numbers), *(significant(x, 3) for x in e)))
        raw.append((r["model"], *numbers, *e))
    head = ("terms", "α [s⁻²]", "β [s⁻²]", "c₁", "c₂", "c₃", "A", "trained [mm]", "inside [mm]", "beyond [mm]")
    keys = ("terms", "alpha", "beta", "c_cen", "c_cor", "c_rad", "A", "trained_mm", "inside_mm", "beyond_mm")
    caption = "The paper’s model with third-order terms of the inertia; mean distance to the noise-free tip. First principles: 1/5, −2/5, 1/25, 0.0105."
    return Table("freed", caption, head, rows, keys, raw)


_SENSITIVITY = (
    ("deflection", "δ max [rad]", 1.0, 3), ("xi", "ξ [s⁻¹]", 1.0, 3), ("omega2", "ω² [s⁻²]", 1.0, 4),
    ("alpha", "α [s⁻²]", 1.0, 4), ("beta", "β [s⁻²]", 1.0, 3), ("gamma", "γ", 1.0, 4),
    ("angle_linear", "angle, linear [mrad]", 1e3, 3), ("angle_cubic", "angle, cubic [mrad]", 1e3, 3),
    ("position_linear", "position, linear [mm]", 1e3, 3), ("position_cubic", "cubic [mm]", 1e3, 3),
    ("position_with_radius", "with law [mm]", 1e3, 3),
)  # fmt: skip
_VARIED = {"speed": ("speed", "rad/s", 1.0), "duration": ("record", "s", 1.0), "rod_mass": ("rod", "g", 1e3)}


def sensitivity_table(sensitivity: Mapping[str, Any]) -> Table:
    """Return the paper's numbers by speed, length of the record and mass of the rod."""
    rows, raw = [], []
    for name, (words, unit, factor) in _VARIED.items():
        for r in sensitivity[name]:
            numbers = [f * r[key] for key, _, f, _ in _SENSITIVITY]
            rows.append(
                (
                    f"{words} {r[name] * factor:g} {unit}",
                    *(significant(v, d) for v, (*_, d) in zip(numbers, _SENSITIVITY, strict=True)),
                )
            )
            raw.append((f"{name}={r[name]:g}", *numbers))
    head = ("", *(words for _, words, *_ in _SENSITIVITY))
    caption = "The paper’s numbers on the twin, one thing changed at a time: otherwise 1.4 rad/s, 30 s, rod of 12.45 g. Mean errors."
    return Table("sensitivity", caption, head, rows, ("changed", *(k for k, *_ in _SENSITIVITY)), raw)


def similar_table(normalisation: Mapping[str, Any]) -> Table:
    """Return the error of carried models on other arms."""
    models = tuple(normalisation["trials"][0]["errors"])
    rows, raw = [], []
    for t in normalisation["trials"]:
        e = [100 * t["errors"][m] for m in models]
        where = f"{t['changed']} {t['value']:g}"
        rows.append(
            (where, significant(t["mass_ratio"], 3), significant(t["deflection"], 3), *(significant(v, 2) for v in e))
        )
        raw.append((where, t["mass_ratio"], t["deflection"], *e))
    head = ("arm", "rod / tip mass", "δ max [rad]", *(f"{m} [%]" for m in models))
    caption = (
        "Mean distance to the noise-free tip over the length, as long as 20 s are to the paper’s arm. The model was found on the paper’s arm and carried by (9), nothing "
        "refitted. Length in m; stiffness and both masses relative to the paper’s arm; amplitude in rad of the hub."
    )
    return Table("other_arms", caption, head, rows, ("arm", "mass_ratio", "deflection", *models), raw)


def mattiasson_table(statics: Mapping[str, Any]) -> Table:
    """Return the published deflections of a cantilever beside the elliptic integrals."""
    rows = []
    raw = []
    for r in statics["mattiasson"]:
        raw.append((r["load"], r["w_published"], r["w"], r["u_published"], r["u"]))
        rows.append((f"{r['load']:g}", *(f"{v:.5f}" for v in raw[-1][1:])))
    head = ("P l²/EI", "w/l published", "here", "u/l published", "here")
    caption = "Vertical load at the tip of a cantilever: Mattiasson’s table (1981) and the elliptic integrals."
    return Table("mattiasson", caption, head, rows, ("load", "w_published", "w", "u_published", "u"), raw)


_BASES = {
    "paper_model": "the paper’s model",
    "exact_arm": "exact arm",
    "exact_arm_dry": "exact arm, dry friction hidden",
}


def friction_table(friction: Mapping[str, Any]) -> Table:
    """Return each law of friction fitted beside the linear one."""
    rows, raw = [], []
    for base, words in _BASES.items():
        for r in friction[base]:
            value = f"{uncertain(r['value'], r['sd'])} {unit_text(r['unit'])}".strip()
            misfit = [significant(r[f"misfit_{when}"], 4) for when in ("before", "after")]
            rows.append((words, effect_name(r["law"]), value, significant(r["xi"], 4), *misfit))
            raw.append((base, r["law"], r["value"], r["sd"], r["xi"], r["misfit_before"], r["misfit_after"]))
    head = ("on", "law beside the linear one", "estimate", "ξ [s⁻¹]", "residual before", "after")
    caption = (
        "Is friction linear? Residuals in standard deviations of the camera, both axes, from rest. The twin’s friction is "
        f"linear but in the last three rows, which hide {1e3 * friction['dry_force']:.1f} mN of dry friction "
        f"(f = {significant(friction['dry_truth'], 4)} s⁻²)."
    )
    keys = ("on", "law", "value", "sd", "xi", "misfit_before", "misfit_after")
    return Table("friction", caption, head, rows, keys, raw, (0, 1))


def general_table(dynamics: Mapping[str, Any]) -> Table:
    """Return the distance of the general model from arms with a rod of ever less mass."""
    rows, raw = [], []
    for against in ("twin", "exact"):
        for r in dynamics[against]:
            e = [1e3 * r[n] for n in ("massless", "rod counted")]
            words = "twin" if against == "twin" else "exact arm"
            rows.append((words, r["move"], significant(r["mass_ratio"], 3), *(significant(v, 3) for v in e)))
            raw.append((against, r["move"], r["mass_ratio"], *e))
    head = ("against", "motion of the hub", "rod / tip mass", "tip mass m [mm]", "m + 33/140 of the rod [mm]")
    caption = (
        "General model (7): mean distance of the tip over 6 s from an arm whose rod has mass, for hub motions that deflect it "
        f"by about 0.8 rad. Halving the step moves the tip by at most {significant(1e6 * dynamics['step_halved'], 1)} µm, doubling the "
        f"internal damping by {1e6 * dynamics['retardation_doubled']:.0f} µm."
    )
    return Table("general", caption, head, rows, ("against", "move", "mass_ratio", "m_mm", "m_eff_mm"), raw, (0, 1))


def motor_table(motor: Mapping[str, Any]) -> Table:
    """Return when the encoder angle may be taken as given, by bandwidth and gear ratio."""
    columns = (
        ("gear_ratio", "n", 1.0), ("inertia_ratio", "J n² / (m l²)", 1.0),
        ("stiffness_ratio", "J n² ω_b² / (α m l²)", 1.0), ("hub_peak", "hub moved by the arm, peak [mrad]", 1e3),
        ("tip_mean", "tip error if the command is the input, mean [mm]", 1e3),
        ("bias_command", "error of α, command [%]", 100.0), ("bias_encoder", "error of α, encoder [%]", 100.0),
        ("sd_encoder", "its sd [%]", 100.0),
    )  # fmt: skip
    raw = []
    for bandwidth, study in motor["by_bandwidth"].items():
        numbers = zip(*[[f * v for v in study[k]] for k, _, f in columns], strict=True)
        raw += [(float(bandwidth), *row) for row in numbers if row[2] > _LEAST]
    rows = [(f"{r[0]:g}", f"{r[1]:g}", *(significant(v, 2) for v in r[2:])) for r in raw]
    caption = (
        "The arm on a motor with a position controller of bandwidth ω_b, by gear ratio n: the manoeuvre of 1.4 rad/s, 10 s. The encoder’s "
        "angle is always a complete input. The command will do where the controller is far stiffer than the arm, "
        "J n² ω_b² ≫ α m l²; rows in which it is softer, and the fit at its bounds, are left out."
    )
    head = ("bandwidth [Hz]", *(h for _, h, _ in columns))
    return Table("motor", caption, head, rows, ("bandwidth_Hz", *(k for k, _, _ in columns)), raw, ())


#: Least stiffness of the controller over that of the arm in the table.
_LEAST = 1.0
