"""Online estimation: the same numbers as over all swings at once, in constant memory, whatever rows come."""

from __future__ import annotations

import runpy
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import swingid as sw
from closed_form_logs import (
    INERTIA,
    TWO_TONES,
    Sines,
    direct_log,
    direct_rig,
    exact_rig,
    free_log,
    free_rig,
    wheel_log,
)
from long_cases import quick_first
from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.numerics.regression import fit_linear
from swingid.recording.recording import Recording
from swingid.recursive import swing_estimates
from swingid.recursive.rows import TOO_MANY_BAD, SwingBuffer
from swingid.recursive.solution import Recursion, Solution
from swingid.recursive.stream import FIRST, Swings
from twin_logs import given, logged, twin

TIME = np.arange(0, 12, 1e-3)
METHODS = ("momentum", "energy")


def friction(v):
    return 1e-3 * v + 2e-3 * np.sign(v)


@cache
def two_tones():
    return wheel_log(exact_rig(), TWO_TONES, friction, TIME)


@pytest.fixture(scope="module")
def twin_log(tmp_path_factory):
    """Twenty seconds of the paper's motion with Stribeck friction, through a file."""
    rig = twin("Stribeck")
    return logged(rig, tmp_path_factory.mktemp("logs"), seed=3, duration=20.0), given(rig)


def rows_of(log):
    drive = log.torque if log.voltage is None else log.voltage
    wheel = [None] * len(log) if log.wheel_angle is None else log.wheel_angle.tolist()
    power = [None] * len(log) if drive is None else drive.tolist()
    return list(zip(log.time.tolist(), log.angle.tolist(), wheel, power, strict=True))


def relative(one, other):
    return abs(one / other - 1)


class AtOnce(Recursion):
    """The same solution over all swings at once, by orthogonal decomposition of all their rows."""

    def __post_init__(self):
        super().__post_init__()
        self.blocks = []

    def add(self, block):
        super().add(block)
        self.blocks.append(block)

    def _solve(self, sought):
        columns = np.vstack([block.columns for block in self.blocks])
        fit = fit_linear(columns * sought, np.concatenate([block.target for block in self.blocks]))
        ends = np.cumsum([len(block.target) for block in self.blocks])[:-1]
        pairs = zip(np.split(columns, ends), np.split(fit.residuals, ends), strict=True)
        scores = np.array([part.T @ left for part, left in pairs])
        cross = scores[1:].T @ scores[:-1]
        inverse = fit.influence @ fit.influence.T
        declared = [block.declared(self.origin) for block in self.blocks]
        for k, one in enumerate(self.errors.values()):
            effect = fit.influence @ np.concatenate([items[k].rows for items in declared])
            assert inverse @ one.rows == pytest.approx(effect, rel=1e-6, abs=1e-9 * np.abs(effect).max())
        covariance, freedom = self._covariance(inverse, scores.T @ scores + (cross + cross.T) / 2, int(sought.sum()))
        return Solution(fit.values, inverse, covariance, freedom)


def estimates_at_once(log, rig, method):
    swings, model, kept, found = Swings(rig, method), rig.axis.model_uncertainty, [], []
    for block in swings.blocks([log]):
        kept.append(block)
        if len(kept) == FIRST:
            solver = AtOnce.of(kept, swings.equation, swings.noise)
            for early in kept[:-1]:
                solver.add(early)
        if len(kept) >= FIRST:
            solver.add(block)
            found.append(solver.estimate(block, model, swings.reader.skipped, swings.lost))
    return found


@pytest.mark.parametrize("method", quick_first(1, METHODS))
def test_the_same_numbers_as_over_all_swings_at_once(twin_log, method):
    log, rig = twin_log
    uncertain = rig.changed(
        {"axis.gravity_torque": "78e-3 ± 1e-4 N*m", "drive.wheel.inertia": "11.34e-5 ± 1e-8 kg*m^2"}
    )
    running = list(sw.online(uncertain, rows_of(log), method))
    at_once = estimates_at_once(log, uncertain, method)
    assert running == swing_estimates(log, uncertain, method)
    assert [one.swing for one in running] == [one.swing for one in at_once]
    for one, other in zip(running, at_once, strict=True):
        assert relative(one.inertia.value, other.inertia.value) < 1e-12
        assert relative(one.swing_inertia.value, other.swing_inertia.value) < 1e-12
        for name, parameter in other.parameters.items():
            scale = max(abs(parameter.value), abs(other.inertia.value))
            assert abs(one.parameters[name].value - parameter.value) < 1e-10 * scale
        assert (one.inertia.standard_uncertainty is None) == (other.inertia.standard_uncertainty is None)
        if one.inertia.standard_uncertainty is not None:
            assert relative(one.inertia.standard_uncertainty, other.inertia.standard_uncertainty) < 1e-8
        kinds = [(entry.source, entry.type) for entry in one.budget]
        assert kinds == [(entry.source, entry.type) for entry in other.budget]
    assert {"axis.gravity_torque", "drive.wheel.inertia"} <= {entry.shared_id for entry in running[-1].budget}


@pytest.mark.parametrize("method", METHODS)
def test_the_twin_within_a_twentieth_of_a_per_cent_after_twenty_seconds(twin_log, method):
    log, rig = twin_log
    last = list(sw.online(rig, [log], method))[-1]
    assert relative(last.inertia.value, INERTIA) < 5e-4
    assert abs(last.inertia.value - INERTIA) < 3 * np.hypot(last.inertia.standard_uncertainty, 2e-5 * INERTIA)
    assert last.swing > 40
    assert last.swings_lost <= 2


def test_momentum_on_a_closed_form_log():
    estimates = list(sw.online(exact_rig(), rows_of(two_tones())))
    assert estimates[-1].inertia.value == pytest.approx(INERTIA, rel=1e-6)
    assert estimates[-1].parameters["coulomb"].value == pytest.approx(2e-3, rel=1e-3)
    assert estimates[-1].parameters["viscous"].value == pytest.approx(1e-3, rel=1e-2)
    assert all(relative(one.swing_inertia.value, INERTIA) < 1e-3 for one in estimates[5:])


@pytest.mark.parametrize(
    ("log", "rig"),
    [
        (lambda: direct_log(TWO_TONES, friction, TIME), direct_rig()),
        (lambda: direct_log(TWO_TONES, friction, TIME, b=0.0), direct_rig(linear=True)),
        (lambda: free_log(lambda v: 1e-3 * v, TIME), free_rig()),
    ],
    ids=["direct", "linear", "free"],
)
@pytest.mark.parametrize("method", METHODS)
def test_other_drives(log, rig, method):
    last = list(sw.online(rig, [log()], method))[-1]
    assert last.inertia.value == pytest.approx(INERTIA, rel=1e-4)
    assert last.parameters["viscous"].value == pytest.approx(1e-3, rel=0.02)


def test_gravity_torque_is_found_beside_the_inertia():
    rig = exact_rig(**{"axis.gravity_torque": "unknown"})
    last = list(sw.online(rig, rows_of(two_tones())))[-1]
    assert last.parameters["gravity_torque"].value == pytest.approx(78e-3, rel=1e-4)
    assert last.inertia.value == pytest.approx(INERTIA, rel=1e-4)


def test_the_turning_points_are_those_of_the_motion():
    reversals = TWO_TONES.reversals(0.0, 12.0)
    for one in sw.online(exact_rig(), rows_of(two_tones())):
        nearest = reversals[np.argmin(np.abs(reversals - one.time))]
        assert abs(one.time - nearest) < 1e-3
        assert one.side == np.sign(-TWO_TONES(nearest, 2))


def test_an_estimate_is_one_swing_late_and_no_later():
    fed = []

    def stream():
        for row in rows_of(two_tones()):
            fed.append(row[0])
            yield row

    reversals = TWO_TONES.reversals(0.0, 12.0)
    for one in sw.online(exact_rig(), stream()):
        behind = reversals[reversals > one.time + 1e-3]
        assert fed[-1] > behind[0]
        assert len(behind) < 2 or fed[-1] < behind[1] + 1e-3


def test_the_buffer_keeps_three_swings_whatever_the_length():
    motion = Sines((0.8, 8.5, 0.0))
    buffer, largest = SwingBuffer(1e-3), 0
    per_swing = np.pi / 8.5 / 1e-3
    time = np.arange(0, 200, 1e-3)
    for t, q in zip(time.tolist(), motion(time).tolist(), strict=True):
        buffer.push((t, q, 0.0, 0.0))
        largest = max(largest, len(buffer.rows))
    assert largest < 3.0 * per_swing
    assert len(buffer.extremes) <= 3
    assert buffer.lost == 0


@pytest.mark.long
def test_memory_does_not_grow_with_the_stream():
    """Eight more periods take less than a fifth of what their rows would; what else the process does is in it too."""
    import gc
    import tracemalloc

    period = 6.0
    rows = list(rows_of(two_tones().segment(0.0, period - 1e-6)))

    def stream(times):
        for k in range(times):
            yield from ((t + k * period, q, w, u) for t, q, w, u in rows)

    def peak(work):
        gc.collect()
        tracemalloc.start()
        work()
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    def read(times):
        for _ in sw.online(exact_rig(), stream(times)):
            pass

    read(1)
    growth = peak(lambda: read(9)) - peak(lambda: read(1))
    assert growth < 0.2 * peak(lambda: list(stream(8)))


def test_chunks_of_any_length_give_the_same():
    log = two_tones()
    whole = [one.inertia.value for one in sw.online(exact_rig(), [log])]
    edges = [0.0, 0.7, 0.71, 5.0, 12.0]
    chunks = [log.segment(a, b - 1e-6) for a, b in pairwise(edges)]
    assert [one.inertia.value for one in sw.online(exact_rig(), chunks)] == whole
    assert [one.inertia.value for one in sw.online(exact_rig(), rows_of(log))] == whole


def test_a_recording_is_a_stream_too(twin_log):
    log, rig = twin_log
    assert [e.inertia for e in sw.online(rig, log)] == [e.inertia for e in sw.online(rig, [log])]


def test_bad_rows_are_left_out_and_counted():
    clean = rows_of(two_tones())
    rng = np.random.default_rng(5)
    dirty = []
    for k, row in enumerate(clean):
        if k % 100 == 50:
            dirty.append((row[0], float("nan"), row[2], None))
        if k % 300 == 7 and k:
            dirty.append((row[0] - 5e-3, rng.normal(), row[2], None))
        dirty.append(row)
    estimates = list(sw.online(exact_rig(), dirty))
    plain = list(sw.online(exact_rig(), clean))
    assert [one.inertia.value for one in estimates] == [one.inertia.value for one in plain]
    until = next(k for k, row in enumerate(dirty) if row[0] == estimates[-1].time or row[0] > estimates[-1].time)
    assert estimates[-1].rows_skipped >= len([k for k in range(until) if k % 100 == 50]) - 5
    assert plain[-1].rows_skipped == 0


def test_a_gap_costs_the_swings_it_touches_and_no_more():
    log = two_tones()
    holed = [row for row in rows_of(log) if not 6.0 < row[0] < 6.2]
    with_gap, without = (list(sw.online(exact_rig(), rows)) for rows in (holed, rows_of(log)))
    assert 1 <= with_gap[-1].swings_lost - without[-1].swings_lost <= 4
    assert len(without) - len(with_gap) == with_gap[-1].swings_lost - without[-1].swings_lost
    assert with_gap[-1].inertia.value == pytest.approx(INERTIA, rel=1e-5)


@pytest.mark.parametrize(
    "row",
    [
        ("a", 1.0, 2.0, None),
        (0.0,),
        None,
        3.0,
        (0.0, None, 1.0, None),
        (0.0, 1.0, None, 0.0),
        (0.0, 1.0, 0.0, 0.0, 9.0),
    ],
    ids=str,
)
def test_what_is_no_row_is_refused_in_one_sentence(row):
    with pytest.raises(InputError) as raised:
        next(sw.online(exact_rig(), [row]))
    assert raised.value.code == "bad-row"
    assert "row 1" in raised.value.message


@pytest.mark.parametrize("more", [(), (None, None), (7.0, float("nan")), ("x", 1.0)], ids=str)
def test_channels_that_the_rig_does_not_have_are_not_looked_at(more):
    log = free_log(lambda v: 1e-3 * v, TIME)
    rows = list(zip(log.time.tolist(), log.angle.tolist(), strict=True))
    plain, longer = (list(sw.online(free_rig(), stream))[-1] for stream in (rows, [(*row, *more) for row in rows]))
    assert longer.inertia == plain.inertia
    whole = replace(log, wheel_angle=5 * log.angle, voltage=log.time)
    assert list(sw.online(free_rig(), whole))[-1].inertia == plain.inertia


def test_a_clock_that_starts_again_is_refused():
    stuck = [*rows_of(two_tones())[:3000], *rows_of(two_tones())[: TOO_MANY_BAD + 10]]
    with pytest.raises(InputError) as raised:
        list(sw.online(exact_rig(), stuck))
    assert raised.value.code == "bad-stream"


def test_a_wheel_of_the_wrong_sign_is_refused():
    turned = [(t, q, -w, u) for t, q, w, u in rows_of(two_tones())]
    with pytest.raises(InputError) as raised:
        list(sw.online(exact_rig(), turned))
    assert raised.value.code == "wrong-sign"


def test_too_few_swings_and_unknown_methods_are_refused():
    with pytest.raises(UnanswerableError):
        list(sw.online(exact_rig(), rows_of(two_tones())[:900]))
    with pytest.raises(UnanswerableError):
        list(sw.online(exact_rig(), []))
    with pytest.raises(UsageError):
        list(sw.online(exact_rig(), [], method="guess"))


def test_a_hand_on_the_body_does_not_count():
    log = free_log(lambda v: 1e-3 * v, TIME)
    again = Recording(time=log.time + 14.0, angle=log.angle)
    rest = Recording(time=np.arange(12.0, 14.0, 1e-3), angle=np.linspace(log.angle[-1], log.angle[0], 2000))
    last = list(sw.online(free_rig(), [log, rest, again]))[-1]
    assert last.inertia.value == pytest.approx(INERTIA, rel=1e-5)
    assert last.swings_lost >= 1


def test_energy_needs_the_voltage_and_says_so():
    with pytest.raises(InputError) as raised:
        list(sw.online(exact_rig(), rows_of(two_tones()), "energy"))
    assert "voltage" in raised.value.message


@pytest.mark.long
def test_the_uncertainty_is_that_of_the_scatter_over_noise():
    """Over draws of white noise of 1 mrad the running inertia scatters as it says, within what 12 runs tell."""
    log, rig = two_tones(), exact_rig(**{"sensors.noise": 1e-3})
    errors, says = [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        angle, wheel = (x + 1e-3 * rng.standard_normal(len(x)) for x in (log.angle, log.wheel_angle))
        last = list(sw.online(rig, [Recording(time=log.time, angle=angle, wheel_angle=wheel)]))[-1]
        errors.append(last.inertia.value / INERTIA - 1)
        says.append(last.inertia.standard_uncertainty / INERTIA)
    ratio = np.sqrt(np.mean(np.square(errors))) / np.median(says)
    assert 0.5 < ratio < 1.5


def test_the_example_runs(capsys):
    example = Path(__file__).resolve().parents[2] / "examples" / "online.py"
    runpy.run_path(str(example))["main"]([])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > 40
    assert lines[-1].startswith("swing ")


def test_a_driven_log_is_no_free_decay_to_identify(twin_log):
    log, _ = twin_log
    with pytest.raises(InputError) as caught:
        sw.identify(log, free_rig())
    assert caught.value.code == "other-drive"


def test_a_stream_that_is_none_is_refused():
    with pytest.raises(InputError, match="or Recordings, not None"):
        list(sw.online(free_rig(), None))
