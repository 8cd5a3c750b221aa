from __future__ import annotations

import json
import math

import numpy as np
import pytest
import sympy as sp
from folded import folded_t
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, stats

from discovery.declarations.effect import OSCILLATOR
from discovery.declarations.parameters import Parameter, natural_scale
from discovery.declarations.priors import Flat, HalfStudent, LogNormal, LogUniform, Normal, Prior, Student
from discovery.declarations.registry import catalogue, get_effect
from discovery.equations.lacking import candidates
from discovery.equations.model import Model
from discovery.equations.program import build_program
from discovery.foundation.errors import InputError
from discovery.mechanics import base_names, get_base

sizes = st.floats(1e-3, 1e3)
exponents = st.integers(-4, 4)


@st.composite
def models(draw: st.DrawFn) -> Model:
    base = get_base(draw(st.sampled_from(base_names())))
    allowed = candidates(Model(base.name, ()))
    effects = draw(st.lists(st.sampled_from(allowed), unique=True, max_size=6))
    model = Model(base.name, tuple(effects))
    known = draw(st.lists(st.sampled_from([*model.parameters, "nothing"]), unique=True, max_size=3))
    return Model(base.name, tuple(effects), {n: draw(st.floats(-10, 10)) for n in known if n != "nothing"})


@settings(deadline=None)
@given(models(), st.data())
def test_adding_and_removing_an_effect_are_inverse(model: Model, data: st.DataObject) -> None:
    others = [e for e in catalogue() if e not in model.effects and model.mechanics.system in get_effect(e).systems]
    added = data.draw(st.lists(st.sampled_from(others), unique=True, max_size=3))
    larger = model.with_effect(*added)
    assert larger.effects == (*model.effects, *added)
    assert larger.without(added) == model
    assert set(larger.parameters) == set(model.parameters) | {p.name for e in added for p in get_effect(e).parameters()}
    assert list(larger.parameters)[: len(model.parameters)] == list(model.parameters)


@settings(deadline=None)
@given(models())
def test_removing_everything_leaves_the_base(model: Model) -> None:
    bare = model.without(model.effects)
    assert bare.effects == ()
    assert set(bare.parameters) == {p.name for p in model.mechanics.parameters()}
    assert model.without(()) == model


@settings(deadline=None)
@given(models())
def test_a_model_survives_json(model: Model) -> None:
    copy = Model.from_dict(json.loads(json.dumps(model.to_dict())))
    assert copy == model
    assert copy.free == model.free


@settings(deadline=None)
@given(models(), st.sampled_from(("constant_radius", "reduced", "elastica", "elastica_2")))
def test_another_base_keeps_what_it_does_not_provide(model: Model, base: str) -> None:
    if model.mechanics.system != get_base(base).system:
        return
    moved = model.on_base(base)
    assert moved.base == base
    assert set(moved.effects) == set(model.effects) - get_base(base).provides
    assert moved.on_base(base) == moved
    assert moved.known == model.known


@settings(deadline=None)
@given(models())
def test_known_and_fixed_parameters_are_not_free(model: Model) -> None:
    line = model.mechanics.system == OSCILLATOR
    fixed = {n for n, p in model.parameters.items() if p.fixed or (p.planar and line)}
    assert set(model.free) == set(model.parameters) - set(model.known) - fixed
    for name in model.known:
        assert (name in model.free_parameter(name).free) == (name not in fixed)


@settings(max_examples=25, deadline=None)
@given(models())
def test_the_program_has_the_parameters_of_the_model(model: Model) -> None:
    if "linear_stiffness" not in model.effects:
        model = model.with_effect("linear_stiffness")
    assert build_program(model.base, model.effects).parameters == tuple(model.parameters)


def test_the_equation_is_the_papers() -> None:
    q, rate, acceleration, delta = sp.symbols("theta_t theta_t' theta_t'' delta", real=True)
    xi, alpha, beta = sp.symbols("xi alpha beta", real=True)
    model = Model("constant_radius", ("viscous_damping", "linear_stiffness", "cubic_stiffness", "radius_law"))
    equation = model.equation()
    assert sp.expand(equation.lhs - equation.rhs - (acceleration + xi * rate + alpha * delta + beta * delta**3)) == 0
    assert q not in equation.free_symbols
    assert Model.from_dict(json.loads(json.dumps(model.to_dict()))).equation() == equation


def test_the_equation_of_a_driven_oscillator() -> None:
    q, rate, acceleration, u, g, alpha, c_2 = sp.symbols("q q' q'' u g alpha c_2", real=True)
    equation = Model("oscillator", ("linear_stiffness", "quadratic_drag")).equation()
    drag = c_2 * rate * sp.Abs(rate)
    difference = equation.lhs - equation.rhs - (acceleration + drag + alpha * q - g * u)
    assert sp.simplify(difference.subs(sp.sqrt(rate**2), sp.Abs(rate))) == 0


def test_several_coordinates_have_no_readable_equation() -> None:
    with pytest.raises(InputError, match="no readable closed form"):
        Model("elastica", ("linear_stiffness",)).equation()


@pytest.mark.parametrize(
    ("base", "effects", "message"),
    [
        ("constant_radius", ("viscous_damping", "viscous_damping"), "viscous_damping appears twice"),
        ("oscillator", ("radius_law",), "'radius_law' acts on flexible_arm, not on oscillator"),
        ("circle", (), "no base called 'circle'; known are constant_radius"),
        ("oscillator", ("linear_stifness",), "Did you mean linear_stiffness"),
    ],
)
def test_impossible_models_are_refused(base: str, effects: tuple[str, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Model(base, effects)


def test_a_relative_effect_without_a_stiffness_is_refused() -> None:
    with pytest.raises(InputError, match=r"uses alpha, which nothing declares\. Add linear_stiffness"):
        build_program("oscillator", ("equilibrium_offset",))


# Natural units.


def unit_text(powers: dict[str, int]) -> str:
    return " ".join(f"{symbol}^{power}" for symbol, power in powers.items() if power) or "1"


@settings(deadline=None)
@given(st.fixed_dictionaries({"s": exponents, "q": exponents, "m": exponents, "rad": exponents}), sizes, sizes, sizes)
def test_natural_scale_is_the_product_of_powers(
    powers: dict[str, int], time: float, coordinate: float, length: float
) -> None:
    scale = natural_scale(unit_text(powers), time=time, coordinate=coordinate, length=length)
    expected = time ** powers["s"] * coordinate ** powers["q"] * length ** powers["m"]
    assert scale == pytest.approx(expected, rel=1e-12)


@settings(deadline=None)
@given(
    st.dictionaries(st.sampled_from("sqm"), exponents), st.dictionaries(st.sampled_from("sqm"), exponents), sizes, sizes
)
def test_natural_scale_of_a_product(a: dict[str, int], b: dict[str, int], time: float, coordinate: float) -> None:
    size = {"time": time, "coordinate": coordinate, "length": 0.7}
    both = {x: a.get(x, 0) + b.get(x, 0) for x in "sqm"}
    parts = natural_scale(unit_text(a), **size) * natural_scale(unit_text(b), **size)
    assert natural_scale(unit_text(both), **size) == pytest.approx(parts, rel=1e-12)


def test_a_unit_without_a_natural_size_is_refused() -> None:
    with pytest.raises(ValueError, match="'kg' has no natural size"):
        natural_scale("kg s^-1", time=1.0, coordinate=1.0)


# Priors.


@settings(deadline=None)
@given(st.floats(-5, 5), st.floats(0.01, 10), st.lists(st.floats(-20, 20), min_size=1, max_size=5))
def test_the_normal_prior_is_scipys(mean: float, sd: float, x: list[float]) -> None:
    np.testing.assert_allclose(Normal(mean, sd).log_density(x), stats.norm.logpdf(x, mean, sd), rtol=1e-12, atol=1e-12)


@settings(deadline=None)
@given(st.floats(0.01, 10), st.lists(st.floats(-20, 20, allow_subnormal=False), min_size=1, max_size=5))
def test_the_half_t_prior_is_scipys(scale: float, x: list[float]) -> None:
    expected = folded_t(scale).logpdf(np.array(x))
    np.testing.assert_allclose(HalfStudent(scale).log_density(x), expected, rtol=1e-12, atol=1e-12)


@settings(deadline=None)
@given(
    st.floats(0.01, 10), st.floats(0.1, 3), st.lists(st.floats(-1, 50, allow_subnormal=False), min_size=1, max_size=5)
)
def test_the_log_normal_prior_is_scipys(median: float, log_sd: float, x: list[float]) -> None:
    values = np.array(x)
    got, inside = LogNormal(median, log_sd).log_density(values), values > 1e-200
    expected = stats.lognorm.logpdf(values[inside], log_sd, scale=median)
    np.testing.assert_allclose(got[inside], expected, rtol=1e-10, atol=1e-10)
    assert (got[values <= 0] == -math.inf).all()


@pytest.mark.parametrize("prior", [Normal(0.3, 0.2), HalfStudent(0.4), Student(0.02), LogNormal(0.5, 0.6)])
def test_priors_are_normalised(prior: Prior) -> None:
    mass, _ = integrate.quad(lambda x: math.exp(prior.log_density(x)), -3.0, 400.0, points=[0.0, 0.5, 5.0], limit=200)
    assert mass == pytest.approx(1.0, abs=1e-6)


def test_an_order_of_magnitude_may_be_unknown() -> None:
    """Every factor is as likely, of either sign; the guess in the middle bounds it and is no preference."""
    prior = LogUniform(0.3, 1e4)
    x = np.array([1e-4, 0.3, 20.0, 2e3])
    np.testing.assert_allclose(prior.log_density(x), -np.log(x) - np.log(2 * np.log(1e4)))
    np.testing.assert_allclose(prior.log_density(-x), prior.log_density(x))
    assert (prior.log_density(np.array([0.0, 1e-5, 4e3])) == -np.inf).all()
    assert prior.log_sd == pytest.approx(np.std(np.linspace(-np.log(1e4), np.log(1e4), 200_001)), rel=1e-4)


def test_a_flat_prior_prefers_nothing() -> None:
    assert (Flat().log_density(np.linspace(-9, 9, 4)) == 0).all()
    assert Flat(3.0).width == 3.0


def test_a_parameter_is_a_declaration_on_the_class_and_a_symbol_on_an_instance() -> None:
    effect = get_effect("cubic_stiffness")
    assert isinstance(type(effect).beta, Parameter)
    assert effect.beta.name == "beta"
    assert effect.expression().has(effect.beta)
