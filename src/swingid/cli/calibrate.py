"""``swingid calibrate``: the motor's constants from voltage tests, the encoders' errors from logs of a motion."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swingid.cli import output
from swingid.cli.compile import compile_first
from swingid.cli.options import Certificate, JsonOrRefusal, LogRigFile, Report, rig_of
from swingid.cli.progress import Progress
from swingid.errors import UsageError
from swingid.progress import shown
from swingid.system import write_whole

if TYPE_CHECKING:
    from collections.abc import Callable

    from swingid.calibration.encoders import EncoderCalibration
    from swingid.calibration.motor import Calibration
    from swingid.model.rig import Rig
    from swingid.recording.recording import Recording


def calibrate(
    logs: Annotated[
        list[str],
        typer.Argument(
            metavar="LOG...",
            help="Voltage tests with the rod clamped or free, and free swings; with --encoders, runs as for identify.",
        ),
    ],
    rig: LogRigFile = None,
    encoders: Annotated[
        bool,
        typer.Option("--encoders", help="Find nonlinearity and latency of the encoders, not the motor's constants."),
    ] = False,
    out: Annotated[
        str | None, typer.Option(metavar="NEW.toml", help="Write the rig with what was found, and its comments.")
    ] = None,
    json: JsonOrRefusal = None,
    report: Report = None,
    certificate: Certificate = None,
) -> None:
    """Find the motor's constants from LOGs of a voltage test, and report which cannot be distinguished.

    What kind of test a log is, clamped rod, free rod or free swing, is found from the log. With --encoders: what the
    encoders do wrong once per turn, and the latency between the channels, from one or several motions of one body.
    """
    output.check_once(logs)
    if out is not None and not out.lower().endswith(".toml"):
        raise UsageError(f"--out {out} must end in .toml, as every rig file", code="bad-target")
    rig = rig_of(rig, logs)
    inputs = {rig: "the rig file"} | dict.fromkeys(logs, "a log")
    output.check_targets({"--out": out, "--json": json, "--report": report}, inputs)
    laboratory = output.check_report(report, certificate)
    provenance: dict[str, object] = {"log": logs[0], "logs": logs, "rig_source": rig}
    with output.refusals_to(json, "calibrate-encoders" if encoders else "calibrate", provenance):
        output.check_writable(out, json, report)
        calibration, first, plant = _calibrate(logs, rig, encoders)
        if out is not None:
            write_whole(Path(out), calibration.rig.text.encode())
        output.write_report(calibration.result, first, plant, report, laboratory)
    output.hand_over(calibration.result, json, out, report)
    if out is not None and calibration.rig.text == plant.text:
        output.say(f"{out} is {rig} unchanged: these logs change none of its constants")


def _calibrate(logs: list[str], rig: str, encoders: bool) -> tuple[Calibration | EncoderCalibration, Recording, Rig]:
    """Read the files; returns the calibration, the first log, the rig as it was."""
    from swingid.calibration.encoders import calibrate_encoders
    from swingid.calibration.motor import calibrate as of_motor
    from swingid.model.rig import Rig
    from swingid.recording.recording import Recording

    plant = Rig.load(rig)
    recordings = [Recording.load(log, plant, still_axis=not encoders) for log in logs]
    if not encoders:
        compile_first("calibrate")
    run: Callable[[list[Recording], Rig], Calibration | EncoderCalibration]
    run = calibrate_encoders if encoders else of_motor
    with shown(Progress("steps")):
        return run(recordings, plant), recordings[0], plant
