"""How good each part of a rig must be for 0.1 %: the table of docs/build-a-rig.md, from the budget.

The twin of the paper's rig with its body swings for 25 s; each source of uncertainty is stated alone, and its size is
what gives the inertia an expanded relative uncertainty (k = 2) of 0.1 % by itself. Then imperfections that nobody has
stated: by how much the inertia is off, its expanded uncertainty, and the warnings that tell.
"""

from __future__ import annotations

import math

import swingid as sw

WANTED = 5e-4
SECONDS = 25.0
MOTION = sw.parse_reference("sine 0.8 rad 8.5 rad/s")

# key of the rig file, its value with the uncertainty {u}, a first size, what a size is multiplied by, in which unit
SOURCES = (
    ("drive.wheel.inertia", "1.134e-4 ± {u} kg*m^2", 1.134e-7, 100 / 1.134e-4, "%"),
    ("axis.gravity_torque", "0.156 ± {u}", 1.56e-4, 100 / 0.156, "%"),
    ("log.clock", "0 ± {u}", 1e-4, 1e6, "ppm"),
    ("axis.tilt", "0 ± {u} rad", 0.03, 180 / math.pi, "deg"),
    ("drive.wheel.tilt", "0 ± {u} rad", 0.03, 180 / math.pi, "deg"),
)

FITTED = {"drive.wheel.inertia": {"axis.gravity_torque": "unknown"}}
"""What is left to the fit beside a source: a wheel whose inertia is known needs no gravity torque."""

# an imperfection of the twin that the rig file does not know
UNKNOWN = (
    ("sensors.nonlinearity_cosine", "0.5 deg"),
    ("sensors.nonlinearity_sine", "0.5 deg"),
    ("sensors.wheel.nonlinearity_cosine", "0.5 deg"),
    ("sensors.wheel.nonlinearity_sine", "0.5 deg"),
    ("sensors.wheel.latency", "0.1 ms"),
    ("axis.friction.coulomb", "0.5 mN*m"),
    ("axis.friction.quadratic", "0.1 mN*m*s^2"),
)


def main() -> None:
    """Print the table."""
    rig = sw.Rig.load("paper-body")
    log = sw.simulate(rig, MOTION, duration=SECONDS)
    plain = relative(sw.identify(log, rig))
    print(f"without any of them: {100 * 2 * plain:.1g} %")
    for key, value, size, scale, unit in SOURCES:
        share = 0.0
        for _ in range(6):  # some effects go with the square of the size, or saturate
            written = value.format(u=f"{size:.6g}")
            share = math.sqrt(
                max(relative(sw.identify(log, rig.changed({key: written, **FITTED.get(key, {})}))) ** 2 - plain**2, 0.0)
            )
            if share <= 0.0 or abs(share / WANTED - 1) < 0.02:
                break
            size *= min(max((WANTED / share) ** (0.5 if key.endswith("tilt") else 1.0), 0.02), 50.0)
        print(f"| {key} | {size * scale:.2g} {unit} | {100 * 2 * share:.2g} % |")
    for key, size in UNKNOWN:
        flawed = rig.changed({key: size})
        found = sw.identify(sw.simulate(flawed, MOTION, duration=SECONDS), rig)
        off = found.inertia.value / rig.axis.inertia.value - 1
        codes = ", ".join(sorted({one.code for one in found.warnings}))
        print(f"| {key} = {size} | {100 * off:+.2g} % | {100 * 2 * relative(found):.2g} % | {codes} |")


def relative(result: sw.Result) -> float:
    """Relative standard uncertainty of the inertia."""
    found = result.inertia
    return math.nan if found.standard_uncertainty is None else found.standard_uncertainty / found.value


if __name__ == "__main__":
    main()
