"""Linear models: tangents of the kernel's motion, describing functions, discrete time, intervals."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm
from test_cli import call
from test_export import BASES, everything, module, some_values, with_stiffness

from discovery.equations.model import Model
from discovery.export import FittedModel, discretise, linear_to_python, linearise, read_draws, to_numpy
from discovery.foundation.errors import InputError

RNG = np.random.default_rng(5)


def deviation(model: Model, values: dict[str, float], point, push: float, time: np.ndarray) -> np.ndarray:
    """Return how far the numpy file's readings move for a small push of the input, held from the start."""
    simulate = module(to_numpy(model, values))["simulate"]
    moves = model.mechanics.input_moves
    u = (0.5 * push * time**2, push * time, np.full_like(time, push)) if moves else (np.full_like(time, push),)
    still = tuple(0.0 * v for v in u)
    deflection, rate = point
    far = simulate(time, *u, deflection=deflection, rate=rate, step=1e-3)
    return far - simulate(time, *still, deflection=deflection, rate=rate, step=1e-3)


@pytest.mark.parametrize(
    "base",
    [
        *("oscillator", "accelerometer", "base_excited", "constant_radius"),
        *(pytest.param(base, marks=pytest.mark.slow) for base in ("reduced", "elastica_2")),
    ],
)
def test_a_small_push_moves_the_reading_as_the_linear_model_says(base: str) -> None:
    model = with_stiffness(base, "viscous_damping", "viscoelastic_relaxation")
    values = some_values(model)
    found = linearise(model, values)
    time, push = np.linspace(0.0, 1.0, 201), 1e-5
    expected = deviation(model, values, (0.0, 0.0), push, time)
    state = [expm(np.block([[found.a, found.b], [np.zeros((1, found.a.shape[0] + 1))]]) * t)[:-1, -1] for t in time]
    got = push * (found.c @ np.transpose(state) + found.d)
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-4 * np.abs(expected).max())
    assert found.warnings == ()


@pytest.mark.parametrize(
    "base", [pytest.param(b, marks=pytest.mark.slow) if b == "reduced" else b for b in BASES if b != "elastica"]
)
def test_every_base_with_all_effects_is_linearised(base: str) -> None:
    model, values, namespace = everything(base)
    found = linearise(FittedModel(model, values), deflection=0.2, speed=0.5)
    inputs = (np.zeros(3) if model.mechanics.input_moves else np.zeros(1)).tolist()
    n = found.a.shape[0] - 2 * model.mechanics.input_moves
    state = np.array([found.point[y] for y in found.states[:n]])
    slopes = namespace["derivative"](0.0, state, *inputs)
    np.testing.assert_allclose(found.drift[:n], slopes, rtol=1e-9, atol=1e-9)
    way = RNG.normal(size=n) * 1e-6
    near = (namespace["derivative"](0.0, state + way, *inputs) - namespace["derivative"](0.0, state - way, *inputs)) / 2
    np.testing.assert_allclose(found.a[:n, :n] @ way, near, rtol=1e-2, atol=1e-3 * np.abs(near).max() + 1e-12)


def test_the_equilibrium_is_found() -> None:
    model = with_stiffness("oscillator", "constant_force", "cubic_stiffness")
    values = {**some_values(model), "alpha": 4.0, "beta": 3.0, "g": 1.3}
    found = linearise(model, values, held=0.7)
    q = found.point[found.states[0]]
    np.testing.assert_allclose(found.drift, 0.0, atol=1e-9)
    assert found.point["u"] == 0.7
    assert abs(q) > 0.01
    np.testing.assert_allclose(found.a[1, 0], -4.0 - 9.0 * q**2, rtol=1e-6)
    with pytest.raises(InputError, match="no equilibrium near rest"):
        linearise(Model("falling_body", ()), {"g_0": 9.81})


def test_friction_is_that_at_a_speed_or_of_a_cycle() -> None:
    """Dry friction of a sinusoid: 4 f_c / (pi a w), Gelb and Vander Velde, table B.1 (2)."""
    model = with_stiffness("oscillator", "viscous_damping", "coulomb_friction")
    values = {"alpha": 9.0, "g": 1.0, "xi": 0.1, "f_c": 0.05, "v_c": 1e-6}
    at_rest = linearise(model, values)
    assert at_rest.a[1, 1] < -1000
    assert "coulomb_friction" in at_rest.warnings[0]
    moving = linearise(model, values, deflection=0.0, speed=0.3)
    assert moving.warnings == ()
    assert moving.a[1, 1] == pytest.approx(-0.1, rel=1e-4)
    cycle = linearise(model, values, amplitude=0.2, frequency=3.0)
    assert cycle.warnings == ()
    assert cycle.a[1, 1] == pytest.approx(-0.1 - 4 * 0.05 / (np.pi * 0.2 * 3.0), rel=1e-4)
    assert cycle.a[1, 0] == pytest.approx(-9.0, rel=1e-6)


def test_a_cubic_spring_of_a_cycle_is_three_quarters() -> None:
    model = with_stiffness("oscillator", "cubic_stiffness", "quadratic_drag")
    values = {"alpha": 9.0, "g": 1.0, "beta": 5.0, "c_2": 0.4}
    found = linearise(model, values, amplitude=0.3, frequency=2.0)
    assert found.a[1, 0] == pytest.approx(-9.0 - 0.75 * 5.0 * 0.09, rel=1e-6)
    assert found.a[1, 1] == pytest.approx(-8 / (3 * np.pi) * 0.4 * 0.3 * 2.0, rel=1e-5)


@pytest.mark.parametrize(
    ("options", "message"),
    [({"amplitude": 0.1}, "both positive"), ({"frequency": 1.0}, "both positive"),
     ({"amplitude": -1.0, "frequency": 1.0}, "both positive")],
)  # fmt: skip
def test_half_a_describing_function_is_refused(options, message: str) -> None:
    model = with_stiffness("oscillator")
    with pytest.raises(InputError, match=message):
        linearise(model, some_values(model), **options)
    rod = with_stiffness("elastica_2")
    with pytest.raises(InputError, match="of one coordinate"):
        linearise(rod, some_values(rod), amplitude=0.1, frequency=1.0)


def test_standard_deviations_are_those_of_the_parameters() -> None:
    model = with_stiffness("oscillator", "viscous_damping")
    names, sd = ("alpha", "xi", "delta_0_init[a]"), np.array([0.2, 0.01, 1.0])
    correlation = np.array([[1.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 1.0]])
    fitted = FittedModel(model, {"alpha": 9.0, "xi": 0.1, "g": 2.0}, names, correlation * np.outer(sd, sd))
    found = linearise(fitted)
    np.testing.assert_allclose(found.sd["a"], [[0.0, 0.0], [0.2, 0.01]], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(found.sd["b"], 0.0, atol=1e-9)
    draws = {"alpha": RNG.normal(9.0, 0.2, 5000), "xi": RNG.normal(0.1, 0.01, 5000), "sigma": np.ones(5000)}
    drawn = linearise(fitted, draws=draws)
    np.testing.assert_allclose(drawn.sd["a"][1], [0.2, 0.01], rtol=0.2)
    assert linearise(model, fitted.values).sd == {}


@pytest.mark.parametrize("delay", [0.0, 0.02, 0.05, 0.073])
def test_samples_are_exact_with_a_late_instrument(delay: float) -> None:
    """The discrete model against the continuous one, an input of steps, the reading as old as it is."""
    model = with_stiffness("accelerometer" if delay == 0 else "oscillator", "viscous_damping", "sensor_delay")
    values = {"alpha": 30.0, "g": 2.0, "xi": 0.5, "tau": delay}
    found, sample = linearise(model, values), 0.05
    assert found.delay == delay
    discrete = discretise(found, sample)
    u = RNG.normal(size=40)
    state, got = np.zeros(discrete.a.shape[0]), []
    for push in u:
        got.append(float((discrete.c @ state + discrete.d[:, 0] * push)[0]))
        state = discrete.a @ state + discrete.b[:, 0] * push
    fine = sample / 500
    whole = expm(fine * np.block([[found.a, found.b], [np.zeros((1, 3))]]))
    truth, y = np.zeros(2), []
    for push in np.repeat(u, 500):
        y.append(float((found.c @ truth + found.d[:, 0] * push)[0]))
        truth = whole[:2, :2] @ truth + whole[:2, 2] * push
    back = round(delay / fine)
    expected = [y[500 * k - back] if 500 * k >= back else 0.0 for k in range(40)]
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_what_cannot_be_sampled_is_refused() -> None:
    model = with_stiffness("oscillator")
    found = linearise(model, some_values(model))
    for wrong in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="positive sample time"):
            discretise(found, wrong)
    with pytest.raises(InputError, match="continuous time becomes"):
        discretise(discretise(found, 0.1), 0.1)


def test_an_instrument_ahead_is_told() -> None:
    model = with_stiffness("oscillator", "sensor_delay")
    found = linearise(model, {**some_values(model), "tau": -0.01})
    assert found.delay == 0
    assert "0.01 s ahead" in found.warnings[0]


def test_a_folder_is_linearised_into_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = with_stiffness("oscillator", "coulomb_friction", "sensor_delay")
    values = {"alpha": 9.0, "g": 2.0, "f_c": 0.05, "v_c": 1e-3, "tau": 0.02}
    name = '"""; open("pwned", "w") #'
    provenance = {"discovery": "1", "rig": {"name": name, "sha256": "0" * 64}, "data": []}
    found = FittedModel(model, values, ("alpha",), np.array([[0.04]]), provenance=provenance)
    (tmp_path / "loop.json").write_text(json.dumps({"models": {"after": found.to_dict()}, "provenance": {}}))
    assert read_draws(tmp_path, model) is None
    said = call(capsys, "linearise", tmp_path, "--out", tmp_path / "a")
    assert said.status == 0, said.err
    assert "warning: At rest the slope of coulomb_friction" in said.err
    asked = ("--amplitude", 0.1, "--frequency", 3.0, "--sample-time", 0.01)
    said = call(capsys, "linearise", tmp_path, "--out", tmp_path / "b", *asked, "--json")
    assert said.status == 0, said.err
    assert said.err == ""
    space = module((tmp_path / "a" / "linear.py").read_text())
    np.testing.assert_array_equal(space["A"], linearise(found).a)
    assert space["A_SD"][1, 0] == pytest.approx(0.2)
    assert space["DELAY"] == 0.02
    content = json.loads((tmp_path / "b" / "linear.json").read_text())
    files = [str(tmp_path / "b" / name) for name in ("linear.py", "linear.json")]
    assert json.loads(said.out) == {**content, "files": files}
    expected = discretise(linearise(found, amplitude=0.1, frequency=3.0), 0.01)
    np.testing.assert_array_equal(content["A"], expected.a)
    assert content["states"] == [*linearise(found).states, "output_1_late", "output_2_late"]
    assert not (tmp_path / "pwned").exists()
    assert call(capsys, "linearise", tmp_path, "--out", tmp_path / "c", "--sample-time", 0).status == 2


@pytest.mark.parametrize("sample", [None, 0.02])
def test_python_control_takes_the_file(sample: float | None) -> None:
    control = pytest.importorskip("control", reason="python-control is not installed")
    model = with_stiffness("reduced", "viscous_damping")
    found = FittedModel(model, some_values(model))
    linear = linearise(found) if sample is None else discretise(linearise(found), sample)
    system = module(linear_to_python(linear, found).replace("import control", "control = CONTROL"))
    system["CONTROL"] = control
    made = system["system"]()
    assert list(made.state_labels) == list(linear.states)
    poles = np.linalg.eigvals(linear.a)
    np.testing.assert_allclose(np.sort_complex(made.poles()), np.sort_complex(poles), atol=1e-9)
    assert made.isdtime(strict=True) == (sample is not None)
