"""``swingid compare``, ``validate`` and ``difference``: what follows from several methods, logs or results."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from swingid.cli import output
from swingid.cli.compile import compile_first, kernels_of
from swingid.cli.options import Certificate, Json, JsonOrRefusal, LogRigFile, Logs, Methods, Parts, Report, rig_of
from swingid.cli.progress import Progress
from swingid.methods.table import METHODS
from swingid.progress import shown


def compare(
    logs: Logs,
    rig: LogRigFile = None,
    method: Methods = None,
    part: Parts = None,
    json: Json = None,
    report: Report = None,
) -> None:
    """Put every method on the same LOGs: inertia, friction, time, what each depends on, and their consistency."""
    rig = rig_of(rig, logs)
    output.check_files({rig: "the rig file"} | dict.fromkeys(logs, "a log"), json=json, report=report)
    output.check_once(logs)
    from swingid.model.rig import Rig
    from swingid.pooling.selected import parts_of
    from swingid.recording.recording import Recording
    from swingid.study.compare import compare as run

    spans, plant = parts_of(part), Rig.load(rig)
    recordings = [Recording.load(log, plant) for log in logs]
    names = method or list(METHODS)
    compile_first(*(task for name in names for log in recordings for task in kernels_of(name, log, plant)))
    with shown(Progress("results")):
        comparison = run(recordings, plant, method, part=spans)
    if report is not None:
        from swingid.report.html import write_comparison

        write_comparison(comparison, plant, report)
    output.hand_over(comparison, json, report)


def validate(
    result: Annotated[str, typer.Argument(metavar="RESULT.json", help="Result of identify --json.")],
    logs: Annotated[list[str], typer.Argument(metavar="LOG...", help="Logs to predict, best ones not fitted.")],
    rig: LogRigFile = None,
    input: Annotated[
        Literal["wheel", "voltage"] | None,
        typer.Option(help="The measured wheel (default, needs no motor) or the voltage drives the prediction."),
    ] = None,
    json: Json = None,
    report: Report = None,
) -> None:
    """Predict LOGs by the model in RESULT: in a free run and one swing ahead, with the normalised fit in per cent."""
    rig = rig_of(rig, logs)
    inputs = {rig: "the rig file", result: "the result"} | dict.fromkeys(logs, "a log")
    output.check_files(inputs, json=json, report=report)
    output.check_once(logs)
    from swingid.model.rig import Rig
    from swingid.recording.recording import Recording
    from swingid.result.file import load_result
    from swingid.study.validate import validate as run

    plant, identified = Rig.load(rig), load_result(result)
    recordings = [Recording.load(log, plant) for log in logs]
    driven = "voltage" if input == "voltage" else "wheel" if plant.drive.wheel is not None else None
    compile_first(*(task for log in recordings for task in kernels_of("output-error", log, plant, driven)))
    with shown(Progress("logs")):
        validation = run(identified, recordings, plant, input=input)
    if report is not None:
        from swingid.report.html import write_validation

        write_validation(validation, plant, report)
    output.hand_over(validation, json, report)


def difference(
    tare: Annotated[str, typer.Argument(metavar="TARE.json", help="Result of identify without the body.")],
    loaded: Annotated[str, typer.Argument(metavar="LOADED.json", help="Result of identify with the body.")],
    mass: Annotated[
        str | None, typer.Option(metavar="'M ± U'", help='Mass of the body, "68.0 ± 0.1 g": with --distance.')
    ] = None,
    distance: Annotated[
        str | None,
        typer.Option(metavar="'D ± U'", help="Its centre from the axis: gives the inertia about its own centre."),
    ] = None,
    known: Annotated[
        str | None,
        typer.Option(metavar="'J ± U'", help='Its inertia, "961 ± 1 kg*mm^2": calibrates the scale of both runs.'),
    ] = None,
    json: JsonOrRefusal = None,
    report: Report = None,
    certificate: Certificate = None,
) -> None:
    """Determine the inertia of a body from two results, with and without it."""
    output.check_targets({"--json": json, "--report": report}, {tare: "the tare result", loaded: "the loaded result"})
    stated = output.check_report(report, certificate)
    with output.refusals_to(json, "difference", {"tare": tare, "loaded": loaded}, report, stated):
        output.check_writable(json, report)
        from swingid.pooling import difference as subtract

        result = subtract(tare, loaded, mass=mass, distance=distance, known=known)
        output.write_report(result, None, None, report, stated)
    output.hand_over(result, json, report)
