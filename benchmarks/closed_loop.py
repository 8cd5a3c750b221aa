"""A controller tuned on the discovered model against one tuned on the declared model, both in a loop with the twin.

Usage: ``python -m benchmarks.closed_loop REPORTS OUT PAGE``. REPORTS holds the loop on `arm_delay`; OUT gets
`results.json`; of PAGE the table between two marks is written again, and its figure. Both controllers are
linear-quadratic with the same weights and the same design of the filter; all that differs is the model that they are
designed on. The twin is none of the models: another rod with its own code, its camera late and noisy, its encoder with
steps.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from discovery_datasets.arm import TwinError
from discovery_datasets.disturbances import SensorDelay
from discovery_datasets.manoeuvres import Manoeuvre
from discovery_datasets.quick import readings
from discovery_datasets.twin import PAPER_RIG
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from discovery.export import FittedModel, discretise, linearise, read_fitted

FloatArray = NDArray[np.float64]
#: Time between samples and length of a run [s], and the angle to be turned [rad].
SAMPLE, LENGTH, TURN = 0.02, 4.0, 0.5
#: Price of an acceleration of the motor [s^4], from a gentle controller to a fast one.
PRICES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
#: Noise that the filter expects: acceleration [rad/s^2], camera over the arm's length, encoder [rad].
PUSH, CAMERA, ENCODER = 1.0, 3e-4, 4e-5
DELAY = 0.01
SEEDS = (1, 2, 3)
BEGIN, END = "<!-- table: written by `make closed-loop` -->", "<!-- end of table -->"
#: Part of the run over which the end is looked at [s].
LAST = 1.0


@dataclass(frozen=True)
class Controller:
    """A Kalman filter and the gain on its state."""

    a: FloatArray
    b: FloatArray
    c: FloatArray
    observe: FloatArray
    gain: FloatArray


def design(found: FittedModel, price: float) -> Controller:
    """Return the controller of least squared error of the tip and priced squared acceleration on a model."""
    model = linearise(found)
    sampled = discretise(model, SAMPLE)
    n = len(model.states)
    encoder = np.zeros((1, len(sampled.states)))
    encoder[0, model.states.index("theta_m")] = 1.0
    length = found.values["length"]
    c = np.vstack([sampled.c[1:2] / length, encoder])
    tip = np.zeros((1, len(sampled.states)))
    tip[0, :n] = model.c[1] / length
    noise = np.diag([CAMERA**2, ENCODER**2])
    # A little of everything may be disturbed, so that all that is observed is corrected.
    q = PUSH**2 * sampled.b @ sampled.b.T + 1e-12 * np.eye(len(sampled.states))
    p = solve_discrete_are(sampled.a.T, c.T, q, noise)
    observe = p @ c.T @ np.linalg.inv(c @ p @ c.T + noise)
    wanted = SAMPLE * tip.T @ tip + 1e-12 * np.eye(len(sampled.states))
    s = solve_discrete_are(sampled.a, sampled.b, wanted, np.array([[SAMPLE * price]]))
    gain = np.linalg.solve(SAMPLE * price + sampled.b.T @ s @ sampled.b, sampled.b.T @ s @ sampled.a)
    return Controller(sampled.a, sampled.b, c, observe, gain)


def motion(accelerations: list[float]) -> Manoeuvre:
    """Return the motor's motion from rest at minus the turn, its acceleration held between samples."""
    at, rate, pieces = -TURN, 0.0, [(-TURN,)]
    for push in accelerations:
        pieces.append((at, rate, push / 2))
        at, rate = at + SAMPLE * (rate + SAMPLE * push / 2), rate + SAMPLE * push
    kinks = tuple(SAMPLE * k for k in range(len(accelerations)))
    return Manoeuvre(kinks, (0.0, *kinks), tuple(tuple(map(float, p)) for p in pieces))


def drive(controller: Controller, seed: int) -> dict[str, FloatArray]:
    """Return what the twin does in the loop; it takes whole motions, so that it begins anew for every sample."""
    rng, pushes, n = np.random.default_rng(seed), [0.0], controller.a.shape[0]
    # The filter knows where the arm rests at first.
    at_rest = np.vstack([np.eye(n) - controller.a, controller.c])
    state = np.linalg.lstsq(at_rest, np.r_[np.zeros(n), -TURN, -TURN], rcond=None)[0]
    for k in range(1, round(LENGTH / SAMPLE)):
        time = SAMPLE * k * np.array([0.0, 1.0])
        seen = readings(PAPER_RIG, motion(pushes), time, disturbances=[SensorDelay(DELAY)])
        x, y = np.array([seen.reading_x[-1], seen.reading_y[-1]]) + PAPER_RIG.length * CAMERA * rng.standard_normal(2)
        encoder = seen.motor_angle[-1] + rng.uniform(-7e-5, 7e-5)
        state = controller.a @ state + controller.b[:, 0] * pushes[-1]
        state = state + controller.observe @ (np.array([np.arctan2(y, x), encoder]) - controller.c @ state)
        pushes.append(float(-(controller.gain @ state)[0]))
        if not abs(pushes[-1]) < 1e4:
            raise TwinError("the loop is unstable")
    time = np.arange(0.0, LENGTH, SAMPLE / 10)
    seen = readings(PAPER_RIG, motion(pushes), time)
    push = np.repeat(pushes, 10)
    return {"time": time, "tip": seen.tip, "motor": seen.motor_angle, "deflection": seen.deflection, "push": push}


def score(run: dict[str, FloatArray], price: float) -> dict[str, float]:
    """Return cost, errors of the tip, effort and the energy that is left in the arm."""
    step = run["time"][1] - run["time"][0]
    away = np.angle(run["tip"])
    last = run["time"] > LENGTH - LAST
    mass = PAPER_RIG.tip_mass + 33 / 140 * PAPER_RIG.beam_mass
    speed = np.abs(np.gradient(run["tip"], step))
    rigidity = 3 * PAPER_RIG.flexural_rigidity / PAPER_RIG.length
    energy = 0.5 * mass * speed**2 + 0.5 * rigidity * run["deflection"] ** 2
    return {
        "cost": float(step * np.sum(away**2 + price * run["push"] ** 2)),
        "tip_error_mm": float(1e3 * PAPER_RIG.length * np.sqrt(np.mean(away[last] ** 2))),
        "effort": float(step * np.sum(run["push"] ** 2)),
        "energy_left_uJ": float(1e6 * energy[last].mean()),
        "largest_energy_mJ": float(1e3 * energy.max()),
    }


def compare(reports: Path) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Return a row for every price and model, and the runs of the first seed."""
    rows, runs = [], {}
    for price in PRICES:
        for what in ("before", "after"):
            controller = design(read_fitted(reports / "arm_delay", what), price)
            row: dict[str, Any] = {"price": price, "model": what}
            try:
                found = [drive(controller, seed) for seed in SEEDS]
            except TwinError as error:
                row["failure"] = str(error)
            else:
                scores = [score(run, price) for run in found]
                row |= {key: float(np.mean([s[key] for s in scores])) for key in scores[0]}
                runs[price, what] = found[0]
            rows.append(row)
            print(row, flush=True)
    return rows, runs


def draw(runs: dict[Any, dict[str, FloatArray]], path: Path) -> None:
    """Draw the tip and the motor in both loops."""
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as plt

    matplotlib.rcParams |= {"svg.hashsalt": "closed_loop", "svg.fonttype": "none"}
    # The price at which the discovered model's controller leaves the tip nearest to its goal.
    price = min((p for p, what in runs if what == "after"), key=lambda p: score(runs[p, "after"], p)["tip_error_mm"])
    thin = slice(None, None, 5)
    figure, axes = plt.subplots(2, 1, sharex=True, figsize=(7, 4.5), layout="constrained")
    for what, colour in (("before", "tab:red"), ("after", "tab:green")):
        run, name = (
            runs[price, what],
            {"before": "tuned on the declared model", "after": "on the discovered model"}[what],
        )
        axes[0].plot(run["time"][thin], 1e3 * np.angle(run["tip"][thin]), color=colour, label=name)
        axes[1].plot(run["time"][::10], run["push"][::10], color=colour, drawstyle="steps-post")
    axes[0].set_ylabel("tip from its goal [mrad]")
    axes[0].set_ylim(-40, 40)
    axes[1].set_ylabel("motor [rad/s$^2$]")
    axes[1].set_xlabel("time [s]")
    axes[0].legend()
    figure.savefig(path, metadata={"Date": None})


def table(rows: list[dict[str, Any]]) -> str:
    """Return the rows side by side: on the declared model, on the discovered one."""
    lines = [
        "| price of the acceleration [s⁴] | tip error in the last second [mm] | energy left in the arm [µJ] | "
        "effort [rad²/s³] | cost |",
        "|---|---|---|---|---|",
    ]
    for before, after in zip(rows[::2], rows[1::2], strict=True):
        cells = [
            f"{before[key]:.4g} → {after[key]:.4g}" if key in before and key in after else "unstable"
            for key in ("tip_error_mm", "energy_left_uJ", "effort", "cost")
        ]
        lines.append(f"| {before['price']:g} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main(reports: Path, out: Path, page: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    rows, runs = compare(reports)
    (out / "results.json").write_text(json.dumps({"sample_s": SAMPLE, "turn_rad": TURN, "rows": rows}, indent=1) + "\n")
    draw(runs, page.parent / "images" / "closed_loop.svg")
    head, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    page.write_text(f"{head}{BEGIN}\n{table(rows)}\n{END}{rest.partition(END)[2]}", encoding="utf-8")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
