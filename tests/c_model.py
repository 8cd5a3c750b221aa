"""Exported C, compiled: its functions on numpy arrays."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

#: Nothing may be doubtful, in C and for readers of its header in C++.
FLAGS = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wshadow", "-Wconversion", "-Werror", "-O1", "-shared", "-fPIC")


def compiled(header: str, source: str, folder: Path, name: str = "model") -> ctypes.CDLL:
    """Return the shared library of an exported model."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.h").write_text(header)
    (folder / f"{name}.c").write_text(source)
    library = folder / "model.so"
    subprocess.run(["gcc", *FLAGS, f"{name}.c", "-lm", "-o", library], cwd=folder, check=True, timeout=300)
    return ctypes.CDLL(str(library))


class CModel:
    """The functions of a compiled model."""

    def __init__(self, header: str, source: str, folder: Path) -> None:
        self.library = compiled(header, source, folder)
        words = [line.split() for line in header.splitlines()]
        numbers = {w[1]: w[2] for w in words if len(w) == 3 and w[0] == "#define"}
        self.states, self.inputs, self.readings, self.history = (
            int(numbers[f"MODEL_{word}"]) for word in ("STATES", "INPUTS", "READINGS", "HISTORY")
        )
        self.step_length = float(numbers["MODEL_STEP"])
        self.n_parameters = header.split("enum {")[1].split("MODEL_PARAMETERS")[0].count("MODEL_")
        self.parameters = np.array(
            (ctypes.c_double * max(1, self.n_parameters)).in_dll(self.library, "model_parameters")
        )
        piece = 2 + 4 * self.states + 3 * self.inputs
        size = 1 + 2 * self.states + self.inputs + max(1, self.n_parameters) + 1 + self.history * piece
        self.motion = (ctypes.c_double * size)()
        self.library.model_lateness.restype = ctypes.c_double

    @staticmethod
    def _pointer(array: FloatArray):
        return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))

    def _call(self, name: str, *arguments):
        told = [
            self._pointer(a) if isinstance(a, np.ndarray) else ctypes.c_double(a) if isinstance(a, float) else a
            for a in arguments
        ]
        return getattr(self.library, f"model_{name}")(*told)

    def derivative(self, time: float, state: FloatArray, recorded: FloatArray) -> FloatArray:
        """Return the slopes of one state."""
        slope = np.empty(self.states)
        self._call("derivative", float(time), state, recorded, self.parameters, slope)
        return slope

    def start(self, time: float, deflection: float, rate: float, recorded: FloatArray) -> None:
        """Begin a motion."""
        self._call("start", self.motion, float(time), self.parameters, deflection, rate, np.ascontiguousarray(recorded))

    def step(self, length: float, *nodes: FloatArray) -> None:
        """Take one step."""
        self._call("step", self.motion, float(length), *[np.ascontiguousarray(n, float) for n in nodes])

    def read(self, time: float) -> tuple[int, FloatArray]:
        """Return whether the state was remembered no more, and the reading."""
        reading = np.empty(self.readings)
        return self._call("read", self.motion, float(time), reading), reading

    def simulate(
        self, time: FloatArray, recorded: FloatArray, deflection: float, rate: float, step: float
    ) -> tuple[int, FloatArray]:
        """Return the status and the readings, shape (r, m), for an input of shape (inputs, m)."""
        time = np.ascontiguousarray(time, float)
        rows, out = np.ascontiguousarray(np.transpose(recorded), float), np.full((time.size, self.readings), np.nan)
        status = self._call(
            "simulate", self.motion, self.parameters, float(deflection), float(rate), float(step),
            ctypes.c_size_t(time.size), time, rows, out,
        )  # fmt: skip
        return status, out.T
