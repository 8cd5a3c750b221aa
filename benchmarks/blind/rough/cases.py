"""Draw, size and write a rough case with its sealed truth."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.blind.rough.ingredient import Action, Ingredient, log_uniform
from benchmarks.blind.rough.plan import kind_and_system
from benchmarks.blind.rough.refit import Wanted, check_readable, clean_reading, prediction_error
from benchmarks.blind.rough.sizes import RATIO, Errors, Sizer, draw_errors
from benchmarks.blind.rough.subject import Subject, save

#: Effects that are tried for one whose size comes near to the wanted one.
_TRIALS = 4
_ENOUGH = 0.7


@dataclass(frozen=True)
class Chosen:
    """The hidden effect or outsider at its strength, and its size alone; none where nothing is hidden."""

    ingredient: Ingredient
    strength: float
    size: float


def draw_subject(system: str, seed: tuple[int, ...]) -> Subject:
    """Draw an arm or a body."""
    if system == "arm":
        from benchmarks.blind.rough.arms import draw_arm

        return draw_arm(seed)
    from benchmarks.blind.rough.bodies import draw_body

    return draw_body(system, seed)


def _hide(subject: Subject, sizer: Sizer, kind: str, target: float, rng: np.random.Generator) -> Chosen | None:
    """Choose what is hidden: of a few drawn effects the first that comes near to the wanted size, or the nearest."""
    if kind == "none":
        return None
    found: list[Chosen] = []
    for name in rng.permutation(subject.effects(kind))[:_TRIALS]:
        ingredient = subject.effect(str(name), rng)
        found.append(Chosen(ingredient, *sizer.settle("hidden", ingredient, target)))
        if found[-1].size >= _ENOUGH * target:
            return found[-1]
    return max(found, key=lambda c: c.size)


def _clean(subject: Subject, actions: Mapping[str, Action], folder: Path) -> pd.DataFrame:
    """Noise-free hold-out: of an arm as its camera would have it, of a body as the program reads it."""
    frame = subject.frame("holdout", actions, scatter=False)
    if subject.system == "arm":
        return frame
    save(frame, folder / "silent.csv")
    return clean_reading(folder / "rig.toml", folder / "silent.csv")


def _truth_error(subject: Subject, case: Path, chosen: Chosen | None, clean: pd.DataFrame) -> float | None:
    """What the true model, fitted to the training recordings, leaves of the noise-free hold-out; None for outsiders.

    None, too, where its fit fails.
    """
    if chosen is not None and chosen.ingredient.catalogue is None:
        return None
    added = () if chosen is None else (chosen.ingredient.accepted[0],)
    values = {} if chosen is None else chosen.ingredient.catalogue(chosen.strength)
    wanted = Wanted(added, {**subject.starts(), **values}, subject.known())
    train = sorted(case.glob("train*.csv"))
    from discovery.foundation.errors import ComputationError, InputError

    try:
        return prediction_error(case, train, wanted, clean)
    except (ComputationError, InputError, ArithmeticError):
        return None


def _hidden_row(chosen: Chosen) -> dict[str, Any]:
    """What the truth says of the hidden effect."""
    i = chosen.ingredient
    values = {} if i.catalogue is None else dict(i.catalogue(chosen.strength))
    return {
        "id": i.id,
        "family": i.family,
        "accepted": list(i.accepted),
        "strength": chosen.strength,
        "shape": dict(i.shape),
        "catalogue": values if i.exact else {},
        "near": {} if i.exact else values,
        "unabsorbed_over_noise": chosen.size,
    }


def _error_rows(errors: Errors) -> list[dict[str, Any]]:
    """What the truth says of the errors of the model."""
    rows = zip(errors.ingredients, errors.strengths, errors.sizes, strict=True)
    return [
        {"id": i.id, "strength": s, "over_noise": u, "resembles": list(i.resembles), "shape": dict(i.shape)}
        for i, s, u in rows
    ]


def write_case(out: Path, name: str, seed: int, index: int) -> dict[str, Any]:
    """Write one case and return its truth; a case that is there already is kept."""
    sealed = out / "truth" / f"{name}.json"
    if sealed.exists():
        return json.loads(sealed.read_text())
    kind, system = kind_and_system(seed, index)
    # Other arms than those of the exact world with the same seed.
    subject = draw_subject(system, (seed, index, 3))
    rng = np.random.default_rng([seed, index, 2])
    sizer = Sizer(subject)
    errors = draw_errors(subject, sizer, rng)
    chosen = _hide(subject, sizer, kind, log_uniform(rng, *RATIO) * errors.joint, rng)
    actions = {**errors.actions}
    if chosen is not None:
        actions["hidden"] = chosen.ingredient.act(chosen.strength)
    with TemporaryDirectory() as scratch:
        subject.write(Path(scratch), name, actions, noise=True)
        # A case that nobody can read is none; it leaves nothing behind.
        check_readable(Path(scratch))
        clean = _clean(subject, actions, Path(scratch))
    case = out / "cases" / name
    case.mkdir(parents=True, exist_ok=True)
    subject.write(case, name, actions, noise=True)
    (out / "truth").mkdir(exist_ok=True)
    save(clean, out / "truth" / f"{name}_holdout_clean.csv")
    truth = _truth(name, kind, subject, chosen, errors, sizer)
    truth["reach"] = {stem: subject.readings(stem, list(actions.values())).reach for stem in subject.stems}
    left = _truth_error(subject, case, chosen, clean)
    truth |= {"truth_error": left, "truth_error_over_noise": None if left is None else left / subject.noise}
    draft = sealed.with_suffix(".part")
    draft.write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")
    os.replace(draft, sealed)
    return truth


def _truth(
    name: str, kind: str, subject: Subject, chosen: Chosen | None, errors: Errors, sizer: Sizer
) -> dict[str, Any]:
    """What is sealed, but for the errors of predictions."""
    return {
        "case": name,
        "world": "rough",
        "system": subject.system,
        "kind": kind,
        "effects": [] if chosen is None else [_hidden_row(chosen)],
        "unabsorbed_over_noise": 0.0 if chosen is None else chosen.size,
        "model_error_over_noise": errors.joint,
        "model_errors": _error_rows(errors),
        "geometry_over_noise": sizer.geometry,
        "noise": subject.noise,
        "unit": subject.unit,
        "rate_hz": round(float(1 / np.median(np.diff(subject.time))), 6),
        "duration": subject.duration,
        **subject.describe(),
    }
