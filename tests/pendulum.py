"""A pendulum swung by an independent integrator, with what a declared model does not contain."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

RIG = """name = "pendulum"
kind = "pendulum"
LENGTH
[columns]
time = { name = "t_s", unit = "s" }
output = { name = "angle_rad", unit = "rad", noise = NOISE }
"""


def swing(
    folder: Path,
    loss: Callable[[float], float],
    *,
    release: float = 1.4,
    duration: float = 40.0,
    strength: float = 30.0,
    length: str = "",
    noise: float = 1e-3,
    seed: int = 0,
    restoring: Callable[[float], float] = lambda _: 0.0,
) -> tuple[Path, Path, NDArray[np.float64]]:
    """Write rig and recording (50 Hz) of theta'' = -strength sin theta - restoring(theta) - loss(theta').

    Return both and the truth.
    """

    def slopes(_: float, state: NDArray[np.float64]) -> list[float]:
        return [state[1], -strength * np.sin(state[0]) - restoring(state[0]) - loss(state[1])]

    time = np.arange(0.0, duration, 0.02)
    true = solve_ivp(slopes, (0.0, duration), [release, 0.0], "DOP853", time, rtol=1e-9, atol=1e-10, max_step=0.02).y[0]
    seen = true + noise * np.random.default_rng(seed).standard_normal(time.size)
    rig, recording = folder / "rig.toml", folder / "swing.csv"
    rig.write_text(RIG.replace("LENGTH", length).replace("NOISE", f"{noise:g}"), encoding="utf-8")
    rows = "\n".join(f"{t:.2f},{a:.8f}" for t, a in zip(time, seen, strict=True))
    recording.write_text(f"t_s,angle_rad\n{rows}\n", encoding="utf-8")
    return rig, recording, true
