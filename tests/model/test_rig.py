from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refusals import coded
from swingid.errors import InputError, UsageError
from swingid.model.rig import Rig
from swingid.model.rig.sensors import Sensor
from swingid.units import Quantity

EXAMPLES = Path(__file__).parents[2] / "examples" / "rigs"
WHEEL = '[drive]\nkind = "reaction-wheel"\n[drive.wheel]\ninertia = 1e-4\n'
NONE = '[drive]\nkind = "none"\n'
DIRECT = '[drive]\nkind = "direct"\n'
LINEAR = '[axis]\nkind = "linear"\n'


def rig(text: str) -> Rig:
    return Rig.from_text(text, "my.toml")


def test_paper_is_section_5() -> None:
    paper = Rig.load("paper")
    motor, wheel = paper.drive.motor, paper.drive.wheel
    assert motor is not None
    assert wheel is not None
    values = (
        paper.axis.inertia,
        paper.axis.gravity_torque,
        paper.axis.friction.viscous,
        wheel.inertia,
        motor.rotor_inertia,
        motor.gear_ratio,
        motor.torque_per_volt,
        motor.back_emf,
        motor.viscous,
        motor.coulomb,
        motor.efficiency,
    )
    expected = (302.2e-5, 78e-3, 26e-5 * 4.4, 11.34e-5, 0.21e-5, 4.4, 52.04e-4, 3.697e-6, 3.687e-5, 302.02e-5, 0.9)
    for quantity, value in zip(values, expected, strict=True):
        assert isinstance(quantity, Quantity)
        assert quantity.value == pytest.approx(value, rel=1e-15)
        assert quantity.std is None
    assert motor.dead_zone == (-2.996e-4, 5.485e-4)
    assert motor.voltage_limit == 10
    assert paper.drive.a12 == pytest.approx(11.34e-5 + 4.4 * 0.21e-5)
    assert paper.drive.a22 == pytest.approx(11.34e-5 + 4.4**2 * 0.21e-5)
    assert paper.sensors.of("angle") == paper.sensors.of("wheel") == Sensor(resolution=2 * math.pi / 16384)
    assert (paper.source, paper.name) == ("built-in paper", "paper-2020")


def test_test_body_adds_its_inertia_and_doubles_gravity() -> None:
    paper, body = Rig.load("paper"), Rig.load("paper-body")
    assert body.axis.inertia is not None
    assert paper.axis.inertia is not None
    assert body.axis.inertia.value - paper.axis.inertia.value == pytest.approx(96.1e-5)
    assert isinstance(paper.axis.gravity_torque, Quantity)
    # m_body g l2 of section 5 is the printed 78e-3 N m
    assert paper.axis.gravity_torque.value == pytest.approx(68.0e-3 * 9.81 * 117.0e-3, rel=2e-3)
    assert body.axis.gravity_torque == Quantity(0.156)
    assert (body.drive, body.sensors, body.log) == (paper.drive, paper.sensors, paper.log)


def test_defaults_of_an_almost_empty_file() -> None:
    plain = rig(WHEEL)
    assert plain.axis.gravity_torque == Quantity(0.0)
    assert plain.axis.inertia is None
    assert plain.drive.a22 == 1e-4
    assert plain.drive.a12 == pytest.approx(1e-4, rel=1e-4)  # as the wheel's tilt is not stated
    unknown = Quantity(0.0, math.radians(0.15))
    expected = Sensor(cosine=unknown, sine=unknown, twice=math.radians(0.05), assumed=True)
    assert plain.sensors.of("angle") == plain.sensors.of("wheel") == expected
    assert (plain.log.time, plain.log.angle, plain.log.wheel_angle, plain.log.voltage) == ("t", "q1", "q2", "u")
    assert (plain.log.reference, plain.log.angle_zero, plain.log.wheel_angle_is) == ("ym", "down", "relative")
    assert plain.log.drive_held
    assert plain.log.model_fields_set == frozenset()


def test_units_follow_the_axis() -> None:
    text = LINEAR + 'inertia = "95 ± 0.1 kg"\nfriction.viscous = "0.2 N/(mm/s)"\nfriction.coulomb = "20 N"\n'
    log = '[log]\nangle_unit = "mm"\ntorque_gain = "35 ± 0.35"\n'
    carriage = rig(text + DIRECT + '[sensors]\nresolution = "50 nm"\n' + log)
    assert carriage.axis.inertia == Quantity(95.0, 0.1)
    assert carriage.axis.friction.viscous is not None
    assert carriage.axis.friction.viscous.value == pytest.approx(200.0)
    assert carriage.sensors.of("angle").resolution == pytest.approx(5e-8)
    assert carriage.log.torque_gain == Quantity(35.0, 0.35)


@pytest.mark.parametrize(
    ("spelled", "unit"),
    [("degrees", "deg"), ("Degree", "deg"), ("°", "deg"), ("radians", "rad"), ("revolutions", "turns"), ("deg", "deg")],
)
def test_units_in_full(spelled: str, unit: str) -> None:
    conventions = rig(f'{WHEEL}[log]\nangle_unit = "{spelled}"\nwheel_angle_unit = "{spelled}"\n').log
    assert conventions.angle_unit == conventions.wheel_angle_unit == unit


def test_wheel_sensor_inherits_what_it_does_not_say() -> None:
    sensors = '[sensors]\ncounts_per_turn = 1000\nnoise = 1e-3\nlatency = "1 ± 0.3 ms"\nnonlinearity = "0.1 deg"\n'
    text = WHEEL + sensors + "[sensors.wheel]\nresolution = 0.25\nnoise = 0\njitter = 1e-4\n"
    both = rig(text).sensors
    bent, late = Quantity(0.0, math.radians(0.1)), Quantity(1e-3, 3e-4)
    assert both.of("angle") == Sensor(math.tau / 1000, bent, bent, noise=1e-3, latency=late)
    assert both.of("wheel") == Sensor(0.25, bent, bent, latency=late, jitter=1e-4)


def test_the_wheel_does_not_inherit_what_was_calibrated_at_the_axis() -> None:
    stated = '[sensors]\nnonlinearity = 1e-3\nnonlinearity_cosine = "2 ± 0.1 mrad"\nnonlinearity_sine = -3e-3\n'
    own = "[sensors.wheel]\nnonlinearity_sine = 0.004\n"
    found = rig(WHEEL + stated).sensors
    assert found.of("angle") == Sensor(cosine=Quantity(2e-3, 1e-4), sine=Quantity(-3e-3), calibrated=("cosine", "sine"))
    assert found.of("wheel") == Sensor(cosine=Quantity(0.0, 1e-3), sine=Quantity(0.0, 1e-3))
    wheel = rig(WHEEL + stated + own).sensors.of("wheel")
    assert wheel == Sensor(cosine=Quantity(0.0, 1e-3), sine=Quantity(0.004), calibrated=("sine",))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (WHEEL + '[sensors]\nnonlinearity_cosine = "100 deg"\n', "at most 0.5"),
        (WHEEL + "[sensors.wheel]\nnonlinearity_sine = -1\n", "at least -0.5"),
        ('[axis]\nkind = "linear"\n' + DIRECT + "[sensors]\nnonlinearity_sine = 1e-3\n", "per turn"),
    ],
)
def test_a_nonlinearity_that_cannot_be(text: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        rig(text)


def test_constants_that_count_as_exact_are_named() -> None:
    paper = Rig.load("paper")
    names = paper.constants_without_uncertainty()
    assert {"axis.gravity_torque", "drive.wheel.inertia", "drive.motor.rotor_inertia", "drive.motor.gear_ratio"} <= set(
        names
    )
    stated = paper.changed({"drive.wheel.inertia": "1134 ± 5 g*cm^2", "axis.gravity_torque": "78 ± 0.4 mN*m"})
    assert set(names) - set(stated.constants_without_uncertainty()) == {"drive.wheel.inertia", "axis.gravity_torque"}
    assert rig(WHEEL).constants_without_uncertainty() == ("axis.gravity_torque", "drive.wheel.inertia")
    unknown = rig('[axis]\ngravity_torque = "unknown"\ninertia = 1\n' + DIRECT)
    assert unknown.constants_without_uncertainty() == ("log.torque_gain",)


def test_changed_rig_is_checked_and_says_so_in_its_text() -> None:
    paper = Rig.load("paper")
    changed = paper.changed(
        {
            "axis.friction.viscous": None,
            "axis.friction.coulomb": Quantity(2e-3, 1e-4),
            "axis.friction.lugre": {"bristle_stiffness": 2.0},
            "sensors.wheel.latency": "0 ± 0.3 ms",
            "drive.motor.dead_zone": (-1e-4, 1e-4),
            "log.angle": 'an "odd"\\name',
        }
    )
    assert changed.axis.friction.viscous is None
    assert changed.axis.friction.coulomb == Quantity(2e-3, 1e-4)
    assert changed.log.angle == 'an "odd"\\name'
    assert Rig.from_text(changed.text, changed.source) == changed
    assert (changed.source, paper.changed({}).axis) == (paper.source, paper.axis)
    with pytest.raises(InputError, match=r"axis\.inertia is -1"):
        paper.changed({"axis.inertia": -1})
    with pytest.raises(InputError, check=coded("unknown-key")):
        paper.changed({"name.first": 1})


BAD = [
    (NONE + "[axis]\ninertai = 3", "unknown-key", "axis.inertai", "did you mean axis.inertia?"),
    ("gravity_torque = 3\n" + NONE, "unknown-key", "gravity_torque", "did you mean axis.gravity_torque?"),
    (NONE + "[axis.friction]\nViscous = 3", "unknown-key", "axis.friction.Viscous", "axis.friction.viscous"),
    (NONE + 'source = "x"', "unknown-key", "drive.source", "kind"),
    ('source = "x"\n' + NONE, "unknown-key", "source", "axis"),
    (WHEEL + "inertai = 3", "unknown-key", "drive.wheel.inertai", "drive.wheel.inertia"),
    ("", "missing-key", "drive", "add the table [drive] with kind"),
    ("[drive]", "missing-key", "drive.kind", "'direct'"),
    ('[drive]\nkind = "reaction-wheel"', "missing-key", "drive.wheel", "missing"),
    ('[drive]\nkind = "reaction-wheel"\n[drive.wheel]', "missing-key", "drive.wheel.inertia", "add it"),
    ('[drive]\nkind = "bike"', "wrong-value", "drive.kind", "'bike'"),
    ("drive = 3", "wrong-value", "drive", "table"),
    (DIRECT + "wheel.inertia = 1", "contradiction", "drive.wheel", "direct"),
    (NONE + "motor.coulomb = 1", "contradiction", "drive.motor", "none"),
    (NONE + "[axis]\ninertia = -3", "out-of-range", "axis.inertia", "-3"),
    (NONE + "[axis]\ninertia = 0", "out-of-range", "axis.inertia", "positive"),
    (NONE + '[axis]\ninertia = "3 kg"', "wrong-unit", "axis.inertia", "'kg'"),
    (NONE + '[axis]\ninertia = "3 ± -1 kg*m^2"', "negative-uncertainty", "axis.inertia", "-1"),
    (NONE + "[axis]\ninertia = nan", "not-finite", "axis.inertia", "nan"),
    (NONE + "[axis]\ninertia = true", "not-a-quantity", "axis.inertia", "true"),
    (NONE + "[axis]\ninertia = 1979-05-27", "not-a-quantity", "axis.inertia", "is 1979-05-27, which is no number"),
    (NONE + '[axis]\ngravity_torque = "unknwon"', "not-a-quantity", "axis.gravity_torque", 'or "unknown"'),
    ('name = "two\\nlines"\n' + NONE, "wrong-value", "name", "one line"),
    (NONE + "[axis]\ngravity_torque = -1", "out-of-range", "axis.gravity_torque", "log.angle_zero"),
    (NONE + LINEAR + "gravity_torque = 1", "contradiction", "axis.gravity_torque", "axis.friction.offset"),
    (LINEAR + 'inertia = "1 kg*m^2"\n' + DIRECT, "wrong-unit", "axis.inertia", "expected in kg"),
    (LINEAR + WHEEL, "contradiction", "drive.kind", "linear"),
    (NONE + "[axis.friction]\nviscous = -1", "out-of-range", "axis.friction.viscous", "-1"),
    (NONE + "[axis.friction]\nviscous = 1\nviscous_positive = 1", "contradiction", "axis.friction.viscous", "one kind"),
    (NONE + "[axis.friction]\ncoulomb_positive = 1", "missing-key", "axis.friction.coulomb_negative", "both"),
    (NONE + "[axis.friction]\ncoulomb = 2\nstatic = 1", "contradiction", "axis.friction.static", "2"),
    (NONE + "[axis.friction]\nstribeck_speed = 1", "missing-key", "axis.friction.static", "stribeck_speed"),
    (NONE + "[axis.friction.lugre]\nbristle_stiffness = 1", "missing-key", "axis.friction.coulomb", "lugre"),
    (WHEEL + "[drive.motor]\nefficiency = 1.2", "out-of-range", "drive.motor.efficiency", "1.2"),
    (WHEEL + "[drive.motor]\nefficiency = 0", "out-of-range", "drive.motor.efficiency", "positive"),
    (WHEEL + "[drive.motor]\ngear_ratio = 0", "out-of-range", "drive.motor.gear_ratio", "positive"),
    (WHEEL + "[drive.motor]\ndead_zone = [1e-3, 2e-3]", "out-of-range", "drive.motor.dead_zone", "d2 <= 0 <= d1"),
    (WHEEL + "[drive.motor]\ndead_zone = 1e-3", "not-a-quantity", "drive.motor.dead_zone", "two"),
    (
        WHEEL + '[drive.motor]\ndead_zone = ["-1 ± 1 N*m", 0]',
        "uncertainty-unused",
        "drive.motor.dead_zone",
        "uncertaint",
    ),
    ("[axis]\ninertia = 1e-25\n" + WHEEL, "unreachable-inertias", "axis.inertia", "unreachable combination"),
    (NONE + "[sensors]\ncounts_per_turn = 8\nresolution = 1", "contradiction", "sensors.resolution", "counts_per_turn"),
    (NONE + "[sensors]\ncounts_per_turn = 0", "wrong-value", "sensors.counts_per_turn", "positive"),
    (NONE + "[sensors]\ncounts_per_turn = 1.5", "wrong-value", "sensors.counts_per_turn", "whole"),
    (NONE + '[sensors]\nnoise = "1 ± 1"', "uncertainty-unused", "sensors.noise", "uncertainty"),
    (NONE + "[sensors]\ndropouts = 1", "out-of-range", "sensors.dropouts", "below 1"),
    (NONE + "[sensors.wheel]\nnoise = 1", "contradiction", "sensors.wheel", "none"),
    (LINEAR + NONE + "[sensors]\ncounts_per_turn = 8", "contradiction", "sensors.counts_per_turn", "linear"),
    (NONE + '[log]\ntime = "t"\nrate = 1000', "contradiction", "log.rate", "time"),
    (NONE + "[log]\nrate = 0", "out-of-range", "log.rate", "positive"),
    (NONE + "[log]\nangle = 1", "wrong-value", "log.angle", "text"),
    (NONE + '[log]\nangle = ""', "wrong-value", "log.angle", "not empty"),
    (NONE + '[log]\nangle_unit = "Grad"', "wrong-value", "log.angle_unit", "'deg'"),
    (NONE + '[log]\nangle_unit = "grad"', "wrong-value", "log.angle_unit", "'deg'"),
    (NONE + '[log]\nangle_unit = "m"', "contradiction", "log.angle_unit", "rotary"),
    (LINEAR + NONE + '[log]\nangle_unit = "deg"', "contradiction", "log.angle_unit", "linear"),
    (LINEAR + NONE + '[log]\nangle_zero = "up"', "contradiction", "log.angle_zero", "linear"),
    (NONE + '[log]\nangle_unit = "counts"', "missing-key", "sensors.counts_per_turn", "counts"),
    (
        WHEEL + '[sensors]\ncounts_per_turn = 8\n[sensors.wheel]\nresolution = 1\n[log]\nwheel_angle_unit = "counts"',
        "missing-key",
        "sensors.wheel.counts_per_turn",
        "wheel_angle_unit",
    ),
    (NONE + "[log]\nangle_sign = 2", "wrong-value", "log.angle_sign", "1 or -1"),
    (
        NONE + '[log]\nangle_zero = "left"',
        "wrong-value",
        "log.angle_zero",
        "'down', 'up' or a number, not 'left'",
    ),
    (NONE + "[log]\nangle_zero = true", "wrong-value", "log.angle_zero", "a number, not true"),
    (NONE + "[log]\nangle_sign = true", "wrong-value", "log.angle_sign", "true"),
    (NONE + '[log]\ndrive_held = "yes"', "wrong-value", "log.drive_held", "true or false, not 'yes'"),
    (NONE + '[log]\nwheel_angle = "q2"', "contradiction", "log.wheel_angle", "none"),
    (DIRECT + '[log]\nvoltage = "u"', "contradiction", "log.voltage", "direct"),
    (
        NONE + '[log]\nvoltage = "u"\ntorque = "f"\nwheel_scale = 2',
        "contradiction",
        "log.wheel_scale",
        "voltage, torque",
    ),
    (NONE + '[log]\ntorque = "tau"', "contradiction", "log.torque", "none"),
    (WHEEL + '[log]\ntorque = "tau"', "contradiction", "log.torque", "direct"),
    (DIRECT + '[log]\ntorque_gain = "2 V"', "wrong-unit", "log.torque_gain", "expected in N*m"),
    (WHEEL + "[log]\ntorque_gain = 2", "contradiction", "log.torque_gain", "direct"),
    (WHEEL + '[log]\nwheel_angle = "q2"\nwheel_speed = "w2"', "contradiction", "log.wheel_speed", "angle"),
    (WHEEL + '[log]\nwheel_angle = "q1"', "contradiction", "log.angle", "also the column of log.wheel_angle"),
    (WHEEL + '[log]\nangle = "q2"', "contradiction", "log.wheel_angle", "also the column of log.angle"),
    (NONE + '[log]\ntime = "x"\nangle = "x"', "contradiction", "log.angle", "also the column of log.time"),
    (DIRECT + '[log]\ntorque = "t"', "contradiction", "log.time", "also the column of log.torque"),
    (NONE + '[log]\nreference = "q1"', "contradiction", "log.angle", "also the column of log.reference"),
    (WHEEL + "[log]\nwheel_scale = 0", "out-of-range", "log.wheel_scale", "positive"),
]


@pytest.mark.parametrize(
    ("axis", "stated", "expected"),
    [
        (LINEAR, '"3.336 ± 0.010 N/A"', Quantity(3.336, 0.01)),
        (LINEAR, '"3.336 N"', Quantity(3.336)),
        (LINEAR, '{value = 3.336, std = 0.01, unit = "N/V"}', Quantity(3.336, 0.01)),
        ("", '"93.5 mN*m/A"', Quantity(0.0935)),
        ("", '"0.1 N*m/mA"', Quantity(100.0)),
        ("", '"0.1 ± 0.002"', Quantity(0.1, 0.002)),
    ],
)
def test_a_gain_is_a_torque_per_logged_unit(axis: str, stated: str, expected: Quantity) -> None:
    gain = rig(f"{axis}{DIRECT}[log]\ntorque_gain = {stated}").log.torque_gain
    assert gain.value == pytest.approx(expected.value)
    assert (gain.std or 0.0) == pytest.approx(expected.std or 0.0)


def test_columns_that_are_not_read_are_free() -> None:
    """A default column of another drive, or the time where rows are evenly spaced, is no channel of this rig."""
    assert rig(NONE + '[log]\nangle = "q2"').log.angle == "q2"
    assert rig(DIRECT + '[log]\nangle = "u"').log.angle == "u"
    assert rig(NONE + '[log]\nangle = "t"\nrate = 100').log.angle == "t"


@pytest.mark.parametrize(("text", "code", "key", "words"), BAD)
def test_unusable_keys_are_named_in_one_sentence(text: str, code: str, key: str, words: str) -> None:
    with pytest.raises(InputError) as refused:
        rig(text)
    message = refused.value.message
    assert refused.value.code == code
    assert message.startswith((f"my.toml: {key} ", f"my.toml: {key}:"))
    assert words in message
    assert "\n" not in message
    assert len(message) < 400


def test_files_that_are_no_rig_files(tmp_path: Path) -> None:
    def refused(path: Path) -> tuple[str, str]:
        with pytest.raises(InputError) as error:
            Rig.load(path)
        assert path.name in error.value.message
        return error.value.code, error.value.message

    file = tmp_path / "rig.toml"
    assert refused(file)[0] == "missing-file"
    file.write_bytes(b'name = "\xff"')
    assert refused(file)[0] == "not-utf8"
    file.write_text("axis = [")
    assert refused(file)[0] == "not-toml"
    file.write_text("a = 1\nb = = 2\n")
    assert "line 2" in refused(file)[1]
    file.write_text("a = " + "[" * 10000)
    assert refused(file)[0] == "not-toml"
    folder = tmp_path / "folder.toml"
    folder.mkdir()
    assert refused(folder)[0] == "not-a-file"
    with pytest.raises(InputError) as caught:
        Rig.load("a\0b.toml")
    assert caught.value.code == "unreadable-file"


def test_names_that_are_no_rig(tmp_path: Path) -> None:
    for name in ("papier", "rig.json", "", tmp_path / "rig", "a\0b"):
        with pytest.raises(UsageError, match="paper, paper-body"):
            Rig.load(name)
    (tmp_path / "rig.toml").write_text(NONE)
    with pytest.raises(UsageError, check=coded("unknown-rig", "rig.toml")):
        Rig.load(tmp_path)
    with pytest.raises(UsageError, match="paper, paper-body"):
        Rig.builtin("paper.toml")


def test_a_file_is_named_after_itself_and_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "my-rig.toml"
    path.write_text(NONE, encoding="utf-8-sig")
    found = Rig.load(str(path))
    assert (found.name, found.source) == ("my-rig", str(path))
    assert found.text.endswith(NONE)


def test_a_rig_is_frozen() -> None:
    with pytest.raises(ValueError, match="frozen"):
        Rig.load("paper").axis.kind = "linear"


def test_rig_files_of_public_data_sets() -> None:
    found = {path.stem: Rig.load(path) for path in sorted(EXAMPLES.glob("*.toml"))}
    assert set(found) >= {"emps", "free_pendulum", "bam_xl330", "dfki_pendulum"}
    emps, free, bam, dfki = (found[name] for name in ("emps", "free_pendulum", "bam_xl330", "dfki_pendulum"))
    assert (emps.axis.kind, emps.drive.kind, emps.log.torque_gain) == ("linear", "direct", Quantity(35.1507))
    assert (emps.log.angle, emps.log.reference, emps.log.torque, emps.log.drive_held) == ("qm", "qg", "vir", True)
    assert emps.sensors.of("angle").resolution == 5e-8
    assert (free.drive.kind, free.log.angle, free.log.angle_zero) == ("none", "theta_rad(up=0)", "up")
    assert isinstance(free.axis.gravity_torque, Quantity)
    assert free.axis.gravity_torque.value == pytest.approx(0.14758 * 9.81 * 0.14775, rel=1e-4)
    assert free.axis.inertia is not None
    assert free.axis.inertia.value == pytest.approx(1.091e-4 + 0.14758 * 0.14775**2, rel=1e-3)
    assert isinstance(bam.axis.gravity_torque, Quantity)
    assert bam.axis.gravity_torque.value == pytest.approx(0.49 * 9.81 * 0.1, rel=1e-4)
    assert dfki.axis.gravity_torque == Quantity(2.992, 0.03)
    assert not dfki.log.drive_held


keys = st.sampled_from(
    [
        "axis",
        "drive",
        "kind",
        "wheel",
        "inertia",
        "sensors",
        "log",
        "angle",
        "friction",
        "lugre",
        "x",
        "dead_zone",
        "motor",
    ]
)
leaves = st.one_of(
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=8),
    st.sampled_from(["none", "direct", "reaction-wheel", "1 kg*m^2"]),
)
tables = st.recursive(
    leaves, lambda inner: st.dictionaries(keys, inner, max_size=4) | st.lists(inner, max_size=3), max_leaves=12
)


@settings(max_examples=200, deadline=None)
@given(st.text(max_size=60))
def test_garbage_text_is_an_input_error(text: str) -> None:
    with pytest.raises(InputError):
        rig(text)


@settings(max_examples=300, deadline=None)
@given(st.dictionaries(keys, tables, max_size=5))
def test_garbage_tables_are_a_rig_or_an_input_error(document: dict[str, object]) -> None:
    try:
        message = f"my.toml: {Rig._validated({'name': 'x', **document}, 'my.toml', '').drive.kind}"
    except InputError as error:
        message = error.message
    assert message.startswith("my.toml: ")
    assert "\n" not in message
