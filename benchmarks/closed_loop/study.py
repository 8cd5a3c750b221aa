"""Two controllers in a loop with the twin.

Both are linear-quadratic with the same weights and the same design of the filter; all that differs is the model that
they are designed on. The twin is none of the models: another rod with its own code, its camera late and noisy, its
encoder with steps.
"""

from __future__ import annotations

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
from discovery.runs.processes import Outcome
from discovery.runs.spread import spread

FloatArray = NDArray[np.float64]
#: Time between samples and length of a run [s], and the angle to be turned [rad].
SAMPLE, LENGTH, TURN = 0.02, 4.0, 0.5
#: Price of an acceleration of the motor [s^4], from a gentle controller to a fast one.
PRICES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
#: Noise that the filter expects: acceleration [rad/s^2], camera over the arm's length, encoder [rad].
PUSH, CAMERA, ENCODER = 1.0, 3e-4, 4e-5
DELAY = 0.01
SEEDS = (1, 2, 3)
#: Part of the run over which the end is looked at [s].
LAST = 1.0
#: Of the samples of a run, one in so many is drawn.
_DRAWN = 5


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
    return Controller(sampled.a, sampled.b, c, observe, np.asarray(gain, np.float64))


def motion(accelerations: list[float]) -> Manoeuvre:
    """Return the motor's motion from rest at minus the turn, its acceleration held between samples."""
    at, rate = -TURN, 0.0
    pieces: list[tuple[float, ...]] = [(-TURN,)]
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


def driven(case: tuple[Path, str, float, int], _seed: object) -> dict[str, Any]:
    """Return how a controller does with one noise, and with the first one what is drawn of the run."""
    loop, what, price, seed = case
    run = drive(design(read_fitted(loop, what), price), seed)
    drawn = {
        "time_s": run["time"][::_DRAWN],
        "tip_mrad": 1e3 * np.angle(run["tip"][::_DRAWN]),
        "motor_rad_s2": run["push"][::_DRAWN],
    }
    scores: dict[str, Any] = dict(score(run, price))
    return scores | ({"run": {key: value.tolist() for key, value in drawn.items()}} if seed == SEEDS[0] else {})


def compare(reports: Path, workers: int = 1) -> list[dict[str, Any]]:
    """Return a row for every price and model: means over the seeds of the noise, and the run with the first of them.

    Parameters
    ----------
    reports : Path
        With the folder of the loop on `arm_delay`.
    workers : int
        Processes.
    """
    rows = [(price, what) for price in PRICES for what in ("before", "after")]
    cases = {
        f"{what} {price:g} {seed}": (reports / "arm_delay", what, price, seed) for price, what in rows for seed in SEEDS
    }
    found = {outcome.name: outcome for outcome in spread(driven, list(cases.items()), workers=workers)}
    return [_row(price, what, [found[f"{what} {price:g} {seed}"] for seed in SEEDS]) for price, what in rows]


def _row(price: float, what: str, outcomes: list[Outcome]) -> dict[str, Any]:
    row: dict[str, Any] = {"price_s4": price, "model": what}
    failed = [outcome.error for outcome in outcomes if outcome.result is None]
    if failed:
        return row | {"failure": failed[0]}
    scores = [dict(outcome.result or {}) for outcome in outcomes]
    run = scores[0].pop("run")
    return row | {key: float(np.mean([s[key] for s in scores])) for key in scores[0]} | {"run": run}
