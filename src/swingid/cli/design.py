"""``swingid design``: the motion that gives the inertia as certain as wanted."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from swingid.errors import SwingidError, UsageError


def design(
    rig: Annotated[str, typer.Option(metavar="RIG", help="Path ending in .toml, or a built-in name such as paper.")],
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
        str | None, typer.Option(help='Gravity torque to expect, such as "78 mN*m", where RIG says "unknown".')
    ] = None,
    rate: Annotated[float, typer.Option(help="Rows per second.")] = 1000.0,
    settling: Annotated[float, typer.Option(help="Time the controller takes to reach its motion, s.")] = 6.0,
    json: Annotated[str | None, typer.Option(metavar="FILE", help='Write JSON; "-": standard output.')] = None,
) -> None:
    """Propose the motion that gives the inertia of RIG with the wanted uncertainty, and say what to expect of it.

    Voltage stays within the limit of RIG. Friction is expected as in axis.friction.
    """
    from swingid.cli.output import check_targets, check_writable, tell, write_json

    check_targets({"--json": json}, {rig: "the rig file"})
    check_writable(json)
    from swingid.cli.kernels import announce_compilation
    from swingid.cli.simulate import parse_angle
    from swingid.model.rig import Rig
    from swingid.study.design import asked, refused
    from swingid.study.design import design as run

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
        asked(plant, uncertainty, **options)
        announce_compilation("simulate")
        found = run(plant, uncertainty, **options)
    except SwingidError as error:
        if json is not None and not isinstance(error, UsageError):
            write_json(refused(plant, error), json)
        raise
    if json is not None:
        write_json(found.to_json(), json)
    tell(found.summary(), to_error=json == "-")
