"""Motor and gear (10), (11): coupling torque, the motor's own motion, and what the gear ratio decides."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from benchmarks.paper.figures.look import DASHED, FloatArray
from benchmarks.paper.theory.drivetrain.motor import ASSUMED_MOTOR
from discovery.report.numbers import significant
from discovery.report.style import BLUE, GREEN, ORANGE, RED, Picture, new_figure, plain_log

_LOOKS: dict[str, dict[str, Any]] = {
    "paper’s model": {"color": ORANGE, "linestyle": (0, (1, 1.2)), "linewidth": 1.6},
    "general model, rod counted": {"color": GREEN, "linestyle": (0, (7, 1.2)), "linewidth": 1.2},
    "exact arm": {"color": BLUE, "linestyle": "-", "linewidth": 0.9},
}

_Curves = Mapping[str, Mapping[str, FloatArray]]


def draw_torque(numbers: Mapping[str, Any], curves: _Curves) -> list[Picture]:
    """Return the coupling torque of the twin and of three models, and the models' errors."""
    torque = curves["torque"]
    time = torque["time"]
    figure = new_figure(4.2)
    top, bottom = figure.subplots(2, 1, sharex=True)
    top.plot(time, torque["twin"], color="black", linewidth=1.2, label="twin")
    for name, look in _LOOKS.items():
        top.plot(time, torque[name], **look, label=name)
        bottom.plot(time, 1e3 * (torque[name] - torque["twin"]), **look)
    top.set_ylabel("torque [N m]")
    bottom.set_ylabel("error [mN m]")
    bottom.set_xlabel("time [s]")
    bottom.set_xlim(time[0], time[-1])
    figure.legend(*top.get_legend_handles_labels(), loc="outside upper left", ncols=2)
    figure.align_ylabels()
    errors = numbers["torque_error_rms"]
    words = ", ".join(f"{name} {significant(1e3 * errors[name], 2)}" for name in _LOOKS)
    words = f"rms error: {words} mN m, of {significant(1e3 * numbers['torque_rms'], 2)} mN m"
    return [
        Picture(
            "coupling_torque",
            figure,
            f"Coupling torque (11) on the paper’s manoeuvre, and below what the models miss of it; the paper’s "
            f"model was fitted to the twin. R{words[1:]}.",
            f"Two panels against time: coupling torque of the twin and three models, and the models’ errors; {words}.",
        )
    ]


def draw_driven(numbers: Mapping[str, Any], curves: _Curves) -> list[Picture]:
    """Return how the motor of (10), under a position controller, makes the manoeuvre with the arm on it."""
    driven = curves["driven"]
    time = driven["time"]
    figure = new_figure(4.4)
    angle, deviation, current = figure.subplots(3, 1, sharex=True)
    angle.plot(time, driven["theta_m"], color="black", linewidth=1.0)
    deviation.plot(time, 1e3 * (driven["theta_m"] - driven["command"]), color="black", linewidth=1.0)
    current.plot(time, driven["current"], color="black", linewidth=1.0)
    angle.set_ylabel("θₘ [rad]")
    deviation.set_ylabel("off command\n[mrad]")
    current.set_ylabel("current i [A]")
    current.set_xlabel("time [s]")
    current.set_xlim(time[0], time[-1])
    figure.align_ylabels()
    words = (
        f"the hub is off its command by {significant(1e3 * numbers['tracking_peak'], 2)} mrad at most, the current "
        f"reaches {significant(numbers['largest_current'], 2)} A"
    )
    return [
        Picture(
            "driven_motor",
            figure,
            f"Motor (10) with an assumed motor’s constants and a position controller, the exact arm on it: {words}.",
            f"Three panels against time: motor angle, its deviation from the command, and the current; {words}.",
        )
    ]


def draw_gear(numbers: Mapping[str, Any], curves: _Curves) -> list[Picture]:
    """Return what the arm does to the hub, and to a fit that takes the command for the hub's angle, by gear ratio."""
    study = {name: np.asarray(values) for name, values in numbers["study"].items()}
    ratio = study["gear_ratio"]
    figure = new_figure(4.6)
    top, bottom = figure.subplots(2, 1, sharex=True)
    top.loglog(ratio, study["hub_peak"], "o-", color=BLUE, markersize=5, linewidth=1.0, label="hub, simulated")
    top.loglog(
        ratio,
        study["hub_predicted"],
        color=ORANGE,
        linestyle=(0, (4, 1.6)),
        linewidth=1.2,
        label=r"$\Gamma_c / (J n^2 \omega_b^2)$",
    )
    for key, colour, marker in (("command", RED, "s"), ("encoder", GREEN, "^")):
        bias = 100 * np.abs(study[f"bias_{key}"])
        bottom.loglog(
            ratio, bias, marker, color=colour, linestyle="-", linewidth=1.0, markersize=5, label=f"{key} as input"
        )
    top.set_ylabel("hub moved [rad]")
    bottom.set_ylabel("error of fitted α [%]")
    bottom.set_xlabel("gear ratio n [–]")
    for axes in (top, bottom):
        axes.axvline(ASSUMED_MOTOR.gear_ratio, **DASHED, label="paper’s n" if axes is bottom else None)
    for axis in (bottom.xaxis, top.yaxis, bottom.yaxis):
        plain_log(axis)
    handles, names = (a + b for a, b in zip(*(x.get_legend_handles_labels() for x in (top, bottom)), strict=True))
    figure.legend(handles, names, loc="outside upper left", ncols=2)
    figure.align_ylabels()
    at = int(np.argmin(np.abs(ratio - ASSUMED_MOTOR.gear_ratio)))
    command, encoder = (significant(100 * abs(study[f"bias_{key}"][at]), 2) for key in ("command", "encoder"))
    words = (
        f"at n = {ratio[at]:g} the arm moves the hub by {significant(1e3 * study['hub_peak'][at], 2)} mrad at most; α "
        f"is wrong by {command} % with the command as input and by {encoder} % with the encoder’s angle"
    )
    return [
        Picture(
            "gear_ratio",
            figure,
            f"When the motor’s angle may be taken as given, by gear ratio: the encoder’s always, the command only "
            f"where the controller is far stiffer than the arm. A{words[1:]} (J n² ω_b² there: "
            f"{significant(study['stiffness_ratio'][at], 2)} times the arm’s stiffness).",
            f"Two panels on logarithmic axes against the gear ratio: motion of the hub and error of the fitted α; "
            f"{words}.",
        )
    ]
