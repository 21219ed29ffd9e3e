"""Cases of the other commands: calibrate, compare, validate, difference, design, rehearse, campaign, convert, init."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from compare_with.case import METHODS, Case, command
from compare_with.outcomes import JSON, of_command, of_table, of_toml
from compare_with.rigs import BLANK, PAPER, STATED, changed, twin_of

SINE = ["--reference", "sine 0.8 rad 8.5 rad/s"]
PLAN = """name = "tiny"
repeats = 3
[base]
rig = "{rig}"
reference = "sine 0.8 rad 8.5 rad/s"
duration = 10
methods = {methods}
[factors.noise]
key = "twin.sensors.noise"
values = [1e-4, 1e-3]
"""


def _log(name: str) -> list[str]:
    return [f"logs/{name}.parquet", "--rig", f"logs/{name}.toml"]


def _with_rig(name: str, tree: dict[str, Any], *arguments: str, quick: bool = False, needs_logs: bool = False) -> Case:
    """A command on a rig file of its own."""
    given = [*arguments, "--rig", "{here}/rig.toml", "--json", JSON]
    return command(name, given, quick=quick, needs_logs=needs_logs, rig=tree)


def _campaign(name: str, methods: list[str], quick: bool = False) -> Case:
    """A tiny campaign: its summary and its table of results."""

    def run(folder: Path) -> Any:
        plan = folder / "plan.toml"
        listed = "[" + ", ".join(f'"{method}"' for method in methods) + "]"
        plan.write_text(PLAN.replace("{rig}", "paper").replace("{methods}", listed), encoding="utf-8")
        out = folder / "results"
        arguments = ["campaign", str(plan), "--out", str(out), "--workers", "1", "--json", JSON]
        found = of_command(arguments, folder)
        table = out / "results.parquet"
        return found | {"table": of_table(table) if table.exists() else "no file"}

    return Case(f"campaign/{name}", run, quick, needs_logs=False)


def _convert(ending: str) -> Case:
    """To a format and back to Parquet."""

    def run(folder: Path) -> Any:
        there, back = folder / f"log{ending}", folder / "back.parquet"
        steps = [
            of_command(["convert", "logs/law-viscous.parquet", str(there)], folder),
            of_command(["convert", str(there), str(back)], folder),
        ]
        return [*steps, of_table(back) if back.exists() else "no file"]

    return Case(f"convert/{ending[1:]}", run, quick=ending in (".csv", ".mat"))


def _simulate(name: str, ending: str, *arguments: str, quick: bool = False) -> Case:
    """The command `simulate`, and the table it writes."""

    def run(folder: Path) -> Any:
        out = folder / f"log{ending}"
        found = of_command(["simulate", "--rig", "paper", *arguments, "--out", str(out)], folder)
        return found | {"table": of_table(out) if out.exists() and ending in (".csv", ".parquet") else out.exists()}

    return Case(f"simulate-command/{name}", run, quick, needs_logs=False)


def _makes_rig(name: str, *arguments: str, written: str = "rig.toml", needs_logs: bool = True) -> Case:
    """A command that writes a rig file; its values, without its comments."""

    def run(folder: Path) -> Any:
        given = [one.replace("{here}", str(folder)) for one in arguments]
        return of_command(given, folder) | {"rig": of_toml(folder / written)}

    return Case(name, run, quick=True, needs_logs=needs_logs)


def _calibrations() -> list[Case]:
    blank, encoders = changed(PAPER, BLANK), ["calibrate", "--encoders", "--json", JSON]
    clamped = "logs/clamped.parquet"
    to = ["--out", "{here}/new.toml", "--json", JSON]
    return [
        command("calibrate/clamped", ["calibrate", *_log("clamped"), "--json", JSON], quick=True),
        command("calibrate/perfect", ["calibrate", *_log("clamped-perfect"), "--json", JSON]),
        command("calibrate/up", ["calibrate", *_log("clamped-up"), "--json", JSON]),
        command("calibrate/swing", ["calibrate", *_log("rod-swing"), "--json", JSON]),
        command("calibrate/free", ["calibrate", *_log("rod-free"), "--json", JSON]),
        command("calibrate/three", ["calibrate", clamped, "logs/rod-free.parquet", *_log("rod-swing"), "--json", JSON]),
        command("calibrate/closed-loop", ["calibrate", *_log("law-viscous"), "--json", JSON]),
        command("calibrate/no-wheel", ["calibrate", *_log("direct-viscous"), "--json", JSON]),
        _with_rig("calibrate/blank", blank, "calibrate", clamped, needs_logs=True),
        _makes_rig("calibrate/out", "calibrate", *_log("clamped"), *to, written="new.toml"),
        command("calibrate-encoders/one", [*encoders, *_log("law-viscous")], quick=True),
        command("calibrate-encoders/nonlinear", [*encoders, *_log("nonlinear")]),
        command("calibrate-encoders/large", [*encoders, *_log("nonlinear-large")]),
        command("calibrate-encoders/late", [*encoders, *_log("latency-wheel-untold")]),
        command("calibrate-encoders/several", [*encoders, "logs/a.parquet", "logs/b.parquet", *_log("c")]),
        command("calibrate-encoders/direct", [*encoders, *_log("direct-stribeck")]),
        command("calibrate-encoders/free", [*encoders, *_log("free-stribeck")]),
        _makes_rig(
            "calibrate-encoders/out", "calibrate", "--encoders", *_log("nonlinear-large"), *to, written="new.toml"
        ),
    ]


def _studies() -> list[Case]:
    """Comparison, validation and the difference of results."""

    def result(log: str, method: str = "momentum", name: str = "result") -> list[str]:
        return ["identify", *_log(log), "--method", method, "--json", f"{{here}}/{name}.json"]

    found = [command(f"compare/{log}", ["compare", *_log(log), "--json", JSON], quick=log == "a") for log in
             ("a", "law-stribeck", "wrong-motor", "direct-stribeck", "free-stribeck", "linear", "short")]  # fmt: skip
    found.append(command("compare/two", ["compare", "logs/b.parquet", *_log("a"), "--method", "momentum",
                                         "--method", "energy", "--json", JSON]))  # fmt: skip
    for method in METHODS:
        validate = ["validate", "{here}/result.json", *_log("b"), "--json", JSON]
        found.append(command(f"validate/{method}", result("a", method), validate, quick=method == "momentum"))
    found.append(command("validate/voltage", result("a"), ["validate", "{here}/result.json", "logs/c.parquet",
                         *_log("b"), "--input", "voltage", "--json", JSON]))  # fmt: skip
    for log in ("direct-stribeck", "free-stribeck", "linear"):
        validate = ["validate", "{here}/result.json", *_log(log), "--json", JSON]
        found.append(command(f"validate/{log}", result(log), validate))
    both = result("a", name="tare"), result("other", name="loaded")
    files = ["difference", "{here}/tare.json", "{here}/loaded.json", "--json", JSON]
    body = ["--mass", "68.0 ± 0.1 g", "--distance", "20 ± 0.1 mm"]
    found.append(command("difference/plain", *both, files, quick=True))
    found.append(command("difference/body", *both, [*files, *body]))
    found.append(command("difference/known", *both, [*files, "--known", "600 ± 10 g*cm^2"]))
    found.append(command("difference/same", both[0], [*files[:2], "{here}/tare.json", *files[3:]]))
    found.append(command("difference/refused", result("short", name="tare"), both[1], files))
    page = ["--report", "{here}/page.html"]
    found.append(command("report/identify", ["identify", *_log("a"), "--json", JSON, *page]))
    found.append(command("report/inspect", ["inspect", *_log("a"), "--json", JSON, *page]))
    return found


def _plans() -> list[Case]:
    """Before the rig is touched: design, rehearse, campaign, simulate."""
    stated = twin_of(changed(PAPER, STATED), "coulomb")
    rehearse = ["rehearse", "--duration", "8", "--runs", "5"]
    free = ["--duration", "3", "--initial-angle"]
    return [
        _with_rig("design/stated", stated, "design", "--uncertainty", "0.5 %", "--duration", "15", quick=True),
        _with_rig("design/impossible", stated, "design", "--uncertainty", "1e-12 kg*m^2", "--duration", "10"),
        _with_rig("design/limits", stated, "design", "--uncertainty", "1 %", "--max-angle", "20 deg", "--rate", "500"),
        _with_rig("design/no-inertia", PAPER, "design", "--uncertainty", "0.5 %"),
        _with_rig("rehearse/stated", stated, *rehearse, *SINE, "--method", "momentum", "--method", "energy"),
        _with_rig("rehearse/quick", stated, *rehearse, *SINE, "--method", "momentum", quick=True),
        _with_rig("rehearse/all", stated, *rehearse, *SINE),
        _with_rig("rehearse/few", stated, "rehearse", "--duration", "8", "--runs", "2"),
        _campaign("single", ["momentum", "energy"], quick=True),
        _campaign("momentum-batch", ["momentum-batch"]),
        _campaign("energy-batch", ["energy-batch"]),
        _campaign("unknown", ["magic"]),
        command("campaign/list", ["campaign", "--list"], needs_logs=False),
        _simulate("sine", ".csv", "--duration", "5", *SINE, quick=True),
        _simulate("decay", ".parquet", *free, "30 deg", "--seed", "3"),
        _simulate("backstepping", ".parquet", "--duration", "5", *SINE, "--controller", "backstepping"),
        _simulate("gains", ".parquet", "--duration", "2", "--rate", "10000", "--gains", "simulation", *SINE),
        _simulate("voltage", ".parquet", "--duration", "5", "--voltage", "multisine 3 V 1 rad/s + 2 V 7 rad/s"),
        _simulate("draw", ".mat", "--duration", "2", "--draw", *SINE),
        _simulate("bad", ".csv", "--duration", "5", "--reference", "sinus 3"),
    ]


def _simple() -> list[Case]:
    """What needs no log, and wrong usage."""
    usage: dict[str, list[str]] = {
        "version": ["--version"],
        "help": ["--help"],
        "nothing": [],
        "no-command": ["idntify"],
        "no-rig": ["identify", "logs/a.parquet"],
        "no-log": ["identify", "--rig", "paper"],
        "bad-method": ["identify", "logs/a.parquet", "--rig", "paper", "--method", "magic"],
        "bad-part": ["identify", *_log("a"), "--part", "5:4", "--json", JSON],
        "bad-repair": ["identify", *_log("a"), "--without-repair", "magic", "--json", JSON],
        "missing-rig": ["identify", "logs/a.parquet", "--rig", "none.toml", "--json", JSON],
        "missing-log": ["identify", "logs/none.parquet", "--rig", "paper", "--json", JSON],
        "variant": ["identify", *_log("a"), "--variant", "printed"],
        "bad-json": ["identify", *_log("a"), "--json", "none/none.json"],
        "datasets": ["datasets", "--json", JSON],
        "datasets-unknown": ["datasets", "get", "nothing"],
    }
    return [command(f"usage/{name}", arguments, quick=True) for name, arguments in usage.items()]


def cases() -> list[Case]:
    """All cases of the other commands."""
    formats = [_convert(ending) for ending in (".csv", ".mat", ".h5", ".mcap", ".jsonl", ".parquet", ".xyz")]
    rigs = [
        _makes_rig("init/plain", "init", "{here}", needs_logs=False),
        _makes_rig("init/from-twin", "init", "{here}", "--from", "logs/law-viscous.parquet"),
        _makes_rig("init/from-units", "init", "{here}", "--from", "logs/units.parquet"),
        _makes_rig("init/from-direct", "init", "{here}", "--from", "logs/direct-stribeck.parquet"),
        _makes_rig("init/from-real", "init", "{here}", "--from", "data/emps/DATA_EMPS.mat"),
        _makes_rig("init/from-json", "init", "{here}", "--from", "data/bam_xl330/2026-01-15_10h28m49.json"),
        _makes_rig("init/from-nothing", "init", "{here}", "--from", "logs/none.csv"),
    ]
    return [*_simple(), *formats, *rigs, *_calibrations(), *_studies(), *_plans()]
