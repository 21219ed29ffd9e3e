"""How time and memory grow with samples, runs, unknowns and workers; what a million runs take. Into docs/cost.md.

    python benchmarks/cost.py [--print]

Each point is measured in a process of its own: processor time of all threads, the least of a few calls after a first
one that compiles; memory as what the largest resident size grows by. So other work on the machine hardly matters.
Growth is the slope of a straight line through the logarithms.
"""

from __future__ import annotations

import argparse
import json
import re
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

import swingid as sw

PAGE = Path(__file__).resolve().parents[1] / "docs" / "cost.md"
PAPER = sw.Rig.builtin("paper")
TOLD = PAPER.changed({"axis.inertia": None, "axis.friction": None})
MOTION = sw.parse_reference("sine 0.8 rad 8.5 rad/s")
RATE, RUN = 1000.0, 25.0
CALLS = 3
UNKNOWNS = (
    ("viscous", ""),
    ("coulomb + viscous", ""),
    ("coulomb + viscous", "gravity_torque"),
    ("coulomb + viscous", "gravity_torque, motor_viscous"),
    ("coulomb + viscous", "gravity_torque, motor_viscous, motor_coulomb"),
)
"""Law and further unknowns of the output error: two to six unknowns."""

SIZES: dict[str, tuple[int, ...]] = {
    "simulate": (25, 100, 400, 1600),
    "momentum": (25, 100, 400, 1600),
    "energy": (25, 100, 400, 1600),
    "output-error": (25, 100, 400),
    "unknowns": (2, 3, 4, 5, 6),
    "ensemble": (64, 256, 1024),
    "batch": (64, 256, 1024),
    "campaign": (1, 2, 4),
}
"""Seconds of log at 1 kHz; unknowns; runs of 25 s; workers."""

WORDS = {
    "simulate": "`simulate`, seconds at 1 kHz",
    "momentum": "`identify`, momentum, seconds of log at 1 kHz",
    "energy": "`identify`, energy, seconds of log at 1 kHz",
    "output-error": "`identify`, output-error, law given, seconds of log at 1 kHz",
    "unknowns": "the same on 25 s, unknowns",
    "ensemble": "`simulate_ensemble`, runs of 25 s, angles and voltage",
    "batch": "`momentum_batch`, runs of 25 s, simulation included",
    "campaign": "`campaign`, workers (48 trials of 25 s, momentum)",
}

TRIALS, BEGIN = 64, 16
"""A campaign of so many trials less one of so many, so that its start is not counted."""

MILLION, CORES = 1_000_000, (2, 16, 128, 1024)


def log_of(seconds: float) -> sw.Recording:
    run = sw.simulate(PAPER, MOTION, sw.Compensator.paper(PAPER), duration=seconds, rate=RATE, seed=1)
    with tempfile.TemporaryDirectory() as folder:
        return sw.Recording.load(run.save(Path(folder) / "run.parquet", TOLD), TOLD)


def work_of(kind: str, size: int) -> Callable[[], object]:
    """What is timed."""
    if kind == "simulate":
        return lambda: sw.simulate(PAPER, MOTION, sw.Compensator.paper(PAPER), duration=size, rate=RATE)
    if kind in ("momentum", "energy", "output-error"):
        log = log_of(size)
        options = {"law": "coulomb + viscous"} if kind == "output-error" else {}
        return lambda: sw.identify(log, TOLD, method=kind, **options)
    if kind == "unknowns":
        log, (law, free) = log_of(RUN), UNKNOWNS[size - 2]
        return lambda: sw.identify(log, TOLD, method="output-error", law=law, free=free)
    return many(size, identified=kind == "batch")


def many(count: int, identified: bool) -> Callable[[], object]:
    """`count` runs in an ensemble, of different inertias, and momentum on them where wanted."""
    from swingid.batch import momentum_batch, plan_batch
    from swingid.simulation.ensemble import simulate_ensemble

    def simulated(runs: int, record: str = "measured") -> object:
        values = {"axis.inertia": 302.2e-5 * np.linspace(0.8, 1.3, runs)}
        return simulate_ensemble(PAPER, MOTION, duration=RUN, rate=RATE, values=values, record=record, threads=1)

    if not identified:
        return lambda: simulated(count)
    few = simulated(3, "all")
    plan = plan_batch([few.recording(k) for k in range(3)], PAPER)

    def both() -> object:
        runs = simulated(count)
        return momentum_batch(runs.channel("angle"), runs.channel("wheel_angle"), RATE, PAPER, plan)

    return both


def campaign(workers: int, trials: int) -> Callable[[], object]:
    from swingid.study.campaign import load_plan, run_campaign

    text = f"""
name = "cost"
about = "one experiment, many times"
repeats = {trials}
block = 2
[base]
rig = "paper"
reference = "sine 0.8 rad 8.5 rad/s"
duration = {RUN}
rate = {RATE}
methods = ["momentum"]
"""

    def run() -> object:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "plan.toml"
            path.write_text(text, encoding="utf-8")
            return run_campaign(load_plan(path), Path(folder) / "out", workers=workers)

    return run


def processor() -> float:
    """Seconds of this process and of those it waited for."""
    whole = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(use.ru_utime + use.ru_stime for use in whole)


def measured(kind: str, size: int) -> dict[str, float]:
    """Seconds and megabytes of one point, in this process."""
    if kind == "campaign":
        seconds = [spent(campaign(size, trials)) for trials in (BEGIN, BEGIN, TRIALS)]
        return {"seconds": seconds[-1] - seconds[-2], "megabytes": 0.0}
    work_of(kind, SIZES[kind][0])()  # compiles
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    work = work_of(kind, size)
    least = min(spent(work) for _ in range(CALLS))
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    return {"seconds": least, "megabytes": grown / 1024}


def spent(work: Callable[[], object]) -> float:
    """Processor seconds of a call, its worker processes included."""
    start = processor()
    work()
    return processor() - start


def point(kind: str, size: int) -> dict[str, float]:
    done = subprocess.run(
        [sys.executable, __file__, "--one", kind, str(size)], capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout.splitlines()[-1])


def slope(sizes: tuple[int, ...], values: list[float]) -> float:
    return float(np.polyfit(np.log(sizes), np.log(np.maximum(values, 1e-9)), 1)[0])


def rows(found: dict[str, list[dict[str, float]]]) -> Iterator[str]:
    heads = ("what, over what", "sizes", "processor time, s", "slope", "memory beyond the first, MB", "MB per unit")
    yield "| " + " | ".join(heads) + " |"
    yield "|---|---|---|---|---|---|"
    for kind, points in found.items():
        seconds, megabytes = ([p[key] for p in points] for key in ("seconds", "megabytes"))
        sizes = SIZES[kind]
        memory, each = "; ".join(f"{m:.3g}" for m in megabytes), f"{megabytes[-1] / (sizes[-1] - sizes[0]):.2g}"
        grows = f"{slope(sizes, seconds):.2f}"
        if kind in ("unknowns", "campaign"):
            memory = each = "–"
        if kind == "campaign":
            grows = "–"
        cells = ("; ".join(map(str, sizes)), "; ".join(f"{s:.2g}" for s in seconds), grows)
        yield "| " + " | ".join((WORDS[kind], *cells, memory, each)) + " |"


def million(found: dict[str, list[dict[str, float]]]) -> Iterator[str]:
    """From the points measured to a million runs of 25 s."""
    each = {
        "simulated, ensemble": found["ensemble"][-1]["seconds"] / SIZES["ensemble"][-1],
        "simulated and identified, ensemble and `momentum_batch`": found["batch"][-1]["seconds"] / SIZES["batch"][-1],
        "`campaign`, momentum, every log a file and a full result": found["campaign"][1]["seconds"] / (TRIALS - BEGIN),
    }
    place = SIZES["output-error"].index(round(RUN))
    full = each["`campaign`, momentum, every log a file and a full result"]
    alone = found["momentum"][SIZES["momentum"].index(round(RUN))]["seconds"]
    each["`campaign`, output-error, law given"] = full - alone + found["output-error"][place]["seconds"]
    yield (
        "| a million runs of 25 s at 1 kHz | per run | processor hours | "
        + " | ".join(f"on {n} cores" for n in CORES)
        + " |"
    )
    yield "|---|---|---|" + "---|" * len(CORES)
    for words, seconds in each.items():
        hours = MILLION * seconds / 3600
        cells = [f"{1e3 * seconds:.3g} ms", f"{hours:.3g}", *(in_words(3600 * hours / cores) for cores in CORES)]
        yield "| " + " | ".join([words, *cells]) + " |"


def in_words(seconds: float) -> str:
    for size, unit in ((86400, "d"), (3600, "h"), (60, "min")):
        if seconds >= 2 * size:
            return f"{rounded(seconds / size)} {unit}"
    return f"{rounded(seconds)} s"


def rounded(value: float) -> str:
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--print", action="store_true", help="only print; leave docs/cost.md as it is")
    parser.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        print(json.dumps(measured(given.one[0], int(given.one[1]))))
        return
    found = {kind: [point(kind, size) for size in sizes] for kind, sizes in SIZES.items()}
    text = PAGE.read_text(encoding="utf-8")
    for name, part in (("growth", rows), ("million", million)):
        block = "\n".join(part(found))
        print(block + "\n", flush=True)
        pattern = re.compile(rf"(<!-- cost: {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        assert pattern.search(text), f"docs/cost.md has no place for {name}"
        text = pattern.sub(lambda match, block=block: f"{match[1]}\n{block}\n\n{match[2]}", text)
    if not given.print:
        PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
