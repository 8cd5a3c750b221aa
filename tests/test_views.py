"""Results in a notebook: short texts, tables, pictures on matplotlib's axes; recordings given in any form."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.axes import Axes
from test_drafting import drafted, written

import discovery
from discovery.foundation.errors import InputError
from discovery.recordings.chosen import held_out_of, training_of
from discovery.recordings.dataset import Dataset, load_dataset

TIME = np.arange(600) / 50.0


@pytest.fixture(autouse=True)
def _no_windows() -> None:
    plt.switch_backend("Agg")


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """A spring that hardens, which nobody declared: q'' = -25 q - 2000 q^3 - 0.2 q'."""
    folder, rng = tmp_path_factory.mktemp("spring"), np.random.default_rng(3)

    def swing(name: str, release: float) -> Path:
        q, rate, seen = release, 0.0, []
        for _ in TIME:
            seen.append(q)
            for _ in range(40):
                rate += 5e-4 * (-25.0 * q - 0.2 * rate - 2000.0 * q**3)
                q += 5e-4 * rate
        return written(folder, name, "t_s,x_m", TIME, np.array(seen) + rng.normal(0.0, 1e-4, TIME.size))

    first, other = swing("first.csv", 0.05), swing("other.csv", 0.03)
    drafted(first, holdout=[other])
    rig = folder / "rig.toml"
    rig.write_text("mass_kg = 0.4\n" + rig.read_text())
    return load_dataset(rig)


@pytest.fixture(scope="module")
def found(dataset: Dataset) -> discovery.LoopResult:
    return discovery.close_loop(dataset, seed=2)


def test_a_dataset_is_given_wherever_recordings_are(dataset: Dataset, found: discovery.LoopResult) -> None:
    assert "cubic_stiffness" in found.added
    assert [r.name for r in found.recordings] == ["first", "other"]
    fitted = discovery.fit_model(discovery.declared_model(dataset), dataset)
    same = discovery.fit_model(discovery.declared_model(dataset.train[0]), dataset.train)
    assert fitted.values == same.values
    assert training_of(dataset.train[0]) == dataset.train
    assert held_out_of(dataset) == dataset.holdout
    assert held_out_of(dataset.train, dataset) == dataset.holdout


@pytest.mark.parametrize("wrong", ["rig.toml", 3.0, [1, 2], None])
def test_a_mistake_gets_a_sentence(wrong: object) -> None:
    with pytest.raises(InputError, match=r"load_dataset\(rig, train, holdout\)"):
        discovery.close_loop(wrong)  # type: ignore[arg-type]


def model(data: Dataset) -> discovery.Model:
    return discovery.declared_model(data)


def numbers(found: discovery.LoopResult, **more: float) -> discovery.FittedModel:
    fitted = discovery.FittedModel.from_fit(found.before)
    return replace(fitted, values={**fitted.values, **more})


def file(data: Dataset) -> Path:
    return data.rig.path.parent / "first.csv"  # type: ignore[union-attr]


@cache
def arm() -> Dataset:
    """Recordings of another system."""
    folder = Path(__file__).parents[1] / "datasets" / "arm"
    return load_dataset(folder / "rig.toml", folder / "train_paper.csv", folder / "holdout_inside.csv")


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (
            lambda d, f: discovery.load_dataset(None),
            "`rig_path` is a path, but None is of type NoneType",
        ),
        (lambda d, f: discovery.load_dataset(d.rig.path, 3), "`train` is a path, but 3 is of type int"),
        (lambda d, f: discovery.load_dataset(d.rig.path, [d]), "`train` is a path, but <Dataset 'first'"),
        (
            lambda d, f: discovery.read_recording("first.csv", "rig.toml"),
            "`rig` is a Rig, but 'rig.toml' is of",
        ),
        (lambda d, f: discovery.close_loop(d, seed=-1), "`seed` is an integer from 0 on, but it is -1"),
        (lambda d, f: discovery.close_loop(d, seed="1"), "`seed` is an integer from 0 on, but it is '1'"),
        (lambda d, f: discovery.close_loop(d, settings={"nats": 3}), "`settings` is a LoopSettings"),
        (lambda d, f: discovery.close_loop(d, progress="yes"), "`progress` is a function of one sentence"),
        (lambda d, f: discovery.fit_model(d, discovery.declared_model(d)), "`model` is a Model, but <Dataset 'first'"),
        (lambda d, f: discovery.Model("oscillator", "viscous_damping"), "write ['viscous_damping']"),
        (lambda d, f: discovery.sample(d), "`fit` is a Fit, but <Dataset 'first'"),
        (lambda d, f: discovery.choose_noise(f), "`fit` is a Fit, but <LoopResult"),
        (lambda d, f: discovery.compare_models([f.before]), "Name the candidates"),
        (lambda d, f: discovery.compare_models({"a": d}), "`fits['a']` is a Fit"),
        (lambda d, f: discovery.predict_bands(f.before, d), "`posterior` is a Posterior"),
        (lambda d, f: discovery.predict_motion(f.before, d), "`experiment` is an Experiment"),
        (lambda d, f: discovery.predict_elastica(d), "`rig` is a Rig"),
        (lambda d, f: discovery.overview("rig.toml"), "`dataset` is a Dataset"),
        (lambda d, f: discovery.discover("rig.toml"), "`dataset` is a Dataset"),
        (lambda d, f: discovery.run(d, 3), "`out` is a path, but 3 is of type int"),
        (lambda d, f: discovery.run("rig.toml", "out"), "`dataset` is a Dataset"),
        (lambda d, f: discovery.draft_rig([]), "no recording to draft a rig file from"),
        (lambda d, f: discovery.to_sympy(f), "Of a loop give its `after`"),
        (lambda d, f: f.before.predict(d), "Give `initial`"),
        # Recordings of different systems.
        (lambda d, f: discovery.close_loop(d.train, arm()), "'holdout_inside' is of another system than 'first'"),
        (lambda d, f: discovery.fit_model(model(d), [*d.train, *arm().train]), "flexible arm in rad with an input in"),
        (lambda d, f: discovery.fit_model(model(d), arm()), "not of the base 'oscillator'"),
        (lambda d, f: discovery.fit_model(model(arm()), d), "not of the base 'constant_radius'"),
        (lambda d, f: discovery.predict_motion(f.before, arm().train[0]), "another system than 'first'"),
        (lambda d, f: discovery.close_loop(replace(d, train=())), "has no training recording"),
        # Names that nothing has.
        (lambda d, f: model(d).without(["viscous_dampin"]), "no effect viscous_dampin; it has viscous_damping"),
        (lambda d, f: model(d).without(None), "`effect_ids` is a list of names"),
        (lambda d, f: discovery.fit_model(model(d), d, start={"alfa": 1.0}), "parameter alfa; it has"),
        (lambda d, f: discovery.fit_model(model(d), d, start={"alpha": np.nan}), "`start['alpha']` is a number"),
        (lambda d, f: discovery.fit_model(model(d), d, gaussian={"zz": (1, 2)}), "no parameter zz"),
        (lambda d, f: discovery.fit_model(model(d), d, gaussian={"xi": 1}), "a pair of numbers, a mean and its sd"),
        (lambda d, f: discovery.fit_model(model(d), d, tolerance=0), "`tolerance` is a number above 0"),
        (lambda d, f: discovery.Model("oscillator", (), {"zzz": 1.0}), "no parameter zzz"),
        (lambda d, f: discovery.Model("oscillator", (), {"g": "a"}), "`known['g']` is a number, but it is 'a'"),
        (lambda d, f: discovery.Model("oscillator", (), None), "`known` is a mapping"),
        (lambda d, f: discovery.Model("oscillator", 3), "`effects` is a list of names, but 3 is"),
        (lambda d, f: numbers(f, zz=2.0), "The model has no parameter zz"),
        (lambda d, f: replace(numbers(f), fitted=("alfa",)), "no parameter alfa; it has"),
        (lambda d, f: replace(numbers(f), covariance=np.eye(9)), "give a row and a column for each"),
        (lambda d, f: numbers(f).unit_of("alfa"), "Did you mean 'alpha'?"),
        (lambda d, f: discovery.get_effect("coulomb_friction").fitted("zz"), "it has flexible_arm, oscillator"),
        # Pictures.
        (lambda d, f: d.plot_recordings(plt.subplots()[1]), "2 axes are needed, and 1 are given"),
        (lambda d, f: f.before.plot_residuals(3), "`axes` is an Axes, but 3 is of type int"),
        (lambda d, f: f.plot_errors("x"), "`axes` is an Axes, but 'x' is of type str"),
        # Numbers out of range.
        (lambda d, f: discovery.LoopSettings(nats=-5), "`nats` is a number from 0 on, but it is -5"),
        (lambda d, f: discovery.LoopSettings(form=np.nan), "`form` is a number from 0 on, but it is nan"),
        (lambda d, f: discovery.LoopSettings(chance=7), "`chance` is a number from 0 to 1"),
        (lambda d, f: discovery.LoopSettings(tolerance=0), "`tolerance` is a number above 0, but"),
        (lambda d, f: discovery.LoopSettings(seed="x"), "`seed` is an integer from 0 on"),
        (lambda d, f: discovery.LoopSettings(budget=3), "`budget` is a Budget"),
        (lambda d, f: discovery.LoopSettings(follow_up=3), "`follow_up` is True or False"),
        (lambda d, f: discovery.close_loop(d, settings={}), "`settings` is a LoopSettings"),
        (lambda d, f: discovery.Parameter("kgg", "m"), "The unit 'kgg' cannot be read"),
        (lambda d, f: discovery.Parameter(None, "m"), "`unit` is text"),
        (lambda d, f: discovery.Parameter("kg", "mass", (2, 1)), "give the lower one first"),
        (lambda d, f: d.train[0].first(0), "`count` is a whole number from 1 on"),
        (lambda d, f: discovery.predict_elastica(arm().rig, draws=0), "`draws` is a whole number from 2 on"),
        (lambda d, f: discovery.predict_elastica(arm().rig, "x"), "`seed` is an integer"),
        (lambda d, f: discovery.predict_elastica(arm().rig, delta_max="x"), "`delta_max` is a number, but"),
        (lambda d, f: discovery.draft_rig(file(d), rate=-1), "`rate` is a number above 0"),
        (lambda d, f: discovery.draft_rig(file(d), kind="pendulun"), "Did you mean 'pendulum'?"),
        (lambda d, f: discovery.draft_rig(file(d), chosen={"in": "x"}), "no column for in; it has time"),
        (lambda d, f: Dataset(d.rig, "x", ()), "`train` is an Experiment, but 'x' is"),
        (lambda d, f: Dataset(d.rig, [d.train[0].recording], []), "make_experiment(recording, rig)"),
        # Another kind of thing.
        (lambda d, f: discovery.read_rig(3), "`path` is a path, but 3 is"),
        (lambda d, f: discovery.read_recording(file(d)), "`rig` is a Rig, but None is"),
        (lambda d, f: discovery.read_recording(file(d), d.rig, 3), "`samples` is a pair"),
        (lambda d, f: discovery.read_recording(file(d), d.rig, where="a"), "`where` is a list of columns"),
        (lambda d, f: discovery.build_report(f), "`run_dir` is a path, but <LoopResult"),
        (lambda d, f: discovery.Posterior.from_netcdf(3), "`path` is a path"),
        (lambda d, f: discovery.run(d, file(d)), "cannot be one: File exists"),
        (lambda d, f: discovery.get_effect([]), "`effect_id` is text, but [] is"),
        (lambda d, f: discovery.Model([], ()), "`base` is text, but [] is"),
        (lambda d, f: model(d).with_effect(["coulomb_friction"]), "but ['coulomb_friction'] is of type list"),
        (lambda d, f: discovery.Model.from_dict({}), "`description` lacks base, effects, known"),
        (lambda d, f: discovery.FittedModel.from_dict({}), "`description` lacks model"),
        (lambda d, f: discovery.FittedModel.from_fit("x"), "`fit` is a Fit"),
        (lambda d, f: discovery.FittedModel(model(d), None), "`values` is a mapping"),
        (lambda d, f: discovery.predict_motion(f.before, d.train[0], (1, 2, 3)), "`initial` is a pair of numbers"),
        (lambda d, f: discovery.sample(f.before, noise=None), "`noise` is text, but None is"),
        (lambda d, f: discovery.sample(f.before, ensembles="4"), "`ensembles` is a whole number, but it is '4'"),
        (lambda d, f: discovery.sample(f.before, walkers=-2), "`walkers` is a whole number from 1 on"),
        (lambda d, f: discovery.sample(f.before, min_effective=-1), "`min_effective` is a number above 0"),
        (lambda d, f: discovery.sample(f.before, r_hat_max="1"), "`r_hat_max` is a number above 1"),
        (lambda d, f: discovery.sample(f.before, max_steps="10"), "`max_steps` is a whole number"),
        (lambda d, f: discovery.sample(f.before, backend_path=3), "`backend_path` is a path"),
        (lambda d, f: discovery.choose_noise(f.before, models=3), "`models` is a list of names"),
        (lambda d, f: discovery.choose_noise(f.before, draws=-500), "`draws` is a whole number from 100 on"),
        (lambda d, f: discovery.compare_models({"a": f.before}, held_out="x"), "`held_out` is a mapping"),
        *(
            (lambda d, f, export=export: export(f.before, 3), "`values` is a mapping, but 3 is")
            for export in (discovery.to_json, discovery.to_latex, discovery.to_sympy, discovery.to_numpy)
        ),
    ],
)
def test_each_mistake_gets_its_sentence(call, told, dataset: Dataset, found: discovery.LoopResult) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError) as refused:
        call(dataset, found)
    assert told in str(refused.value)


def test_one_path_is_a_list_of_one_and_effects_may_be_a_list(dataset: Dataset) -> None:
    rig = dataset.rig.path
    assert rig is not None
    alone = load_dataset(rig, rig.parent / "first.csv", str(rig.parent / "other.csv"))
    assert (len(alone.train), len(alone.holdout)) == (1, 1)
    assert discovery.draft_rig(str(rig.parent / "first.csv")).startswith("# Drafted")
    model = discovery.Model("oscillator", ["viscous_damping", "linear_stiffness"])  # type: ignore[arg-type]
    assert hash(model.effects) == hash(("viscous_damping", "linear_stiffness"))


def test_only_public_names_are_listed() -> None:
    assert {n for n in dir(discovery) if not n.startswith("__")} == set(discovery.__all__)


def test_nothing_is_no_recording() -> None:
    with pytest.raises(InputError, match="No recording is given"):
        discovery.close_loop([])


def test_texts_are_short_and_tables_hold_what_was_found(dataset: Dataset, found: discovery.LoopResult) -> None:
    recording = dataset.train[0].recording
    assert repr(recording) == "<Recording 'first': 600 readings of output [m]>"
    assert repr(dataset) == "<Dataset 'first' (oscillator): 1 to fit, 1 held out>"
    for shown in (found, found.after, dataset):
        assert len(repr(shown)) < 300
        assert shown._repr_html_().count("<tr") >= 2
    assert found.verdict in found._repr_html_()
    table = found.to_pandas()
    assert table.loc["beta", "effect"] == "cubic_stiffness"
    assert table.loc["beta", "value"] == found.after.values["beta"] == pytest.approx(2000.0, rel=0.05)
    assert table.loc["beta", "unit"] == "s^-2 m^-2"
    assert table.loc["beta", "physical"] == pytest.approx(0.4 * table.loc["beta", "value"])
    assert table.loc["beta", "physical_unit"] == "N m^-3"
    assert table.index.tolist() == ["xi", "alpha", "beta"]
    start = found.after.initial_states()
    assert start.index.tolist() == ["first"]
    assert start.loc["first", "deflection"] == pytest.approx(0.05, abs=1e-3)
    assert start.loc["first", ["deflection_unit", "rate_unit"]].tolist() == ["m", "m s^-1"]
    assert "_init" not in found.after._repr_html_()


def test_what_is_large_is_told_in_a_line(dataset: Dataset, found: discovery.LoopResult) -> None:
    fit, data = found.before.specialised(), found.before.problem.bench.experiments
    posterior = discovery.sample(fit, min_effective=400)
    weighed = discovery.choose_noise(fit, models=["student_t"], draws=200)
    compared = discovery.compare_models(
        {"declared": fit, "again": fit}, held_out={"declared": 1, "again": 2}, draws=200
    )
    searched = discovery.discover(dataset)
    told = [
        (dataset.rig, "<Rig 'first' (oscillator): "),
        (dataset.train[0], "<Experiment 'first' of 'first' (oscillator): 600 readings"),
        (numbers(found), "<FittedModel oscillator + viscous_damping + linear_stiffness: g = 0, xi = "),
        (
            discovery.predict_elastica(arm().rig, draws=100),
            "<Prediction of 'fibreglass arm': 100 draws of static_small",
        ),
        (discovery.predict_bands(posterior, data, 10)[0], "<Band of 'first': 600 times of output [m]>"),
        (weighed, "<NoiseChoice "),
        (compared, "<Comparison of 2 models: behind by [nats] "),
        (searched, "<Discovered "),
    ]
    for given, beginning in told:
        assert repr(given).startswith(beginning)
        assert len(repr(given)) < 300
    assert weighed._repr_html_().count("<tr") == compared._repr_html_().count("<tr") == 3
    assert "held-out error" in compared._repr_html_()
    assert "<td>linear_stiffness</td>" in searched._repr_html_()


def test_recordings_as_pandas_and_xarray(dataset: Dataset) -> None:
    recording = dataset.train[0].recording
    frame, labelled = recording.to_pandas(), recording.to_xarray()
    assert np.array_equal(frame["output"], recording.output[:, 0])
    assert np.array_equal(frame.index, recording.time)
    assert labelled["output"].attrs == {"units": "m", "noise": float(recording.noise[0])}
    assert np.array_equal(labelled["time"], recording.time)


def test_pictures_are_drawn_on_axes(dataset: Dataset, found: discovery.LoopResult) -> None:
    drawn = [*dataset.plot_recordings(), *found.after.plot_residuals(), *found.plot_residuals(), found.plot_errors()]
    assert all(isinstance(ax, Axes) and ax.has_data() for ax in drawn)
    figure, given = plt.subplots()
    assert found.plot_errors(given) is given
    drawn_at = {dots.get_label(): sorted(dots.get_offsets()[:, 0]) for dots in given.collections[1:]}
    for when, places in drawn_at.items():
        assert set(places) == {told["rms"] for told in found.errors[when].values()}
    assert found.after.plot_residuals([given]) == found.after.plot_residuals(given) == [given]
    left = given.lines[-1].get_ydata()
    recording = dataset.train[0].recording
    assert np.allclose(left, ((recording.output - found.after.predict()[0]) / recording.noise)[:, 0])
    with pytest.raises(InputError, match="2 axes are needed, and 1 are given"):
        dataset.plot_recordings([given])
    figure.clear()
    plt.close("all")


@pytest.mark.parametrize(("between", "drawn"), [("hold", "steps-post"), ("linear", "default")])
def test_an_input_is_drawn_as_it_runs_between_its_samples(tmp_path: Path, between: str, drawn: str) -> None:
    time = 0.05 * np.arange(200)
    table = np.column_stack([time, np.round(np.sin(time)), 0.1 * np.sin(3.0 * time) * np.sin(time)])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="t,u,x", comments="")
    (tmp_path / "rig.toml").write_text(
        'name = "a"\nkind = "oscillator"\n[columns]\ntime = { name = "t", unit = "s" }\n'
        f'input = {{ name = "u", unit = "V", interpolation = "{between}" }}\n'
        'output = { name = "x", unit = "m" }\n[model]\neffects = ["viscous_damping", "linear_stiffness"]\n'
        '[records]\ntrain = [{ file = "a.csv" }]\n'
    )
    (axes,) = discovery.load_dataset(tmp_path / "rig.toml").plot_recordings()
    (behind,) = [ax for ax in axes.figure.axes if ax is not axes]
    assert behind.lines[0].get_drawstyle() == drawn
    plt.close("all")


def test_a_posterior_in_a_notebook(found: discovery.LoopResult) -> None:
    drawn = discovery.sample(found.before.specialised(), min_effective=400)
    assert drawn.provenance["seed"] == 1
    table = drawn.to_pandas()
    row = next(row for row in drawn.summary() if row["name"] == "alpha")
    assert table.loc["alpha", ["mean", "unit"]].tolist() == [row["mean"], row["unit"]]
    assert drawn.status in drawn._repr_html_()
    assert not table.index.str.contains("_init").any()
    assert drawn.initial_states().loc["first", "deflection_sd"] > 0.0
    assert "4 chains" in repr(drawn)
    axes = drawn.plot_marginals()
    assert [ax.get_xlabel().split(" ")[0] for ax in axes] == [n for n in drawn.names if "_init[" not in n]
    with pytest.raises(InputError, match="Did you mean 'alpha'"):
        drawn.plot_marginals(["alph"])
    given = plt.subplots()[1]
    assert drawn.plot_marginals("alpha", given) == [given]
    data = found.before.problem.bench.experiments
    for told, call in {
        "`names` is empty": lambda: drawn.plot_marginals([]),
        "`names` is a list of names, but 3 is": lambda: drawn.plot_marginals(3),
        "`data` are the recordings": lambda: drawn.to_arviz(),
        "`draws` is a whole number from 1 on": lambda: drawn.to_arviz(data, draws=0),
        "`path` is a path": lambda: drawn.to_netcdf(None),
        "is of another system than the model": lambda: discovery.predict_bands(drawn, arm(), 10),
        "`n` is a whole number from 1 to": lambda: discovery.predict_bands(drawn, data, 10**9),
        "`seed` is an integer": lambda: discovery.predict_bands(drawn, data, 9, seed=-1),
        "has no recording zzz; it has first": lambda: discovery.predict_bands(drawn, data, 9, initial={"zzz": (0, 0)}),
        "is a pair of numbers": lambda: discovery.predict_bands(drawn, data, 9, initial={"first": (0, 0, 0)}),
    }.items():
        with pytest.raises(InputError, match=told):
            call()
    plt.close("all")


def test_a_name_that_is_not_public_is_suggested() -> None:
    with pytest.raises(AttributeError, match="Did you mean 'close_loop'"):
        _ = discovery.closed_loop
