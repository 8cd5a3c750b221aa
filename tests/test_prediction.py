from __future__ import annotations

from dataclasses import asdict, replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from discovery.foundation.errors import InputError
from discovery.rigs.rig import Quantity, Rig
from discovery.rigs.rig_file import read_rig
from discovery.theory.dynamic_reduction import DYNAMIC_REDUCTION
from discovery.theory.elastica.static_law import (
    DEFLECTION_MAX,
    StaticLaw,
    fitted_law,
    perpendicular_law,
    usable_deflections,
)
from discovery.theory.prediction import LAWS, MASSES, Prediction, predict

PAPER_RIG = Rig(
    name="paper",
    length=Quantity(1.0, 1e-3),
    tip_mass=Quantity(0.04376, 0.005 * 0.04376),
    beam_mass=Quantity(0.01245, 0.02 * 0.01245),
    flexural_rigidity=Quantity(31.65e9 * 3.98e-12, 0.05 * 31.65e9 * 3.98e-12),
)


def static_law(delta_max: float | None = None, deflection: object = None) -> StaticLaw:
    return fitted_law(usable_deflections(delta_max, deflection))


@pytest.fixture(scope="module")
def prediction() -> Prediction:
    return predict(PAPER_RIG, np.random.default_rng(7), delta_max=0.85)


def test_dynamic_reduction_is_lagranges_equation() -> None:
    """The tip on rho = l (1 - delta^2 / 10), driven by the elastica's force F_n = 3 delta + (13/70) delta^3."""
    t, eps, alpha = sp.symbols("t epsilon alpha")
    motor = sp.Function("theta_m")(t)
    delta = sp.Function("delta")(t)
    tip = motor + delta
    rho = 1 - delta**2 / 10
    kinetic = (sp.diff(rho, t) ** 2 + rho**2 * sp.diff(tip, t) ** 2) / 2
    force = alpha * rho * (3 * delta + sp.Rational(13, 70) * delta**3) / 3
    lagrange = sp.diff(sp.diff(kinetic, sp.diff(delta, t)), t) - sp.diff(kinetic, delta) + force
    d, d1, d2, m1, m2 = sp.symbols("d d1 d2 m1 m2")
    rates = [
        (sp.diff(delta, t, 2), d2),
        (sp.diff(motor, t, 2), m2),
        (sp.diff(delta, t), d1),
        (sp.diff(motor, t), m1),
    ]
    row = sp.expand(lagrange.doit().subs(rates).subs(delta, d))
    acceleration = sp.solve(row, d2)[0] + m2  # theta_t''
    small = {symbol: eps * symbol for symbol in (d, d1, m1, m2)}
    third = sp.expand(sp.series(acceleration.subs(small, simultaneous=True), eps, 0, 4).removeO().subs(eps, 1))
    c = DYNAMIC_REDUCTION
    terms = (
        alpha * d
        + _exact(c.beta) * alpha * d**3
        + _exact(c.c1) * d * (d1 + m1) ** 2
        + _exact(c.c2) * d * d1 * (d1 + m1)
        + _exact(c.c3) * d * d1**2
        - _exact(c.c_m) * d**2 * m2
    )
    assert sp.expand(third + terms) == 0


def test_beta_of_the_reduction() -> None:
    assert DYNAMIC_REDUCTION.beta == Fraction(64, 525)
    assert float(DYNAMIC_REDUCTION.beta) == pytest.approx(0.122, abs=5e-4)
    assert DYNAMIC_REDUCTION.effective_beta == Fraction(12, 175)


def test_motor_acceleration_term(prediction: Prediction) -> None:
    """The rod turns with the motor and bends in the shape of a tip-loaded beam."""
    s, m, rod, dm, dd = sp.symbols("s m m_r a_m a_d")
    shape = (3 * s**2 - s**3) / 2
    # Row of delta: accelerations of motor (a_m) and deflection (a_d), then a_d = a_t - a_m.
    row = m * (dm + dd) + rod * sp.integrate(shape * (s * dm + shape * dd), (s, 0, 1))
    tip = sp.symbols("a_t")
    row = sp.expand(row.subs(dd, tip - dm))
    coefficient = sp.simplify(row.coeff(dm) / row.coeff(tip))
    assert sp.simplify(coefficient - 11 * rod / (2 * (140 * m + 33 * rod))) == 0
    value = float(coefficient.subs({m: 0.04376, rod: 0.01245}))
    draws = prediction.draws["rod_counted", "dynamic"]["A"]
    assert np.mean(draws) == pytest.approx(value, abs=5 * np.std(draws) / np.sqrt(draws.size))
    assert value == pytest.approx(0.0105, abs=5e-5)
    assert np.all(prediction.draws["as_printed", "dynamic"]["A"] == 0.0)


@pytest.mark.parametrize("amplitude", [0.1, 0.2])
def test_effective_beta_gives_the_frequency_of_the_reduction(amplitude: float) -> None:
    c = DYNAMIC_REDUCTION
    rates = float(c.c1 + c.c2 + c.c3)
    reduced = _half_period(lambda d, v: -d - float(c.beta) * d**3 - rates * d * v**2, amplitude)
    cubic = _half_period(lambda d, v: -d - float(c.effective_beta) * d**3, amplitude)
    static = _half_period(lambda d, v: -d - 13.0 / 210.0 * d**3, amplitude)
    shift = abs(reduced - np.pi)
    assert abs(reduced - cubic) < 0.5 * amplitude**2 * shift
    assert abs(reduced - static) > 0.05 * shift, "the comparison can tell the two apart"


def test_published_numbers(prediction: Prediction) -> None:
    rows = {(row.mass, row.law, row.parameter): row for row in prediction.summary()}
    assert rows["as_printed", "static_small", "alpha"].q50 == pytest.approx(8.636, rel=5e-3)
    assert rows["rod_counted", "static_small", "alpha"].q50 == pytest.approx(8.09, rel=5e-3)
    fitted = static_law(0.85)
    assert fitted.cubic / fitted.stiffness == pytest.approx(0.0608, abs=1e-4)
    assert fitted.gamma == pytest.approx(0.4428, abs=1e-4)
    small = static_law(0.01)
    assert small.cubic == pytest.approx(13.0 / 210.0, rel=1e-5)
    assert small.gamma == pytest.approx(1.0 / np.sqrt(5.0), rel=1e-5)
    assert small.stiffness == pytest.approx(1.0, rel=1e-9)


def test_without_uncertainty_the_prediction_is_the_formula() -> None:
    exact = replace(
        PAPER_RIG,
        length=Quantity(0.9, 0.0),
        tip_mass=Quantity(0.05, 0.0),
        beam_mass=Quantity(0.02, 0.0),
        flexural_rigidity=Quantity(0.1, 0.0),
    )
    result = predict(exact, np.random.default_rng(0), delta_max=0.6, draws=3)
    alpha = 3.0 * 0.1 / ((0.05 + 33.0 / 140.0 * 0.02) * 0.9**3)
    draws = result.draws["rod_counted", "dynamic"]
    np.testing.assert_allclose(draws["alpha"], alpha, rtol=1e-14)
    np.testing.assert_allclose(draws["beta"], 64.0 / 525.0 * alpha, rtol=1e-14)
    assert all(row.sd == 0.0 and row.mean == row.q05 == row.q95 for row in result.summary())


@pytest.mark.parametrize("mass", MASSES)
def test_spread_follows_linear_propagation(prediction: Prediction, mass: str) -> None:
    rod = 33.0 / 140.0 * 0.01245 if mass == "rod_counted" else 0.0
    effective = 0.04376 + rod
    inertia = np.hypot(0.005 * 0.04376, 0.02 * rod) / effective
    relative = np.sqrt(0.05**2 + inertia**2 + (3 * 1e-3) ** 2)
    alpha = prediction.draws[mass, "static_small"]["alpha"]
    assert alpha.shape == (20_000,)
    assert np.std(alpha) / np.mean(alpha) == pytest.approx(relative, rel=0.03)
    assert np.all(alpha > 0.0)


def test_a_wide_rig_still_has_positive_draws() -> None:
    wide = replace(PAPER_RIG, flexural_rigidity=Quantity(0.1, 0.08))
    alpha = predict(wide, np.random.default_rng(3), draws=50_000).draws["as_printed", "static_small"]["alpha"]
    assert np.all(alpha > 0.0)
    expected = 3.0 * 0.1 / 0.04376
    assert np.mean(alpha) == pytest.approx(expected, rel=0.02)
    assert np.std(alpha) == pytest.approx(0.8 * expected, rel=0.05)


def test_same_seed_same_prediction_and_all_variants(prediction: Prediction) -> None:
    again = predict(PAPER_RIG, np.random.default_rng(7), delta_max=0.85)
    assert set(again.draws) == {(mass, law) for mass in MASSES for law in LAWS}
    assert again.summary() == prediction.summary()
    bare = predict(PAPER_RIG, np.random.default_rng(7))
    assert bare.delta_max is None
    assert not any(law == "static_least_squares" for _, law in bare.draws)


def test_recorded_deflections_weigh_the_static_law() -> None:
    grid = np.linspace(0.0, 0.85, 401)
    signed = np.concatenate([grid, -grid, [np.nan, 1.2]])
    assert static_law(0.85, signed).gamma == pytest.approx(static_law(0.85).gamma, rel=1e-9)
    assert static_law(0.85, signed).cubic == pytest.approx(static_law(0.85).cubic, rel=1e-9)
    # A decaying recording dwells at small deflections, where the law is the small one.
    decay = 0.85 * np.exp(-np.linspace(0.0, 8.0, 2000)) * np.cos(np.linspace(0.0, 100.0, 2000))
    assert static_law(0.85).gamma < static_law(deflection=decay).gamma < 1.0 / np.sqrt(5.0)
    result = predict(PAPER_RIG, np.random.default_rng(0), deflection=signed[:-1], draws=10)
    assert result.delta_max == pytest.approx(0.85)


def test_comparison_counts_standard_deviations(prediction: Prediction) -> None:
    rng = np.random.default_rng(11)
    predicted = prediction.draws["as_printed", "dynamic"]
    spread = np.std(predicted["alpha"], ddof=1)
    alpha = np.mean(predicted["alpha"]) + 2.0 * np.sqrt(2.0) * spread + spread * _standard(rng, 5000)
    posterior = {"xi": rng.normal(size=5000), "alpha": alpha, "beta": 0.06 * alpha, "gamma": np.full(5000, 0.45)}
    rows = {(row.mass, row.law, row.parameter): row for row in prediction.compare(posterior)}
    row = rows["as_printed", "dynamic", "alpha"]
    assert row.discrepancy == pytest.approx(2.0, abs=1e-6)
    assert row.difference == pytest.approx(row.posterior_mean - row.predicted_mean)
    assert row.unit == "s^-2"
    assert rows["as_printed", "dynamic", "beta/alpha"].difference == pytest.approx(0.06 - 64.0 / 525.0)
    assert rows["as_printed", "dynamic", "gamma"].discrepancy == np.inf
    assert {parameter for _, _, parameter in rows} == {"alpha", "beta", "beta/alpha", "gamma"}
    assert set(asdict(row)) >= {"mass", "law", "parameter", "posterior_mean", "predicted_mean", "discrepancy"}


def test_comparison_with_itself_is_zero(prediction: Prediction) -> None:
    draws = prediction.draws["rod_counted", "static_least_squares"]
    for row in prediction.compare(draws):
        if (row.mass, row.law) == ("rod_counted", "static_least_squares"):
            assert row.discrepancy == pytest.approx(0.0, abs=1e-12)


def test_laws_for_drawing() -> None:
    delta = np.linspace(-0.3, 0.3, 61)
    force, rho = perpendicular_law(delta)
    np.testing.assert_allclose(force / 3.0, delta + 13.0 / 210.0 * delta**3, atol=6e-5)
    np.testing.assert_allclose(rho * force / 3.0, delta + (13.0 / 210.0 - 0.1) * delta**3, atol=6e-5)
    np.testing.assert_allclose(rho, 1.0 - delta**2 / 10.0, atol=6e-5)
    np.testing.assert_allclose(rho, np.cos(delta / np.sqrt(5.0)), atol=6e-5)


def test_prediction_from_a_rig_file(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    text = 'name = "arm"\nlength_m = 1.0\ntip_mass_kg = 0.04376\nbeam_mass_kg = 0.01245\n'
    path.write_text(text + "flexural_rigidity_N_m2 = 0.12597\n", encoding="utf-8")
    alpha = predict(read_rig(path), np.random.default_rng(0)).draws["as_printed", "static_small"]["alpha"]
    assert np.std(alpha) / np.mean(alpha) == pytest.approx(0.0503, rel=0.03)
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="does not state flexural_rigidity"):
        predict(read_rig(path), np.random.default_rng(0))


def test_refusals(prediction: Prediction) -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match=r"'paper'.*does not state tip_mass, beam_mass"):
        predict(replace(PAPER_RIG, tip_mass=None, beam_mass=None), rng)
    with pytest.raises(InputError, match="`delta_max` is a number, but it is nan"):
        predict(PAPER_RIG, rng, delta_max=np.nan)
    for delta_max in (DEFLECTION_MAX + 0.01, 0.0):
        with pytest.raises(InputError, match="deflections that reach between"):
            predict(PAPER_RIG, rng, delta_max=delta_max)
    with pytest.raises(InputError, match="got none"):
        static_law(deflection=[np.nan])
    with pytest.raises(InputError, match="needs the largest deflection"):
        static_law()
    with pytest.raises(InputError, match=r"None of the posterior's parameters \(xi\)"):
        prediction.compare({"xi": np.ones(3)})
    with pytest.raises(InputError, match="alpha are empty or not finite"):
        prediction.compare({"alpha": [1.0, np.nan]})
    with pytest.raises(InputError, match="must be paired"):
        prediction.compare({"alpha": [1.0, 2.0], "beta": [1.0]})


def _exact(number: Fraction) -> sp.Rational:
    return sp.Rational(number.numerator, number.denominator)


def _standard(rng: np.random.Generator, size: int) -> np.ndarray:
    values = rng.normal(size=size)
    return (values - np.mean(values)) / np.std(values, ddof=1)


def _half_period(acceleration, amplitude: float) -> float:
    """Time from one turning point to the next."""

    def turning(_: float, y: np.ndarray) -> float:
        return y[1]

    turning.direction = 1.0
    path = solve_ivp(
        lambda _, y: [y[1], acceleration(*y)],
        (0.0, 5.0),
        [amplitude, 0.0],
        method="DOP853",
        rtol=1e-12,
        atol=1e-14,
        events=turning,
    )
    return float(path.t_events[0][-1])
