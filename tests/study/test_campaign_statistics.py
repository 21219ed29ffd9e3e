"""The figures of a campaign on tables whose figures are known."""

from __future__ import annotations

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from refusals import coded
from swingid.errors import InputError
from swingid.report.html import write_campaign
from swingid.study.campaign.loading import plan_from_text
from swingid.study.campaign.store import Store
from swingid.study.campaign.summary import levels_in, statistics_of, summary_of

TRUTH = 2.0


def answers(errors, half_widths, bounds=None, points=None) -> dict[str, np.ndarray]:
    """Rows with these relative errors, by column."""
    errors = np.asarray(errors, dtype=float)
    n = len(errors)
    value, reach = TRUTH * (1 + errors), TRUTH * np.broadcast_to(half_widths, n).astype(float)
    return {
        "point": np.zeros(n, int) if points is None else np.asarray(points),
        "truth": np.full(n, TRUTH),
        "value": value,
        "low": value - reach,
        "high": value + reach,
        "bound": np.full(n, np.nan) if bounds is None else TRUTH * np.broadcast_to(bounds, n).astype(float),
        "code": np.full(n, ""),
        "warnings": np.full(n, ""),
    }


def test_figures_of_four_errors() -> None:
    s = statistics_of(answers([0.03, -0.01, 0.01, 0.01], 0.02, 0.005))
    assert s.bias[0] == pytest.approx(0.01)
    assert s.bias[1] == pytest.approx(np.sqrt(8 / 3) / 100 / 2)
    assert s.rmse[0] == pytest.approx(np.sqrt(3) / 100)
    assert s.width == pytest.approx(2 / np.sqrt(3))
    # Agresti and Coull: two hits and two misses more
    assert s.coverage == pytest.approx((0.75, np.sqrt(5 / 8 * 3 / 8 / 8)))
    assert s.efficiency[0] == pytest.approx(0.25 / 3)


def test_normal_errors_at_the_bound_have_efficiency_one_and_right_errors() -> None:
    """Over points of very different noise; each standard error is that of repetitions."""
    rng = np.random.default_rng(3)
    sizes = np.repeat([1e-5, 1e-3, 1e-2], 200)
    found = [
        statistics_of(answers(sizes * rng.standard_normal(600), 1.96 * sizes, sizes, np.repeat([0, 1, 2], 200)))
        for _ in range(200)
    ]
    for name, expected in (("efficiency", 1.0), ("coverage", 0.95), ("bias", 0.0)):
        values, errors = np.array([getattr(s, name) for s in found]).T
        assert np.mean(values) == pytest.approx(expected, abs=4 * np.std(values) / np.sqrt(200) + 0.005 * expected)
        assert np.mean(errors) == pytest.approx(np.std(values), rel=0.2)
    assert np.mean([s.width for s in found]) == pytest.approx(1.96, rel=0.01)
    # of one point alone
    one = [statistics_of(answers(0.01 * rng.standard_normal(400), 0.0196)) for _ in range(200)]
    rmse, error = np.array([s.rmse for s in one]).T
    assert np.mean(error) == pytest.approx(np.std(rmse), rel=0.2)


def test_what_did_not_answer_counts_as_a_run_and_no_more() -> None:
    nothing = statistics_of(answers([np.nan, np.nan], np.nan))
    assert (nothing.runs, nothing.answered) == (2, 0)
    assert np.isnan([nothing.bias[0], nothing.rmse[0], nothing.width, nothing.coverage[0]]).all()
    some = statistics_of(answers([np.nan, 0.02], [np.nan, 0.01]))
    assert (some.runs, some.answered, some.coverage[0]) == (2, 1, 0.0)
    assert some.rmse[0] == pytest.approx(0.02)


def test_a_truth_of_zero_has_no_relative_error() -> None:
    s = statistics_of(answers([0.01, 0.02], 0.01) | {"truth": np.zeros(2)})
    assert (s.runs, s.answered) == (2, 0)
    assert np.isnan(s.rmse[0])


def test_many_numbers_go_into_groups_of_equal_size() -> None:
    values = np.random.default_rng(0).random(200)
    groups = levels_in(values)
    assert [int(mask.sum()) for mask in groups.values()] == [50] * 4
    assert values[next(iter(groups.values()))].max() < values[list(groups.values())[3]].min()
    assert list(levels_in(np.array([3.0, 1.0, 3.0]))) == ["1", "3"]
    assert list(levels_in(np.array(["b", "a", "b"], dtype=object))) == ["b", "a"]


PLAN = """
name = "made-up"
design = "one-at-a-time"
repeats = 50
[base]
duration = 5
reference = "sine 0.8 rad 8.5 rad/s"
methods = ["momentum", "energy"]
[factors.torque]
key = "stated.drive.motor.torque_per_volt"
relative = true
values = [0.9, 1.2]
[factors.noise]
key = "twin.sensors.noise"
values = [1e-3]
"""


def table_of(plan, effect) -> pa.Table:
    """Rows of a plan whose methods are off by `effect(method, point labels, random numbers)`."""
    rng = np.random.default_rng(1)
    store = Store.__new__(Store)
    store.plan = plan
    rows = []
    for trial in range(plan.trials):
        point, repeat = plan.place(trial)
        labels = plan.points[point].labels
        for method in plan.tables.base.methods:
            off = effect(method, labels, rng.standard_normal())
            row = dict.fromkeys(store._schema().names, np.nan)
            row |= {"trial": trial, "point": point, "repeat": repeat, "seed": 0, **labels, "method": method}
            row |= {"quantity": "inertia", "status": "ok", "code": "", "message": "", "warnings": ""}
            row |= {"truth": 2.0, "value": 2.0 * (1 + off), "error": off, "u": 0.002, "low": 1.996 + 2 * off}
            rows.append(row | {"high": 2.004 + 2 * off})
    return pa.Table.from_pylist(rows, schema=store._schema())


def effect(method: str, labels: dict[str, object], chance: float) -> float:
    if method == "momentum":
        return (0.01 if labels["noise"] != "base" else 0.001) * chance
    return 0.001 * chance + {"base": 0.0, "0.9": -0.1, "1.2": 0.2}[str(labels["torque"])]


def test_effects_are_those_that_were_put_in(tmp_path) -> None:
    plan = plan_from_text(PLAN)
    summary = summary_of(plan, table_of(plan, effect))
    effects = {(e.method, e.factor): e for e in summary.effects}
    torque = effects["energy", "torque"]
    assert (torque.low[1], torque.high[1], torque.rmse[1]) == ("0.9", "1.2", "1.2")
    assert torque.low[0] == pytest.approx(-0.1, abs=1e-3)
    assert torque.high[0] == pytest.approx(0.2, abs=1e-3)
    assert effects["momentum", "noise"].rmse == (pytest.approx(0.01, rel=0.4), "0.001")
    # at the base of one factor another may not be off its base
    assert summary.at("noise", "base", "energy").rmse[0] == pytest.approx(0.001, rel=0.4)
    assert summary.at("torque", "1.2", "energy").runs == 50
    page = write_campaign(summary, tmp_path / "report.html").read_text()
    assert page.count('aria-label="What each factor does') == 2
    assert "20 % at 1.2" in page
    assert json.loads(summary.to_json())["effects"][0]["factor"] == "torque"


def test_coverage_at_each_level_is_drawn_where_it_is() -> None:
    """Errors within a ninth of the interval at one level and nine times it at the other: 100 and about 8 % covered."""
    from swingid.report.figures.campaign import draw_coverage_by

    plan = plan_from_text(PLAN.replace('design = "one-at-a-time"\n', ""))
    table = table_of(plan, lambda _, labels, chance: 0.02 * chance * (labels["torque"] == 1.2))
    summary = summary_of(plan, table)
    (axes,) = draw_coverage_by(summary, "torque").axes
    drawn = [line.lines[0].get_xdata() for line in axes.containers]
    wrong = 100 * summary.at("torque", "1.2", "energy").coverage[0]
    assert drawn[1] == pytest.approx([100.0, wrong])
    assert 0 < wrong < 25
    assert max(bar.vertices[:, 0].max() for bar in axes.collections[0].get_paths()) <= 100.0
    assert draw_coverage_by(summary, "noise") is None


def test_results_of_another_version_are_not_taken_for_this_ones(tmp_path) -> None:
    plan = plan_from_text(PLAN)
    store = Store(plan, tmp_path / "one")
    pq.write_table(table_of(plan, effect).drop_columns(["wanted"]), tmp_path / "one" / "results.parquet")
    with pytest.raises(InputError, check=coded("other-version", "wanted")):
        store.table()
    (tmp_path / "one" / "results.parquet").write_bytes(b"PAR1")
    with pytest.raises(InputError, check=coded("bad-part")):
        store.table()


def test_a_page_of_nothing_but_refusals(tmp_path) -> None:
    plan = plan_from_text(PLAN)
    table = table_of(plan, lambda *_: np.nan)
    table = table.set_column(table.column_names.index("code"), "code", pa.array(["too-short"] * len(table)))
    summary = summary_of(plan, table)
    assert summary.of("energy").answered == 0
    assert summary.of("energy").refusals == {"too-short": 200}
    page = write_campaign(summary, tmp_path / "report.html").read_text()
    assert "too-short in 200 of 200" in page
    assert "0 of 200" in page
    assert "nan" not in summary.text().replace("nant", "")
