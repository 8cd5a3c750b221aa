"""Long recordings: of a flexible arm, a spring bench, and an oscillator whose motion needs every reading."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numba
import numpy as np
from discovery_datasets.manoeuvres import trapezoid
from discovery_datasets.twin import PAPER_RIG, record, simulate, write_csv

from benchmarks.growth.stick_slip import stick_slip

#: Mass [kg] and dry friction [N] of the body that sticks and slips.
MASS, DRY = 1.7, 0.6
#: Steps of the integrator between two readings.
_STEPS = 4


@dataclass(frozen=True)
class Recorded:
    """Recordings of one system.

    Parameters
    ----------
    rows : int
        Readings that are fitted.
    write : callable
        Writes ``rig.toml`` and the recordings that it names to a folder.
    sampled : bool
        Whether its posterior is a part of the measurement.
    """

    rows: int
    write: Callable[[Path], None]
    sampled: bool = False


def _arm(folder: Path) -> None:
    """Write three manoeuvres of the twin at 1 kHz, ten seconds each."""
    time = np.arange(10_000) / 1000.0
    manoeuvres = {"one": trapezoid(1.0, 1.0), "two": trapezoid(1.0, 1.4), "holdout": trapezoid(-0.9, 1.1)}
    for seed, (name, manoeuvre) in enumerate(manoeuvres.items()):
        motion = simulate(PAPER_RIG, manoeuvre, time)
        write_csv(record(motion, rng=np.random.default_rng(seed)), folder / f"{name}.csv")
    (folder / "rig.toml").write_text(
        'name = "arm at 1 kHz"\nlength_m = 1.0\ntip_mass_kg = 0.04376\nbeam_mass_kg = 0.01245\n'
        "flexural_rigidity_N_m2 = 0.125967\nposition_noise_m = 3e-4\nangle_noise_rad = 7e-5\n"
        '[records]\ntrain = [{ file = "one.csv" }, { file = "two.csv" }]\nholdout = [{ file = "holdout.csv" }]\n',
        encoding="utf-8",
    )


def _spring_bench(folder: Path) -> None:
    """Write 20 s of a body on a spring that sticks and slips, at 1 kHz, from event to event, at rest to begin with."""
    time = np.arange(20_000) / 1000.0
    for seed, name in enumerate(("train", "holdout")):
        rng = np.random.default_rng(seed)
        force, moved = stuck(time, rng)
        read = 1e3 * moved + rng.normal(0.0, 0.05, time.size)
        table = np.column_stack([time, force, read])
        np.savetxt(folder / f"{name}.csv", table, "%.7g", ",", header="t,u,y", comments="")
    (folder / "rig.toml").write_text(
        'name = "spring bench"\nkind = "oscillator"\n[columns]\ntime = { name = "t", unit = "s" }\n'
        'input = { name = "u", unit = "N" }\noutput = { name = "y", unit = "mm", noise = 0.05 }\n'
        '[model]\neffects = ["viscous_damping", "linear_stiffness"]\n'
        '[records]\ntrain = [{ file = "train.csv", at_rest = true }]\n'
        'holdout = [{ file = "holdout.csv", at_rest = true }]\n',
        encoding="utf-8",
    )


def stuck(time: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return a force [N] of drawn sines that swells in half a second, and where a body on a spring is under it [m]."""
    frequency, phase = 2 * np.pi * rng.uniform(0.3, 6.0, 9), rng.uniform(0.0, 2 * np.pi, 9)
    size = 6.0 * rng.uniform(0.3, 1.0, 9) * np.sqrt(2 / 9)

    def force(when: np.ndarray) -> np.ndarray:
        return np.sin(np.multiply.outer(when, frequency) + phase) @ size * np.minimum(1.0, (when / 0.5) ** 2)

    return force(time), stick_slip(force, time, mass=MASS, stiffness=410.0, loss=0.35, dry=DRY)


def _driven(folder: Path, rows: int) -> None:
    """Write a driven body on a spring with dry friction, read so rarely that no reading can be spared."""
    rng = np.random.default_rng(1)
    for name, count in (("train", rows), ("holdout", min(rows // 4, 20_000))):
        time = np.arange(count) / 50.0
        frequency, phase = rng.uniform(0.5, 8.0, 40), rng.uniform(0, 2 * np.pi, 40)
        read = _swung(count, frequency, phase) + rng.normal(0.0, 2e-4, count)
        force = np.zeros(count)
        for f, p in zip(frequency, phase, strict=True):
            force += np.sin(2 * np.pi * f * time + p)
        np.savetxt(
            folder / f"{name}.csv", np.column_stack([time, force, read]), "%.7g", ",", header="t,u,y", comments=""
        )
    (folder / "rig.toml").write_text(
        'name = "driven body"\nkind = "oscillator"\n[columns]\ntime = { name = "t", unit = "s" }\n'
        'input = { name = "u", unit = "N" }\noutput = { name = "y", unit = "m", noise = 2e-4 }\n'
        '[model]\neffects = ["viscous_damping", "linear_stiffness"]\n'
        '[records]\ntrain = [{ file = "train.csv" }]\nholdout = [{ file = "holdout.csv" }]\n',
        encoding="utf-8",
    )


@numba.njit(cache=False)
def _swung(count: int, frequency: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """Return the motion of 2 kg on 400 N/m with 3 N s/m and 0.8 N of dry friction, 50 readings a second (RK4)."""
    out = np.empty(count)
    h = 0.02 / _STEPS
    x = v = 0.0
    for i in range(count):
        out[i] = x
        for k in range(_STEPS):
            t = i * 0.02 + k * h
            ax = np.empty(4)
            av = np.empty(4)
            for stage in range(4):
                part = 0.0 if stage == 0 else 1.0 if stage == 3 else 0.5
                last = stage - 1 if stage else 0
                y = x + part * h * ax[last] if stage else x
                w = v + part * h * av[last] if stage else v
                force = 0.0
                for j in range(frequency.size):
                    force += np.sin(2 * np.pi * frequency[j] * (t + part * h) + phase[j])
                ax[stage] = w
                av[stage] = (force - 400.0 * y - 3.0 * w - 0.8 * np.tanh(w / 2e-3)) / 2.0
            x += h / 6 * (ax[0] + 2 * ax[1] + 2 * ax[2] + ax[3])
            v += h / 6 * (av[0] + 2 * av[1] + 2 * av[2] + av[3])
    return out


CASES = {
    "arm, two records at 1 kHz": Recorded(20_000, _arm),
    "spring bench, 20 s at 1 kHz": Recorded(20_000, _spring_bench, sampled=True),
    **{f"driven body, {n} rows": Recorded(n, partial(_driven, rows=n)) for n in (20_000, 200_000, 2_000_000)},
}
