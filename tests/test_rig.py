"""Rig files: what is read, the defaults, and every refusal by its message."""

from __future__ import annotations

import hashlib
import os
import re

import numpy as np
import pytest

from discovery.foundation.errors import InputError
from discovery.recordings.dataset import load_dataset
from discovery.rigs.kinds import LINEAR_MODEL, PAPER_MODEL
from discovery.rigs.rig import ARM_COLUMNS, Quantity
from discovery.rigs.rig_file import read_rig

ARM = """
name = "fibreglass arm"
length_m = 1.0
tip_mass_kg = 0.04376
beam_mass_kg = 0.01245
flexural_rigidity_N_m2 = 0.12597
position_noise_m = 3e-4
angle_noise_rad = 7e-5
"""

OSCILLATOR = """
name = "Silverbox"
kind = "oscillator"
[columns]
time = { rate_hz = 610.3515625 }
input = { name = "V1", unit = "V", interpolation = "band_limited" }
output = { name = "V2", unit = "mV", noise = 0.2 }
[model]
effects = ["viscous_damping", "linear_stiffness"]
[records]
train = [{ file = "SNLS80mV.mat", samples = [40650, 105712] }]
holdout = [{ file = "SNLS80mV.mat", samples = [105712, 127400] }, { file = "other.mat" }]
"""


@pytest.fixture
def write(tmp_path):
    def write(text):
        path = tmp_path / "rig.toml"
        path.write_text(text)
        return path

    return write


def test_arm(write):
    rig = read_rig(write(ARM))
    assert rig.kind == "flexible_arm"
    assert rig.length == Quantity(1.0, 1e-3)
    assert rig.tip_mass == Quantity(0.04376, pytest.approx(0.005 * 0.04376))
    assert rig.beam_mass == Quantity(0.01245, pytest.approx(0.02 * 0.01245))
    assert rig.flexural_rigidity == Quantity(0.12597, pytest.approx(0.05 * 0.12597))
    assert (rig.position_noise, rig.angle_noise) == (3e-4, 7e-5)
    assert rig.declared == PAPER_MODEL
    assert rig.columns == ARM_COLUMNS
    assert rig.records == {}
    assert rig.sha256 == hashlib.sha256(ARM.encode()).hexdigest()


def test_units_and_deviations_of_quantities(write):
    rig = read_rig(
        write(
            'name = "a"\nlength_mm = { value = 1000, sd = 2 }\ntip_mass_g = 43.76\nbeam_mass_g = { value = 12.45 }\n'
            "position_noise_mm = 0.3\nangle_noise_deg = 0.004\n"
        )
    )
    assert rig.length == Quantity(pytest.approx(1.0), pytest.approx(0.002))
    assert rig.tip_mass == Quantity(pytest.approx(0.04376), pytest.approx(0.0002188))
    assert rig.beam_mass == Quantity(pytest.approx(0.01245), pytest.approx(0.000249))
    assert rig.position_noise == pytest.approx(3e-4)
    assert rig.angle_noise == pytest.approx(6.98e-5, rel=1e-3)
    assert rig.flexural_rigidity is None


SPRING = """name = "a"
kind = "oscillator"
[columns]
time = { name = "t", unit = "s" }
output = { name = "x", unit = "mm" }
[records]
train = [{ file = "a.csv" }]
"""


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"mm"', '"mm", noise = -0.05', "'columns.output.noise' is -0.05, but it must be greater than 0. Correct the"),
        ('"mm"', '"mm", scale = 0', "'columns.output.scale' is 0, but it must not be zero."),
        ('"mm"', '"mm", noise = -1, zero = "1"', "is -1, but it must be greater than 0. Correct the value. (1 more"),
        ('{ file = "a.csv" }', '"a.csv"', "'a.csv', but each recording must be a table, { file = \"a.csv\" }."),
        ('[{ file = "a.csv" }]', '"a.csv"', "'a.csv', but it must be a list, [ ... ]."),
        ('"a.csv" }', '"a.csv", samples = [1] }', "is [1], but it must have at least 2 entries."),
        ('{ name = "t", unit = "s" }', "3", "'columns.time' is 3, but it must be a table, { key = value }."),
        ('"oscillator"', '"oscillator"\nmass_kg = { value = -1 }', "'mass_kg.value' is -1, but it must be greater"),
    ],
)
def test_a_value_that_cannot_be_is_explained_in_words_of_the_file(write, old, new, words):
    with pytest.raises(InputError, match=re.escape(words)):
        read_rig(write(SPRING.replace(old, new)))


LIMITS = (
    "motor_angle_limit_deg = 90\nmotor_speed_limit_rad_per_s = 2.0\n"
    "motor_acceleration_limit_rad_per_s2 = 12\ndeflection_limit_rad = 0.9\n"
)


def test_limits_of_the_motor(write):
    rig = read_rig(write(ARM))
    bare = (rig.motor_angle_limit, rig.motor_speed_limit, rig.motor_acceleration_limit, rig.deflection_limit)
    assert bare == (None,) * 4
    rig = read_rig(write(ARM + LIMITS))
    assert rig.motor_angle_limit == pytest.approx(np.pi / 2)
    assert (rig.motor_speed_limit, rig.motor_acceleration_limit, rig.deflection_limit) == (2.0, 12.0, 0.9)
    # Each for itself, in any unit of its kind.
    rig = read_rig(write(f"{ARM}motor_speed_limit_rpm = 30\nmotor_acceleration_limit_deg_per_s2 = 720\n"))
    assert rig.motor_speed_limit == pytest.approx(np.pi)
    assert rig.motor_acceleration_limit == pytest.approx(4 * np.pi)
    assert (rig.motor_angle_limit, rig.deflection_limit) == (None, None)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("= 2.0", "= 0", "line 10: the key 'motor_speed_limit_rad_per_s' is 0.*greater than 0. Correct the value"),
        ("= 12", "= -12", "line 11: the key 'motor_acceleration_limit_rad_per_s2' is -12.*greater than 0"),
        ("= 90", "= inf", "line 9: the key 'motor_angle_limit_deg' is inf.*finite number"),
        ("= 0.9", "= nan", "line 12: the key 'deflection_limit_rad' is nan.*finite number"),
        ("= 0.9", '= "1 rad"', "line 12: the key 'deflection_limit_rad' is '1 rad', but.*number"),
        (
            "limit_deg = 90",
            "limit = 1.5",
            "line 9: the key 'motor_angle_limit' lacks its unit.*'motor_angle_limit_rad'",
        ),
        ("_rad_per_s =", " =", "line 10.*lacks its unit. Write it as a suffix, 'motor_speed_limit_rad_per_s'"),
        ("_rad_per_s =", "_rad_s =", "line 10.*'rad s' cannot be conv.*the key is 'motor_speed_limit_rad_per_s'"),
        ("_rad_per_s2 =", "_m_per_s2 =", "line 11.*another kind.*the key is 'motor_acceleration_limit_rad_per_s2'"),
        ("limit_deg", "limit_rad", "line 9: 'motor_angle_limit_rad' is 90 rad, which is not plausible.*suffix"),
        ("motor_speed", "motor_sped", r"line 10: .*not known\. Did you mean 'motor_speed_limit_rad_per_s'\?"),
    ],
)
def test_errors_of_the_limits(write, old, new, message):
    path = write(ARM + LIMITS.replace(old, new, 1))
    with pytest.raises(InputError, match=message) as error:
        read_rig(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_only_an_arm_has_limits_of_a_motor(write):
    for line in LIMITS.splitlines():
        text = OSCILLATOR.replace("[columns]", f"{line}\n[columns]", 1)
        key = line.partition(" ")[0]
        with pytest.raises(InputError, match=f"line 4: the key '{key}' belongs to flexible_arm; .*Remove it"):
            read_rig(write(text))


def test_oscillator(write, tmp_path, monkeypatch):
    monkeypatch.delenv("DISCOVERY_DATA", raising=False)
    rig = read_rig(write(OSCILLATOR))
    assert rig.columns.time.rate == 610.3515625
    assert rig.columns.input.interpolation == "band_limited"
    assert rig.columns.output.noise == pytest.approx(2e-4)
    assert rig.declared == ("viscous_damping", "linear_stiffness")
    assert rig.records["train"][0].samples == (40650, 105712)
    assert [part.file for part in rig.records["holdout"]] == [tmp_path / "SNLS80mV.mat", tmp_path / "other.mat"]
    assert rig.records["holdout"][1].samples is None


def test_oscillator_without_input_declares_the_linear_model(write):
    rig = read_rig(
        write(
            'name = "pendulum"\nkind = "oscillator"\n[columns]\ntime = { name = "t", unit = "ms" }\n'
            'output = { name = "angle", unit = "deg" }\n'
        )
    )
    assert rig.columns.input is None
    assert rig.declared == LINEAR_MODEL
    assert (rig.columns.time.name, rig.columns.time.unit) == ("t", "ms")


def test_records_are_found_in_the_data_folder(write, tmp_path, monkeypatch):
    (tmp_path / "data" / "silverbox").mkdir(parents=True)
    there = tmp_path / "data" / "silverbox" / "SNLS80mV.mat"
    there.touch()
    monkeypatch.setenv("DISCOVERY_DATA", str(tmp_path / "data"))
    assert read_rig(write(OSCILLATOR)).records["train"][0].file == there


@pytest.fixture
def records(tmp_path, monkeypatch):
    """Return a function that makes files in two data folders, and the file that a rig file's drop.csv then is."""
    monkeypatch.setenv("DISCOVERY_DATA", f"{tmp_path / 'one'}{os.pathsep}{tmp_path / 'two'}")
    rig = 'name = "ball"\nkind = "falling_body"\n[columns]\ntime = { name = "t", unit = "s" }\n'
    rig += 'output = { name = "h", unit = "m" }\n[records]\ntrain = [{ file = "drop.csv" }]\n'

    def find(folder, *files):
        for file in files:
            (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / file).touch()
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "rig.toml").write_text(rig)
        file = read_rig(tmp_path / folder / "rig.toml").records["train"][0].file
        return file.relative_to(tmp_path).as_posix()

    return find


def test_records_are_found_in_the_folder_called_like_that_of_the_rig_file(records):
    assert records("b", "one/a/drop.csv", "two/b/drop.csv", "two/c/drop.csv") == "two/b/drop.csv"


def test_the_first_data_folder_comes_first(records):
    assert records("mine", "one/a/drop.csv", "two/a/drop.csv") == "one/a/drop.csv"


def test_a_name_that_several_subfolders_have_is_refused(records):
    with pytest.raises(InputError, match=r"'drop\.csv', which is in .*a and in .*b\. Name it with its folder"):
        records("mine", "one/a/drop.csv", "two/b/drop.csv")


def test_records_of_a_registered_set_are_not_those_of_another(records):
    set_ = "balloon_globo_chico"
    assert records(set_, "one/balloon_globo_mediano/drop.csv") == f"{set_}/drop.csv"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("length_m", "lenght_m", r"line 3: the key 'lenght_m' is not known\. Did you mean 'length_m'\?"),
        ("length_m = 1.0", "length = 1.0", r"line 3: the key 'length' lacks its unit.*'length_m'"),
        ("length_m = 1.0\n", "", "lacks the key 'length_m'"),
        ('name = "fibreglass arm"\n', "", "lacks the key 'name'"),
        ("length_m = 1.0", "length_m = 1000.0", "line 3: 'length_m' is 1000 m, which is not plausible.*suffix"),
        ("length_m = 1.0", 'length_m = "1 m"', "line 3: the key 'length_m' is '1 m', but.*number"),
        ("length_m = 1.0", "length_m = -1.0", "line 3.*greater than 0"),
        ("length_m = 1.0", "length_m = nan", "line 3: the key 'length_m' is nan"),
        ("length_m = 1.0", "length_m.value = nan", "line 3: the key 'length_m.value' is nan"),
        (
            "length_m = 1.0",
            '"length_m.value" = 1.0',
            r"line 3: .* Write length_m = 1.0, or with .*\{ value = 1.0, sd =",
        ),
        (
            "length_m = 1.0",
            "length_m = 1.0\nlength_m_sd = 0.1",
            "line 4: the key 'length_m_sd' is not known. Write len",
        ),
        ("length_m = 1.0", "length_m.mean = 1.0", r"'length_m.mean' is not known\. .*Known here: value, sd"),
        ("length_m = 1.0", "length_mm = 1e6", "'length_mm' is 1e.06 mm, that is 1000 m, which is not plausible"),
        (
            "length_m = 1.0",
            "length_m = 1.0\ngravity_m_s2 = 9.8",
            "line 4: the key 'gravity_m_s2' belongs to pendulum or",
        ),
        ("7e-5", "7e-5\n[model]\neffects = ['falling_body']", "line 10, key 'model.effects': There is no effect"),
        ("length_m = 1.0", "length_m = true", "line 3.*must be a number"),
        ("length_m = 1.0", "length_kg = 1.0", "line 3: key 'length_kg'.*cannot be converted to 'm'"),
        ("length_m = 1.0", "length_m = 1.0\nlength_mm = 1000", "line 4.*second time"),
        ("length_m = 1.0", "length_m = { value = 1.0, std = 0.1 }", r"line 3.*'length_m.std'.*Did you mean 'sd'\?"),
        ("length_m = 1.0", "length_m = { sd = 0.1 }", "lacks the key 'length_m.value'"),
        ("length_m = 1.0", "length_m = ", "not valid TOML.*line 3"),
        ("3e-4", "0.05\nlength_mm = 400", "second time"),
        ("7e-5", "7.0", "'angle_noise_rad' is 7 rad, which is not plausible"),
        ("3e-4", "{ value = 3e-4, sd = 1e-5 }", "position_noise_m' has an sd, which nothing uses. Write .* = 0.0003"),
        ("3e-4", "0.3", "'position_noise_m' is 0.3 m, which is not plausible"),
        ('name = "fibreglass arm"', 'name = "a"\nkind = "osc"', "line 3: the key 'kind' is 'osc'.*flexible_arm"),
        ('name = "fibreglass arm"', 'name = "a"\nkind = "oscillator"', r"no table \[columns\]"),
    ],
)
def test_arm_errors(write, old, new, message):
    path = write(ARM.replace(old, new, 1))
    with pytest.raises(InputError, match=message) as error:
        read_rig(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"band_limited"', '"band_limit"', r"line 6: the key 'columns.input.interp.*Did you mean 'band_limited'\?"),
        ('unit = "mV"', 'unit = "mVV"', "line 7, column 'output'.*'mVV' is not known"),
        ('name = "V2", ', "", "lacks the key 'columns.output.name'"),
        ("rate_hz = 610.3515625", "rate = 610.0", r"line 5.*'columns.time.rate'.*Did you mean 'rate_hz'\?"),
        ("{ rate_hz = 610.3515625 }", "{ }", "line 5: the time needs either a rate"),
        ("{ rate_hz = 610.3515625 }", "{ rate_hz = 610.3515625, scale = 0.5 }", "line 5: a rate has no scale"),
        ("rate_hz = 610.3515625", 'rate_hz = 610.0, name = "t"', "line 5: the time needs either"),
        ("rate_hz = 610.3515625", 'name = "t", unit = "mm"', "column 'time'.*cannot be converted to 's'"),
        ("holdout", "hold_out", r"'records.hold_out' is not known. Did you mean 'holdout'\?"),
        ("[40650, 105712]", "[105712, 40650]", "is empty. Give"),
        ("[40650, 105712]", "[40650]", "'records.train.samples'"),
        ("noise = 0.2", "noise = 0", "greater than 0"),
        ('["viscous_damping", "linear_stiffness"]', "[]", "'model.effects'"),
    ],
)
def test_oscillator_errors(write, old, new, message):
    with pytest.raises(InputError, match=message):
        read_rig(write(OSCILLATOR.replace(old, new, 1)))


@pytest.mark.parametrize(
    ("unit", "more", "message"),
    [
        ("g", ', reads = "acceleration"', "line 6: the key 'columns.output.unit' is 'g', a mass.*mean 'g_0'"),
        ("mg", ', reads = "acceleration"', "Did you mean 'mg_0'"),
        ("g", "", 'an angle, or in volts. Did you mean .g_0.*also needs reads = "acceleration"'),
        ("g", "", "A force that a scale shows is in 'gf', and the output of a .system. in its own equations"),
        ("kg", "", "Correct the unit.*A force that a scale shows is in 'kgf'"),
        ("kg", ', reads = "acceleration"', "a mass, but the output is read as an acceleration.*Correct the unit"),
        ("mm", ', reads = "acceleration"', "'mm', a length, but"),
        ("deg", ', reads = "acceleration"', "'deg', an angle, but"),
        ("m/s", ', reads = "acceleration"', "'m/s', a speed, but"),
    ],
)
def test_an_output_in_a_unit_of_something_else_is_refused(write, unit, more, message):
    text = (
        'name = "beam"\nkind = "oscillator"\n[columns]\ntime = { name = "t", unit = "ms" }\n\n'
        f'output = {{ name = "a", unit = "{unit}"{more} }}\n'
    )
    with pytest.raises(InputError, match=message):
        read_rig(write(text))


@pytest.mark.parametrize(
    ("unit", "reads"),
    [
        *((unit, "acceleration") for unit in ("g_0", "mg_0", "m/s^2", "deg/s^2", "V", "1", "count")),
        *((unit, "position") for unit in ("m", "inch", "rev", "1", "mV", "pixel", "A", "N", "kPa", "rpm", "m/s^2")),
    ],
)
def test_an_output_in_a_unit_of_what_is_read_passes(write, unit, reads):
    path = write(
        'name = "beam"\nkind = "oscillator"\n[columns]\ntime = { name = "t" }\n'
        f'output = {{ name = "a", unit = "{unit}", reads = "{reads}" }}\n'
    )
    assert read_rig(path).columns.output.unit == unit


def test_a_pendulum_may_be_read_by_an_accelerometer_that_turns(write):
    text = 'name = "p"\nkind = "pendulum"\n[columns]\ntime = { name = "t" }\noutput = { name = "a", unit = "UNIT" }\n'
    read = text.replace("UNIT", 'deg/s^2", reads = "acceleration')
    assert read_rig(write(read)).columns.output.reads == "acceleration"
    for wrong in ('deg", reads = "acceleration', "deg/s^2"):
        with pytest.raises(InputError, match="cannot be converted"):
            read_rig(write(text.replace("UNIT", wrong)))


def test_the_force_of_a_view_is_no_mass(write):
    text = (
        'name = "d"\nkind = "drive"\n[columns]\ntime = { name = "t" }\ninput = { name = "x", unit = "m" }\n'
        'output = { name = "f", unit = "kg" }\n[view]\noutput = "force"\nmotion_cutoff_hz = 20.0\ncutoff_hz = 10.0\n'
    )
    with pytest.raises(InputError, match="'kg', a mass, but the output is read as a force or a torque, as in N, kgf"):
        read_rig(write(text))
    assert read_rig(write(text.replace('"kg"', '"kgf"'))).columns.output.unit == "kgf"


def test_arm_must_not_declare_columns(write):
    columns = '[columns]\ntime = { rate_hz = 100 }\noutput = { name = "y", unit = "m" }\n'
    with pytest.raises(InputError, match=r"line 9, declares \[columns\]"):
        read_rig(write(ARM + columns))


def test_noise_of_the_size_of_the_arm(write):
    with pytest.raises(InputError, match="position_noise_mm"):
        read_rig(write('name = "a"\nlength_m = 0.3\nposition_noise_m = 0.05\n'))


def test_missing_and_binary_file(tmp_path):
    with pytest.raises(InputError, match="cannot be read: No such file"):
        read_rig(tmp_path / "none.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(InputError, match="not valid TOML"):
        read_rig(tmp_path / "binary.toml")


@pytest.mark.parametrize(
    ("unit", "what"), [("km/h", "a speed"), ("g_0", "an acceleration"), ("kN", "a force"), ("mm", "")]
)
def test_a_speed_that_is_taken_as_a_position_is_doubted(tmp_path, unit, what):
    (tmp_path / "rig.toml").write_text(
        'name = "c"\nkind = "oscillator"\n[columns]\ntime = { name = "t", unit = "s" }\n'
        f'output = {{ name = "v", unit = "{unit}" }}\n'
    )
    time = np.linspace(0.0, 20.0, 400)
    table = np.column_stack([time, np.sin(3 * time) + 0.01 * np.random.default_rng(0).normal(size=400)])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="t,v", comments="")
    (experiment,) = load_dataset(tmp_path / "rig.toml", tmp_path / "a.csv").train
    told = [flag for flag in experiment.recording.flags if flag.code == "rate_as_position"]
    assert len(told) == bool(what)
    if told:
        assert told[0].severity == "doubt"
        assert f"'v', {what}, is taken as the position" in told[0].sentence
