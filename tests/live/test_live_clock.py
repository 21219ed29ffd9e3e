"""The device's clock against the computer's, samples that the device flags, the zero of the body at rest."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from live_faults import FaultyDevice, Rules
from live_host import RIG
from long_cases import quick_first, quick_if
from refusals import coded
from swingid.control.compensator import Compensator
from swingid.control.references.parse import parse_reference
from swingid.errors import DeviceError, UsageError
from swingid.identification import identify
from swingid.live.devices.twin import twin_of
from swingid.live.experiment import Conductor, Order
from swingid.live.frames import Frame
from swingid.live.guard import Board, Limits, Readings
from swingid.live.plant import Plant
from swingid.live.preflight import rehearsed
from swingid.live.rest import Channel, friction_band, hanging, listening_time, period_of, require_rate
from swingid.model.rig import Rig
from swingid.recording.live import Comparison, compare
from swingid.recording.recording import Recording
from swingid.result.result import Result

TRUTH = 3.022e-3


def arrivals(
    deviation: float, seconds: float, seed: int, *, jitter: float, period: float = 1e-3, turn: float = 5e-3
) -> tuple[np.ndarray, np.ndarray]:
    """Device times and arrivals (s) of samples that come late by an exponential delay and are seen at the next turn."""
    draws = np.random.default_rng(seed)
    true = np.arange(int(seconds / period)) * period * (1 - deviation)  # the board samples by its own clock
    device = true * (1 + deviation)
    arrived = np.maximum.accumulate(true + 3e-4 + draws.exponential(jitter, len(true)))
    phase = draws.uniform(0, turn)
    return device, (np.ceil((arrived - phase) / turn)) * turn + phase + draws.exponential(1e-4, len(true)) * 0.1


@pytest.mark.parametrize("deviation", [0.0, 1e-3, -1e-3, 0.01, -0.05])
def test_a_deviation_is_found_exactly_without_jitter(deviation: float) -> None:
    device = np.arange(25_000) * 1e-3
    found = compare(device, 7.0 + device / (1 + deviation))
    assert found is not None
    assert found.deviation == pytest.approx(deviation, abs=1e-9)
    assert found.spread < 2e-5  # nothing but the turns of the host's loop


@pytest.mark.parametrize(("seconds", "jitter"), quick_first(1, product([6.0, 25.0], [1e-4, 1e-3, 5e-3])))
def test_the_spread_holds(jitter: float, seconds: float) -> None:
    """Of 60 runs with delays of some ms nearly all lie within two standard uncertainties, and these are not wide."""
    found = [compare(*arrivals(200e-6, seconds, seed, jitter=jitter)) for seed in range(60)]
    assert all(found)
    within = [abs(one.deviation - 200e-6) <= 2 * one.spread for one in found if one is not None]
    assert np.mean(within) > 0.93
    spreads = [one.spread for one in found if one is not None]
    assert np.median(spreads) < 6e-4 * (6.0 / seconds) * max(jitter / 1e-3, 1.0)


def test_what_cannot_be_compared_is_not() -> None:
    device = np.arange(1500) * 1e-3
    assert compare(device, device) is None  # too short
    device = np.arange(9000) * 1e-3
    assert compare(device[::-1], device) is None  # time that goes back
    late = np.concatenate([device, device + 60.0])
    assert compare(late, late) is None  # blocks without a sample
    assert compare(np.array([]), np.array([])) is None


def test_a_clock_that_jumps_is_unsteady_and_not_fast() -> None:
    device = np.arange(25_000) * 1e-3
    found = compare(device, device + np.where(device > 12.0, 0.08, 0.0))
    assert found is not None
    assert found.is_unsteady
    assert abs(found.deviation) < 2 * found.spread
    assert not Comparison(0.0, 1e-5, 1e-3).is_unsteady


def run(out: Path, rules: Rules | None = None, rig: Rig = RIG, seconds: float = 12.0, **device: object) -> Result:
    order = Order(parse_reference("sine 0.8 rad 8.5 rad/s"), Compensator.paper(RIG), seconds)
    Conductor(rig, FaultyDevice(rules or Rules(), rig=rig, **device)).run(order, out)  # type: ignore[arg-type]
    return identify(Recording.load(out, rig), rig)


def holds(result: Result, share: float = 1.0) -> bool:
    low, high = result.inertia.interval95
    return abs(result.inertia.value - TRUTH) <= share * (high - low) / 2


@pytest.mark.parametrize(
    ("deviation", "stated"),
    quick_if(
        lambda case: case == (0.004, "0"),
        product([0.004, -0.004, 0.001, 1.5e-4, -5e-5], ["0", "0 ± 100 ppm"]),
    ),
)
def test_an_answer_does_not_come_from_a_wrong_clock(deviation: float, stated: str, tmp_path: Path) -> None:
    """Believed, 0.4 % made an error of 30 half-widths with the default of the clock, 300 with the twin's."""
    rig = RIG.changed({"log.clock": stated})
    result = run(tmp_path / "run.mcap", Rules(time=lambda row, t: t * (1 + deviation)), rig)
    assert holds(result, 1.2)
    codes = [warning.code for warning in result.warnings]
    assert codes == (["device-clock"] if abs(deviation) > 5e-4 else [])
    said = [one.message for one in (*result.warnings, *result.notes) if one.code == "device-clock"]
    assert ("fast" in said[0]) == (deviation > 0)
    budget = {entry.source: entry.standard_uncertainty for entry in result.budget}
    assert budget["log.clock"] / result.inertia.value > 1e-5


@pytest.fixture(scope="module")
def fast(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The journal of a run whose device's clock is 0.4 % fast."""
    path = tmp_path_factory.mktemp("clock") / "run.mcap"
    run(path, Rules(time=lambda row, t: t * 1.004))
    return path


def test_a_stated_deviation_of_the_clock_is_taken_and_needs_no_warning(fast: Path) -> None:
    rig = RIG.changed({"log.clock": "4000 ± 100 ppm"})
    result = identify(Recording.load(fast, rig), rig)
    assert result.status == "ok"
    assert holds(result)


def test_the_correction_has_a_switch(fast: Path) -> None:
    log = Recording.load(fast, RIG, repairs={"device-clock": False})
    assert log.duration == pytest.approx(11.999 * 1.004, rel=1e-6)
    assert [one.level for one in log.findings if one.code == "device-clock"] == ["warning"]


def test_an_emulated_rig_moves_by_its_own_clock(tmp_path: Path) -> None:
    order = Order(parse_reference("sine 0.8 rad 8.5 rad/s"), Compensator.paper(RIG), 6.0)
    Conductor(RIG, twin_of(RIG)).run(order, tmp_path / "run.mcap")
    log = Recording.load(tmp_path / "run.mcap", RIG)
    assert "device-clock" not in [one.code for one in log.findings]


def test_flagged_samples_are_not_used(tmp_path: Path) -> None:
    """Repeated readings that the device flags itself; used, they made an error of 2.8 half-widths and "ok"."""
    last = [Readings(0, 0)]

    def one_of_five(row: int, found: Readings) -> Readings:
        if row % 5 and row > 1600:
            return last[0]._replace(valid=False)
        last[0] = found
        return found

    result = run(tmp_path / "run.mcap", Rules(read=one_of_five))
    (flagged,) = [one.message for one in result.warnings if one.code == "flagged-samples"]
    assert "of 12000 samples left out" in flagged
    assert holds(result)
    few = run(tmp_path / "few.mcap", Rules(read=lambda row, r: r._replace(valid=row % 200 != 0)), seconds=6.0)
    assert few.status == "ok"
    assert "30 of 6000 samples left out" in next(n.message for n in few.notes if n.code == "flagged-samples")


def still(axis: np.ndarray, wheel: float = -7.0, rate: float = 1000.0) -> list[Frame]:
    return [
        Frame(
            "Sample",
            {"axis": round(q), "wheel": round(wheel), "time": round(k * 1e6 / rate), "voltage": 0.0, "flags": 0},
        )
        for k, q in enumerate(axis)
    ]


def test_the_zero_is_where_the_body_hangs_over_a_full_period() -> None:
    period = period_of(RIG)
    assert period == pytest.approx(2 * math.pi * math.sqrt(3.1375e-3 / 78e-3), rel=1e-4)
    assert listening_time(RIG) > 1.2 * period
    t = np.arange(int(1000 * listening_time(RIG))) * 1e-3
    step = 2 * math.pi / 16384
    for phase in np.linspace(0, 2 * math.pi, 9):
        # a period that is 12 % longer than by the rig file
        swing = 5000 + 0.004 / step * np.cos(2 * math.pi * t / (1.12 * period) + phase)
        body, wheel = hanging(still(swing), RIG, Board(), "x")
        assert abs(body.zero - 5000) * step < 2 * body.spread
        assert body.spread < 6e-4
        assert wheel is not None
        assert wheel.zero == -7
    quiet, _ = hanging(still(np.full(len(t), 5000.0)), RIG, Board(), "x")
    assert quiet == Channel(16384, 5000.0, 0.0, step / math.sqrt(12))


def test_a_body_at_a_turning_point_does_not_hang_still() -> None:
    """It stands still there: half a second of a swing of 12 mrad looked like rest."""
    t = np.arange(int(1000 * listening_time(RIG))) * 1e-3
    swing = 0.012 * 16384 / (2 * math.pi) * np.cos(2 * math.pi * t / 1.26)
    with pytest.raises(DeviceError, check=coded("not-still")):
        hanging(still(swing), RIG, Board(), "x")


def test_dry_friction_widens_the_zero() -> None:
    assert friction_band(RIG) == 0.0
    dry = RIG.changed({"axis.friction.coulomb": 2e-3})
    assert friction_band(dry) == pytest.approx(2e-3 / 78e-3 / math.sqrt(3))


def test_the_uncertainty_of_the_zero_is_in_the_budget(tmp_path: Path) -> None:
    dry = RIG.changed({"axis.friction.coulomb": 2e-3, "axis.friction.static": 2e-3})
    result = run(tmp_path / "run.mcap", rig=dry, plant=Plant(dry, initial_angle=0.012))
    assert holds(result)
    budget = {entry.source: entry.standard_uncertainty for entry in result.budget}
    assert budget["log.angle_offset"] > 0.0
    assert "zero-at-rest" in [note.code for note in result.notes]


@pytest.mark.parametrize(("rate", "seconds"), [(1010.0, 1.5), (1000.0, 1.2), (1000.0, 1.9)])
def test_samples_of_another_rate_are_refused(rate: float, seconds: float) -> None:
    frames = [Frame("Sample", {"sequence": k, "time": round(k * 1e6 / rate)}) for k in range(1500)]
    with pytest.raises(DeviceError) as error:
        require_rate(frames, Board(), seconds, "x")
    assert error.value.code == "other-rate"
    good = [Frame("Sample", {"sequence": k, "time": k * 1000}) for k in range(1500)]
    require_rate(good, Board(), 1.53, "x")


@pytest.mark.parametrize("words", ["sine 3 rad 8.5 rad/s", "sine 0.05 rad 5 rad/s"])
def test_a_motion_that_the_twin_does_not_follow_is_refused(words: str) -> None:
    limits = replace(Limits.of(RIG), angle=3.0, speed=60.0, wheel_speed=500.0, saturated=60.0)
    span = {"duration": 10.0, "rate": 1000.0, "fade": 0.5}
    with pytest.raises(UsageError, check=coded("does-not-follow")) as error:
        rehearsed(RIG, parse_reference(words), Compensator.paper(RIG), limits, **span)
    assert (error.value.code, error.value.exit_code) == ("does-not-follow", 2)


def test_a_saved_journal_keeps_what_is_known_of_clock_and_zero(fast: Path, tmp_path: Path) -> None:
    log = Recording.load(fast, RIG)
    before = identify(log, RIG)
    again = identify(Recording.load(log.save(tmp_path / "saved.parquet", RIG), RIG), RIG)
    assert again.inertia.value == pytest.approx(before.inertia.value, rel=1e-9)
    assert again.inertia.standard_uncertainty == pytest.approx(before.inertia.standard_uncertainty, rel=1e-6)
