"""What a declared system reads beside its output: a cart and the pendulum on it, simulated by LSODA."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discovery import close_loop, load_dataset
from discovery.cli import main
from discovery.declarations.system import Constant, SystemDeclaration
from discovery.foundation.errors import InputError
from discovery.mechanics.place_sizes import place_sizes
from discovery.mechanics.systems import system_base
from discovery.rigs.rig_file import read_rig

CART, BOB, ARM, INERTIA, SPRING, GRAVITY = 0.5, 0.1, 0.3, 0.012, 6.0, 9.81
LOSS, PIVOT, DRY = 0.3, 8e-4, 0.06
NOISES = (2e-3, 5e-4)  # rad, m
RIG = """
name = "cart between springs"
kind = "system"
[system]
coordinates = { place = "m", angle = "rad" }
kinetic = "(cart + bob)*dot(place)^2/2 + bob*arm*cos(angle)*dot(place)*dot(angle) + inertia*dot(angle)^2/2"
potential = "-bob*gravity*arm*cos(angle) + spring*place^2/2"
dissipation = "track_loss*dot(place)^2/2 + pivot_loss*dot(angle)^2/2"
output = "angle"
also = { cart_place = "place" }
places = { track = "place", pivot = "angle" }
[system.constants]
cart = { value = 0.5, unit = "kg" }
bob = { value = 0.1, unit = "kg" }
arm = { guess = 0.25, unit = "m" }
inertia = { guess = 0.01, unit = "kg m^2" }
gravity = { value = 9.81, unit = "m / s^2" }
spring = { guess = 5, unit = "N/m" }
track_loss = { guess = 0.5, unit = "N s / m" }
pivot_loss = { guess = 1e-3, unit = "N m s" }
[columns]
time = { name = "t", unit = "s" }
output = { name = "angle", unit = "rad" }
also = { cart_place = { name = "x", unit = "mm" } }
[records]
train = [{ file = "a.csv" }, { file = "b.csv" }]
holdout = [{ file = "c.csv" }]
"""


def record(path: Path, seed: int, start: tuple[float, float, float, float], dry: float = DRY) -> None:
    """Write a free motion from a place [m], an angle [rad] and their rates."""

    def slope(_: float, state: np.ndarray) -> list[float]:
        x, angle, v, turn = state
        mass = [[CART + BOB, BOB * ARM * np.cos(angle)], [BOB * ARM * np.cos(angle), INERTIA]]
        force = BOB * ARM * np.sin(angle) * turn**2 - LOSS * v - dry * np.tanh(v / 1e-3) - SPRING * x
        return [v, turn, *np.linalg.solve(mass, [force, -BOB * GRAVITY * ARM * np.sin(angle) - PIVOT * turn])]

    time = np.arange(600) / 100
    found = solve_ivp(slope, (0, time[-1]), start, "LSODA", time, rtol=1e-8, atol=1e-10, max_step=5e-3).y
    rng = np.random.default_rng(seed)
    angle, place = (found[k] + rng.normal(0, sd, time.size) for k, sd in zip((1, 0), NOISES, strict=True))
    np.savetxt(path, np.column_stack([time, angle, 1e3 * place]), "%.7g", ",", header="t,angle,x", comments="")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("cart")
    starts = (0.5, 0.3, 0.0, 0.0), (-0.4, 1.2, 0.3, 0.0), (0.3, -0.8, -0.5, 0.0)
    for seed, (name, start) in enumerate(zip("abc", starts, strict=True)):
        record(place / f"{name}.csv", seed, start)
    (place / "rig.toml").write_text(RIG)
    (place / "angle.toml").write_text(RIG.replace("also = {", "#").replace("# cart_place", "# also"))
    return place


def test_both_are_read_in_their_units(folder: Path) -> None:
    first = load_dataset(folder / "rig.toml").train[0]
    assert (first.recording.channels, first.recording.units) == (("output", "cart_place"), ("rad", "m"))
    assert first.recording.noise == pytest.approx(NOISES, rel=0.15)
    assert first.recording.output[0] == pytest.approx((0.3, 0.5), abs=0.01)
    assert first.recording.noise_floor() == first.recording.noise[0]


def test_friction_on_the_track_is_found(folder: Path) -> None:
    found = close_loop(load_dataset(folder / "rig.toml"))
    assert (found.verdict, found.added) == ("explained", ("coulomb_friction_at_track",))
    value, sd = found.after.values["f_c_track"], found.after.sd["f_c_track"]
    assert abs(value - DRY) < 3 * sd < 0.03 * DRY
    # Errors are those of the output alone; those of the place are told beside them, in metres.
    assert found.errors["after"]["holdout"]["rms"] == pytest.approx(NOISES[0], rel=0.1)
    (also,) = found.errors["also"]
    assert (also["name"], also["unit"]) == ("cart_place", "m")
    assert also["after"]["holdout"]["rms"] == pytest.approx(NOISES[1], rel=0.1)
    assert also["before"]["holdout"]["rms"] > 5 * NOISES[1]
    # Where the cart begins is read, and no belief pulls it to its rest.
    starts = {s.name: s for s in found.after.problem.states}
    assert starts["place_start_0_init[a]"].guess == pytest.approx(0.5, abs=0.01)
    assert not starts["place_start_0_init[a]"].believed


@pytest.mark.slow
def test_the_second_reading_tells_the_parameters_better(folder: Path) -> None:
    both, angle = (close_loop(load_dataset(folder / f"{name}.toml")).after for name in ("rig", "angle"))
    assert both.sd["f_c_track"] < 0.6 * angle.sd["f_c_track"]


@pytest.mark.slow
def test_what_follows_a_loop_has_both(folder: Path) -> None:
    out = folder / "out"
    main(["loop", str(folder / "rig.toml"), "--out", str(out), "--predict", str(folder / "c.csv")])
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "read beside the output" in page
    assert "cart place" in page
    header = (out / "prediction.csv").read_text(encoding="utf-8").splitlines()[0].split(",")
    assert {"output_after", "cart_place_after", "cart_place_after_sd"} <= set(header)
    main(["export", str(out), "--out", str(folder / "model")])
    text = (folder / "model" / "model.py").read_text(encoding="utf-8")
    assert "output, cart_place = simulate(time, u)" in text
    assert "y_cart_place = place" in text


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('also = { cart_place = "place" }', "", r"\[columns.also\] has it, unlike the system"),
        ('also = { cart_place = {', 'also = { other = {', r"also\.\w+.*unlike the system"),
        ('also = { cart_place = "place" }', 'also = { cart_place = "spring" }', "also.*no coordinate stands"),
        ('also = { cart_place = "place" }', 'also = { cart_place = "dot(place)" }', "it is in m s"),
        ('unit = "mm"', 'unit = "deg"', r"also\.cart_place.*it is in m, and its column in 'deg'"),
        ('output = "angle"', 'output = "dot(angle)"', "less often differentiated. Make it the output"),
    ],
)  # fmt: skip
def test_refused_with_its_key(tmp_path: Path, old: str, new: str, says: str) -> None:
    text = RIG.replace(old, new, 1)
    assert text != RIG
    (tmp_path / "rig.toml").write_text(text)
    with pytest.raises(InputError, match=says):
        read_rig(tmp_path / "rig.toml")


def test_the_name_of_another_signal_is_refused(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(RIG.replace("cart_place", "time"))
    with pytest.raises(InputError, match="'time' is the name of something else"):
        read_rig(tmp_path / "rig.toml")


def test_no_kind_with_one_output_has_another(tmp_path: Path) -> None:
    text = 'name = "a"\nkind = "oscillator"\n[columns]\ntime = { name = "t", unit = "s" }\n'
    text += 'output = { name = "x", unit = "m" }\nalso = { y = { name = "y", unit = "m" } }\n'
    (tmp_path / "rig.toml").write_text(text)
    with pytest.raises(InputError, match="an oscillator has one output"):
        read_rig(tmp_path / "rig.toml")


def test_a_missing_column_is_named(folder: Path, tmp_path: Path) -> None:
    for name in "abc":
        lines = (folder / f"{name}.csv").read_text().replace("t,angle,x", "t,angle,y")
        (tmp_path / f"{name}.csv").write_text(lines)
    (tmp_path / "rig.toml").write_text(RIG)
    with pytest.raises(InputError, match=r"a\.csv has no column 'x'"):
        load_dataset(tmp_path / "rig.toml")


def test_a_place_that_the_output_does_not_pull_moves_in_the_mode() -> None:
    """Two masses coupled by their inertia alone: a static force at one leaves the other where it is."""
    system = SystemDeclaration(
        name="coupled",
        coordinates={"x": "m", "y": "m"},
        constants={"mass": Constant("kg", 1.0), "spring": Constant("N / m", 4.0)},
        kinetic="mass*dot(x)^2 + mass*dot(y)^2 + mass*dot(x)*dot(y)/2",
        potential="spring*(x^2 + y^2)/2",
        output="x",
        places={"first": "x", "second": "y"},
    )
    base = system_base(system)
    slow = np.sqrt(4.0 / 2.5)  # both the same way
    sizes = place_sizes(base, float(slow) * 0.999, 1.0, 0.1)
    assert sizes["first"][0] == pytest.approx(0.1)
    assert sizes["second"][0] == pytest.approx(0.1, rel=0.3)


def test_a_name_is_that_of_what_it_reads(tmp_path: Path) -> None:
    for name in ("angle", "spring"):
        (tmp_path / "rig.toml").write_text(RIG.replace("cart_place", name))
        with pytest.raises(InputError, match=f"'{name}' is the name of something else"):
            read_rig(tmp_path / "rig.toml")
    (tmp_path / "rig.toml").write_text(RIG.replace("cart_place", "place"))
    assert list(read_rig(tmp_path / "rig.toml").columns.also) == ["place"]


GYRO = """
name = "pendulum with a gyro"
kind = "system"
[system]
coordinates = { swing = "rad" }
kinetic = "inertia*dot(swing)^2/2"
potential = "-weight*cos(swing)"
dissipation = "loss*dot(swing)^2/2"
output = "swing"
also = { gyro = "dot(swing)" }
places = { pivot = "swing" }
[system.constants]
inertia = { value = 0.01, unit = "kg m^2" }
weight = { guess = 0.35, unit = "N m" }
loss = { guess = 1e-3, unit = "N m s" }
[columns]
time = { name = "t", unit = "s" }
output = { name = "encoder", unit = "deg" }
also = { gyro = { name = "rate", unit = "rad/s", noise = 0.02 } }
[records]
train = [{ file = "a.csv" }]
"""


def swing(folder: Path, *, jitter: float = 0.0) -> Path:
    rng = np.random.default_rng(4)
    time = np.arange(500) / 50
    taken = time + rng.normal(0.0, jitter, time.size)
    angle = 0.5 * np.exp(-0.05 * taken) * np.cos(6.0 * taken)
    rate = -0.5 * np.exp(-0.05 * taken) * (6.0 * np.sin(6.0 * taken) + 0.05 * np.cos(6.0 * taken))
    encoder = np.round(np.degrees(angle) / 0.5) * 0.5
    columns = [time, encoder, rate + rng.normal(0, 0.02, time.size)]
    np.savetxt(folder / "a.csv", np.column_stack(columns), "%.7g", ",", header="t,encoder,rate", comments="")
    (folder / "rig.toml").write_text(GYRO)
    return folder / "rig.toml"


def test_a_rate_beside_a_position_is_no_position(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = swing(tmp_path)
    (first,) = load_dataset(rig).train
    assert not [flag for flag in first.recording.flags if flag.code == "rate_as_position"]
    main(["check", str(rig)])
    told = capsys.readouterr().out
    assert "gyro: -2.9" in told
    assert re.search(r"gyro: .* noise 0\.02 rad/s as stated", told)
    assert re.search(r"output: .* from the scatter", told)


def test_stamps_err_by_what_the_faster_instrument_shows(tmp_path: Path) -> None:
    """A coarse encoder shows nothing of it, and does not halve it."""
    jitter = load_dataset(swing(tmp_path, jitter=2e-3)).train[0].recording.jitter
    assert jitter == pytest.approx(2e-3, rel=0.25)


def test_an_output_is_judged_where_it_is_read(tmp_path: Path) -> None:
    """Readings may come in turns: no row has both."""
    rig = swing(tmp_path)
    lines = (tmp_path / "a.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines[1:]]
    cells = [",".join((t, a, "") if i % 3 else (t, "", r)) for i, (t, a, r) in enumerate(rows)]
    (tmp_path / "a.csv").write_text("\n".join([lines[0], *cells]))
    (first,) = load_dataset(rig).train
    assert np.isfinite(first.recording.output).sum(axis=0).tolist() == [333, 167]


def test_a_key_that_is_not_known_is_told_with_those_that_are(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(RIG.replace('unit = "mm"', 'unit = "mm", reads = "position"'))
    with pytest.raises(InputError, match="Known here: name, unit, noise, zero, scale"):
        read_rig(tmp_path / "rig.toml")


def test_what_is_read_beside_an_output_may_rest(tmp_path: Path) -> None:
    rig = swing(tmp_path)
    lines = (tmp_path / "a.csv").read_text().splitlines()
    cells = [",".join((*line.split(",")[:2], "0.0")) for line in lines[1:]]
    (tmp_path / "a.csv").write_text("\n".join([lines[0], *cells]))
    assert load_dataset(rig).train[0].recording.noise[1] == 0.02
    rig.write_text(GYRO.replace(", noise = 0.02", ""))
    with pytest.raises(InputError, match=r"every reading.*If it rests while the output moves, state its noise"):
        load_dataset(rig)


def test_where_a_reading_counts_from_is_no_place(folder: Path, tmp_path: Path) -> None:
    """A distance is read from a sensor 3 m away: the cart begins where that says, less the 3 m."""
    text = RIG.replace('also = { cart_place = "place" }', 'also = { cart_place = "place + zero" }')
    (folder / "far.toml").write_text(text.replace("[columns]", 'zero = { value = 3.0, unit = "m" }\n[columns]'))
    rig = read_rig(folder / "far.toml")
    base = system_base(rig.system)
    begun = base.begun(np.array([[0.3, 0.0], [3.5, -0.1]]))
    assert begun["place_start"] == pytest.approx(0.5)
    assert begun["place_rate_start"] == pytest.approx(-0.1)
    # Nothing is told by what is first read later.
    assert base.begun(np.array([[0.3, 0.0], [np.nan, np.nan]])) == {}
    assert base.begun(np.array([[np.nan, np.nan], [3.5, 0.0]])) == {}


def test_what_is_first_read_later_tells_no_beginning(tmp_path: Path) -> None:
    rig = swing(tmp_path)
    lines = (tmp_path / "a.csv").read_text().splitlines()
    cells = [line if i > 60 else ",".join((*line.split(",")[:2], "")) for i, line in enumerate(lines[1:])]
    (tmp_path / "a.csv").write_text("\n".join([lines[0], *cells]))
    first = load_dataset(rig).train[0].first_readings
    assert np.isfinite(first).tolist() == [[True, True], [False, False]]
