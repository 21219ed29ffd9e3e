"""Changes within a log: friction and zero that drift are found as they are; parts of a log agree where they should."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from closed_form_logs import INERTIA, TWO_TONES, direct_log, direct_rig, free_log, free_rig
from swingid.balance.choice import NEAR_REST, _other_causes, choose
from swingid.balance.parts import compared, predicted
from swingid.balance.rows import Signals
from swingid.balance.slow import polynomial, slope, slow_columns
from swingid.identification import identify
from swingid.preparation.prepared import prepare
from swingid.recording.recording import Recording
from swingid.uncertainty.significance import normal_of_ratio

TIME = np.arange(12_001) / 1000
NOISE = 1e-4
VISCOUS, COULOMB = 1.5e-3, 2e-4
SOURCES = {"friction": "change of the friction over the log", "zero": "drift of the angle's zero"}


def friction(v):
    return VISCOUS * v + COULOMB * np.sign(v)


def noisy(log: Recording, seed: int = 1) -> Recording:
    return replace(log, angle=log.angle + np.random.default_rng(seed).normal(0, NOISE, len(log)))


@pytest.fixture(scope="module")
def clean() -> Recording:
    return direct_log(TWO_TONES, friction, TIME)


def progress(log: Recording) -> np.ndarray:
    return np.asarray((log.time - log.time[0]) / (log.time[-1] - log.time[0]))


def warming(log: Recording, share: float) -> Recording:
    """Viscous friction that falls by a share, in a log whose motion is prescribed."""
    return replace(log, torque=log.torque - share * VISCOUS * progress(log) * TWO_TONES(log.time, 1))


def codes(messages) -> list[str]:
    return [message.code for message in messages]


def choice_of(log: Recording):
    prepared = prepare(log, direct_rig())
    part = prepared.part(reread=True)
    signals = Signals.of(part.log, part.rig, part.motion, part.encoders)
    return choose(signals, part.rig, part.equation, part.noise)


@pytest.mark.parametrize("share", [0.1, 0.4])
def test_a_friction_that_falls_is_found_with_its_course(clean, share):
    result = identify(noisy(warming(clean, share)), direct_rig())
    (change,) = result.details.changing
    assert change.what == "friction"
    size = np.abs(TWO_TONES(clean.time, 1))
    mean = VISCOUS * (1 - share / 2) * np.mean(size**2) + COULOMB * np.mean(size)
    course = -share * VISCOUS * (np.linspace(0, 1, len(change.times)) - 0.5) * np.mean(size**2) / mean
    assert np.max(np.abs(change.values - course)) < max(4 * np.max(change.uncertainties), 0.1 * share)
    assert change.values[0] > 5 * change.uncertainties[0]
    assert "friction-changes" in codes([*result.notes, *result.warnings])
    assert SOURCES["friction"] in [entry.source for entry in result.budget]
    assert result.inertia.interval95[0] < INERTIA < result.inertia.interval95[1]


def test_a_zero_that_drifts_is_found_with_its_course(clean):
    log = noisy(clean)
    result = identify(replace(log, angle=log.angle + 2e-3 * progress(log)), direct_rig())
    (change,) = result.details.changing
    assert (change.what, change.unit) == ("zero", "rad")
    assert change.values[-1] - change.values[0] == pytest.approx(2e-3, rel=0.2)
    note = next(note.message for note in result.notes if note.code == "zero-drifts")
    assert "mrad" in note
    assert result.inertia.interval95[0] < INERTIA < result.inertia.interval95[1]


def test_a_method_that_takes_friction_as_constant_states_what_the_change_does(clean):
    log = noisy(warming(clean, 0.4))
    result = identify(log, direct_rig(), "equation-error")
    said = next(m.message for m in (*result.notes, *result.warnings) if m.code == "friction-changes")
    assert "takes it as constant" in said
    assert SOURCES["friction"] in [entry.source for entry in result.budget]


def test_a_log_in_which_nothing_changes_has_no_finding(clean):
    for log, rig in ((clean, direct_rig()), (free_log(lambda v: VISCOUS * v, TIME), free_rig())):
        result = identify(noisy(log), rig)
        assert result.status == "ok"
        assert result.details.changing == ()
        new = {"friction-changes", "zero-drifts", "parts-disagree", "second-half-not-predicted"}
        assert not new & set(codes(result.notes))
        assert all(abs(one.difference) < 5 * one.standard_uncertainty for one in result.details.agreement)


def test_halves_with_another_scale_of_the_torque_disagree(clean):
    log = noisy(clean)
    late = progress(log) > 0.5
    # what the torque of the inertia is larger by is an inertia that is larger by as much; gravity is unchanged
    of_inertia = INERTIA * TWO_TONES(log.time, 2)
    result = identify(replace(log, torque=log.torque + 0.02 * late * of_inertia), direct_rig())
    assert "parts-disagree" in codes(result.warnings)
    one = next(one for one in result.details.agreement if one.division == "time")
    assert one.first[0] == pytest.approx(INERTIA, abs=5 * one.first[1])
    assert one.second[0] == pytest.approx(1.02 * INERTIA, abs=5 * one.second[1])
    assert "first and the second half" in next(m.message for m in result.warnings if m.code == "parts-disagree")
    assert result.inertia.interval95[0] < INERTIA < 1.02 * INERTIA < result.inertia.interval95[1]


def test_differences_of_parts_are_as_large_as_they_are_stated(clean):
    short = clean.segment(0.0, 8.0)
    found: dict[str, list[float]] = {}
    for seed in range(40):
        choice = choice_of(noisy(short, seed))
        for one in compared(choice.law, choice.signals):
            found.setdefault(one.name, []).append(one.deviation)
    assert {"time", "amplitude", "direction"} <= set(found)
    for name, deviations in found.items():
        # χ² of 40 independent values: 0.6 to 1.5 at 99.9 %
        assert 0.5 < np.sqrt(np.mean(np.square(deviations))) < 1.5, name


def test_a_friction_law_with_all_terms_leaves_no_other_to_try(clean):
    choice = choice_of(noisy(clean))
    every = replace(choice.law, unknowns=(*choice.law.unknowns, *NEAR_REST, "cubic"))
    assert next(_other_causes(every, choice.signals)).shape == (len(every.rows), 0)


def test_the_second_half_is_not_predicted_where_friction_changes(clean):
    assert predicted(choice_of(noisy(clean)).law).significance < 3
    halves = replace(clean, torque=clean.torque - 0.4 * VISCOUS * (progress(clean) > 0.5) * TWO_TONES(clean.time, 1))
    plain = choice_of(noisy(halves))
    assert plain.slow or predicted(plain.law).significance > 5


def test_columns_are_the_integrals_of_their_terms(clean):
    choice = choice_of(clean)
    law, signals = choice.law, choice.signals
    windows = law.rows.windows
    friction_columns, zero = (slow_columns(signals, law, kind) for kind in ("friction", "zero"))
    x, w = np.polynomial.legendre.leggauss(400)
    first, last = signals.nodes.stamps[[0, -1]]
    for k in (3, len(windows) // 2, len(windows) - 2):
        at = windows.centres[k] + windows.half[k] * x
        weights = windows.half[k] * w * (1 - x**2) ** 3
        over = 2 * (at - first) / (last - first) - 1
        speed, angle = TWO_TONES(at, 1), TWO_TONES(at)
        for order in (1, 2):
            shape = np.polynomial.legendre.Legendre.basis(order)(over)
            scale = np.sum(weights * np.abs(speed))
            assert friction_columns[f"viscous over time {order}"][k] == pytest.approx(
                np.sum(weights * shape * speed), abs=1e-5 * scale
            )
            assert friction_columns[f"coulomb over time {order}"][k] == pytest.approx(
                np.sum(weights * shape * np.sign(speed)), abs=0.01 * np.sum(weights)
            )
            assert zero[f"zero over time {order}"][k] == pytest.approx(
                -np.sum(weights * shape * 78e-3 * np.cos(angle)), abs=1e-5 * 78e-3 * np.sum(weights)
            )


def test_polynomials_and_tails_are_those_of_numpy_and_scipy():
    x = np.linspace(-1, 1, 21)
    for order in range(1, 6):
        series = np.polynomial.legendre.Legendre.basis(order)
        assert np.allclose(polynomial(order, x), series(x))
        assert np.allclose(slope(order, x), series.deriv()(x))
    for ratio, first, second in ((2.0, 4, 30), (8.0, 4, 60), (15.0, 3, 100)):
        expected = stats.norm.isf(stats.f.sf(ratio, first, second))
        assert normal_of_ratio(ratio, first, second) == pytest.approx(expected, rel=0.05)
    assert normal_of_ratio(0.0, 3, 10) == -np.inf
