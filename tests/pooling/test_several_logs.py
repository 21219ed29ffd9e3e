"""Several logs of the twin through library, command line and report."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import swingid as sw
from refusals import coded
from swingid.cli import main
from swingid.control.compensator import Compensator
from swingid.control.references import Sine
from twin_logs import INERTIA, PAPER, given

STATED = {"drive.wheel.inertia": "113.4 ± 0.3 kg*mm^2", "axis.gravity_torque": "78 ± 0.2 mN*m"}


def run(rig: sw.Rig, speed: float, folder: Path, name: str, amplitude: float = 0.8, seed: int = 0) -> Path:
    """A log of 12 s in a file."""
    motion, controller = Sine(amplitude, speed), Compensator.paper(rig, sample_time=1e-3)
    log = sw.simulate(rig, motion, controller, duration=12.0, seed=seed, rate=1000.0)
    return log.save(folder / f"{name}.parquet", given(rig))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Logs a, b, c of the paper's rig and `other`, with 2 % more inertia; a rig file."""
    folder = tmp_path_factory.mktemp("logs")
    for k, (name, speed) in enumerate((("a", 8.5), ("b", 9.0), ("c", 8.5))):
        run(PAPER, speed, folder, name, 0.8 + 0.01 * k)
    run(PAPER.changed({"axis.inertia": 1.02 * INERTIA}), 8.5, folder, "other")
    (folder / "rig.toml").write_text(given(PAPER).changed(STATED).text, encoding="utf-8")
    (folder / "broken.parquet").write_bytes((folder / "a.parquet").read_bytes()[:500])
    return folder


def logs(folder: Path, *names: str) -> list[str]:
    return [str(folder / f"{name}.parquet") for name in names]


def read(folder: Path, *names: str) -> tuple[list[sw.Recording], sw.Rig]:
    rig = sw.Rig.load(folder / "rig.toml")
    return [sw.Recording.load(log, rig) for log in logs(folder, *names)], rig


@pytest.mark.parametrize("method", ["momentum", "energy"])
def test_clean_logs_pool_without_a_warning(folder: Path, method: str) -> None:
    recordings, rig = read(folder, "a", "b", "c")
    result = sw.identify(recordings, rig, method)
    assert (result.status, result.warnings) == ("ok", ())
    assert result.inertia.value == pytest.approx(INERTIA, rel=5e-4)
    low, high = result.inertia.interval95
    assert low < INERTIA < high
    # the wheel's inertia is the same in all three: no better known for being used three times
    single = min(one.inertia.standard_uncertainty for one in result.per_log)
    assert result.inertia.standard_uncertainty > 0.95 * single
    assert [one.provenance["log"] for one in result.per_log] == logs(folder, "a", "b", "c")


def test_order_does_not_matter_and_one_is_itself(folder: Path) -> None:
    recordings, rig = read(folder, "a", "b", "c")
    there, back = sw.identify(recordings, rig), sw.identify(recordings[::-1], rig)
    assert there.inertia.value == pytest.approx(back.inertia.value, rel=1e-12)
    alone = sw.identify(recordings[:1], rig)
    assert alone.to_dict() == sw.identify(recordings[0], rig).to_dict()


def test_the_log_of_another_body_is_named(folder: Path) -> None:
    recordings, rig = read(folder, "a", "b", "other", "c")
    (warning,) = sw.identify(recordings, rig).warnings
    assert warning.code == "logs-disagree"
    assert warning.message.startswith("other.parquet (+2.0 %")
    assert "in inertia" in warning.message


def test_one_log_twice_is_refused(folder: Path) -> None:
    recordings, rig = read(folder, "a", "a")
    with pytest.raises(sw.errors.UsageError, check=coded("same-log-twice")):
        sw.identify(recordings, rig)


def test_two_single_speeds_tell_gravity_torque_and_inertia(tmp_path: Path) -> None:
    """At 0.2 rad and 1 mrad of noise one speed leaves the inertia to 5 % and more; two give both to a tenth of a %."""
    twin = PAPER.changed({"sensors.noise": 1e-3})
    rig = given(twin).changed({"axis.gravity_torque": "unknown"})
    paths = [run(twin, speed, tmp_path, str(speed), 0.2, seed) for seed, speed in enumerate((8.5, 12.0))]
    recordings = [sw.Recording.load(path, rig) for path in paths]
    result = sw.identify(recordings, rig)
    assert result.status == "ok"
    for name, truth in (("inertia", INERTIA), ("gravity_torque", 78e-3)):
        found = result.parameters[name]
        assert found.standard_uncertainty < 2e-3 * truth
        assert abs(found.value - truth) < 3 * found.standard_uncertainty
    single = min(one.inertia.standard_uncertainty for one in result.per_log)
    assert result.inertia.standard_uncertainty < single / 30
    assert result.covariance_of_fit["inertia"]["inertia"] < result.inertia.standard_uncertainty**2 * 1.01


def test_command_line(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target, page = tmp_path / "r.json", tmp_path / "r.html"
    rig = ["--rig", str(folder / "rig.toml")]
    assert (
        main(["identify", *logs(folder, "a", "broken", "c"), *rig, "--json", str(target), "--report", str(page)]) == 0
    )
    brief = capsys.readouterr().out
    assert [line.split()[0] for line in brief.splitlines()[1:4]] == ["a.parquet", "broken.parquet", "c.parquet"]
    assert main(["identify", *logs(folder, "a", "broken", "c"), *rig, "-v"]) == 0
    assert "[[Logs]]" in capsys.readouterr().out
    data = json.loads(target.read_text(encoding="utf-8"))
    assert data["schema"] == "swingid.result/1"
    assert [one["status"] for one in data["per_log"]] == ["ok", "refused", "ok"]
    assert [w["code"] for w in data["warnings"]] == ["log-refused"]
    assert "broken.parquet" in data["warnings"][0]["message"]
    assert data["provenance"]["logs"] == logs(folder, "a", "broken", "c")
    text = page.read_text(encoding="utf-8")
    assert 'id="logs"' in text
    assert "broken.parquet" in text
    for name, parameter in data["parameters"].items():
        parts = [e["standard_uncertainty"] for e in data["budget"] if e["parameter"] == name]
        assert np.sqrt(np.sum(np.square(parts))) == pytest.approx(parameter["standard_uncertainty"])


def test_shared_friction_and_wrong_choices(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "r.json"
    command = ["identify", *logs(folder, "a", "c"), "--rig", str(folder / "rig.toml"), "--json", str(target)]
    assert main([*command, "--option", "friction=shared"]) == 0
    found = json.loads(target.read_text(encoding="utf-8"))["parameters"]["viscous"]
    assert found["value"] == pytest.approx(1.144e-3, rel=0.01)
    assert main([*command, "--option", "friction=mine"]) == 2
    assert "per-log or shared" in capsys.readouterr().err


def test_where_all_logs_are_refused_the_first_says_why(folder: Path, tmp_path: Path) -> None:
    still = tmp_path / "still.csv"
    still.write_text("t,q1,q2,u\n" + "".join(f"{k / 1000},0.1,0.2,0\n" for k in range(5000)), encoding="utf-8")
    rig, target = ["--rig", str(folder / "rig.toml")], tmp_path / "r.json"
    assert main(["identify", str(still), str(tmp_path / "none.csv"), *rig, "--json", str(target)]) == 4
    assert json.loads(target.read_text(encoding="utf-8"))["status"] == "refused"
    assert main(["identify", str(tmp_path / "none.csv"), str(still), *rig]) == 3
