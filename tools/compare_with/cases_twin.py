"""Cases on generated logs: every log by every method, read and inspected; options; several logs; simulation; online."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from compare_with.case import METHODS, Case, command
from compare_with.logs import recipes
from compare_with.outcomes import JSON, of_call, of_recording, plain
from compare_with.recipe import Recipe, made
from compare_with.rigs import to_toml

ONLINE = ("law-stribeck", "noise", "stated", "direct-stribeck", "free-stribeck", "gravity-unknown", "linear", "pushed",
          "direct-unknown", "spring", "cogging", "strings")  # fmt: skip
QUICK_ONLINE = ("law-stribeck", "gravity-unknown", "spring")
OPTIONS = {
    "energy-printed": ("law-viscous", "energy", ["variant=printed"]),
    "energy-trapezoid": ("law-viscous", "energy", ["variant=printed", "work=trapezoid"]),
    "energy-observers": ("law-viscous", "energy", ["velocities=observers"]),
    "equation-error-law": ("law-coulomb", "equation-error", ["friction=coulomb + viscous"]),
    "equation-error-cutoff": ("law-coulomb", "equation-error", ["cutoff=20"]),
    "equation-error-instruments": ("noise", "equation-error", ["instruments=true"]),
    "output-error-wheel": ("law-stribeck", "output-error", ["input=wheel"]),
    "output-error-law": ("law-coulomb", "output-error", ["law=coulomb + viscous, offset"]),
    "output-error-free": ("law-viscous", "output-error", ["law=viscous", "free=torque_per_volt,back_emf"]),
    "output-error-segment": ("law-viscous", "output-error", ["law=viscous", "segment=2"]),
    "backstepping-consistent": ("law-viscous", "backstepping", ["law=consistent"]),
    "backstepping-observers": ("law-viscous", "backstepping", ["velocities=observers"]),
    "memory-on": ("law-stribeck", "momentum", ["memory=on"]),
    "memory-off": ("law-stribeck", "momentum", ["memory=off"]),
    "memory-on-lugre": ("direct-lugre", "momentum", ["memory=on"]),
    "memory-off-lugre": ("direct-lugre", "momentum", ["memory=off"]),
    "unknown-option": ("law-viscous", "momentum", ["magic=1"]),
}
QUICK_OPTIONS = ("memory-on", "memory-off")
REPAIRS = ("blanks", "clock", "encoders", "calibrate", "latency", "push", "limit", "spikes")


def identified(recipe: Recipe, method: str) -> Case:
    """A log by a method, through the command line."""
    arguments = ["identify", recipe.log, "--rig", recipe.rig, "--method", method, "--json", JSON]
    return command(f"twin/{recipe.name}/{method}", arguments, quick=recipe.is_quick(method))


def _simulated(recipe: Recipe, folder: Path) -> Any:
    import swingid as sw

    return of_call(lambda: of_recording(made(sw, recipe)))


def _read(recipe: Recipe, folder: Path) -> Any:
    import swingid as sw

    return of_call(lambda: of_recording(sw.Recording.load(recipe.log, sw.Rig.load(recipe.rig))))


def _online(recipe: Recipe, method: str, folder: Path) -> Any:
    import swingid as sw

    def estimates() -> Any:
        rig = sw.Rig.load(recipe.rig)
        log = sw.Recording.load(recipe.log, rig)
        drive = log.torque if log.voltage is None else log.voltage
        none = [None] * len(log)
        columns = [none if one is None else one.tolist() for one in (log.wheel_angle, drive)]
        rows = zip(log.time.tolist(), log.angle.tolist(), *columns, strict=True)
        return list(sw.online(rig, rows, method))

    return of_call(estimates)


def _library(recipe: Recipe, folder: Path) -> Any:
    """What the commands do not show: several recordings in memory, a segment, the rig as text."""
    import swingid as sw

    rig = sw.Rig.load(recipe.rig)
    log = sw.Recording.load(recipe.log, rig)
    columns = {"t": log.time, "q1": log.angle, "q2": log.wheel_angle, "u": log.voltage}
    again = sw.Recording.from_columns(columns, rig)
    return {
        "segment": of_call(lambda: sw.identify(log.segment(5.0, 12.0), rig)),
        "columns": of_call(lambda: sw.identify(again, rig)),
        "changed": of_call(lambda: sw.identify(log, rig.changed({"axis.gravity_torque": "78 ± 1 mN*m"}))),
        "unknown-method": of_call(lambda: sw.identify(log, rig, "magic")),
        "no-rig": of_call(lambda: sw.identify(log, "paper")),
        "bad-key": of_call(lambda: rig.changed({"axis.inertai": 1})),
        "exact": plain(rig.constants_without_uncertainty()),
        "text": to_toml(recipe.given) in rig.text,
    }


def _several() -> list[Case]:
    """Several logs of one body."""

    def pooled(name: str, logs: list[str], *more: str, quick: bool = False) -> Case:
        paths = [f"logs/{log}.parquet" for log in logs]
        return command(
            f"several/{name}", ["identify", *paths, "--rig", "logs/a.toml", "--json", JSON, *more], quick=quick
        )

    found = [pooled(f"abc-{method}", ["a", "b", "c"], "--method", method) for method in METHODS]
    return [
        *found,
        pooled("ab", ["a", "b"], quick=True),
        pooled("shared", ["a", "b", "c"], "--option", "friction=shared", quick=True),
        pooled("shared-energy", ["a", "b", "c"], "--option", "friction=shared", "--method", "energy"),
        pooled("other", ["a", "b", "c", "other"]),
        pooled("missing", ["a", "b", "nothing"]),
        pooled("twice", ["a", "a"]),
        pooled("part", ["a", "b"], "--part", "4:12"),
        pooled("refused", ["short", "tiny"]),
        pooled("mixed", ["a", "law-stribeck", "short"]),
    ]


def cases() -> list[Case]:
    """All cases on generated logs."""
    known = {recipe.name: recipe for recipe in recipes()}
    found: list[Case] = []
    for recipe in known.values():
        found += [identified(recipe, method) for method in METHODS]
        found.append(command(f"inspect/{recipe.name}", _inspect(recipe), quick=recipe.is_quick("inspect")))
        found.append(Case(f"read/{recipe.name}", partial(_read, recipe), recipe.is_quick("read")))
        quick = recipe.is_quick("simulate")
        found.append(Case(f"simulate/{recipe.name}", partial(_simulated, recipe), quick, needs_logs=False))
    for name in ONLINE:
        found += [
            Case(f"online/{name}/{method}", partial(_online, known[name], method), quick=name in QUICK_ONLINE)
            for method in ("momentum", "energy")
        ]
    for name, (log, method, options) in OPTIONS.items():
        given = [word for option in options for word in ("--option", option)]
        arguments = ["identify", f"logs/{log}.parquet", "--rig", f"logs/{log}.toml", "--method", method]
        found.append(command(f"option/{name}", [*arguments, *given, "--json", JSON], quick=name in QUICK_OPTIONS))
    for repair in REPAIRS:
        for log in ("pushed", "nonlinear-large-untold", "latency-stated", "jitter"):
            arguments = ["identify", f"logs/{log}.parquet", "--rig", f"logs/{log}.toml", "--without-repair", repair]
            found.append(command(f"without/{repair}/{log}", [*arguments, "--json", JSON]))
    found.append(Case("library/law-stribeck", partial(_library, known["law-stribeck"]), quick=True))
    return [*found, *_several()]


def _inspect(recipe: Recipe) -> list[str]:
    return ["inspect", recipe.log, "--rig", recipe.rig, "--json", JSON]
