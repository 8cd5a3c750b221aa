"""A small run directory with every documented result file, made of closed formulas and invented numbers."""

from __future__ import annotations

import copy
import functools
import json
import math
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import xarray as xr

from discovery.posterior.inference_data import arranged
from discovery.results.provenance import write_json

ARM_DECLARED = ["viscous_damping", "linear_stiffness", "cubic_stiffness", "radius_law"]
TIME = np.arange(0.0, 20.0, 0.05)


Write = Callable[[Path], dict[str, Any]]


def _once(write: Write) -> Write:
    """Write a run once: what is asked for again is copied."""

    @functools.cache
    def kept() -> tuple[dict[str, Any], dict[str, bytes]]:
        with TemporaryDirectory() as folder:
            results = write(Path(folder))
            return results, {path.name: path.read_bytes() for path in Path(folder).iterdir()}

    @functools.wraps(write)
    def written(folder: Path) -> dict[str, Any]:
        results, files = kept()
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            (folder / name).write_bytes(content)
        return copy.deepcopy(results)

    return written


def _errors(mean: float) -> dict[str, float]:
    return {"rms": 1.25 * mean, "mean": mean, "peak": 4.0 * mean}


def _parameters(values: dict[str, tuple[float, float | None, str]]) -> dict[str, Any]:
    found: dict[str, Any] = {n: {"value": v, "sd": sd, "unit": unit} for n, (v, sd, unit) in values.items()}
    for name, parameter in found.items():
        if parameter["sd"] is None:
            found[name]["reason"] = "at its bound"
    return found


def _fit(base: str, effects: list[str], values: dict[str, tuple[float, float | None, str]]) -> dict[str, Any]:
    return {
        "model": {"base": base, "effects": effects, "known": {}},
        "parameters": _parameters({**values, "delta_0_init[train_a]": (1.0e-3, 1.0e-4, "")}),
        "chi2": 812.0,
        "n_data": 800,
        "reduced_chi2": 1.0213,
        "status": "Converged.",
        "solver_step_s": 0.01,
        "solver_shift_sd": 0.037,
        "null_directions": [],
    }


def _residual(size: float) -> dict[str, Any]:
    frequency = np.linspace(0.0, 10.0, 65)
    names = ("time", "deflection", "rate", "phase", "amplitude", "angle")
    return {
        "rms": size,
        "reduced_chi2": size**2,
        "systematic": 0.9 * size,
        "autocorrelation": 0.1 * size,
        "ljung_box_p": 0.5 / size**4,
        "frequency": frequency.tolist(),
        "spectrum": (0.1 + size / (1.0 + frequency**2)).tolist(),
        "dependence": [{"variable": n, "share": 0.1 / (i + 1), "p_value": 10.0**-i} for i, n in enumerate(names)],
        "white": size < 2,
    }


def _equation(terms: list[str], coefficients: list[float], share: float) -> dict[str, Any]:
    return {
        "terms": terms,
        "effects": [None] * len(terms),
        "coefficients": coefficients,
        "sd": [0.01 * abs(c) for c in coefficients],
        "unexplained": share,
        "likelihood_ratio": 1.0,
        "probability": 0.9,
    }


def decision(action: str, *effects: str, accepted: bool, code: str = "accepted", **extra: Any) -> dict[str, Any]:
    """Return one step of the search as in loop.json."""
    made = {"action": action, "effects": list(effects), "accepted": accepted, "code": code}
    return {**made, "numbers": {}, "candidates": [], **extra}


def odds(train: float, held: float, size: float = 2.0, gain: float = 400.0) -> dict[str, float]:
    """Return the numbers of an effect against its absence, as in loop.json."""
    against = 0.5 * (size / 0.7) ** 2
    each = {
        "train": train,
        "held": held,
        "ahead": held,
        "size": size,
        "against_error": against,
        "gain": gain,
        "beside": False,
    }
    return {**each, "odds": min(train, train + held, against)}


def candidate(*effects: str, train: float, held: float, chi2: float = 812.0, error: float = 0.05) -> dict[str, Any]:
    """Return one set that was weighed, as in loop.json."""
    found = {"effects": list(effects), "train": train, "held": held, "size": 2.0, "model_error": error}
    return {**found, "chi2": chi2, "parameters": 4 + len(effects)}


def model_error(before: float, after: float, unit: str, *depends: str) -> dict[str, Any]:
    """Return the model error before and after, as in loop.json."""
    share = after / before
    return {
        "before": before,
        "after": after,
        "unit": unit,
        "share": share,
        "least": 4.5e-5,
        "held": after,
        "depends_on": [*depends],
    }


def _arm_steps() -> list[dict[str, Any]]:
    """Return a search that finds dry friction on better mechanics, tries three more, and then leaves noise."""
    first = [
        candidate("coulomb_friction", train=724.4, held=311.5),
        candidate("quadratic_drag", train=723.5, held=311.2, chi2=820.0),
        candidate("table_tilt", train=12.3, held=-812.0, chi2=198100.0, error=6.5),
    ]
    beside = [
        candidate("table_tilt", train=4.2, held=0.7, error=0.01),
        candidate("encoder_ripple", train=3.9, held=0.2, error=0.01),
        candidate("hysteresis", "base_compliance", train=-9.4, held=-0.5),
        candidate("sensor_delay", train=-math.inf, held=0.0),
    ]
    return [
        decision("mechanics", "radius_inertia", accepted=False, code="training", numbers={"odds": -7.25}),
        decision("mechanics", "elastica_geometry", accepted=True, numbers={"odds": 2086.1}),
        decision("add", "coulomb_friction", accepted=True, numbers=odds(724.4, 311.5, 8.0, 186705.0), candidates=first),
        *(
            decision("add", e, accepted=False, code=code, numbers=odds(4.2, held, 0.5, 12.3), candidates=beside)
            for e, code, held in (("table_tilt", "held_out", 0.7), ("encoder_ripple", "chance", 2.2))
        ),
        decision("stop", accepted=True, code="complete", numbers={"promise": 14.8, "chance": 20.4}),
    ]


def _provenance() -> dict[str, Any]:
    return {
        "command": "discovery run rig.toml --out <out> & more",
        "seed": 31,
        "git_revision": None,
        "versions": {"python": "3.11.0", "discovery": "0.1.0"},
        "platform": "Linux x86_64",
        "created": "2026-01-02T03:04:05+00:00",
        "rig_sha256": "a" * 64,
        "data": [{"name": "train_a", "role": "train", "sha256": "b" * 64, "source": "train_a.csv"}],
    }


def _discovery(kind: str) -> dict[str, Any]:
    position, rate = ("delta", "theta_t'") if kind == "flexible_arm" else ("q", "q'")
    terms, coefficients = [position, rate, f"{position}^3"], [8.1234, 0.0456, -0.4321]
    if kind == "oscillator":
        terms, coefficients = [*terms, "u"], [*coefficients, -2.5]
    rivals = [_equation([position], [8.0], 1e-3), _equation(terms, coefficients, 1e-6)]
    return {
        "terms": [
            {"term": t, "effect": None, "coefficient": c, "sd": 0.01 * abs(c), "inclusion_probability": 0.87}
            for t, c in zip(terms, coefficients, strict=True)
        ],
        "status": f"3 terms ({', '.join(terms)}) explain 99.9% of the variance.",
        "inclusion": {**dict.fromkeys(terms, 0.87), f"sin({position})": 0.13, f"{rate}|{rate}|": 0.02, "1": 0.0},
        "table": rivals,
        "best_three": rivals[1],
    }


def _posterior_rows(parameters: dict[str, tuple[float, float, str]]) -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "unit": unit,
            "mean": value,
            "sd": sd,
            "q05": value - 1.645 * sd,
            "q50": value,
            "q95": value + 1.645 * sd,
            "interval": "equal-tailed 90 % credible interval",
            "r_hat": 1.0012,
            "mcse": sd / 70.0,
            "ess": 5123.0,
            "fit_value": value,
            "fit_sd": sd,
        }
        for name, (value, sd, unit) in parameters.items()
    ]


def _write_groups(path: Path, groups: dict[str, xr.Dataset]) -> None:
    for i, (name, group) in enumerate(groups.items()):
        group.to_netcdf(path, group=name, mode="w" if i == 0 else "a", engine="h5netcdf")


def _write_posterior(folder: Path, rows: list[dict[str, Any]]) -> None:
    rng = np.random.default_rng(5)
    draws = {
        r["name"]: r["mean"] + r["sd"] * rng.standard_normal((64, 40)).reshape(4, 16, 40).swapaxes(1, 2) for r in rows
    }
    said = {r["name"]: {"tau": 1.5 + 0.1 * i} for i, r in enumerate(rows)}
    provenance = {"noise": "gaussian", "steps": 160, "burn_in": 40, "walkers": 16, "thin": 3}
    origin = {"provenance": provenance, "acceptance": {"independence": 0.8765, "stretch": 0.4567}}
    attributes = {key: json.dumps(value) for key, value in origin.items()}
    _write_groups(folder / "posterior.nc", {"posterior": arranged(draws, said).assign_attrs(attributes)})


def _study(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return what `PosteriorStudy.summary` and the choice of noise add to a posterior, made of closed formulas."""
    physical = [r for r in rows if "[" not in r["name"] and r["name"] != "sigma"]
    names = [r["name"] for r in rows if "[" not in r["name"]]
    matrix = np.eye(len(names))
    matrix[1, 2] = matrix[2, 1] = -0.9712
    normalised = np.linspace(-3.0, 3.0, 13)
    changes = [{"factor": f, "shift": s, "sd_ratio": 1 + s, "effective": 0.9} for f, s in ((0.5, -0.3456), (2.0, 0.1))]
    still = [{**change, "shift": 0.0, "sd_ratio": 1.0} for change in changes]
    widths = (0.01, 0.5, 0.02)
    return {
        "priors": [
            {
                "name": r["name"], "law": "normal", "mean": r["mean"], "sd": 10 * r["sd"], "prior_sd": 10 * r["sd"],
                "contraction": 0.87654 if r["name"] == "gamma" else 0.99998,
                "widths": changes if r["name"] == "gamma" else still, "sensitive": r["name"] == "gamma",
            }
            for r in physical
        ],
        "profiles": [
            {
                "name": r["name"], "best": r["mean"], "cut": 2.7055,
                "values": (r["mean"] + r["sd"] * normalised).tolist(), "statistic": (normalised**2).tolist(),
                "interval": [None if r["name"] == "xi" else r["mean"] - 1.5 * r["sd"], r["mean"] + 1.5 * r["sd"]],
                "prior_values": [r["mean"] - 3 * r["sd"], r["mean"] + 3 * r["sd"]], "prior_density": [1.0, 0.99],
            }
            for r in physical
        ],
        "correlations": {
            "names": names, "matrix": matrix.tolist(),
            "pairs": [{"pair": ["alpha", "beta"], "correlation": -0.9712}],
        },
        "autocorrelation": {
            "lags": [0.0, 2.0, 4.0], "tau": dict.fromkeys(names, 3.25),
            "functions": {n: [[1.0, 0.5, 0.1]] * 4 for n in names},
        },
        "coverage": [
            {
                "recording": name, "part": part, "channel": channel, "unit": "m", "readings": 400, "share": share,
                "width": width,
            }
            for (name, part, share), width in zip(
                (("train_a", "fitted", 0.9123), ("hold_in", "held out", 0.8765), ("hold_out", "held out", 0.4321)),
                widths, strict=True,
            )
            for channel in ("tip_x", "tip_y")
        ],
    }  # fmt: skip


def _evidence(name: str, behind: float, pareto_k: float, rows: list[dict[str, Any]], wide: float) -> dict[str, Any]:
    return {
        "noise": name, "name": name, "effects": ["viscous_damping"], "free": 4, "held_out": 1.25e-3 + 1e-4 * behind,
        "log_evidence": 4321.0 - behind, "behind": behind, "error": 0.02, "pareto_k": pareto_k,
        "reliable": pareto_k <= 0.7,
        "intervals": {r["name"]: [r["mean"] - wide * r["sd"], r["mean"], r["mean"] + wide * r["sd"]] for r in rows},
    }  # fmt: skip


@_once
def write_arm_run(folder: Path) -> dict[str, Any]:
    """Write the run of an arm, explained by better mechanics and dry friction; return the content of results.json."""
    rng = np.random.default_rng(3)
    deflection = 0.8 * np.exp(-0.02 * TIME) * np.sin(2.9 * TIME)
    motor = np.clip(TIME, 0.0, 1.0)
    groups: dict[str, xr.Dataset] = {}
    for name, role, scale in (("train_a", "train", 1.0), ("hold_in", "holdout", 0.8), ("hold_out", "holdout", 1.2)):

        def tip(angle: np.ndarray) -> np.ndarray:
            return np.column_stack([np.cos(angle), np.sin(angle)])

        bend = scale * deflection
        clean = tip(motor + bend)
        measured = clean + 3e-4 * rng.standard_normal(clean.shape)
        if role == "train":
            measured[50:55] = np.nan
        both = ("time", "channel")
        variables: dict[str, Any] = {
            "measured": (both, measured),
            "deflection": ("time", bend),
            "fitted": ("time", np.full(TIME.size, int(role == "train"), np.int8)),
            "input": ("time", motor),
            "linear": (both, tip(motor + 0.97 * bend)),
            "before": (both, tip(motor + 0.995 * bend)),
            "after": (both, clean),
        }
        if role == "train":
            variables |= {
                f"posterior_{q}": (both, clean + shift) for q, shift in (("q05", -0.001), ("q50", 0), ("q95", 0.001))
            }
        else:
            variables["clean"] = (both, clean)
        groups[name] = xr.Dataset(variables, {"time": TIME, "channel": ["tip_x", "tip_y"]}, {"role": role})
    folder.mkdir(parents=True, exist_ok=True)
    _write_groups(folder / "trajectories.nc", groups)

    amplitude = np.linspace(0.8, 0.3, 12)
    _write_groups(
        folder / "amplitude.nc",
        {
            name: xr.Dataset(
                {"frequency": ("swing", 0.45 + k * amplitude**2 / 100), "damping": ("swing", 0.046 + 0 * amplitude)},
                {"amplitude": ("swing", amplitude)},
                {"recording": "train_a"},
            )
            for k, name in enumerate(("measured", "linear", "before", "after"))
        },
    )
    delta = np.linspace(0.0, 0.95, 40)
    bands = {
        f"posterior_spring_{q}": ("delta", delta + (0.05 + s) * delta**3)
        for q, s in (("q05", 0), ("q50", 0.01), ("q95", 0.02))
    }
    bands |= {
        f"posterior_radius_{q}": ("delta", 1 - (0.09 + s) * delta**2)
        for q, s in (("q05", 0), ("q50", 0.01), ("q95", 0.02))
    }
    laws = xr.Dataset(
        {
            "elastica_spring": ("delta", delta + 0.06 * delta**3),
            "elastica_torque": ("delta", delta - 0.04 * delta**3),
            "elastica_radius": ("delta", 1 - 0.1 * delta**2),
            **bands,
        },
        {"delta": delta},
        {"delta_max": 0.83},
    )
    points = xr.Dataset({"delta": ("point", bend), "rho": ("point", 1 - 0.1 * bend**2)})
    _write_groups(folder / "laws.nc", {"laws": laws, "measured": points})
    rows = _posterior_rows(
        {
            "xi": (0.045827, 2.4e-5, "s^-1"),
            "alpha": (8.10097, 3.3e-4, "s^-2"),
            "beta": (0.47661, 1.1e-3, "s^-2 rad^-2"),
            "gamma": (0.44222, 3.6e-4, "rad^-1"),
            "sigma": (2.55e-3, 1.8e-5, "m"),
            "delta_0_init[train_a]": (1.08e-2, 1.3e-4, "rad"),
        }
    )
    _write_posterior(folder, rows)
    at = groups["train_a"].coords
    bands = {
        f"{kind}_{q}": (("time", "channel"), groups["train_a"]["before"].to_numpy() + shift * size)
        for kind, size in (("motion", 1e-4), ("reading", 4e-3))
        for q, shift in (("q05", -1.0), ("q50", 0.0), ("q95", 1.0))
    }
    _write_groups(folder / "predictive.nc", {n: xr.Dataset(bands, at) for n in ("train_a", "hold_in")})

    declared = {
        "xi": (0.0458, 1e-4, "s^-1"),
        "alpha": (8.1, 2e-3, "s^-2"),
        "beta": (0.476, 6e-3, "s^-2 q^-2"),
        "gamma": (0.442, 4e-4, "q^-1"),
    }
    final = {
        "xi": (0.045123, 2.2e-5, "s^-1"),
        "alpha": (8.0931, 8.7e-4, "s^-2"),
        "f_c": (0.012815, 2.3e-5, "s^-2 q"),
        "tau_r": (0.0, None, "s"),
        "mu": (0.28477, 1.4e-5, "1"),
    }
    groups_before = {
        "train": _errors(2.31e-3),
        "holdout": _errors(3.19e-3),
        "holdout_inside": _errors(2.38e-3),
        "holdout_outside": _errors(4.01e-3),
    }
    groups_after = {name: _errors(3.781e-4) for name in groups_before}
    comparison = [
        {
            "mass": mass,
            "law": law,
            "parameter": parameter,
            "unit": unit,
            "posterior_mean": value,
            "posterior_sd": 1e-3,
            "predicted_mean": predicted,
            "predicted_sd": sd,
            "difference": value - predicted,
            "discrepancy": discrepancy,
        }
        for mass in ("as_printed", "rod_counted")
        for law in ("static_small", "dynamic")
        for parameter, unit, value, predicted, sd, discrepancy in (
            ("alpha", "s^-2", 8.101, 8.64 if mass == "as_printed" else 8.09, 0.43, -1.2345),
            ("gamma", "1", 0.4422, 0.44721, 0.0, None),
        )
    ]
    results: dict[str, Any] = {
        "provenance": _provenance(),
        "data_note": "These recordings are simulated by a twin of the rig.",
        "rig": {
            "name": "test arm <1>",
            "kind": "flexible_arm",
            "quantities": {
                "length": {"value": 1.0, "sd": 1e-3, "unit": "m"},
                "tip_mass": {"value": 0.04376, "sd": 2.2e-4, "unit": "kg"},
                "flexural_rigidity": {"value": 0.125967, "sd": 6.3e-3, "unit": "N m^2"},
                "position_noise": {"value": 3e-4, "sd": None, "unit": "m"},
            },
            "declared": ARM_DECLARED,
        },
        "recordings": [
            {
                "name": name,
                "role": role,
                "samples": TIME.size,
                "duration_s": 19.95,
                "rate_hz": 20.0,
                "largest_deflection": largest,
                "channels": ["tip_x", "tip_y"],
                "units": ["m", "m"],
                "noise": [3e-4, 3e-4],
            }
            for name, role, largest in (
                ("train_a", "train", 0.83),
                ("hold_in", "holdout", 0.7),
                ("hold_out", "holdout", 0.99),
            )
        ],
        "discovery": _discovery("flexible_arm"),
        "radius": {
            "gamma": 0.44123,
            "interval": [0.4337, 0.4481],
            "status": "1 - a delta^2 is the simplest law that fits; in (16) alone gamma = 0.4412 +- 0.0072.",
            "rivals": [
                {
                    "law": "1 - a delta^2 - b delta^4",
                    "parameters": "a = 0.0986, b = -0.00137",
                    "unexplained": 1.2e-3,
                    "likelihood_ratio": 1.0,
                },
                {
                    "law": "cos(gamma delta) + kappa delta^2 theta_t'^2",
                    "parameters": "gamma = 0.444",
                    "unexplained": 1.3e-3,
                    "likelihood_ratio": 2.0,
                },
            ],
        },
        "fits": {},
        "fit_errors": {
            label: {"position": _errors(size), "angle": _errors(0.7 * size), "radius": _errors(0.5 * size)}
            for label, size in (("linear", 0.0245), ("constant_radius", 0.0173), ("declared", 2.31e-3))
        },
        "posterior": {
            "subject": "declared",
            "rows": rows,
            "status": "sigma is 8.5 times the stated noise.",
            **_study(rows),
        },
        "noise": {
            "chosen": "correlated",
            "reliable": True,
            "widening": {r["name"]: 7.5 for r in rows},
            "models": [
                _evidence("correlated", 0.0, 0.12, rows, 12.3375),
                _evidence("gaussian", 321.0, 0.91, rows, 1.645),
            ],
        },
        "evidence": {
            "preferred": "both",
            "held_out_prefers": "both",
            "same_order": 1.0,
            "reliable": True,
            "models": [
                {**_evidence(name, behind, 0.1, rows, 1.0), "noise": "correlated"}
                for name, behind in (("both", 0.0), ("neither", 55.5))
            ],
        },
        "elastica": {"prediction": [], "comparison": comparison, "delta_max": 0.83},
        "loop": {
            "verdict": "explained",
            "declared": ARM_DECLARED,
            "effects": [
                {
                    "id": "elastica_geometry",
                    "parameters": {},
                    "evidence": {},
                    "probability": None,
                    "group_probability": None,
                    "ambiguous_with": [],
                },
                {
                    "id": "coulomb_friction",
                    "parameters": {"f_c": {"value": 0.012815, "sd": 2.3e-5, "unit": "s^-2 q"}},
                    "evidence": odds(724.4, 311.5, 8.0, 186705.0),
                    "probability": 0.76852,
                    "group_probability": 1 - 4.9e-11,
                    "ambiguous_with": ["quadratic_drag"],
                },
            ],
            "errors": {
                "unit": "m",
                "noise_floor": 4.2426e-4,
                "holdout_kind": "separate recordings",
                "holdout_motion": 250.0,
                "before": groups_before,
                "after": groups_after,
            },
            "model_error": model_error(1.1554e-3, 9.127e-6, "m"),
            "complete": True,
            "model": {
                "before": _fit("constant_radius", ARM_DECLARED, declared),
                "after": _fit("elastica", ["viscous_damping", "linear_stiffness", "coulomb_friction"], final),
            },
            "residual": {"before": _residual(8.5), "after": _residual(0.99)},
            "steps": _arm_steps(),
        },
        "clean": {"hold_in": {m: _errors(size) for m, size in (("before", 2.33e-3), ("after", 1.62e-5))}},
    }
    write_json(folder / "results.json", results)
    return results


@_once
def write_oscillator_run(folder: Path) -> dict[str, Any]:
    """Write the run of a driven oscillator, nothing missing, without posterior, elastica, clean motion or hold-out."""
    declared = ["viscous_damping", "linear_stiffness", "cubic_stiffness"]
    time = np.arange(6000) / 600.0
    drive = np.sin(60.0 * time) + np.sin(97.0 * time)
    output = 0.05 * np.sin(60.0 * time + 0.3)
    fitted = np.ones(time.size, np.int8)
    fitted[4000:] = 0
    both = ("time", "channel")
    variables = {
        "measured": (both, output[:, None]),
        "deflection": ("time", output),
        "fitted": ("time", fitted),
        "input": ("time", drive),
        "linear": (both, 0.9 * output[:, None]),
        "before": (both, 0.99 * output[:, None]),
        "after": (both, 0.99 * output[:, None]),
    }
    folder.mkdir(parents=True, exist_ok=True)
    _write_groups(folder / "trajectories.nc", {"train_a": xr.Dataset(variables, {"time": time, "channel": ["output"]})})
    values = {
        "xi": (14.0, 0.1, "s^-1"),
        "alpha": (1.9e5, 30.0, "s^-2"),
        "beta": (7.1e5, 400.0, "s^-2 q^-2"),
        "g": (-2.5, 0.01, "s^-2 q"),
    }
    fit = _fit("oscillator", declared, values)
    errors = {"train": _errors(2.2e-4), "holdout": _errors(2.4e-4)}
    results: dict[str, Any] = {
        "provenance": _provenance(),
        "data_note": "",
        "rig": {"name": "test circuit", "kind": "oscillator", "quantities": {}, "declared": declared},
        "recordings": [
            {
                "name": "train_a",
                "role": "train",
                "samples": 6000,
                "duration_s": 10.0,
                "rate_hz": 600.0,
                "largest_deflection": 0.05,
                "channels": ["output"],
                "units": ["V"],
                "noise": [2e-4],
                "noise_estimated": True,
            }
        ],
        "discovery": _discovery("oscillator"),
        "radius": None,
        "fits": {},
        "fit_errors": {"linear": {"position": _errors(7e-3)}, "declared": {"position": _errors(2.2e-4)}},
        "posterior": None,
        "elastica": None,
        "loop": {
            "verdict": "nothing_missing",
            "declared": declared,
            "effects": [],
            "errors": {
                "unit": "V",
                "noise_floor": 2e-4,
                "holdout_kind": "last third, continued",
                "holdout_motion": 25.0,
                "before": errors,
                "after": errors,
            },
            "model_error": model_error(4e-6, 4e-6, "V"),
            "complete": True,
            "model": {"before": fit, "after": fit},
            "residual": {"before": _residual(1.0), "after": _residual(1.0)},
            "steps": [decision("stop", accepted=True, code="complete", numbers={"promise": 8.1, "chance": 20.4})],
        },
        "clean": None,
    }
    write_json(folder / "results.json", results)
    return results


def write_loop_run(folder: Path) -> dict[str, Any]:
    """Write what the page of a loop alone is made of: no regression, no fits side by side, no posterior."""
    results = write_oscillator_run(folder)
    for name in ("discovery", "radius", "fits", "fit_errors", "posterior", "elastica"):
        del results[name]
    results["scope"] = "loop"
    write_json(folder / "results.json", results)
    return results
