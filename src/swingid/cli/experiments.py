"""``swingid design``, ``rehearse`` and ``reproduce``: experiments on the twin, before anyone touches the rig."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from swingid.cli import output
from swingid.cli.compile import compile_first
from swingid.cli.options import Angle, Json, Methods, Motion, Rate, RigFile
from swingid.cli.progress import Progress, Steps
from swingid.cli.simulate import Gains, compensator_of, parse_angle
from swingid.errors import SwingidError, UsageError
from swingid.progress import shown
from swingid.system import write_whole


def design(
    rig: RigFile,
    uncertainty: Annotated[
        str, typer.Option(help='Wanted standard uncertainty of the inertia: "0.05 %", or with its unit.')
    ],
    duration: Annotated[float, typer.Option(help="Longest run allowed, s.")] = 60.0,
    max_angle: Annotated[
        str | None, typer.Option(metavar="ANGLE", help='Largest angle, rad (m), or "45 deg"; default 0.8 rad.')
    ] = None,
    max_speed: Annotated[
        float | None, typer.Option(help="Largest speed of the wheel (without a wheel: of the axis), rad/s (m/s).")
    ] = None,
    inertia: Annotated[
        str | None, typer.Option(help='Inertia to expect, such as "3e-3 kg*m^2"; default: axis.inertia of RIG.')
    ] = None,
    gravity_torque: Annotated[
        str | None, typer.Option(help='Gravity torque to expect, such as "78 mN*m", in place of that of RIG.')
    ] = None,
    rate: Rate = 1000.0,
    settling: Annotated[float, typer.Option(help="Time the controller takes to reach its motion, s.")] = 6.0,
    json: Json = None,
) -> None:
    """Propose the motion that gives the inertia of RIG with the wanted uncertainty, and predict its result.

    Voltage stays within the limit of RIG. Friction is expected as in axis.friction.
    """
    output.check_files({rig: "the rig file"}, json=json)
    from swingid.model.rig import Rig
    from swingid.study.design import design as run
    from swingid.study.design import refused, required

    plant = Rig.load(rig)
    angle = None if max_angle is None else parse_angle(max_angle, plant, "--max-angle")
    options: dict[str, Any] = {
        "duration": duration,
        "max_angle": angle,
        "max_speed": max_speed,
        "inertia": inertia,
        "gravity_torque": gravity_torque,
        "rate": rate,
        "settling": settling,
    }
    try:
        required(plant, uncertainty, **options)
        compile_first("simulate")
        with shown(Progress("steps")):
            answer = run(plant, uncertainty, **options)
    except SwingidError as error:
        if json is not None and not isinstance(error, UsageError):
            output.write_json(refused(plant, error), json)
        raise
    output.hand_over(answer, json)


def rehearse(
    rig: RigFile,
    duration: Annotated[float, typer.Option(help="Length of each run, s.")],
    reference: Motion = None,
    rate: Rate = 1000.0,
    runs: Annotated[int, typer.Option(help="How many times.")] = 40,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first run.")] = 0,
    initial_angle: Angle = "0",
    gains: Annotated[Gains | None, typer.Option(help="Of the controller; default: the paper's experiment.")] = None,
    method: Methods = None,
    fault: Annotated[
        list[str] | None, typer.Option(metavar="NAME: GRADE", help="An undeclared fault; repeatable.")
    ] = None,
    json: Json = None,
) -> None:
    """Predict the error and the interval of each method from this experiment on RIG, before the rig is touched.

    Each run draws what rig.toml states with an uncertainty: constants, encoders, noise. RIG has to state
    axis.inertia (what you expect) and should state axis.friction.
    """
    output.check_files({rig: "the rig file"}, json=json)
    from swingid.control.references import reference_for
    from swingid.model.rig import Rig
    from swingid.study.rehearse import rehearse as run

    plant = Rig.load(rig)
    angle = parse_angle(initial_angle, plant)
    motion = None if reference is None else reference_for(reference, plant)
    if motion is None and angle == 0.0:
        raise UsageError("nothing would move; give --reference or --initial-angle", code="no-motion")
    if motion is None and gains is not None:
        raise UsageError("--gains needs a motion to follow; give --reference, or leave it out", code="no-reference")
    compile_first("simulate")
    rehearsal = run(
        plant,
        motion,
        None if motion is None else compensator_of(plant, gains),
        duration=duration,
        rate=rate,
        runs=runs,
        seed=seed,
        initial_angle=angle,
        methods=method,
        faults=fault or (),
        progress=Progress("runs"),
    )
    output.hand_over(rehearsal, json)


def reproduce(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder to write to; made if need be.")] = Path("paper"),
    seed: Annotated[int, typer.Option(min=0, help="Of the encoders' grids and of what is drawn.")] = 0,
    quick: Annotated[
        bool, typer.Option("--quick", help="Without the table of imperfections and the paper's claims.")
    ] = False,
) -> None:
    """Run the experiment and the simulations of the paper on the twin, and set its numbers beside these.

    Writes index.html, fig2 to fig8 as .svg and .png, and results.json to DIR; the same seed gives the same files.
    """
    from swingid.study.reproduce import reproduce as run
    from swingid.study.reproduce import steps

    output.make_folder(out)
    names = [f"fig{k}.{ending}" for k in range(2, 9) for ending in ("svg", "png")]
    for name in (*names, "results.json", "index.html"):
        output.check_target(out / name)
    compile_first("simulate")
    reproduction = run(seed=seed, quick=quick, progress=Steps(steps(quick=quick)))
    from swingid.report.paper import drawn_figures, write_paper

    output.say("drawing figures 2 to 8")
    figures = drawn_figures(reproduction)
    for figure in figures:
        for name, content in figure.files().items():
            write_whole(out / name, content)
    write_whole(out / "results.json", reproduction.to_json().encode("utf-8"))
    page = write_paper(reproduction.results, figures, out / "index.html")
    output.tell(f"wrote {page}, figures 2 to 8 and results.json to {out}")
