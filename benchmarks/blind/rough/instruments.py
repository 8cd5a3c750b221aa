"""Errors of clocks, cameras and mounts that no effect of the catalogue holds; they serve arms and bodies alike.

Readings are (n, c) arrays. `size` is the reach of a reading, and a strength of 1 is one noise sd where nothing else is
said. Unit sequences depend on the source of random numbers alone, so that an error grows in proportion to its strength.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from benchmarks.blind.rough.ingredient import Action, Ingredient, log_uniform

FloatArray = NDArray[np.float64]
Generator = np.random.Generator
Draw = Callable[[Generator, float, float, float], Ingredient]


def _lens(rng: Generator, size: float, noise: float, frequency: float) -> Ingredient:
    """Lens that distorts about a centre: a point at a distance d from it is seen at d (1 + k d^2 / size^2)."""
    centre, sign = rng.uniform(-0.5, 0.5, 2) * size, float(rng.choice([-1.0, 1.0]))

    def act(strength: float) -> Action:
        def see(time: FloatArray, reading: FloatArray) -> FloatArray:
            away = reading - centre[: reading.shape[1]]
            return reading + 0.01 * sign * strength * away * np.sum(away**2, axis=1, keepdims=True) / size**2

        return Action(optics=see)

    shape = {"centre": centre.tolist(), "sign": sign}
    return Ingredient("lens", act, 8.0, resembles=("position_scale", "perspective", "cubic_stiffness"), shape=shape)


def _interpolation(rng: Generator, size: float, noise: float, frequency: float) -> Ingredient:
    """Encoder that errs periodically between its lines."""
    pitch, phase = size / rng.uniform(3.0, 12.0), rng.uniform(0, 2 * np.pi)

    def act(strength: float) -> Action:
        def see(time: FloatArray, reading: FloatArray) -> FloatArray:
            return reading + 1.4 * strength * noise * np.sin(2 * np.pi * reading / pitch + phase)

        return Action(optics=see)

    return Ingredient("interpolation", act, 6.0, shape={"pitch": pitch, "phase": phase})


def _jitter(rng: Generator, size: float, noise: float, frequency: float) -> Ingredient:
    """Time stamps that scatter: a reading is of another time than it says."""
    unit = 1.5 * noise / (size * frequency)

    def act(strength: float) -> Action:
        def scatter(time: FloatArray, reading: FloatArray, source: Generator) -> FloatArray:
            step = float(np.median(np.diff(time)))
            away = np.clip(strength * unit * source.standard_normal(time.size), -0.45 * step, 0.45 * step)
            return np.asarray(CubicSpline(time, reading)(np.clip(time + away, time[0], time[-1])))

        return Action(scatter=scatter)

    return Ingredient("jitter", act, 6.0, shape={"unit_s": unit})


def _coloured(rng: Generator, size: float, noise: float, frequency: float) -> Ingredient:
    """Noise with memory beside the white one: autoregressive of order one."""
    memory = log_uniform(rng, 0.05, 0.6) * 2 * np.pi / frequency

    def act(strength: float) -> Action:
        def scatter(time: FloatArray, reading: FloatArray, source: Generator) -> FloatArray:
            keep = float(np.exp(-np.median(np.diff(time)) / memory))
            white = source.standard_normal(reading.shape)
            white[1:] *= np.sqrt(1 - keep**2)
            return reading + strength * noise * lfilter([1.0], [1.0, -keep], white, axis=0)

        return Action(scatter=scatter)

    return Ingredient("coloured_noise", act, 6.0, shape={"memory_s": memory})


def _outliers(rng: Generator, size: float, noise: float, frequency: float) -> Ingredient:
    """Readings that are wrong now and then, by 4 to 8 noise sds where the strength is one."""
    share = log_uniform(rng, 0.003, 0.012)

    def act(strength: float) -> Action:
        def scatter(time: FloatArray, reading: FloatArray, source: Generator) -> FloatArray:
            hit = source.random(reading.shape) < share
            far = source.uniform(4.0, 8.0, reading.shape) * source.choice([-1.0, 1.0], reading.shape)
            return reading + strength * noise * hit * far

        return Action(scatter=scatter)

    return Ingredient("outliers", act, 3.0, shape={"share": share})


def _sway(rng: Generator, size: float, noise: float, frequency: float) -> Ingredient:
    """Mount with a slow mode of its own that people's steps shake: its motion is in what is read."""
    own = rng.uniform(0.08, 0.35) * frequency
    loss, turn = rng.uniform(0.1, 0.3), rng.uniform(0, 2 * np.pi)
    along = np.array([np.cos(turn), np.sin(turn)])

    def act(strength: float) -> Action:
        def scatter(time: FloatArray, reading: FloatArray, source: Generator) -> FloatArray:
            step = float(np.median(np.diff(time)))
            warm = round(6 / (loss * own) / step)
            white = source.standard_normal(warm + time.size)
            decay, turned = np.exp(-loss * own * step), np.cos(np.sqrt(1 - loss**2) * own * step)
            moved = lfilter([1.0], [1.0, -2 * decay * turned, decay**2], white)[warm:]
            axes = along if reading.shape[1] == 2 else np.ones(1)
            return reading + strength * noise * moved[:, None] / moved.std() * axes * np.sqrt(axes.size)

        return Action(scatter=scatter)

    return Ingredient("sway", act, 6.0, shape={"frequency": own, "damping_ratio": loss, "direction": turn})


#: Every error by its name.
INSTRUMENT_ERRORS: dict[str, Draw] = {
    "lens": _lens,
    "interpolation": _interpolation,
    "jitter": _jitter,
    "coloured_noise": _coloured,
    "outliers": _outliers,
    "sway": _sway,
}


def instrument_error(name: str, rng: Any, *, size: float, noise: float, frequency: float) -> Ingredient:
    """Draw everything of an instrument's error but its strength.

    Parameters
    ----------
    name : str
        Key of `INSTRUMENT_ERRORS`.
    rng : numpy.random.Generator
        Source of random numbers.
    size, noise, frequency : float
        Reach of the readings, white noise [both in their unit], and angular frequency of the motion [rad/s].
    """
    return INSTRUMENT_ERRORS[name](rng, size, noise, frequency)
