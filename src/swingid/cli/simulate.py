"""``swingid simulate``: the twin's log of a rig."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from swingid.cli import output
from swingid.cli.compile import compile_first
from swingid.cli.options import Angle, Motion, Rate, RigFile
from swingid.cli.progress import Progress
from swingid.errors import InputError, UsageError
from swingid.progress import shown

if TYPE_CHECKING:
    from swingid.control.backstepping import Backstepping
    from swingid.control.compensator import Compensator
    from swingid.control.references import Reference
    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array
    from swingid.recording.recording import Recording

MOST_ROWS = 20_000_000
"""More rows than this are a typing error rather than a run: their arrays would fill some gigabytes."""

WILDEST = 1e6
"""Angles in rad, speeds in rad/s and voltages beyond this are typing errors; the twin would not follow them."""

Kind = Literal["compensator", "backstepping"]
"""Controllers."""

Law = Literal["printed", "consistent"]
"""Adaptation laws of backstepping."""

Gains = Literal["experiment", "simulation"]
"""Named sets of gains, both of the paper's section 5."""

GAINS = ("delta0", "sigma0", "lambda0", "k_tilde0", "k_tilde_max")
"""Gains of the compensator that have an option each."""

NONE: Mapping[str, float] = {}


def simulate(
    rig: RigFile,
    duration: Annotated[float, typer.Option(help="Length of the run, s.")],
    out: Annotated[str, typer.Option(metavar="FILE", help="Log to write, ending in .parquet, .csv or .mat.")],
    reference: Motion = None,
    voltage: Annotated[
        str | None,
        typer.Option(metavar="WORDS", help='Voltage without control, such as "multisine 3 V 1 rad/s + 2 V 7 rad/s".'),
    ] = None,
    rate: Rate = 1000.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything random.")] = 0,
    initial_angle: Angle = "0",
    draw: Annotated[
        bool, typer.Option("--draw", help="Draw every constant with a stated uncertainty, by the seed.")
    ] = False,
    controller: Annotated[
        Kind, typer.Option(help="The consecutive compensator (20), or adaptive backstepping (21).")
    ] = "compensator",
    law: Annotated[
        Law | None, typer.Option(help="Of backstepping: the adaptation law as printed, or as its proof requires.")
    ] = None,
    gains: Annotated[
        Gains | None,
        typer.Option(help="Of the compensator: those of the paper's experiment (default), or simulation (for 10 kHz)."),
    ] = None,
    delta0: Annotated[float | None, typer.Option(help="Error above which the gain grows, rad; (18).")] = None,
    sigma0: Annotated[float | None, typer.Option(help="sigma = sigma0 k_tilde^2, 1/s; (19).")] = None,
    lambda0: Annotated[float | None, typer.Option(help="Growth of the gain, 1/s; (18).")] = None,
    k_tilde0: Annotated[float | None, typer.Option(help="Gain k_tilde at the start; (17).")] = None,
    k_tilde_max: Annotated[float | None, typer.Option(help="Upper bound of the gain k_tilde.")] = None,
) -> None:
    """Write the log that RIG would make: its closed loop, its sensors, its columns and units.

    Without --reference and --voltage nothing drives the rig: a free decay from --initial-angle.
    """
    from swingid.recording.formats import writer_for

    named = zip(GAINS, (delta0, sigma0, lambda0, k_tilde0, k_tilde_max), strict=True)
    given = {name: value for name, value in named if value is not None}
    _check_controller(controller, law, gains, given)
    if voltage is not None and reference is not None:
        raise UsageError("--voltage is without control, --reference with it; give one of them", code="two-drives")
    if duration * rate > MOST_ROWS:
        text = f"--duration {duration:g} s at --rate {rate:g} is more than {MOST_ROWS} rows; simulate a shorter run"
        raise UsageError(text, code="too-long")
    writer_for(Path(out))
    output.check_target(Path(out))
    from swingid.control.references import reference_for
    from swingid.model.rig import Rig

    plant = Rig.load(rig)
    angle = parse_angle(initial_angle, plant)
    motion = None if reference is None else reference_for(reference, plant)
    chosen: Compensator | Backstepping | None = None
    if motion is not None and controller == "backstepping":
        from swingid.control import backstepping

        chosen = backstepping.Backstepping.paper(plant, law=law or "printed")
    elif motion is not None:
        chosen = compensator_of(plant, gains, given)
    elif given or gains or law or controller != "compensator":
        raise UsageError("controllers and gains need a motion to follow; give --reference", code="no-reference")
    elif voltage is None:
        _require_decay(plant, angle)
    drive = None if voltage is None else _commands(voltage, plant, duration, rate)
    _check_size(motion, drive, duration)
    compile_first("simulate")
    from swingid.simulation import simulate as run

    with shown(Progress("rows")):
        log = run(
            plant, motion, chosen, duration=duration, rate=rate, seed=seed, initial_angle=angle, drive=drive, draw=draw
        )
    output.tell(_line(log, Path(out), plant, chosen))


def _require_decay(rig: Rig, angle: float) -> None:
    """Raise UsageError where a rig that nothing drives would not move from this angle."""
    from swingid.units import Quantity

    if angle == 0.0:
        raise UsageError("nothing would move; give --reference, --voltage or --initial-angle", code="no-motion")
    springs = getattr(rig.axis, "stiffness", None), rig.axis.suspension
    if rig.axis.gravity_torque == Quantity(0.0) and rig.axis.friction.offset is None and springs == (None, None):
        message = f"nothing would move: rig {rig.name!r} has no gravity torque and no spring; give --reference"
        message += " or --voltage"
        raise UsageError(message, code="no-motion")


def _check_size(motion: Reference | None, drive: Array | None, duration: float) -> None:
    """Raise UsageError for a motion or a voltage beyond anything that moves, which the twin could not follow."""
    import numpy as np

    peak = motion.peak_speed(duration) if motion is not None and duration > 0 else 0.0
    if not peak <= WILDEST:
        raise UsageError(
            f"--reference reaches a speed of {peak:.3g} per s; give a motion that a rig can make", code="wild"
        )
    if drive is not None and not float(np.max(np.abs(drive), initial=0.0)) <= WILDEST:
        raise UsageError("--voltage goes beyond a million volts; give one that a motor stands", code="wild")


def _commands(text: str, rig: Rig, duration: float, rate: float) -> Array:
    """One voltage per row from the words of a reference motion with V in the place of rad; UsageError for others."""
    import re

    import numpy as np

    from swingid.control.controller import require_torque
    from swingid.control.references.parse import EXAMPLES, parse_reference

    if rig.drive.motor is None:
        raise UsageError(f"--voltage needs a motor, and rig {rig.name!r} has none", code="no-drive")
    words, count = re.subn(r"(?<![A-Za-z])V(?![A-Za-z])", " rad", text)
    kind = text.strip().partition(" ")[0]
    # the grammar's example of this kind, with an amplitude that moves the wheel
    shown = re.sub(r"[\d.]+ (rad|deg)(?!/)", "3 V", EXAMPLES[kind if kind in EXAMPLES else "multisine"])
    example = f"; write for example {shown!r}"
    if count == 0 and not text.startswith("file "):
        raise UsageError(f"--voltage {text!r} has no amplitude in V{example}", code="bad-voltage")
    try:
        wave = parse_reference(words)
    except UsageError as error:
        problem = error.message.partition(": ")[2].partition("; write")[0].rstrip(".")
        raise UsageError(f"--voltage {text!r}: {problem}{example}", code="bad-voltage") from None
    require_torque(rig)
    return np.asarray(wave(np.arange(int(duration * rate + 1e-9) + 1) / rate))


def parse_angle(text: str, rig: Rig, option: str = "--initial-angle") -> float:
    """An angle in rad, or m on a linear axis; UsageError for what is no number with such a unit."""
    unit = "rad" if rig.axis.kind == "rotary" else "m"
    std: float | None = None
    try:
        angle = float(text)
    except ValueError:
        from swingid.units import parse_quantity

        try:
            quantity = parse_quantity(text, unit, option)
            angle, std = quantity.value, quantity.std
        except InputError as error:
            raise UsageError(error.message, code=error.code) from None
    if std is not None:
        raise UsageError(f"{option} takes no uncertainty, and is {text!r}; give a number", code="uncertainty-unused")
    if not abs(angle) <= WILDEST:
        raise UsageError(f"{option} is {angle:g} {unit}; give an angle that a rig can have", code="wild")
    return angle


def _check_controller(controller: Kind, law: Law | None, gains: Gains | None, given: dict[str, float]) -> None:
    """Raise UsageError for gains or a law of the other controller."""
    if controller == "backstepping" and (gains or given):
        name = "gains" if gains else next(iter(given)).replace("_", "-")
        raise UsageError(f"--{name} belongs to --controller compensator; leave one out", code="other-controller")
    if controller == "compensator" and law:
        raise UsageError("--law belongs to --controller backstepping; leave it out or give both", code="no-law")


def compensator_of(rig: Rig, gains: Gains | None, given: Mapping[str, float] = NONE) -> Compensator:
    """The compensator with the named gains, those of `given` in their place."""
    from dataclasses import replace

    from swingid.control.compensator import Compensator

    named = Compensator.paper_simulation if gains == "simulation" else Compensator.paper
    return replace(named(rig), **given)  # type: ignore[arg-type]


def _line(log: Recording, out: Path, rig: Rig, controller: Compensator | Backstepping | None) -> str:
    """Write the log; what was written, in one line, and where the controller's adaptation ended."""
    path = log.save(out, rig)
    line = f"wrote {path}: {len(log)} rows, {log.duration:g} s at {log.rate:g} per second, rig {rig.name}"
    if log.adaptive_gain is None:
        return line
    from swingid.control.backstepping import Backstepping

    last = float(log.adaptive_gain[-1])
    if isinstance(controller, Backstepping):
        return f"{line}, its estimate of the inertia {float(controller.inertia(last)):.4g} kg m^2 at the end"
    return f"{line}, adaptive gain {last:.4g} at the end"
