"""Plans of campaigns: what is refused and how, which points and seeds a plan means."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from refusals import coded
from swingid.errors import InputError, UsageError
from swingid.study.campaign import READY, load_plan
from swingid.study.campaign.experiment import experiment_of
from swingid.study.campaign.loading import described, plan_from_text

BASE = 'name = "p"\n[base]\nreference = "sine 0.8 rad 8.5 rad/s"\nduration = 6\n'


def plan_of(text: str, head: str = ""):
    return plan_from_text(head + BASE + text)


@pytest.mark.parametrize(
    ("head", "text", "said"),
    [
        ("", "[factor.x]\nvalues = [1]\n", "factor is not a known key; did you mean factors?"),
        ("", '[factors.x]\nkey = "rate"\nvalue = [1]\n', "factors.x.value is not a known key; did you mean"),
        ("", '[factors.x]\nkey = "speed"\nvalues = [1]\n', "factors.x.key is 'speed'"),
        ("", '[factors.x]\nkey = "rate"\n', "factors.x needs one of values, range and levels, and has none"),
        ("", '[factors.x]\nkey = "rate"\nrange = [2, 1]\nsteps = 3\n', "factors.x.range must rise"),
        ("", '[factors.x]\nkey = "rate"\nrange = [1, 2]\n', "factors.x.steps is missing, which the design"),
        ('design = "sobol"\n', '[factors.x]\nkey = "rate"\nrange = [1, 2]\n', "points is missing"),
        ("points = 3\n", "", "points belongs to the designs random, latin-hypercube, sobol"),
        ("", '[factors.error]\nkey = "rate"\nvalues = [1]\n', "factors.error is a column of the results already"),
        ("", '[factors.x]\nkey = "twin.axis.friction.viscos"\nvalues = [1]\n', "mean axis.friction.viscous?"),
        ("", '[factors.x]\nkey = "rate"\nvalues = [1000, -5]\n', "factors.x at -5.0: rate must be a positive number"),
        ("", '[factors.x]\nkey = "controller.lamda0"\nvalues = [1]\n', "controller.lamda0 is no setting of the"),
        ("", '[factors.x]\nkey = "reference.f"\nvalues = [1]\n', "has no {f} for reference.f"),
        ("", '[factors.x]\nkey = "methods.momentum.magic"\nvalues = [1]\n', "has no option 'magic'"),
        ("", '[methods.mine]\nmethod = "magic"\n', "methods.mine.method is 'magic'; choose one of momentum"),
        ("", "[factors.x.levels.a]\nspeed = 3\n", "factors.x at 'a': speed is nothing that can be set; give rig,"),
        ("", '[factors.x]\nkey = "methods.energy.variant"\nvalues = ["printed"]\n', "that base.methods does not name"),
        ("", '[base.twin]\nsensors.noise = "1 kg"\n', "base: "),
        ("", '[methods.mine]\nmethod = ["energy"]\n', "methods.mine.method is ['energy']"),
        ("", '[bound]\nlaw = "dry"\n', "bound.law is 'dry': unknown friction law"),
        ("", '[base.controller]\nlambda0 = "big"\n', "controller.lambda0 cannot be 'big'; give a number"),
        ("", 'methods = ["momentum-batch", "energy"]\n', "base.methods names 'momentum-batch' beside others"),
        ("", 'methods = ["energy", "energy"]\n', "base.methods names a method twice"),
        ('quantities = ["mass"]\n', "", "quantities names 'mass'; choose of inertia, gravity_torque, "),
        ("", '[base.both]\naxis.gravity_torque = "unknown"\n', "set stated.axis.gravity_torque alone"),
        ('repeats = 0\n', "", "repeats must be positive, not 0"),
    ],
)  # fmt: skip
def test_a_bad_plan_is_one_sentence_that_names_the_key(head: str, text: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        plan_of(text, head)
    assert said in caught.value.message
    assert caught.value.message.startswith("plan.toml: ")
    assert "\n" not in caught.value.message


def test_files_that_are_no_plan(tmp_path) -> None:
    with pytest.raises(UsageError, check=coded("unknown-plan")):
        load_plan("nothing")
    with pytest.raises(InputError) as caught:
        load_plan(tmp_path / "none.toml")
    assert caught.value.code == "missing-file"
    (tmp_path / "bad.toml").write_text("name = ")
    with pytest.raises(InputError) as caught:
        load_plan(tmp_path / "bad.toml")
    assert caught.value.code == "not-toml"


def test_a_grid_has_every_combination() -> None:
    plan = plan_of('[factors.a]\nkey = "rate"\nvalues = [500, 1000]\n[factors.b]\nkey = "twin.sensors.noise"\n'
                   'range = [1e-4, 1e-2]\nscale = "log"\nsteps = 3\n')  # fmt: skip
    assert [tuple(p.labels.values()) for p in plan.points] == [
        (a, b) for a in (500.0, 1000.0) for b in (1e-4, 1e-3, 1e-2)
    ]
    first = experiment_of(plan, plan.points[1])
    assert (first.rate, first.twin.sensors.noise, first.stated.sensors.noise) == (500.0, 1e-3, 0.0)
    assert first.stated.axis.inertia is None


def test_one_at_a_time_is_the_base_and_each_level_alone() -> None:
    plan = plan_of('[factors.c]\nkey = "stated.drive.motor.torque_per_volt"\nrelative = true\nvalues = [0.95, 1.05]\n'
                   '[factors.f.levels.coulomb]\ntwin.axis.friction = {viscous = "absent", coulomb = 2e-3}\n',
                   'design = "one-at-a-time"\n')  # fmt: skip
    assert [tuple(p.labels.values()) for p in plan.points] == [
        ("base", "base"), ("0.95", "base"), ("1.05", "base"), ("base", "coulomb"),
    ]  # fmt: skip
    off, dry = (experiment_of(plan, plan.points[k]) for k in (1, 3))
    assert off.stated.drive.motor.torque_per_volt.value == pytest.approx(0.95 * 52.04e-4)
    assert off.twin.drive.motor.torque_per_volt.value == 52.04e-4
    assert dry.twin.axis.friction.coulomb.value == 2e-3
    assert dry.twin.axis.friction.viscous is None
    # the controller is made for the rig that the lab believes to have
    assert off.controller.coulomb_voltage == pytest.approx(302.02e-5 / (0.9 * 0.95 * 52.04e-4))


SAMPLED = ('[factors.a]\nkey = "twin.sensors.noise"\nrange = [1e-4, 1e-2]\nscale = "log"\n'
           '[factors.b]\nkey = "controller.lambda0"\nrange = [1, 3]\n'
           '[factors.c]\nkey = "rate"\nvalues = [500, 1000]\n')  # fmt: skip


@pytest.mark.parametrize("design", ["latin-hypercube", "sobol"])
def test_sampled_designs_fill_every_slice_once(design: str) -> None:
    plan = plan_of(SAMPLED, f'design = "{design}"\npoints = 16\nseed = 4\n')
    labels = np.array([[p.labels[n] for n in "abc"] for p in plan.points])
    assert sorted(np.floor(16 * (np.log10(labels[:, 0]) + 4) / 2).astype(int)) == list(range(16))
    assert sorted(np.floor(16 * (labels[:, 1] - 1) / 2).astype(int)) == list(range(16))
    assert sorted(labels[:, 2]) == [500.0] * 8 + [1000.0] * 8


def test_random_points_follow_the_seed() -> None:
    one, same, other = (plan_of(SAMPLED, f'design = "random"\npoints = 9\nseed = {s}\n') for s in (1, 1, 2))
    assert one.points == same.points != other.points


def test_seeds_are_those_of_spawn() -> None:
    text = '[factors.a]\nkey = "rate"\nvalues = [500, 1000]\n'
    plan = plan_of(text, "repeats = 3\nseed = 7\n")
    trials = np.random.SeedSequence(7).spawn(2)[1]
    spawned = [repeat.spawn(2) for repeat in trials.spawn(3)]
    for trial in range(6):
        point, repeat = plan.place(trial)
        assert plan.seed(point, repeat) == spawned[repeat][point].generate_state(1, np.uint64)[0] >> np.uint64(1)
    assert len({plan.seed(*plan.place(trial)) for trial in range(6)}) == 6
    common = plan_of(text, 'repeats = 3\nseeds = "common"\n')
    assert common.seed(0, 1) == common.seed(1, 1) != common.seed(0, 2)


def test_fewer_runs_are_spread_over_the_points() -> None:
    plan = plan_of('[factors.a]\nkey = "rate"\nrange = [100, 1000]\nsteps = 10\n', "repeats = 5\n")
    assert plan.trials == 50
    short = plan.with_runs(5)
    assert [short.place(k) for k in range(short.trials)] == [(0, 0), (2, 0), (4, 0), (6, 0), (8, 0)]
    assert [plan.with_runs(12).place(k) for k in (0, 1, 2, 11)] == [(0, 0), (0, 4), (1, 3), (9, 0)]
    assert [plan.place(k) for k in (0, 4, 5, 49)] == [(0, 0), (0, 4), (1, 0), (9, 4)]
    with pytest.raises(UsageError, match="--runs is 0"):
        plan.with_runs(0)


def test_the_plan_in_the_documentation_is_one() -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "campaign.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"^```toml\n(.*?)^```", page, re.M | re.S)
    plan = plan_from_text(text)
    assert plan.trials == 5 * 2 * 20
    assert experiment_of(plan, plan.points[1]).reference(np.array([np.pi / 17]))[0] == pytest.approx(0.8)


def test_ready_plans_are_sound_and_described() -> None:
    assert [name for name, _, _ in described()] == list(READY)
    for name, about, takes in described():
        plan = load_plan(name)
        assert plan.name == name
        assert about
        assert takes
        assert plan.trials > 100
