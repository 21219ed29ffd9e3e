"""What the data cannot see: rank, condition and the combination, against closed forms and on logs of the twin."""

from __future__ import annotations

import numpy as np
import pytest

from refusals import coded
from swingid.balance.identifiability import examine, examine_information, require_seen, second_frequency
from swingid.control.references import Multisine, Sine
from swingid.errors import UnanswerableError
from swingid.identification import identify
from twin_logs import PAPER, given, logged

TIME = np.linspace(0, 20, 4001)


def columns_of(amplitude: float, *frequencies: float) -> np.ndarray:
    """q1'' and sin q1 of a motion."""
    q = sum(amplitude / len(frequencies) * np.sin(w * TIME) for w in frequencies)
    a = sum(-amplitude / len(frequencies) * w**2 * np.sin(w * TIME) for w in frequencies)
    return np.column_stack([a, np.sin(q)])


def of(columns: np.ndarray, noise: float = 1.0):
    return examine(["inertia", "gravity_torque"], ["kg m^2", "N m"], columns, noise)


def test_two_columns_at_an_angle_have_the_condition_of_that_angle():
    angle = 0.01
    seen = examine(["a", "b"], ["", ""], np.array([[5.0, 3 * np.cos(angle)], [0.0, 3 * np.sin(angle)]]), noise=0.1)
    assert seen.rank == 2
    assert seen.condition == pytest.approx(1 / np.tan(angle / 2), rel=1e-6)
    assert seen.inflation == pytest.approx(1 / np.sin(angle), rel=1e-6)
    assert seen.covariance[0, 0] == pytest.approx((0.1 / (5 * np.sin(angle))) ** 2, rel=1e-6)
    assert seen.together == ("a", "b")


def test_units_do_not_matter():
    columns = columns_of(0.8, 8.5)
    mine, other = of(columns), of(columns * [1e6, 1e-5])
    assert other.condition == pytest.approx(mine.condition, rel=1e-6)
    assert other.inflation == pytest.approx(mine.inflation, rel=1e-6)


def test_a_small_sine_does_not_show_the_inertia_and_says_with_what_it_moves():
    small = of(columns_of(1e-6, 8.5))
    assert small.rank == 1
    assert small.condition == np.inf
    with pytest.raises(UnanswerableError, check=coded("not-identifiable")):
        require_seen(small, 8.5, 5.0 / 1.5)


def test_what_is_not_seen_but_does_not_touch_the_inertia_is_no_reason_to_refuse():
    columns = np.column_stack([np.sin(TIME), np.cos(TIME), 2 * np.cos(TIME)])
    seen = examine(["inertia", "viscous", "coulomb"], ["", "", ""], columns)
    assert seen.rank == 2
    require_seen(seen)
    assert seen.together == ("inertia",)
    assert seen.relative(1.0) == pytest.approx(1 / np.linalg.norm(columns[:, 0]), rel=1e-2)


def test_a_second_frequency_tells_them_apart():
    one, two = of(columns_of(0.3, 8.5)), of(columns_of(0.3, 8.5, second_frequency(8.5, 3.0)))
    assert one.inflation > 50
    assert two.inflation < 5


@pytest.mark.parametrize(("frequency", "natural"), [(8.5, 5.0), (8.5, 3.0), (3.0, 5.0), (20.0, 0.0)])
def test_the_second_frequency_is_another_one_and_not_the_free_swing(frequency, natural):
    other = second_frequency(frequency, natural)
    assert max(other / frequency, frequency / other) > 1.5
    assert natural == 0 or not 0.95 < other / natural < 1.2


def test_columns_and_their_information_matrix_say_the_same():
    columns = columns_of(0.8, 5.0, 8.5)
    one, other = (
        of(columns, 0.3),
        examine_information(["inertia", "gravity_torque"], ["", ""], columns.T @ columns / 0.09),
    )
    assert other.condition == pytest.approx(one.condition, rel=1e-6)
    np.testing.assert_allclose(other.covariance, one.covariance, rtol=1e-6)


def test_the_covariance_is_the_spread_of_fits():
    columns = columns_of(0.8, 5.0, 8.5)
    random = np.random.default_rng(0)
    values = np.linalg.lstsq(columns, 0.3 * random.standard_normal((len(TIME), 4000)), rcond=None)[0]
    np.testing.assert_allclose(np.cov(values), of(columns, 0.3).covariance, rtol=0.1)


UNKNOWN = {"axis.gravity_torque": "unknown", "sensors.noise": 1e-2}


@pytest.mark.parametrize("method", ["momentum", "energy"])
def test_one_small_sine_with_unknown_gravity_is_refused_in_words(tmp_path, method):
    rig = PAPER.changed({"sensors.noise": 1e-2})
    log = logged(rig, tmp_path, Sine(0.2, 8.5), duration=12.0)
    with pytest.raises(UnanswerableError, check=coded("not-identifiable")):
        identify(log, given(rig).changed(UNKNOWN), method)


def test_the_same_with_two_frequencies_is_answered(tmp_path):
    rig = PAPER.changed({"sensors.noise": 1e-2})
    log = logged(rig, tmp_path, Multisine((Sine(0.5, 5.0), Sine(0.3, 8.5))), duration=12.0)
    result = identify(log, given(rig).changed(UNKNOWN))
    assert result.status == "ok"
    (note,) = [message.message for message in result.notes if message.code == "identifiability"]
    assert "rank 7 of 7" in note


@pytest.mark.parametrize(("slope", "words"), [(0.0, "add little"), (0.3, "add little"), (1.0, "1.4 times larger")])
def test_the_inflation_by_other_unknowns_in_words(slope, words):
    """Columns at an angle with cosine c: the uncertainty of the inertia is 1 / sqrt(1 - c²) times larger."""
    assert words in of(np.array([[1.0, slope], [0.0, 1.0]])).price


def test_an_unknown_without_information_leaves_the_others_identifiable():
    draws = np.random.default_rng(3)
    for _ in range(30):
        columns = draws.standard_normal((200, 7)) * draws.uniform(1.0, 1e4, 7)
        columns[:, 5] = 0.0
        seen = examine_information(["inertia", *"abcdef"], [""] * 7, columns.T @ columns)
        assert seen.answerable
        assert seen.blind[5] == pytest.approx(1.0)
