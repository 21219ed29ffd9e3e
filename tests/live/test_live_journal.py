"""The journal of a run: what is in it, what a cut leaves, and what `recover` makes of it."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from live_host import LIMITS, RIG
from long_cases import quick_if
from swingid.control.compensator import Compensator
from swingid.control.references.parse import parse_reference
from swingid.errors import InputError
from swingid.identification import identify
from swingid.live.devices.twin import twin_of
from swingid.live.guard import parameters_of
from swingid.live.journal import Journal, Plan
from swingid.live.recover import recover, recovered
from swingid.live.session import Run, Session
from swingid.model.rig import Rig
from swingid.recording.recording import Recording

SINE = parse_reference("sine 0.8 rad 8.5 rad/s")


def record(path: Path, seconds: float = 6.0, clock: int = 2**32 - 2_000_000, **options: object) -> Run:
    """A run whose device time wraps on the way, with its journal."""
    journal = Journal(path, RIG, sync=False, **options)  # type: ignore[arg-type]
    with Session(twin_of(RIG, clock=clock), tap=journal.take) as session:
        board = session.connect()
        parameters = parameters_of(Compensator.paper(RIG), board, LIMITS)
        session.load(parameters)
        reference = SINE(np.arange(int(seconds * 1000)) / 1000.0)
        journal.plan(Plan(parameters, reference, "sine"), firmware=f"{board.firmware:08x}")
        done = session.run(reference)
    journal.close()
    return done


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Run]:
    path = tmp_path_factory.mktemp("journal") / "run.mcap"
    return path, record(path)


def test_the_journal_is_a_log_with_device_time_and_every_count(whole: tuple[Path, Run]) -> None:
    path, done = whole
    log = Recording.load(path, RIG)
    assert len(log) == 6000
    np.testing.assert_allclose(log.time, np.arange(6000) / 1000.0, rtol=0, atol=1e-9)
    step = 2 * np.pi / 16384
    np.testing.assert_allclose(log.angle, [frame.axis * step for frame in done.samples[:6000]], rtol=0, atol=1e-12)
    assert log.wheel_angle is not None
    np.testing.assert_allclose(
        log.wheel_angle, [frame.wheel * step for frame in done.samples[:6000]], rtol=0, atol=1e-12
    )
    assert log.voltage is not None
    assert log.voltage.tolist() == [frame.voltage for frame in done.samples[:6000]]
    assert log.reference is not None
    np.testing.assert_allclose(log.reference, SINE(log.time), rtol=0, atol=1e-7)
    assert not [finding for finding in log.findings if finding.level == "warning"]


def test_it_holds_every_byte_the_rig_file_and_what_was_sent(whole: tuple[Path, Run]) -> None:
    from mcap.reader import make_reader

    seen: list[tuple[bool, bytes]] = []
    with Session(twin_of(RIG, clock=2**32 - 2_000_000), tap=lambda came, _, data: seen.append((came, data))) as session:
        session.load(parameters_of(Compensator.paper(RIG), session.connect(), LIMITS))
        session.run(SINE(np.arange(6000) / 1000.0))
    reader = make_reader(io.BytesIO(whole[0].read_bytes()))
    raw = [(c.topic == "/raw/device", m.data) for _, c, m in reader.iter_messages(["/raw/device", "/raw/host"])]
    assert b"".join(d for came, d in raw if came) == b"".join(d for came, d in seen if came)
    assert b"".join(d for came, d in raw if not came) == b"".join(d for came, d in seen if not came)
    names = {a.name: a.data for a in make_reader(io.BytesIO(whole[0].read_bytes())).iter_attachments()}
    assert names["rig.toml"].decode() == RIG.text
    assert np.frombuffer(names["reference.f32"], "<f4").shape == (6000,)
    about = {m.name: m.metadata for m in make_reader(io.BytesIO(whole[0].read_bytes())).iter_metadata()}
    assert len(about["swingid.run"]["firmware"]) == 8
    events = [json.loads(m.data)["text"] for _, _, m in reader.iter_messages(["/event"])]
    assert [event.split()[0] for event in events][-3:] == ["running", "stopping", "idle"]


def test_the_same_run_is_the_same_file(whole: tuple[Path, Run], tmp_path: Path) -> None:
    record(tmp_path / "again.mcap")
    assert (tmp_path / "again.mcap").read_bytes() == whole[0].read_bytes()


@pytest.mark.parametrize("share", quick_if(lambda share: share in (0.5, 0.999), [0.5, 0.77, 0.9, 0.999]))
def test_a_cut_file_opens_with_a_finding_and_is_recovered(
    whole: tuple[Path, Run], tmp_path: Path, share: float
) -> None:
    content = whole[0].read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(content[: int(share * len(content))])
    log = Recording.load(cut, RIG)
    assert "cut-off" in [finding.code for finding in log.findings]
    full = Recording.load(whole[0], RIG)
    np.testing.assert_array_equal(log.angle, full.angle[: len(log)])
    found, path = recover(cut)
    assert found.cut
    assert path == tmp_path / "cut.recovered.mcap"
    again = Recording.load(path, RIG)
    np.testing.assert_array_equal(again.angle, log.angle)
    assert "cut-off" not in [finding.code for finding in again.findings]
    assert identify(again, RIG).parameters["inertia"].value == pytest.approx(3.022e-3, rel=5e-3)


def test_a_cut_loses_no_more_than_the_last_quarter_of_a_second(tmp_path: Path) -> None:
    path = tmp_path / "killed.mcap"
    journal = Journal(path, RIG, sync=False)
    session = Session(twin_of(RIG), tap=journal.take)
    parameters = parameters_of(Compensator.paper(RIG), session.connect(), LIMITS)
    session.load(parameters)
    reference = SINE(np.arange(4000) / 1000.0)
    journal.plan(Plan(parameters, reference))
    seen: list[int] = []

    def killed(frames: list[object]) -> None:
        seen.append(len(frames))
        if sum(seen) > 3000:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        session.run(reference, on_batch=killed)  # type: ignore[arg-type]
    copy = tmp_path / "copy.mcap"
    copy.write_bytes(path.read_bytes())  # what a killed process has given to the system
    rows = len(Recording.load(copy, RIG))
    begun = 3000 - rows
    assert begun < 600  # samples before the run are among those counted


def test_damaged_blocks_are_left_out_and_counted(whole: tuple[Path, Run]) -> None:
    content = bytearray(whole[0].read_bytes())
    content[len(content) // 2] ^= 1
    found = recovered(bytes(content), "run.mcap")
    assert found.damaged == 1
    assert 5000 < found.messages["/sample"] < 6000


def test_what_cannot_be_recovered_is_refused(whole: tuple[Path, Run], tmp_path: Path) -> None:
    assert recover(whole[0])[1] is None
    for content in (b"t,q1\n0,0\n", whole[0].read_bytes()[:200]):
        path = tmp_path / "x.mcap"
        path.write_bytes(content)
        with pytest.raises(InputError):
            recover(path)


def test_a_full_disk_stops_the_journal_and_not_the_run(tmp_path: Path) -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("no /dev/full on this system")
    journal = Journal(full, RIG, sync=False)
    with Session(twin_of(RIG), tap=journal.take) as session:
        session.load(parameters_of(Compensator.paper(RIG), session.connect(), LIMITS))
        assert session.run(SINE(np.arange(500) / 1000.0)).end.usable
    journal.close()
    assert "space" in journal.error


def test_a_journal_in_no_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        Journal(tmp_path / "none" / "run.mcap", RIG)
    assert caught.value.code == "cannot-write"


def test_a_journal_is_identified_by_the_rig_file_inside(
    whole: tuple[Path, Run], capsys: pytest.CaptureFixture[str]
) -> None:
    from swingid.cli.app import run as swingid

    path = str(whole[0])
    assert swingid(["identify", path, "--json", "-"]) == 0
    alone = json.loads(capsys.readouterr().out)
    assert swingid(["identify", path, "--rig", "paper", "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["parameters"] == alone["parameters"]
    assert "rig.toml inside" in alone["provenance"]["rig_source"]
    assert swingid(["inspect", path]) == 0
    assert "momentum" in capsys.readouterr().out
    assert Rig.load(path).text == RIG.text


def test_a_cut_journal_still_has_its_rig_file(whole: tuple[Path, Run], tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[0].read_bytes()[:100_000])
    assert Rig.load(cut).text == RIG.text


@pytest.mark.parametrize("content", [b"", b"a,b\n1,2\n", b"\x89MCAP0\r\n", b"\x89MCAP0\r\n" + bytes(200)])
def test_a_file_without_a_rig_file_inside_is_one_sentence(
    content: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from swingid.cli.app import run as swingid

    log = tmp_path / "log.mcap"
    log.write_bytes(content)
    assert swingid(["identify", str(log)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "--rig" in said
    assert swingid(["identify", str(log), "--rig", str(log)]) == 3
    assert "no rig file inside" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["identify", "compare", "calibrate"])
def test_a_journal_that_is_not_there_is_said(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from swingid.cli.app import run as swingid

    log = str(tmp_path / "rnu.mcap")
    assert swingid([command, log]) == 3
    assert capsys.readouterr().err == f"swingid: {log} does not exist; give the path of a log.\n"


def test_a_wrong_sign_in_a_journal_does_not_point_to_log(tmp_path: Path) -> None:
    """Its signs are those of [device] at the run; [log] is not read."""
    path = tmp_path / "run.mcap"
    journal = Journal(path, RIG, sync=False)
    with Session(twin_of(RIG), tap=journal.take) as session:
        board = session.connect()
        right = parameters_of(Compensator.paper(RIG), board, LIMITS)
        session.load(right)
        reference = SINE(np.arange(6000) / 1000.0)
        wrong = right.copy()
        wrong[1] *= -1  # the step of the wheel
        journal.plan(Plan(wrong, reference, "sine"))
        session.run(reference)
    journal.close()
    for method in ("momentum", "equation-error"):
        with pytest.raises(InputError, match="swingid commission") as error:
            identify(Recording.load(path, RIG), RIG, method)
        assert error.value.code == "wrong-sign"
        assert "[log]" not in error.value.message


def test_a_journal_ends_where_the_devices_clock_goes_back(whole: tuple[Path, Run]) -> None:
    from swingid.recording.findings import Source
    from swingid.recording.formats import read_table
    from swingid.recording.load import contents_of

    table = read_table(whole[0].read_bytes(), "run.mcap")
    time = table.columns["t"].copy()
    time[4000:] -= 0.5
    fields = contents_of(replace(table, columns={**table.columns, "t": time}), RIG, Source("run.mcap"))
    assert len(fields["time"]) == 4000
    (found,) = [one for one in fields["findings"] if one.code == "device-clock-back"]
    assert found.level == "warning"
    assert "the last 2000 of 6000 samples" in found.message


def test_nothing_is_left_where_nothing_was_measured(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    journal = Journal(path, RIG, sync=False)
    with Session(twin_of(RIG), tap=journal.take) as session:
        session.connect()
    journal.event("refused", "the body swings")
    journal.close()
    assert not path.exists()
