"""Faults of a live rig: how each ends, with which exit code, what the journal holds, and that the motor is at 0 V."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest

from live_contradictions import CONTRADICTIONS
from live_faults import AT, FAULTS, Fault, FaultyDevice, Rules
from live_host import RIG
from long_cases import quick_of_each
from swingid.control.compensator import Compensator
from swingid.control.references.parse import parse_reference
from swingid.errors import SwingidError
from swingid.identification import identify
from swingid.live.codes import FaultCode, State
from swingid.live.experiment import Conductor, Done, Order, require_usable
from swingid.live.session import Reason
from swingid.recording.recording import Recording

SECONDS = 4.0


def device_of(fault: Fault) -> FaultyDevice:
    known = dict(fault.device)
    if "plant" in known:
        known["plant"] = known["plant"]()
    return FaultyDevice(fault.rules(), **{"rig": fault.rig(), **known})


def run(fault: Fault, device: FaultyDevice, out: Path, said: list[str] | None = None) -> tuple[Done | None, str, int]:
    """What the run left, the reason or the code of what was raised, and the exit code; said: takes its sentence."""
    rig = fault.rig()
    motion = parse_reference("sine 0.8 rad 8.5 rad/s")
    order = Order(motion, Compensator.paper(RIG), SECONDS, fade=0.1, **fault.order)
    done = None
    try:
        done = Conductor(rig, device).run(order, out)
        require_usable(done, out)
        identify(Recording.load(out, rig), rig)
    except SwingidError as error:
        if said is not None:
            said.append(error.message)
        return done, error.code if done is None else done.end.reason.value, error.exit_code
    return done, done.end.reason.value, 0


def measured(journal: Path) -> bool:
    """Whether a journal holds a sample of a run."""
    from mcap.reader import make_reader

    reader = make_reader(io.BytesIO(journal.read_bytes()))
    return any(True for _ in reader.iter_messages(["/sample"]))


ALL = [*FAULTS, *CONTRADICTIONS]


@pytest.mark.parametrize(
    "fault",
    quick_of_each(lambda fault: (fault.end, fault.exit, fault.guard), ALL),
    ids=[fault.name for fault in ALL],
)
def test_a_fault_ends_as_it_should(fault: Fault, tmp_path: Path) -> None:
    device, out = device_of(fault), tmp_path / "run.mcap"
    told: list[str] = []
    done, end, code = run(fault, device, out, told)
    assert (end, code) == (fault.end, fault.exit), (end, told, done)
    assert fault.says in " ".join(told)
    for _ in range(150):  # what a device does when its host has gone
        device.step()
    assert device.applied[-1] == 0.0
    assert device.machine.state in (State.IDLE, State.FAULT, State.ARMED)  # type: ignore[attr-defined]
    if fault.guard is not FaultCode.NONE:
        assert done is not None
        assert done.end.fault is fault.guard
    if fault.dead_by is not None:
        assert not np.any(device.applied[AT + fault.dead_by :])
    if fault.end == "finished":
        assert np.any(device.applied)
    assert not out.exists() or measured(out)  # nothing is left where nothing was measured
    if fault.log:
        assert Recording.load(out, fault.rig()).duration >= fault.log


def test_there_are_many_of_every_kind() -> None:
    assert len(FAULTS) >= 45
    assert len(CONTRADICTIONS) >= 60
    assert len({fault.name for fault in ALL}) == len(ALL)


def test_a_full_disk_is_reported_after_the_planned_end(tmp_path: Path) -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("no /dev/full on this system")
    device = FaultyDevice(Rules())
    done, end, code = run(Fault("disk full"), device, full)
    assert done is not None
    assert (end, code) == ("finished", 3)
    assert "space" in done.journal_error
    assert sum(voltage != 0.0 for voltage in device.applied) > 3900


def test_a_view_that_fails_does_not_stop_the_run(tmp_path: Path) -> None:
    def closed(progress: object) -> None:
        raise BrokenPipeError

    device = FaultyDevice(Rules())
    order = Order(parse_reference("sine 0.8 rad 8.5 rad/s"), Compensator.paper(RIG), SECONDS)
    done = Conductor(RIG, device, show=closed).run(order, tmp_path / "run.mcap")
    assert done.end.reason is Reason.FINISHED
    assert "view" in done.notes[0]


def test_an_error_in_the_host_is_0_volts(tmp_path: Path) -> None:
    device = FaultyDevice(Rules())

    def broken(progress: object) -> None:
        if device.row > AT:
            raise KeyboardInterrupt

    order = Order(parse_reference("sine 0.8 rad 8.5 rad/s"), Compensator.paper(RIG), SECONDS)
    with pytest.raises(KeyboardInterrupt):
        Conductor(RIG, device, show=broken).run(order, tmp_path / "run.mcap")
    assert device.machine.state is State.IDLE  # type: ignore[attr-defined]
    assert not np.any(device.applied[AT + 40 :])
    assert Recording.load(tmp_path / "run.mcap", RIG).duration > 1.0
