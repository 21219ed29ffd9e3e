"""Reference motions: turning points and peak speeds against dense values and closed forms; the grammar."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from refusals import coded
from swingid.cli import main
from swingid.control.references import (
    Chirp,
    Motion,
    Multisine,
    Reference,
    Sampled,
    Sine,
    Strokes,
    Triangle,
    parse_reference,
)
from swingid.errors import InputError, UsageError
from swingid.model.rig import Rig
from swingid.simulation import simulate

amplitudes = st.floats(0.05, 3.0)
frequencies = st.floats(0.5, 20.0)
durations = st.floats(0.0, 12.0)
sines = st.builds(Sine, amplitudes, frequencies, st.floats(-7.0, 7.0))
multisines = st.lists(sines, min_size=1, max_size=4, unique_by=lambda part: round(part.frequency, 3)).map(
    lambda parts: Multisine(tuple(parts))
)
strokes = st.builds(Strokes, amplitudes, st.floats(0.1, 2.0), st.floats(0.0, 1.0))
triangles = st.builds(
    lambda a, w, part: Triangle(a, w, part * math.pi / w), amplitudes, frequencies, st.floats(0.01, 1.0)
)
chirps = st.builds(Chirp, amplitudes, frequencies, frequencies, st.floats(1.0, 8.0))
motions = st.one_of(sines, multisines, strokes, triangles, chirps)


def dense_reversals(y: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Times at which the steps of a dense sampling change sign; the middle of a flat stretch between."""
    step = np.diff(y)
    moving = np.flatnonzero(np.abs(step) > 1e-12 * np.ptp(y))
    turns = np.flatnonzero(np.sign(step[moving[:-1]]) != np.sign(step[moving[1:]]))
    return 0.5 * (t[moving[turns] + 1] + t[moving[turns + 1]])


@settings(max_examples=150, deadline=None)
@given(motions, st.floats(0.5, 12.0))
def test_turning_points_and_peak_speed_are_those_of_a_dense_sampling(motion: Reference, duration: float) -> None:
    t = np.linspace(0.0, duration, 60_001)
    y = motion(t)
    h = t[1]
    peak = float(np.max(np.abs(np.diff(y)))) / h
    assert motion.peak_speed(duration) >= peak * (1.0 - 1e-9)
    assert motion.peak_speed(duration) == pytest.approx(peak, rel=2e-2 if peak * h < 1e-3 else 1e-1)

    seen, told = dense_reversals(y, t), motion.turning_points(duration)
    assert np.all(np.diff(told) > 0.0)
    # Pairs of reversals closer than a few samples, and those at the ends, cannot be seen in the samples.
    for times, others in ((seen, told), (told, seen)):
        gaps = np.diff(times, prepend=-1.0, append=duration + 1.0)
        clear = (np.minimum(gaps[:-1], gaps[1:]) > 8 * h) & (times > 8 * h) & (times < duration - 8 * h)
        dwell = isinstance(motion, Strokes) * (motion.dwell if isinstance(motion, Strokes) else 0.0)
        clear &= times < duration - dwell
        for time in times[clear]:
            assert np.min(np.abs(others - time)) < 2.5 * h + 2e-3 * dwell


@given(motions, durations)
def test_turning_points_lie_inside_and_motions_stay_within_their_amplitude(motion: Reference, duration: float) -> None:
    times = motion.turning_points(duration)
    assert np.all((times > 0.0) & (times < duration))
    parts = motion.parts if isinstance(motion, Multisine) else (motion,)
    bound = sum(part.amplitude for part in parts)  # type: ignore[attr-defined]
    assert np.max(np.abs(motion(np.linspace(0.0, duration + 1.0, 500)))) <= bound * (1.0 + 1e-12)


@given(st.one_of(sines, strokes, triangles))
def test_simple_motions_are_even_about_their_turning_points(motion: Reference) -> None:
    times = motion.turning_points(12.0)[2:]
    gap = np.min(np.diff(times)) if times.size > 1 else 0.0
    ahead = np.linspace(0.0, gap, 20)
    for time in times[:3]:
        np.testing.assert_allclose(motion(time + ahead), motion(time - ahead), atol=1e-11)


def test_sine_of_the_paper() -> None:
    sine = Sine(0.8, 8.5)
    times = sine.turning_points(9.5)
    np.testing.assert_allclose(times, (np.arange(26) + 0.5) * math.pi / 8.5, rtol=1e-14)
    assert times[-1] == pytest.approx(25.5 * math.pi / 8.5)
    assert sine.peak_speed(25.0) == 0.8 * 8.5
    # Before a quarter of a period from a crest, the largest speed is that of the end.
    assert Sine(0.8, 8.5, math.pi / 2).peak_speed(0.1) == pytest.approx(0.8 * 8.5 * math.sin(0.85))


def test_strokes_have_the_peak_speed_of_the_quintic_and_turn_in_the_middle_of_the_dwell() -> None:
    motion = Strokes(0.8, 0.5, 0.2)
    np.testing.assert_allclose(motion.turning_points(2.3), [0.6, 1.3, 2.0])
    assert motion.peak_speed(0.5) == pytest.approx(15 / 8 * 0.8 / 0.5)
    assert motion.peak_speed(5.0) == pytest.approx(15 / 8 * 1.6 / 0.5)
    np.testing.assert_allclose(
        motion(np.array([0.0, 0.25, 0.5, 0.7, 0.95, 1.2, 1.4])), [0, 0.4, 0.8, 0.8, 0, -0.8, -0.8]
    )


def test_strokes_rest_without_speed_and_acceleration_at_their_ends() -> None:
    motion, h = Strokes(0.8, 0.5, 0.2), 1e-4
    for end in (0.5, 0.7, 1.2, 1.4):
        near = motion(end + h * np.array([-2.0, -1.0, 0.0, 1.0, 2.0]))
        assert np.max(np.abs(np.diff(near))) / h < 1e-5
        assert np.max(np.abs(np.diff(near, 2))) / h**2 < 0.2  # 60 * way / T^3 * 2 h


def test_triangle_has_constant_flanks_and_constant_acceleration_in_the_corners() -> None:
    motion = Triangle(0.8, 2 * math.pi, 0.1)
    assert motion.speed == pytest.approx(4 * 0.8 / 0.9)
    t = np.linspace(-0.2, 0.2, 101)
    np.testing.assert_allclose(motion(t), motion.speed * t, atol=1e-14)
    corner = motion(0.25 + np.linspace(-0.05, 0.05, 101))
    np.testing.assert_allclose(np.diff(corner, 2) / 0.001**2, -2 * motion.speed / 0.1, rtol=1e-6)
    assert corner[50] == pytest.approx(0.8, rel=1e-14)
    np.testing.assert_allclose(motion.turning_points(2.0), [0.25, 0.75, 1.25, 1.75])


def test_chirp_frequency_stays_in_its_band_and_returns() -> None:
    motion = Chirp(0.5, 3.0, 12.0, 5.0)
    turns = motion.turning_points(30.0)
    np.testing.assert_allclose(np.abs(motion(turns)), 0.5, rtol=1e-12)
    local = math.pi / np.diff(turns)
    assert local.min() > 3.0 - 1e-9
    assert local.max() < 12.0 + 1e-9
    # Phase after a sweep up and down: mean frequency times time, and the second pair repeats the first.
    assert len(motion.turning_points(20.0)) == round(7.5 * 20.0 / math.pi)
    assert Chirp(0.5, 4.0, 4.0, 5.0)(np.array([3.3, 7.7])) == pytest.approx(Sine(0.5, 4.0)(np.array([3.3, 7.7])))


def test_multisine_finds_reversals_that_nearly_touch() -> None:
    # cos t - a cos 3t turns at multiples of pi and, once a > 1/9, at sin^2 t = (9 a - 1)/(12 a) beside them.
    a = 1.0 / 9.0 + 1e-7
    motion = Multisine((Sine(1.0, 1.0, math.pi / 2), Sine(a, 3.0, -math.pi / 2)))
    side = math.asin(math.sqrt((9.0 * a - 1.0) / (12.0 * a)))
    assert side < 1e-3
    expected = [side, math.pi - side, math.pi, math.pi + side]
    np.testing.assert_allclose(motion.turning_points(6.0), expected, atol=1e-8)
    merged = Multisine((Sine(1.0, 1.0, math.pi / 2), Sine(1.0 / 9.0 - 1e-7, 3.0, -math.pi / 2)))
    times = merged.turning_points(6.0)
    np.testing.assert_allclose(times[times > 1e-6], [math.pi], atol=1e-8)  # the turn at t = 0 may count


def test_sampled_motion_has_the_turning_points_and_speed_of_what_was_sampled() -> None:
    motion = Multisine((Sine(0.5, 5.0), Sine(0.3, 8.5)))
    t = np.arange(0.0, 10.0, 0.01)
    sampled = Sampled(t, motion(t))
    np.testing.assert_allclose(sampled.turning_points(9.9), motion.turning_points(9.9), atol=2e-5)
    assert sampled.peak_speed(9.9) == pytest.approx(motion.peak_speed(9.9), rel=2e-3)
    shuffled = np.array([7.123, 0.4, 3.3])
    np.testing.assert_allclose(sampled(shuffled), motion(shuffled), atol=1e-5)
    np.testing.assert_allclose(sampled(np.array([-1.0, 99.0])), [motion(t[0]), motion(t[-1])], atol=1e-15)


def test_sampled_peak_speed_is_that_of_the_spline() -> None:
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.1, 0.5, 30))
    sampled = Sampled(t, rng.normal(size=30))
    dense = np.linspace(0.0, 6.0, 200_001)
    speed = np.abs(np.diff(sampled(dense))) / dense[1]
    assert sampled.peak_speed(6.0) == pytest.approx(speed.max(), rel=1e-5)
    assert sampled.peak_speed(0.01) == 0.0


def test_callable_motion_with_a_dwell_and_ripple_below_its_range() -> None:
    stroke = Strokes(0.8, 0.5, 0.2)
    motion = Motion(lambda t: stroke(t) + 1e-5 * np.sin(300.0 * t), "rippled")
    times = motion.turning_points(5.0)
    assert len(times) == len(stroke.turning_points(5.0))
    np.testing.assert_allclose(times, stroke.turning_points(5.0), atol=0.11)
    smooth = Motion(stroke)
    np.testing.assert_allclose(smooth.turning_points(5.0), stroke.turning_points(5.0), atol=2e-3)
    # The central difference is short by step^2/6 times the third derivative: by 16/6 (step/T)^2 here.
    expected = stroke.peak_speed(5.0) * (1.0 - 16.0 / 6.0 * (1e-3 / 0.5) ** 2)
    assert smooth.peak_speed(5.0) == pytest.approx(expected, rel=1e-8)
    with pytest.raises(UsageError, check=coded("bad-reference")):
        Motion(lambda t: np.array([1.0]))(np.zeros(4))


def test_callable_reversals_are_exact_to_the_third_order() -> None:
    motion = Multisine((Sine(0.5, 5.0), Sine(0.3, 8.5)))
    np.testing.assert_allclose(Motion(motion).turning_points(9.9), motion.turning_points(9.9), atol=1e-6)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("sine 0.8 rad 8.5 rad/s", Sine(0.8, 8.5)),
        ("  sine  0.8rad   8.5 ", Sine(0.8, 8.5)),
        ("sine .8 rad 1.5 Hz 0.2 rad", Sine(0.8, 3.0 * math.pi, 0.2)),
        ("sine 0.1 m 2 rad/s", Sine(0.1, 2.0, 0.0, "m")),
        ("multisine 0.5 rad 5 rad/s + 0.3 rad 8.5 rad/s", Multisine((Sine(0.5, 5.0), Sine(0.3, 8.5)))),
        ("strokes 0.8 rad 0.5 s 0.2 s", Strokes(0.8, 0.5, 0.2)),
        ("strokes 0.8 rad 0.5 s", Strokes(0.8, 0.5)),
        ("triangle 0.8 rad 1 Hz 0.1 s", Triangle(0.8, 2 * math.pi, 0.1)),
        ("triangle 0.8 rad 1 Hz", Triangle(0.8, 2 * math.pi, 0.1)),
        ("chirp 0.5 rad 0.5 Hz 2 Hz 20 s", Chirp(0.5, math.pi, 4 * math.pi, 20.0)),
    ],
)
def test_grammar(text: str, expected: Reference) -> None:
    assert parse_reference(text) == expected


def test_units_that_need_conversion() -> None:
    sine = parse_reference("sine 45 deg 1.3 Hz")
    assert isinstance(sine, Sine)
    assert sine.amplitude == pytest.approx(math.pi / 4)
    assert sine.frequency == pytest.approx(2.6 * math.pi)
    linear = parse_reference("triangle 5 cm 500 mHz 100 ms")
    assert isinstance(linear, Triangle)
    assert linear.amplitude == pytest.approx(0.05)
    assert linear.unit == "m"
    assert linear.frequency == pytest.approx(math.pi)
    assert linear.corner == pytest.approx(0.1)


@given(motions)
def test_describe_reads_back(motion: Reference) -> None:
    assert parse_reference(motion.describe()) == motion


@pytest.mark.parametrize(
    "text",
    [
        "",
        "wiggle 0.8 rad",
        "sine",
        "sine 0.8 rad",
        "sine 0.8 rad 8.5 rad/s 0 rad 1 s",
        "sine fast",
        "sine 0.8 rad 8.5 rad/s quickly",
        "sine 0.8 rad 8.5 kg",
        "sine 0.8 kg 8.5 rad/s",
        "sine 0 rad 8.5 rad/s",
        "sine -1 rad 8.5 rad/s",
        "sine 1e999 rad 8.5 rad/s",
        "sine 0.8 rad 8.5 rad/s 1e999 rad",
        "multisine 0.5 rad 5 rad/s +",
        "multisine 0.5 rad 5 rad/s + 0.3 m 8.5 rad/s",
        "multisine 0.5 rad 5 rad/s + 0.3 rad 5 rad/s",
        "strokes 0.8 rad 0.5 s -0.2 s",
        "triangle 0.8 rad 1 Hz 0.6 s",
        "chirp 0.5 rad 0.5 Hz 2 Hz",
        "file",
    ],
)
def test_bad_text_is_one_sentence_with_what_to_do(text: str) -> None:
    with pytest.raises(UsageError) as caught:
        parse_reference(text)
    assert caught.value.message.startswith("Reference ")
    assert caught.value.message.endswith(".")
    assert "\n" not in caught.value.message


@settings(suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(
    st.one_of(
        st.text(max_size=40),
        st.builds(
            lambda kind, words: " ".join([kind, *words]),
            st.sampled_from(["sine", "multisine", "strokes", "triangle", "chirp"]),
            st.lists(st.sampled_from(["0.8", "rad", "-1", "1e400", "s", "Hz", "rad/s", "+", "nan", "m", "1"])),
        ),
    )
)
def test_any_text_is_a_motion_or_a_usage_error(text: str) -> None:
    try:
        motion = parse_reference(text)
    except (UsageError, InputError):
        return
    assert np.all(np.isfinite(motion(np.array([0.0, 1.0]))))


def test_motion_from_a_file(tmp_path) -> None:
    path = tmp_path / "motion.csv"
    t = np.arange(0.0, 3.0, 0.01)
    rows = [f"{a!r},{b!r}" for a, b in zip(t.tolist(), Sine(0.8, 5.0)(t).tolist(), strict=True)]
    path.write_text("\n".join(["t,ym", *rows]))
    motion = parse_reference(f"file {path}")
    np.testing.assert_allclose(motion.turning_points(2.9), Sine(0.8, 5.0).turning_points(2.9), atol=1e-5)
    assert motion.describe() == f"file {path}"

    path.write_text("t,ym\n0,0\n0.1,x\n")
    with pytest.raises(InputError, match="row 3"):
        parse_reference(f"file {path}")
    path.write_text("t,ym\n0,0\n")
    with pytest.raises(InputError, check=coded("bad-reference-file")):
        parse_reference(f"file {path}")
    path.write_text("0,0\n1,1\n1,2\n2,2\n")
    with pytest.raises(InputError) as caught:
        parse_reference(f"file {path}")
    assert caught.value.code == "bad-reference-file"
    with pytest.raises(InputError, check=coded("missing-reference")):
        parse_reference(f"file {tmp_path / 'none.csv'}")


@pytest.mark.parametrize("motion", [Sine(1, 2), Strokes(1, 1), Triangle(1, 1), Chirp(1, 1, 2, 3), Motion(np.sin)])
def test_every_motion_is_a_reference(motion: Reference) -> None:
    assert isinstance(motion, Reference)


# The kind of axis


CART = """
[axis]
kind = "linear"
inertia = 2.0
[axis.friction]
viscous = 3.0
[drive]
kind = "direct"
"""


@pytest.mark.parametrize(("rig", "right", "wrong"), [(CART, "m", "rad"), (None, "rad", "m")])
def test_a_motion_has_the_unit_of_its_axis(rig, right, wrong):
    plant = Rig.builtin("paper") if rig is None else Rig.from_text(rig)
    for words in ("sine 0.1 {} 8.5 rad/s", "strokes 0.1 {} 0.5 s", "chirp 0.1 {} 1 Hz 2 Hz 5 s"):
        moved = simulate(plant, parse_reference(words.format(right)), duration=0.2)
        assert np.ptp(moved.reference) > 0
        with pytest.raises(UsageError, match=f"is in {wrong}, but the rig's axis is {plant.axis.kind}; give it in"):
            simulate(plant, parse_reference(words.format(wrong)), duration=0.2)


def test_a_bare_amplitude_has_the_unit_that_is_asked_for():
    assert parse_reference("sine 0.1 8.5").unit == "rad"
    assert parse_reference("multisine 0.1 8.5 + 0.2 5", "m").unit == "m"
    assert parse_reference("sine 0.1 rad 8.5", "m").unit == "rad"


def test_a_motion_without_a_unit_suits_both():
    for rig in (Rig.from_text(CART), Rig.builtin("paper")):
        assert np.ptp(simulate(rig, lambda t: 0.1 * np.sin(8 * t), duration=0.2).reference) > 0


@pytest.mark.parametrize("command", ["simulate", "rehearse"])
def test_the_commands_refuse_radians_on_a_linear_axis(command, tmp_path, capsys):
    rig = tmp_path / "cart.toml"
    rig.write_text(CART)
    options = ["--rig", str(rig), "--reference", "sine 0.8 rad 8.5 rad/s", "--duration", "5"]
    code = main([command, *options, *(["--out", str(tmp_path / "log.csv")] if command == "simulate" else [])])
    told = capsys.readouterr().err
    assert code == 2
    assert "is in rad, but the rig's axis is linear; give it in m." in told
    assert "compil" not in told
