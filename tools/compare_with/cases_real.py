"""Cases on public measurements of real rigs, where their folder is there."""

from __future__ import annotations

from compare_with.case import METHODS, Case, command
from compare_with.outcomes import JSON

LOGS: dict[str, tuple[str, str, str | None]] = {
    "emps": ("emps/DATA_EMPS.mat", "emps", None),
    "emps-pulses": ("emps/DATA_EMPS_PULSES.mat", "emps", None),
    "free": ("free_pendulum/free_swing.csv", "free_pendulum", None),
    "simulink": ("free_pendulum/SinglePendulumArm_RawData_1.mat", "free_pendulum_simulink", None),
    "bam-drop": ("bam_xl330/2026-01-15_10h28m49.json", "bam_xl330", None),
    "bam-sine": ("bam_xl330/2026-01-15_10h28m42.json", "bam_xl330", None),
    "bam-up-down": ("bam_xl330/2026-01-15_10h28m57.json", "bam_xl330", None),
    "bam-square": ("bam_xl330/2026-01-15_10h29m04.json", "bam_xl330", None),
    "dfki-energy": ("dfki_pendulum/energy_shaping.csv", "dfki_pendulum", "0:4.6"),
    "dfki-energy-whole": ("dfki_pendulum/energy_shaping.csv", "dfki_pendulum", None),
    "dfki-sac": ("dfki_pendulum/sac.csv", "dfki_pendulum", "0:4.4"),
    "dfki-sac-whole": ("dfki_pendulum/sac.csv", "dfki_pendulum", None),
    "dfki-pd": ("dfki_pendulum/pd_sysid.csv", "dfki_pendulum", None),
    "dfki-1kg": ("dfki_pendulum/energy_shaping_1kg.csv", "dfki_pendulum", None),
}
QUICK = ("emps", "simulink", "bam-drop", "dfki-sac")


def cases() -> list[Case]:
    """Every log by every method, inspected with and without its rig, and a rig made from it."""
    found: list[Case] = []
    for name, (path, rig, part) in LOGS.items():
        log, given = f"data/{path}", ["--rig", f"rigs/{rig}.toml", "--json", JSON]
        cut = ["--part", part] if part else []
        for method in METHODS:
            arguments = ["identify", log, *given, "--method", method, *cut]
            quick = name in QUICK and method in ("momentum", "energy", "equation-error")
            found.append(command(f"real/{name}/{method}", arguments, quick=quick, needs_logs=False))
        if part is None:
            quick = name in ("emps", "bam-drop")
            found += [
                command(f"real/{name}/inspect", ["inspect", log, *given], quick=quick, needs_logs=False),
                command(f"real/{name}/inspect-alone", ["inspect", log, "--json", JSON], needs_logs=False),
            ]
    pair = [f"data/dfki_pendulum/{name}.csv" for name in ("energy_shaping", "sac")]
    given = ["--rig", "rigs/dfki_pendulum.toml", "--json", JSON]
    two = ["--method", "momentum", "--method", "energy"]
    found.append(command("real/dfki-two/momentum", ["identify", *pair, *given], needs_logs=False))
    found.append(command("real/dfki-two/compare", ["compare", *pair, *given, *two], needs_logs=False))
    free = ["data/free_pendulum/free_swing.csv", "--rig", "rigs/free_pendulum.toml"]
    found.append(command("real/free/compare", ["compare", *free, *two, "--json", JSON], needs_logs=False))
    return found
