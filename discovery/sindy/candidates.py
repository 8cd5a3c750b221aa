"""Named candidate terms f_j of the equation of motion, from pysindy's feature libraries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pysindy

from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.signals.motion import Motion, State

#: Highest degree of the polynomials in the deflection and the rate.
_DEGREE = 5
Family = Literal["polynomial", "trigonometric", "dissipative", "input"]


def _effects(position: str, rate: str) -> dict[str, str]:
    """Ids of the effects that single terms stand for."""
    return {
        "1": "equilibrium_offset",
        position: "linear_stiffness",
        f"{position}^2": "quadratic_stiffness",
        f"{position}^3": "cubic_stiffness",
        f"{position}^5": "quintic_stiffness",
        rate: "viscous_damping",
        f"{rate}|{rate}|": "quadratic_drag",
        f"sign({rate})": "coulomb_friction",
        f"{position}^2 {rate}": "amplitude_dependent_damping",
        "delta'": "structural_damping",
    }


@dataclass(frozen=True)
class Term:
    """One candidate f_j of the equation."""

    name: str  # as a reader writes it, such as ``delta^2 theta_t'``
    effect: str | None  # id of the effect that it stands for, where there is one
    family: Family  # "polynomial", "trigonometric", "dissipative" (not smooth in the rate) or "input"
    #: Degree of a polynomial, two for a term that is not smooth or an input; a trigonometric term counts more than any
    #: polynomial of the library.
    complexity: int


def _family(name: str, position: str) -> Family:
    if name == "u":
        return "input"
    if "|" in name or name.startswith("sign"):
        return "dissipative"
    return "trigonometric" if f"({position})" in name or f"(2 {position})" in name else "polynomial"


class Candidates:
    """The candidate terms of one kind of system, built from pysindy's feature libraries.

    An arm's coordinate is an angle: sin and cos of it and of twice as much are offered, too. Where its base rests, its
    delta' is theta_t' and is not offered beside it.

    Raises InputError without recordings, or with recordings of different kinds.
    """

    def __init__(self, motions: Sequence[Motion], *, at_rest: bool) -> None:
        if len({motion.kind for motion in motions}) != 1:
            raise InputError("SINDy needs one or more recordings of one kind of system.")
        arm = motions[0].system.has_rod
        driven = all(motion.drive is not None for motion in motions) and not (arm and at_rest)
        position, rate = ("delta", "theta_t'") if arm else ("q", "q'")
        # The sign of a rate is graded where the rate is not known better than that.
        width = 3.0 * float(np.median(np.concatenate([motion.coordinate.sd[1] for motion in motions])))
        parts = [
            (pysindy.PolynomialLibrary(degree=_DEGREE), [0, 1]),
            (
                pysindy.CustomLibrary(
                    [lambda v: v * np.abs(v), lambda v: np.tanh(v / width)],
                    [lambda v: f"{v}|{v}|", lambda v: f"sign({v})"],
                ),
                [1],
            ),
        ]
        if arm:
            functions = [lambda x: np.sin(x), lambda x: np.sin(2.0 * x), lambda x: np.cos(x), lambda x: np.cos(2.0 * x)]
            labels = [lambda x: f"sin({x})", lambda x: f"sin(2 {x})", lambda x: f"cos({x})", lambda x: f"cos(2 {x})"]
            parts.append((pysindy.CustomLibrary(functions, labels), [0]))
        self.inputs = [position, rate]
        if driven:  # the base moves an arm's delta' away from theta_t'; an oscillator's input is a term by itself
            parts.append((pysindy.IdentityLibrary(), [2]))
            self.inputs.append("delta'" if arm else "u")
        self.features = pysindy.GeneralizedLibrary([p for p, _ in parts], inputs_per_library=[i for _, i in parts])
        self.features.fit(np.zeros((2, len(self.inputs))))
        effects = _effects(position, rate)
        terms = []
        for name in self.features.get_feature_names(self.inputs):
            family = _family(name, position)
            complexity = _DEGREE + 1 if family == "trigonometric" else 2
            if family == "polynomial":
                complexity = 0 if name == "1" else sum(int(f.partition("^")[2] or 1) for f in name.split())
            terms.append(Term(name, effects.get(name), family, complexity))
        self.terms = tuple(terms)

    def inputs_of(self, state: State) -> FloatArray:
        """Columns (n, 2 or 3) that the feature library takes."""
        columns = [state.delta, state.q_dot]
        if len(self.inputs) == 3:
            columns.append(state.delta_dot if state.input is None else state.input)
        return np.column_stack(columns)

    def evaluate(self, state: State) -> FloatArray:
        """Candidates at a state, shape (n, p), with the sign that they have beside the acceleration."""
        columns = np.asarray(self.features.transform(self.inputs_of(state)))
        return columns * np.array([1.0 if term.family == "input" else -1.0 for term in self.terms])

    def nearest_oscillator(self, motions: Sequence[Motion]) -> tuple[float, float]:
        """Stiffness [1/s^2] and damping [1/s], none negative, of the linear oscillator nearest to the motion."""
        states = [motion.state(motion.coordinate.time) for motion in motions]
        design = np.vstack([np.column_stack([-self.inputs_of(s)[:, :2], np.ones(s.q.size)]) for s in states])
        if self.inputs[-1] == "u":
            design = np.column_stack([design, np.concatenate([self.inputs_of(s)[:, 2] for s in states])])
        solution = np.linalg.lstsq(design, np.concatenate([s.q_ddot for s in states]), rcond=None)[0]
        return max(float(solution[0]), 0.0), max(float(solution[1]), 0.0)
