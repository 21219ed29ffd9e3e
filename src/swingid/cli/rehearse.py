"""``swingid rehearse``: the planned experiment on the twin of the user's own rig."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from swingid.cli.identify import Method
from swingid.cli.simulate import Gains, compensator_of, motion_of, parse_angle
from swingid.errors import UsageError


def rehearse(
    rig: Annotated[str, typer.Option(metavar="RIG", help="Path ending in .toml, or a built-in name such as paper.")],
    duration: Annotated[float, typer.Option(help="Length of each run, s.")],
    reference: Annotated[
        str | None,
        typer.Option(metavar="MOTION", help='Motion to follow, such as "sine 0.8 rad 8.5 rad/s"; none: a free decay.'),
    ] = None,
    rate: Annotated[float, typer.Option(help="Rows and controller steps per second.")] = 1000.0,
    runs: Annotated[int, typer.Option(help="How many times.")] = 40,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first run.")] = 0,
    initial_angle: Annotated[str, typer.Option(metavar="ANGLE", help='Angle at the start, such as "30 deg".')] = "0",
    gains: Annotated[Gains | None, typer.Option(help="Of the controller; default: the paper's experiment.")] = None,
    method: Annotated[
        list[Method] | None, typer.Option(help="Only this method; may be repeated. Default: all of them.")
    ] = None,
    json: Annotated[str | None, typer.Option(metavar="FILE", help='Write JSON; "-": standard output.')] = None,
) -> None:
    """Say what error and interval to expect of each method from this experiment on RIG, before the rig is touched.

    Each run draws what rig.toml is unsure of: constants within their uncertainties, encoders, noise. RIG has to state
    axis.inertia (what you expect) and should state axis.friction.
    """
    from swingid.cli.output import check_targets, check_writable, tell, write_json

    check_targets({"--json": json}, {rig: "the rig file"})
    check_writable(json)
    from swingid.cli.kernels import announce_compilation
    from swingid.model.rig import Rig
    from swingid.study.rehearse import rehearse as run

    plant = Rig.load(rig)
    angle = parse_angle(initial_angle, plant)
    motion = None if reference is None else motion_of(reference, plant)
    if motion is None and angle == 0.0:
        raise UsageError("nothing would move; give --reference or --initial-angle", code="no-motion")
    if motion is None and gains is not None:
        raise UsageError("--gains needs a motion to follow; give --reference, or leave it out", code="no-reference")
    announce_compilation("simulate")
    rehearsal = run(
        plant,
        motion,
        None if motion is None else compensator_of(plant, gains, {}),
        duration=duration,
        rate=rate,
        runs=runs,
        seed=seed,
        initial_angle=angle,
        methods=[m.value for m in method] if method else None,
        progress=_progress if sys.stderr is not None and sys.stderr.isatty() else None,
    )
    if json is not None:
        write_json(rehearsal.to_json(), json)
    tell(rehearsal.summary(), to_error=json == "-")


def _progress(done: int, runs: int) -> None:
    """A counter that overwrites itself, for terminals only."""
    sys.stderr.write(f"\rrun {done} of {runs}" + ("\n" if done == runs else ""))
    sys.stderr.flush()
