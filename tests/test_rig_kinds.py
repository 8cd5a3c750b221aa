"""Rig files of every kind of system: defaults, the tables that only some have, refusals."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from discovery.equations.lacking import candidates, ever_candidates
from discovery.equations.model import Model
from discovery.foundation.errors import InputError
from discovery.recordings.recording import read_recording
from discovery.rigs.kinds import KINDS
from discovery.rigs.quantities import QUANTITIES
from discovery.rigs.rig import Controller, ForceView, Quantity
from discovery.rigs.rig_file import read_rig
from discovery.rigs.rig_schema import RigTable

TIME = "[columns]\ntime = { rate_hz = 100.0 }\n"
DRIVEN = TIME + 'input = { name = "u", unit = "V" }\noutput = { name = "y", unit = "mm" }\n'
MOVED = DRIVEN.replace('"V"', '"cm"')
FREE = TIME + 'output = { name = "y", unit = "deg" }\n'
SERVO = (
    'name = "d"\nkind = "drive"\n'
    + TIME
    + 'input = { name = "r", unit = "mm" }\noutput = { name = "y", unit = "mm" }\n'
    + '[controller]\nkp = 160.0\nkv = 0.2\nlimit = 10\nunit = "mV"\nadded = "p"\n'
)
SEEN = TIME + 'input = { name = "y", unit = "mm" }\noutput = { name = "u", unit = "V" }\n'
VIEW = f'name = "d"\nkind = "drive"\n{SEEN}[view]\noutput = "force"\nmotion_cutoff_hz = 30\ncutoff_hz = 10\n'


@pytest.fixture
def read(tmp_path):
    def read(text):
        path = tmp_path / "rig.toml"
        path.write_text(text)
        return read_rig(path)

    return read


def test_the_schema_knows_the_kinds():
    assert set(get_args(RigTable.model_fields["kind"].annotation)) == set(KINDS)


@pytest.mark.parametrize(
    ("kind", "columns", "base", "interpolation"),
    [
        ("oscillator", DRIVEN, "oscillator", "spline"),
        ("oscillator", FREE, "oscillator", None),
        ("pendulum", FREE, "oscillator", None),
        ("base_excited", MOVED, "base_excited", "motion"),
        ("base_excited", MOVED.replace("mm", "deg"), "moving_pivot", "motion"),
        ("drive", DRIVEN, "oscillator", "spline"),
        ("falling_body", FREE.replace("deg", "m"), "falling_body", None),
    ],
)
def test_defaults_of_a_kind(read, kind, columns, base, interpolation):
    rig = read(f'name = "a"\nkind = "{kind}"\n{columns}')
    assert (rig.kind, rig.base) == (kind, base)
    assert base in KINDS[kind].searched
    assert rig.declared == KINDS[kind].declared
    assert (rig.columns.input.interpolation if rig.columns.input else None) == interpolation
    assert rig.gravity == (Quantity(9.80665, 0.02) if kind in ("pendulum", "falling_body") else None)


def test_what_is_tried_on_a_rig_is_told_for_its_kind():
    rigs = [read_rig(path) for path in sorted((Path(__file__).parents[1] / "datasets").glob("*/rig*.toml"))]
    assert {rig.kind for rig in rigs} >= {"oscillator", "pendulum", "base_excited", "drive", "falling_body"}
    for rig in rigs:
        if rig.system is None and not rig.traits.has_rod:
            assert {*candidates(Model(rig.base, ()))} <= ever_candidates(rig.traits.searched)


def test_gravity_and_the_length_of_a_pendulum(read):
    head = 'name = "a"\nkind = "pendulum"\nlength_mm = 250\n'
    rig = read(f"{head}gravity_m_s2 = {{ value = 9.79, sd = 0.001 }}\n{FREE}")
    assert rig.gravity == Quantity(9.79, 0.001)
    assert rig.length == Quantity(0.25, 1e-3)
    assert read(f"{head}gravity_m_per_s2 = 9.8\n{FREE}").gravity == Quantity(9.8, 0.02)
    assert read(f"{head}gravity_cm_per_s2 = 981\n{FREE}").gravity.value == pytest.approx(9.81)
    with pytest.raises(InputError, match=r"line 4: 'gravity_m_s2' is 981 m s\^-2, which is not plausible"):
        read(f"{head}gravity_m_s2 = 981\n{FREE}")
    with pytest.raises(InputError, match=r"lacks its unit\. Write it as a suffix, 'gravity_m_s2'"):
        read(f"{head}gravity = 9.8\n{FREE}")


def test_quantities_of_another_kind_are_refused(read):
    assert all(set(known.kinds) <= set(KINDS) for known in QUANTITIES.values())
    for key in ("tip_mass_kg = 0.04", "length_cm = 25", "gravity_m_s2 = 9.8", "position_noise_mm = 0.3"):
        name = key.partition(" ")[0]
        with pytest.raises(InputError, match=f"line 3: the key '{name}' belongs to .*'oscillator'.*make it a comment"):
            read(f'name = "a"\nkind = "oscillator"\n{key}\n{DRIVEN}')
    with pytest.raises(InputError, match=r"'position_noise_mm' .*noise = \.\.\. of the output in \[columns\]"):
        read(f'name = "a"\nkind = "pendulum"\nposition_noise_mm = 0.3\n{FREE}')


def test_an_encoder_may_state_its_error_wherever_its_motion_is_smoothed(read):
    head = 'name = "a"\nkind = "base_excited"\nangle_noise_deg = 0.1\n'
    turned = MOVED.replace('"cm"', '"deg"').replace('"mm"', '"deg"')
    assert read(head + turned).angle_noise == pytest.approx(np.radians(0.1))
    with pytest.raises(InputError, match="line 3: the key 'angle_noise_deg' belongs to flexible_arm"):
        read(head + turned.replace('name = "u", unit = "deg"', 'name = "u", unit = "deg", interpolation = "spline"'))
    with pytest.raises(InputError, match=r"line 3: .* is the error of an angle, and the input is in 'cm'\. Remove it"):
        read(head + MOVED)


def test_a_falling_body_may_be_declared_bare(read):
    assert read(f'name = "a"\nkind = "falling_body"\n{FREE.replace("deg", "m")}[model]\neffects = []\n').declared == ()


def test_a_controller_makes_a_servo_in_si_units(read):
    rig = read(SERVO)
    assert rig.base == "servo"
    assert rig.base in rig.traits.searched
    assert rig.controller == Controller(160.0, pytest.approx(0.2), pytest.approx(0.01), "mV", "p")


def test_a_view_makes_inverse_dynamics(read):
    rig = read(VIEW)
    assert rig.base == "inverse_dynamics"
    assert rig.view == ForceView(30.0, 10.0, None)
    assert read(VIEW + "decimation = 5\n").view.decimation == 5
    assert rig.columns.input.interpolation == "spline"
    # What a unit of the instrument's own measures is not known: of counts, either may be.
    assert read(VIEW.replace('"mm"', '"count"').replace('"V"', '"count"')).base == "inverse_dynamics"


def test_columns_are_scaled_named_and_read_as_accelerations(read):
    text = (
        'name = "a"\nkind = "oscillator"\n[columns]\nheader = ["u", "y"]\ntime = { rate_hz = 1, assumed = true }\n'
        'input = { name = "u", unit = "V", interpolation = "auto", scale = 2.0 }\n'
        'output = { name = "y", unit = "mV", zero = 3, scale = -1, noise = 2, reads = "acceleration" }\n'
    )
    columns = read(text).columns
    assert columns.header == ("u", "y")
    assert columns.time.assumed
    assert (columns.input.interpolation, columns.input.scale) == ("auto", 2.0)
    assert (columns.output.zero, columns.output.scale, columns.output.reads) == (3.0, -1.0, "acceleration")
    assert columns.output.noise == pytest.approx(2e-3)
    with pytest.raises(InputError, match=r"line 4: the header does not name the column 'y'"):
        read(text.replace('["u", "y"]', '["u", "x"]'))


def test_records_pick_rows_and_have_names(read):
    rig = read(
        f'name = "a"\nkind = "oscillator"\n{DRIVEN}[records]\n'
        'train = [{ file = "a.csv", where = { ball = "Tennis Ball", drop = 1 }, samples = [0, 50], name = "one" }]\n'
        'test = [{ file = "b.csv" }]\n'
    )
    (part,) = rig.records["train"]
    assert part.where == (("ball", "Tennis Ball"), ("drop", 1))
    assert (part.samples, part.name) == ((0, 50), "one")
    assert rig.records["test"][0].where == ()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f'name = "a"\nkind = "base_excited"\n{FREE}', "input is the motion of the base or hub, but declares none"),
        (
            f'name = "a"\nkind = "drive"\n{FREE}',
            r"whose input is the force, but declares none.*not recorded, .*drafts a constant one",
        ),
        (
            f'name = "a"\nkind = "base_excited"\n{DRIVEN}',
            r"line 5: the base moves in 'V' and the deflection is in 'mm', so that they cannot be added",
        ),
        (
            f'name = "a"\nkind = "base_excited"\n{MOVED}'.replace('"cm"', '"deg"'),
            r"the base moves in 'deg' and the deflection is in 'mm'.*scale = 1/l",
        ),
        (f'name = "a"\nkind = "falling_body"\n{DRIVEN}', "line 5, declares an input, but a falling_body has none"),
        ('name = "a"\nkind = "pendulum"\n', r"describes a pendulum but has no table \[columns\]"),
        (f'name = "a"\nkind = "pendulum"\n{DRIVEN}', "line 6, column 'output'.*cannot be converted to 'rad'"),
        (f'name = "a"\nkind = "falling_body"\n{FREE}', "column 'output'.*cannot be converted to 'm'"),
        (SERVO.replace('"drive"', '"oscillator"'), r"line 7: \[controller\] belongs to drive"),
        (SERVO.replace("kp = 160.0", "kp = 0"), "line 8.*greater than 0"),
        (
            f'name = "a"\ntype = "pendulum"\n{FREE}',
            r"line 2: the key 'type' is not known\. Did you mean kind = \"pendulum\"\? Known here: name, kind, ",
        ),
        (SERVO.replace("limit", "limt"), r"line 10: the key 'controller.limt' is not known\. Did you mean 'limit'\?"),
        (SERVO.replace('"r", unit = "mm"', '"r", unit = "V"'), "line 5, column 'input'.*cannot be converted to 'mm'"),
        (SERVO.replace('unit = "mV"', 'unit = "mVV"'), r"line 11, \[controller\]: The unit 'mVV' is not known"),
        (VIEW.replace("cutoff_hz = 10", "cutoff_hz = 50"), "Raise motion_cutoff_hz"),
        (
            VIEW.replace('"mm"', '"kN"'),
            r"rig\.toml, line 5: the key 'columns\.input\.unit' is 'kN', a force or a torque, .* motion as input",
        ),
        (VIEW.replace('"mm"', '"mN m"'), r"line 5: the key 'columns\.input\.unit' is 'mN m'"),
        (
            VIEW.replace('"V"', '"deg"'),
            r"line 6: the key 'columns\.output\.unit' is 'deg', a position, but with .* the output is the force",
        ),
        (VIEW.replace('"V"', '"um"'), r"line 6: the key 'columns\.output\.unit' is 'um'"),
        (VIEW.replace('"force"', '"torque"'), "line 8: the key 'view.output'"),
        (f"{SERVO}[view]\noutput = 'force'\nmotion_cutoff_hz = 30\ncutoff_hz = 10\n", "Keep one of"),
        (f'name = "a"\nlength_m = 1.0\n[view]\n{VIEW.split("[view]")[1]}', r"line 3, declares \[view\], but"),
        (f'name = "a"\nkind = "oscillator"\n{DRIVEN}[model]\neffects = []', "'model.effects'"),
        ('name = "a"\nkind = "drive"\n' + DRIVEN.replace("unit", "scale = 0, unit"), "must not be zero"),
        (f'name = "a"\nkind = "drive"\n{DRIVEN.replace("rate_hz = 100.0", "assumed = true")}', "only a rate can be"),
        (
            f'name = "a"\nkind = "pendulm"\n{FREE}',
            r"line 2: the key 'kind' is 'pendulm', which is not known\. Did you mean 'pendulum'\? Known here: flex",
        ),
        (
            f'name = "a"\nkind = "drive"\n{DRIVEN}[model]\neffects = ["viscous_dampin"]',
            r"rig\.toml, line 8, key 'model\.effects': There is no effect called 'viscous_dampin'\. Did you mean",
        ),
        (
            f'name = "a"\nkind = "drive"\n{DRIVEN}[model]\neffects = ["radius_law"]',
            r"rig\.toml, line 8, key 'model\.effects': 'radius_law' acts on flexible_arm, not on kind 'drive'\. Remove",
        ),
        (
            'name = "a"\nlength_m = 1.0\n[model]\neffects = ["gravity_torque"]',
            r"rig\.toml, line 4, key 'model\.effects': 'gravity_torque' acts on oscillator, not on kind 'flexible_arm'",
        ),
        (
            f'name = "a"\nkind = "drive"\n{DRIVEN}[model]\neffects = ["viscous_damping", "viscous_damping"]',
            r"line 8, key 'model\.effects': 'viscous_damping' is named twice",
        ),
    ],
)
def test_refusals(read, text, message):
    with pytest.raises(InputError, match=message) as error:
        read(text)
    assert "\n" not in str(error.value)


def test_one_row_in_so_many_is_used(tmp_path):
    """With every = 5 a recording is what its file would be with every fifth row, times included."""
    time = np.arange(600) / 100
    rows = "\n".join(f"{t:.2f},{v:.6f}" for t, v in zip(time, np.cos(time), strict=True))
    (tmp_path / "a.csv").write_text(f"t,y\n{rows}\n")
    text = (
        'name = "n"\nkind = "oscillator"\n[columns]\nevery = 5\ntime = { TIME }\noutput = { name = "y", unit = "m" }\n'
    )
    for when in ('name = "t", unit = "s"', "rate_hz = 100.0"):
        (tmp_path / "rig.toml").write_text(text.replace("TIME", when))
        found = read_recording(tmp_path / "a.csv", read_rig(tmp_path / "rig.toml"))
        np.testing.assert_allclose(found.time, time[::5], atol=1e-12)
        np.testing.assert_allclose(found.output[:, 0], np.cos(time[::5]), atol=1e-6)
