"""Parts of a log: free decays in noise, several releases, and the parts that a user selects."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import swingid as sw
from swingid.cli import main
from swingid.errors import UnanswerableError, UsageError
from swingid.pooling.selected import parts_of
from swingid.preparation.decays import decays
from swingid.preparation.motion import find_motion
from swingid.preparation.segment import of_selected

TEXT = """
name = "pendulum"
[axis]
gravity_torque = "0.3 ± 0.0003 N*m"
inertia = 3e-3
[axis.friction]
coulomb = 2e-3
viscous = 5e-5
[drive]
kind = "none"
[sensors]
counts_per_turn = 8192
"""
RIG = sw.Rig.from_text(TEXT)
J, RATE = 3e-3, 200.0


def motion_of(sizes: np.ndarray, noise: float = 1e-5) -> Any:
    """What `decays` reads of a motion: swings of these sizes, half a second each."""
    times = 0.5 * np.arange(len(sizes) + 1.0)
    return SimpleNamespace(swing_sizes=sizes, turning_times=times, speed=SimpleNamespace(angle_noise=noise))


def shrinking(count: int, loss: float, scatter: float, seed: int) -> np.ndarray:
    """Sizes of swings that lose a share each, with a relative scatter."""
    rng = np.random.default_rng(seed)
    return np.exp(-loss * np.arange(count) + scatter * rng.normal(size=count))


def released(starts: list[float], each: float = 8.0, lift: float = 1.5) -> sw.Recording:
    """A log in which a body is lifted in `lift` s and released, once from each angle, caught after `each` s."""
    angles: list[np.ndarray] = []
    for seed, start in enumerate(starts):
        free = sw.simulate(RIG, duration=each, rate=RATE, initial_angle=start, seed=seed).angle
        share = np.arange(int(lift * RATE)) / (lift * RATE)
        before = angles[-1][-1] if angles else 0.0
        angles += [before + (free[0] - before) * (3 * share**2 - 2 * share**3), free]
    angle = np.concatenate(angles)
    return sw.Recording(time=np.arange(len(angle)) / RATE, angle=angle)


@pytest.fixture(scope="module")
def thrice() -> sw.Recording:
    """Three releases of 8 s each, from 1.5, 11.0 and 20.5 s on."""
    return released([0.8, 0.7, 0.6])


# free decays


@pytest.mark.parametrize("scatter", [0.0, 0.002, 0.01])
@pytest.mark.parametrize("loss", [0.003, 0.03])
def test_a_decay_whose_sizes_scatter_is_used_whole(scatter, loss):
    for seed in range(10):
        found = max(decays(motion_of(shrinking(120, loss, scatter, seed))), key=lambda one: one.last - one.first)
        assert found.free
        assert found.last - found.first > 100


def test_a_wrong_turning_angle_ends_no_decay():
    sizes = shrinking(120, 0.01, 0.003, 0)
    sizes[60:62] *= 1.2  # it makes two swings larger
    (found,) = decays(motion_of(sizes))
    assert (found.first, found.last) == (0, 119)


def test_noise_that_is_known_makes_no_hand():
    """Swings of 3 noises and more: the sizes grow as often as they shrink."""
    rng = np.random.default_rng(3)
    sizes = 3.5 * np.exp(-np.arange(110) / 40) + 0.03 * rng.normal(size=110)
    assert np.count_nonzero(np.diff(sizes) > 0) > 30
    (found,) = decays(motion_of(sizes, noise=0.03 / np.sqrt(2)))
    assert found.free
    assert found.last - found.first > 80


@pytest.mark.parametrize(("scatter", "push"), [(0.0, 0.05), (0.002, 0.05), (0.01, 0.2)])
def test_a_push_after_which_the_swings_stay_larger_ends_a_decay(scatter, push):
    for seed in range(10):
        sizes = shrinking(120, 0.01, scatter, seed)
        sizes[60:] *= 1 + push
        assert not any(one.first < 55 and one.last > 65 for one in decays(motion_of(sizes)))


def test_the_constant_swings_of_a_drive_are_no_part_of_the_decay_after_it():
    rng = np.random.default_rng(5)
    sizes = np.concatenate([np.full(100, 3.6), 3.6 * np.exp(-np.arange(1, 90) / 30)]) + 0.02 * rng.normal(size=189)
    (found,) = decays(motion_of(sizes, noise=0.015))
    assert 96 <= found.first <= 104


# noise of a tenth of the swing

SEISMOMETER = 'name = "s"\n[axis]\ngravity_torque = 0.3\n[drive]\nkind = "none"\n[log]\nclock = "0 ± 1 ppm"\n'


@pytest.mark.parametrize(("share", "known"), [(0.1, 0.01), (0.2, 0.03)])
def test_noise_of_many_samples_averages_out_of_a_slow_swing(share, known):
    """A damped cosine of 10 s at 10 rows/s; of 40 such logs 39 have an answer, and none is 2 u off."""
    rig, omega, time = sw.Rig.from_text(SEISMOMETER), 2 * np.pi / 10, np.arange(4000) / 10
    true = 0.3 / (omega**2 + 1 / 200**2)
    for seed in range(3):
        noise = np.random.default_rng(seed).normal(size=len(time))
        angle = 0.02 * (np.exp(-time / 200) * np.cos(omega * time) + share * noise)
        found = sw.identify(sw.Recording(time=time, angle=angle), rig).inertia
        assert abs(found.value - true) < 2.5 * found.standard_uncertainty
        assert found.standard_uncertainty < known * true


def test_steps_of_an_encoder_do_not_average_out():
    time = np.arange(4000) / 10
    angle = np.rint(1.2 * np.exp(-time / 200) * np.cos(2 * np.pi / 10 * time))
    with pytest.raises(UnanswerableError) as caught:
        find_motion(time, angle, 1 / np.sqrt(12))
    assert caught.value.code == "no-motion"


# several releases


def test_every_release_is_a_part_of_one_result(thrice):
    result = sw.identify(thrice, RIG)
    alone = sw.identify(thrice.segment(0, 9.4), RIG)
    assert result.status == "ok"
    assert result.inertia.value == pytest.approx(J, rel=3e-4)
    assert len(result.per_part) == 3
    for one, begin in zip(result.per_part, (1.5, 11.0, 20.5), strict=True):
        assert begin < one.start < begin + 0.5
        assert begin + 7 < one.stop < begin + 8
        assert one.value == pytest.approx(J, rel=1e-3)
        assert one.status == "ok"
    # what the data say is better known, what the rig states is not
    own, common = (sum(e.standard_uncertainty**2 for e in one.budget if e.type == "A") for one in (alone, result))
    assert common < own
    assert result.inertia.standard_uncertainty == pytest.approx(1e-3 * J, rel=0.1)
    assert next(note for note in result.notes if note.code == "releases").message.startswith("3 free decays")
    assert json.loads(result.to_json())["per_part"][2]["value"] == result.per_part[2].value


def test_many_releases_are_found():
    starts = [0.75 + 0.15 * ((7 * k) % 22) / 22 for k in range(22)]
    result = sw.identify(released(starts), RIG)
    assert len(result.per_part) == 22
    low, high = result.inertia.interval95
    assert low < J < high


# selected parts


def test_selected_parts_are_used_as_they_are(thrice):
    result = sw.identify(thrice, RIG, part=[(2, 9), "11.5:18"])
    assert [(one.start, one.stop) for one in result.per_part] == [(2, 9), (11.5, 18)]
    used = [one.details for one in result.per_log]
    assert [(one.start, one.stop) for one in used] == [(2, 9), (11.5, 18)]
    assert result.inertia.value == pytest.approx(J, rel=3e-4)
    assert result.status == "ok"


@pytest.mark.parametrize("method", ["momentum", "equation-error"])
def test_all_of_a_selected_part_is_used_with_a_warning_where_it_is_no_decay(thrice, method):
    result = sw.identify(thrice, RIG, method, part=(0, 9))
    assert (result.details.start, result.details.stop) == (0, 9)
    (warning,) = [one for one in result.warnings if one.code == "selected-part"]
    assert "looks like a free decay" in warning.message


def test_a_transient_in_a_selected_part_is_a_note_and_a_rest_at_the_end_too():
    time = np.arange(20_000) / 1000
    growing = sw.Recording(time=time, angle=np.clip(0.1 + 0.9 * time / 7, 0, 1) * np.sin(8.5 * time), selected=True)
    found = of_selected(growing, find_motion(time, growing.angle, 0.0), "torque")
    assert found is not None
    assert found.level == "note"
    dying = sw.Recording(time=time, angle=np.clip(1 - time / 14, 0, None) * np.cos(8.5 * time), selected=True)
    found = of_selected(dying, find_motion(time, dying.angle, 0.0), None)
    assert found is not None
    assert (found.level, found.code) == ("note", "selected-part")


@pytest.mark.parametrize(
    ("part", "told"),
    [
        ((9, 2), "ends before it begins"),
        ("9:2", "ends before it begins"),
        ([(2, 12), (11, 18)], "overlap"),
        ("a:b", "is no part"),
        ((2, "x"), "is no part"),
        ((2, None), "is no part"),
        ((float("nan"), 3), "is no part"),
        ([(1, 2, 3)], "is no part"),
        ("2", "is no part"),
        (5, "is no part"),
    ],
)
def test_what_is_no_part_is_refused_in_one_sentence(part, told):
    with pytest.raises(UsageError, match=told) as caught:
        parts_of(part)
    assert caught.value.code == "bad-part"
    assert caught.value.message.count(". ") == 0


@pytest.mark.parametrize(
    ("part", "code"), [((100, 200), "empty-segment"), ((3, 3.05), "too-short"), ((3, 4), "no-turning-points")]
)
def test_a_part_with_too_little_in_it_is_refused(thrice, part, code):
    with pytest.raises(UnanswerableError) as caught:
        sw.identify(thrice, RIG, part=part)
    assert caught.value.code == code


def test_commands_take_parts(thrice, tmp_path, capsys):
    log, rig = tmp_path / "log.csv", tmp_path / "rig.toml"
    rig.write_text(TEXT, encoding="utf-8")
    thrice.save(log)
    parts = ["--part", "2:9", "--part", "11.5:18"]
    assert main(["identify", str(log), "--rig", str(rig), "--json", "-", *parts]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [one["stop"] for one in told["per_part"]] == [9, 18]
    assert [one["provenance"]["log"] for one in told["per_log"]] == [f"{log} 2:9", f"{log} 11.5:18"]
    words = ["compare", str(log), "--rig", str(rig), "--method", "momentum", "--json", "-", *parts]
    assert main(words) == 0
    trials = json.loads(capsys.readouterr().out)["results"]
    assert [one["log"] for one in trials] == [f"{log} 2:9", f"{log} 11.5:18"]
    assert main(["identify", str(log), "--rig", str(rig), "--part", "2:12", "--part", "11:18"]) == 2
    assert "overlap" in capsys.readouterr().err
