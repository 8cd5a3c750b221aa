from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from discovery_datasets.cases import draw_rig
from discovery_datasets.disturbances import PositionScale
from discovery_datasets.manoeuvres import trapezoid
from discovery_datasets.quick_effects import BaseCompliance
from discovery_datasets.twin import PAPER_RIG, ArmRig
from pendulum import swing
from scipy.integrate import trapezoid as trapezoid_rule
from synthetic_run import write_arm_run
from twin_arm import BASE, EFFECTS, fitted, recorded, rig_file

from discovery.diagnosis.contradiction import (
    WIDE,
    Check,
    Contradiction,
    ContradictionReport,
    _check,
    check_contradictions,
)
from discovery.diagnosis.reconciliation import Reconciliation
from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.declared import declared_model, rig_uncertainty
from discovery.estimation.fit import Fit, fit
from discovery.estimation.holdout import HoldOut
from discovery.estimation.natural_units import natural_units
from discovery.estimation.problem import known_values
from discovery.recordings.dataset import load_dataset
from discovery.report import build_report
from discovery.report.contradiction_sentences import contradiction_sentences
from discovery.rigs.rig import Quantity, Rig
from discovery.selection.context import Context
from discovery.selection.settings import LoopSettings

CANDIDATES = tuple(e for e in EFFECTS if e not in BASE)
RIGIDITY = PAPER_RIG.flexural_rigidity
#: Gentle, and a poor camera: what the clamp does to the radius hardly shows.
SLOW = trapezoid(0.5, 0.4)


def check(fitted_model: Fit, candidates: tuple[str, ...] | None = CANDIDATES) -> ContradictionReport:
    experiments, settings = fitted_model.problem.bench.experiments, LoopSettings()
    units = natural_units(experiments)
    judge = HoldOut(experiments, (), units, settings.tolerance)
    context = Context(experiments, judge, settings, units, lambda _: None)
    return check_contradictions(fitted_model, np.random.default_rng(0), candidates=candidates, context=context)


def said(found: Contradiction) -> str:
    (sentence,) = contradiction_sentences(ContradictionReport((found.check,), (found,)).summary())
    return sentence


# The tests and their probabilities.


def numbers(value: float) -> Check:
    return _check("alpha", "s^-2", (value, 0.6), (0.0, 0.8), "the rig")


def evidence(value: float, sd: float, width: float) -> float:
    """Return the log evidence of a reading under a Gaussian prior about zero, by quadrature."""
    grid = np.linspace(-12 * width, 12 * width, 400_001)
    density = np.exp(-0.5 * (grid / width) ** 2 - 0.5 * ((value - grid) / sd) ** 2) / (2 * math.pi * sd * width)
    return math.log(float(trapezoid_rule(density, grid)))


@pytest.mark.parametrize("value", [0.0, 1.0, 3.0, 5.0])
def test_the_odds_are_the_evidence_that_a_wider_prior_gains(value: float) -> None:
    wide, narrow = (evidence(value, 0.6, 0.8 * factor) for factor in (WIDE, 1.0))
    assert numbers(value).odds == pytest.approx(wide - narrow, abs=1e-6)


def test_what_is_stated_three_sds_off_contradicts_nothing_and_four_do() -> None:
    odds = [numbers(z).odds > LoopSettings().nats for z in (0.0, 3.0, -3.0, 4.0, -4.0)]
    assert odds == [False, False, False, True, True]
    # The combined standard deviation is one.
    assert numbers(4.0).z == pytest.approx(4.0)


def test_several_effects_that_reconcile_are_all_named() -> None:
    def tried(effect: str, reconciles: bool) -> Reconciliation:
        return Reconciliation(effect, {}, 0.1, 0.1, 100.0, 1.5, reconciles)

    both = Contradiction(numbers(6.0), (tried("base_compliance", True), tried("base_backlash", True)))
    assert both.reconciling == ("base_compliance", "base_backlash")
    assert "base_compliance reconciles them, 1.5 nats against an error of the rig file" in said(both)
    assert said(both).endswith("so would base_backlash.")
    none = Contradiction(numbers(6.0), (Reconciliation("time_base_error", {}, 0.1, 9.0, 100.0, -56.2, False),))
    assert none.reconciling == ()
    assert "no effect of the catalogue reconciles them. Is the rig" in said(none)
    near = Contradiction(numbers(6.0), (Reconciliation("time_base_error", {}, 0.1, 0.1, 100.0, -56.2, False),))
    assert "; the nearest is time_base_error, 56 nats less likely than an error of the rig file." in said(near)


def with_rig(found: Fit, rig: Rig) -> Fit:
    """Return the same fit as if the rig file had stated something else."""
    experiment = replace(found.problem.bench.experiments[0], rig=rig)
    bench = object.__new__(Bench)
    bench.__dict__.update({**found.problem.bench.__dict__, "experiments": (experiment,)})
    return replace(found, problem=replace(found.problem, bench=bench))


def test_nothing_is_predicted_for_an_oscillator() -> None:
    assert check(with_rig(exact("clean"), Rig("o", "oscillator"))) == ContradictionReport((), ())


def test_where_nothing_is_sought_the_sentence_says_so() -> None:
    contradiction = Contradiction(numbers(6.0), (), sought=False)
    assert "no effect is sought" in said(contradiction)
    assert "of the catalogue" not in said(contradiction)
    found = check(exact("compliance"), ()).contradictions
    assert [c.sought for c in found] == [False] * len(found)
    assert found


# Clean arms.


def stated(rig: ArmRig, rng: np.random.Generator) -> Rig:
    """Return what an experimenter would state of an arm: every quantity off by its own uncertainty."""

    def drawn(value: float, spread: float) -> Quantity:
        return Quantity(value * (1 + spread * rng.standard_normal()), spread * value)

    return rig_file(
        rig,
        length=drawn(rig.length, 1e-3),
        tip_mass=drawn(rig.tip_mass, 5e-3),
        beam_mass=drawn(rig.beam_mass, 2e-2),
        flexural_rigidity=drawn(rig.flexural_rigidity, 3e-2),
    )


@pytest.mark.parametrize("seed", [*range(2), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 20))])
def test_a_clean_arm_contradicts_nothing(seed: int) -> None:
    rng = np.random.default_rng([7, seed])
    rig = draw_rig(rng)
    omega = np.sqrt(3 * rig.flexural_rigidity / (rig.effective_mass * rig.length**3))
    manoeuvre = trapezoid(rng.uniform(0.6, 1.2), rng.uniform(0.3, 1.0) * omega / 2.2, start=0.3)
    e = recorded(manoeuvre, rig=rig, stated=stated(rig, rng), duration=8 * np.pi / omega, rate=40, seed=seed)
    length = e.rig.length
    assert length is not None
    gaussian = {**rig_uncertainty(e), "length": (length.value, length.sd)}
    model, units = Model("elastica", BASE, known_values(e)), natural_units([e])
    found = check(fit(model, [e], units=units, gaussian=gaussian, tolerance=2e-5), ())
    assert [c.parameter for c in found.checks] == ["mu", "length", "alpha"]
    assert found.contradictions == ()


# Effects that hide in a parameter.


@cache
def exact(which: str) -> Fit:
    """Fit the bare exact arm to a recording in which something hides in one of its parameters."""
    noise = 1e-3
    if which == "compliance":
        e = recorded(SLOW, BaseCompliance(RIGIDITY / 0.05), stated=rig_file(noise=noise), duration=8, rate=50, seed=1)
        return fitted([e])
    if which == "scale":
        loose = rig_file(length=Quantity(1.0, 0.004))
        e = recorded(trapezoid(1.0, 0.7), PositionScale(0.02), stated=loose, duration=8, rate=50, seed=1)
        return fitted([e], gaussian={"length": (1.0, 0.02)})
    rig = replace(PAPER_RIG, beam_mass=1.2 * PAPER_RIG.beam_mass) if which == "mass" else PAPER_RIG
    return fitted([recorded(trapezoid(1.0, 1.2), rig=rig, stated=rig_file(), duration=8, rate=50, seed=1)])


def test_a_clean_arm_of_the_paper_is_what_the_rig_predicts() -> None:
    found = check(exact("clean"))
    assert found.contradictions == ()
    values = {c.parameter: c for c in found.checks}
    assert values["alpha"].value == pytest.approx(values["alpha"].predicted, rel=2e-3)
    assert values["alpha"].predicted_sd / values["alpha"].predicted == pytest.approx(
        math.hypot(0.02, 3e-3, 5e-3 * 0.94, 2e-2 * 0.06), rel=0.05
    )
    assert abs(values["mu"].z) < 2
    # The rig says so little beside the recording that it hardly matters whether it is heard.
    assert values["mu"].sd == pytest.approx(exact("clean").sd["mu"], rel=0.05)


def test_a_compliant_base_hides_in_alpha_and_is_named() -> None:
    before = exact("compliance")
    (found,) = check(before).contradictions
    assert found.check.parameter == "alpha"
    # A small motion is slower by 1 + 3 c_b.
    assert found.check.value == pytest.approx(found.check.predicted / 1.15, rel=0.01)
    assert found.check.z < -5
    assert found.reconciling == ("base_compliance",)
    best = found.tried[0]
    value, sd = best.parameters["c_b"]
    assert abs(value - 0.05) < 4 * sd
    assert sd < 0.005
    assert abs(best.z) < 2
    assert best.odds > 30
    assert best.chi2 < before.chi2 + 40


def test_a_camera_s_scale_hides_in_the_length_and_is_named() -> None:
    (found,) = check(exact("scale")).contradictions
    assert found.check.parameter == "length"
    assert found.check.value == pytest.approx(1.02, abs=1e-4)
    assert found.check.z == pytest.approx(0.02 / 0.004, rel=0.02)
    assert found.reconciling == ("position_scale",)
    value, sd = found.tried[0].parameters["s"]
    assert value == pytest.approx(0.02, abs=2e-3)
    # Only the rig tells the scale from the length.
    assert sd == pytest.approx(0.004, rel=0.2)
    assert found.tried[0].odds > -3


def test_a_wrong_mass_in_the_rig_file_is_no_effect() -> None:
    (found,) = check(exact("mass")).contradictions
    assert found.check.parameter == "mu"
    assert found.check.value == pytest.approx(1.2 * 0.01245 / 0.04376, rel=0.01)
    assert found.reconciling == ()
    assert "no effect of the catalogue" in said(found)


def test_the_report_is_plain_json() -> None:
    report = check(exact("compliance"))
    summary = json.loads(json.dumps(report.summary(), allow_nan=False))
    assert [c["parameter"] for c in summary["checks"] if c["contradicts"]] == ["alpha"]
    (found,) = summary["contradictions"]
    assert found["reconciling"] == ["base_compliance"]
    assert found["tried"][0]["parameters"]["c_b"]["unit"] == "1"


@pytest.mark.usefixtures("undrawn")
def test_the_report_shows_what_was_tested(tmp_path: Path) -> None:
    results = write_arm_run(tmp_path)
    report = check(exact("compliance"))
    results["loop"]["contradiction"] = report.summary()
    (tmp_path / "results.json").write_text(json.dumps(results), encoding="utf-8")
    page = build_report(tmp_path).read_text(encoding="utf-8")
    assert "Does the model contradict the rig?" in page
    assert "base compliance" in page
    table = pd.read_csv(tmp_path / "tables" / "contradictions.csv").set_index("parameter")
    assert table.loc["alpha", "reconciled_by"] == "base_compliance"
    assert table.loc["alpha", "z"] == report.contradictions[0].check.z


@pytest.mark.parametrize(("metres", "contradicts"), [(9.80665 / 30, False), (9.80665 / 30 * 1.02, True)])
def test_the_pull_on_a_pendulum_is_compared_with_its_length(tmp_path: Path, metres: float, contradicts: bool) -> None:
    length = f"length_m = {{ value = {metres:.6f}, sd = 0.001 }}"
    rig, recording, _ = swing(tmp_path, lambda v: 0.05 * v, release=0.8, duration=20.0, length=length)
    data = load_dataset(rig, [recording], keep_third=False)
    report = check(fit(declared_model(data.train[0]), data.train), None)
    (found,) = report.checks
    assert found.parameter == "k_g"
    assert found.value == pytest.approx(30.0, rel=1e-3)
    assert found.predicted == pytest.approx(9.80665 / metres, rel=1e-5)
    assert len(report.contradictions) == contradicts
    assert all("no effect of the catalogue reconciles" in said(c) for c in report.contradictions)


def sprung(folder: Path, release: float):
    """Return a swing of a pendulum of 0.6 m with a spring at its pivot, which a small swing takes for gravity."""
    rig, recording, _ = swing(
        folder, lambda v: 0.05 * v, release=release, duration=30.0, strength=9.80665 / 0.6,
        length="length_m = { value = 0.6, sd = 0.003 }", restoring=lambda angle: 4.0 * angle,
    )  # fmt: skip
    return load_dataset(rig, [recording], keep_third=False).train


def test_a_spring_that_gravity_hides_is_named_by_the_length_of_a_pendulum(tmp_path: Path) -> None:
    train = sprung(tmp_path, 0.05)
    (found,) = check(fit(declared_model(train[0]), train), None).contradictions
    assert found.reconciling[0] == "linear_stiffness"
    stiffness, sd = found.tried[0].parameters["alpha"]
    assert abs(stiffness - 4.0) < 3 * sd


def test_gravity_that_pushes_a_pendulum_up_has_its_sign(tmp_path: Path) -> None:
    """A spring beside it that takes the part of a cubic one leaves gravity the wrong way round."""
    rig, recording, _ = swing(
        tmp_path, lambda v: 0.05 * v, release=0.85, duration=30.0, strength=31.0,
        length=f"length_m = {9.80665 / 31.0:.6f}", restoring=lambda angle: 14.0 * angle**3,
    )  # fmt: skip
    train = load_dataset(rig, [recording], keep_third=False).train
    (found,) = check(fit(declared_model(train[0]).with_effect("linear_stiffness"), train), None).contradictions
    assert found.check.value == pytest.approx(-56.0, rel=0.1)
    assert found.check.predicted == pytest.approx(31.0, rel=1e-3)


def test_gravity_is_found_in_the_smallest_swing(tmp_path: Path) -> None:
    rig, recording, _ = swing(tmp_path, lambda v: 0.05 * v, release=0.01, strength=9.80665 / 0.6, noise=1e-5)
    train = load_dataset(rig, [recording], keep_third=False).train
    found = fit(declared_model(train[0]), train)
    assert found.values["g_c"] == pytest.approx(9.80665 / 0.6, rel=1e-4)
    assert found.reduced_chi2 < 1.1


def test_a_pull_that_is_not_known_contradicts_nothing(tmp_path: Path) -> None:
    """Beside a spring, a small swing gives gravity no standard deviation, which is not one of zero."""
    train = sprung(tmp_path, 0.05)
    found = fit(declared_model(train[0]), train)
    unknown = replace(found, reasons={"g_c": "at its bound"}, covariance=np.full_like(found.covariance, np.nan))
    assert check(unknown).checks == ()
