"""``swingid simulate``: the twin's log of a rig."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swingid.errors import InputError, UsageError

if TYPE_CHECKING:
    from swingid.control.compensator import Compensator
    from swingid.model.rig import Rig
    from swingid.recording.recording import Recording

MOST_ROWS = 20_000_000
"""More rows than this are a typing error rather than a run: their arrays would fill some gigabytes."""


class Gains(StrEnum):
    """Named sets of gains, both of the paper's section 5."""

    EXPERIMENT = "experiment"
    SIMULATION = "simulation"


def simulate(
    rig: Annotated[str, typer.Option(metavar="RIG", help="Path ending in .toml, or a built-in name such as paper.")],
    duration: Annotated[float, typer.Option(help="Length of the run, s.")],
    out: Annotated[str, typer.Option(metavar="FILE", help="Log to write, ending in .parquet or .csv.")],
    reference: Annotated[
        str | None,
        typer.Option(metavar="MOTION", help='Motion to follow, such as "sine 0.8 rad 8.5 rad/s"; none: no command.'),
    ] = None,
    rate: Annotated[float, typer.Option(help="Rows and controller steps per second.")] = 1000.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything random.")] = 0,
    initial_angle: Annotated[
        str, typer.Option(metavar="ANGLE", help='Angle at the start, rad (m), or with a unit: "30 deg".')
    ] = "0",
    draw: Annotated[
        bool, typer.Option("--draw", help="Draw every constant with a stated uncertainty, by the seed.")
    ] = False,
    gains: Annotated[
        Gains, typer.Option(help="The paper's gains: of its experiment, or of its simulation (for 10 kHz).")
    ] = Gains.EXPERIMENT,
    delta0: Annotated[float | None, typer.Option(help="Error above which the gain grows, rad; (18).")] = None,
    sigma0: Annotated[float | None, typer.Option(help="sigma = sigma0 k_tilde^2, 1/s; (19).")] = None,
    lambda0: Annotated[float | None, typer.Option(help="Growth of the gain, 1/s; (18).")] = None,
    k_tilde0: Annotated[float | None, typer.Option(help="Gain k_tilde at the start; (17).")] = None,
    k_tilde_max: Annotated[float | None, typer.Option(help="Upper bound of the gain k_tilde.")] = None,
) -> None:
    """Write the log that RIG would make: its closed loop, its sensors, its columns and units.

    Without --reference nothing drives the rig: a free decay from --initial-angle.
    """
    from swingid.cli.kernels import announce_compilation
    from swingid.cli.output import check_target, tell
    from swingid.recording.formats import writer_for

    own = {"delta0": delta0, "sigma0": sigma0, "lambda0": lambda0, "k_tilde0": k_tilde0, "k_tilde_max": k_tilde_max}
    given = {name: value for name, value in own.items() if value is not None}
    if duration * rate > MOST_ROWS:
        raise UsageError(
            f"--duration {duration:g} s at --rate {rate:g} is more than {MOST_ROWS} rows; simulate a shorter run",
            code="too-long",
        )
    writer_for(Path(out))
    check_target(Path(out))
    from swingid.control.references import parse_reference
    from swingid.model.rig import Rig
    from swingid.simulate import simulate as run

    plant = Rig.load(rig)
    angle = _angle(initial_angle, plant)
    motion = None if reference is None else parse_reference(reference)
    controller = None
    if motion is not None:
        controller = _controller(plant, gains, given)
    elif given:
        raise UsageError("gains need a motion to follow; give --reference", code="no-reference")
    elif angle == 0.0:
        raise UsageError("nothing would move; give --reference or --initial-angle", code="no-motion")
    announce_compilation("simulate")
    log = run(
        plant,
        motion,
        controller,
        duration=duration,
        rate=rate,
        seed=seed,
        initial_angle=angle,
        draw=draw,
    )
    tell(_line(log.save(out, plant), log, plant))


def _angle(text: str, rig: Rig) -> float:
    """The initial angle in rad, or m on a linear axis; UsageError for what is no number with such a unit."""
    unit = "rad" if rig.axis.kind == "rotary" else "m"
    try:
        return float(text)
    except ValueError:
        from swingid.units import parse_quantity
    try:
        return parse_quantity(text, unit, "--initial-angle").value
    except InputError as error:
        raise UsageError(error.message, code=error.code) from None


def _controller(rig: Rig, gains: Gains, given: dict[str, float]) -> Compensator:
    """The compensator with the named gains, those of `given` in their place."""
    from dataclasses import replace

    from swingid.control.compensator import Compensator

    named = Compensator.paper if gains is Gains.EXPERIMENT else Compensator.paper_simulation
    return replace(named(rig), **given)  # type: ignore[arg-type]


def _line(path: Path, log: Recording, rig: Rig) -> str:
    """What was written, in one line."""
    line = f"wrote {path}: {len(log)} rows, {log.duration:g} s at {log.rate:g} per second, rig {rig.name}"
    if log.adaptive_gain is not None:
        line += f", adaptive gain {log.adaptive_gain[-1]:.4g} at the end"
    return line
