"""What users would take otherwise, on the same log and the same loop, as tables in docs/benchmarks.md.

    python benchmarks/peers [--print]        (make peers)

Each peer is optional (`pip install 'swingid[peers]'`); a missing one is named with its install line. Every module here
is one peer: `fit_*` has fit(log) -> J1, `loop_*` has closed_loop(rig, reference, rate) -> readings and voltage. Times
are those of the processor, all threads, of a second call; what a first call takes longer is set beside them.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.metadata
import os
import platform
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import problem

import swingid as sw
from swingid.simulation import simulate_run
from swingid.simulation.ensemble import simulate_ensemble

FITS = ("fit_scipy", "fit_casadi", "fit_diffrax", "fit_pysindy")
LOOPS = ("loop_control", "loop_mujoco")
PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks.md"
MARKS = r"(<!-- peers: {} -->\n).*?(<!-- end -->)"
SLOW = 20.0
"""s; what takes longer is not done twice."""


def present(name: str) -> ModuleType | str:
    """The module of a peer, or what has to be installed for it."""
    module = importlib.import_module(name)
    for package in module.PACKAGES:
        try:
            importlib.import_module(package)
        except ImportError:
            return f"{module.NAME}: not installed; pip install {' '.join(module.PACKAGES)}"
    return module


def timed(work: Callable[[], object]) -> tuple[object, float, float]:
    """What `work` gives; processor seconds of the second call, and by how much the first took longer."""
    seconds = []
    for _ in range(2):
        start = time.process_time()
        found = work()
        seconds.append(time.process_time() - start)
        if seconds[0] > SLOW:
            break
    return found, seconds[-1], seconds[0] - seconds[-1]


def ours(method: str) -> Callable[[problem.Log], float]:
    return lambda log: sw.identify(log.recording, log.rig, method=method).inertia.value


def fits() -> Iterator[str]:
    """Rows of the table of fits."""
    yield (
        "| fitted by | "
        + " | ".join(f"{name}: error of J1" for name in problem.LOGS)
        + " | time | first call | ratio |"
    )
    yield "|---|" + "---|" * (len(problem.LOGS) + 3)
    work: list[tuple[str, Callable[[problem.Log], float]]] = [
        ("swingid, momentum", ours("momentum")),
        ("swingid, output-error", ours("output-error")),
    ]
    missing = []
    for name in FITS:
        module = present(name)
        if isinstance(module, str):
            missing.append(module)
        else:
            work.append((module.NAME, module.fit))
    base = None
    for words, fit in work:
        log, *others = (problem.log(name) for name in problem.LOGS)
        inertia, seconds, more = timed(lambda fit=fit, log=log: fit(log))
        errors = [log.error(inertia), *(other.error(fit(other)) for other in others)]
        base = base or seconds
        cells = [percent(error) for error in errors]
        first = f"+ {more:.2g} s" if more > 0.1 * seconds else "–"
        yield "| " + " | ".join([words, *cells, f"{seconds:.2g} s", first, plain(seconds / base)]) + " |"
    for line in missing:
        yield f"| {line} |" + " – |" * (len(problem.LOGS) + 3)


def plain(value: float) -> str:
    """Two digits, never an exponent."""
    return f"{float(f'{value:.2g}'):g}"


def percent(error: float) -> str:
    return f"{error:+.2g} %".replace("-", "−")


def loops() -> Iterator[str]:
    """Rows of the table of closed loops: against the twin over the first seconds and the whole."""
    rig, rate = problem.twin("viscous"), problem.RATE
    rows = round(problem.DURATION * rate) + 1
    reference = 0.8 * np.sin(8.5 * np.arange(rows) / rate)
    motion, controller = sw.parse_reference("sine 0.8 rad 8.5 rad/s"), sw.Compensator.paper(rig)
    yield "| simulated by | q1 from the twin's, first s | whole run | q2, first s | whole run | time | ratio |"
    yield "|---|---|---|---|---|---|---|"
    run, seconds, _ = timed(lambda: simulate_run(rig, motion, controller, duration=problem.DURATION, rate=rate, seed=1))
    log = run.recording
    truth = np.column_stack([log.angle, log.wheel_angle, log.voltage])
    yield f"| swingid, simulate | – | – | – | – | {seconds:.2g} s | 1 |"
    count = 128
    many, seconds_many, _ = timed(
        lambda: simulate_ensemble(
            rig,
            motion,
            controller,
            duration=problem.DURATION,
            rate=rate,
            seeds=range(1, count + 1),
            record="measured",
            threads=1,
        )
    )
    own = np.column_stack([many.channel(name)[0] for name in ("angle", "wheel_angle", "command")])
    yield row(f"swingid, simulate_ensemble, each of {count}", own - truth, seconds_many / count, seconds)
    for name in LOOPS:
        module = present(name)
        if isinstance(module, str):
            yield f"| {module} | – | – | – | – | – | – |"
            continue
        start = time.process_time()
        found = module.closed_loop(rig, reference, rate)
        took = time.process_time() - start
        yield row(module.NAME, found - truth, took, seconds)


def row(words: str, apart: np.ndarray, took: float, base: float) -> str:
    """A row of the table of loops: how far angles are apart in the first second and at all, and the time."""
    early = round(problem.RATE) + 1
    cells = [f"{np.abs(part).max():.2g} rad" for k in range(2) for part in (apart[:early, k], apart[:, k])]
    return "| " + " | ".join([words, *cells, f"{took:.2g} s", plain(took / base)]) + " |"


def check() -> Iterator[str]:
    """Free swings without friction: MuJoCo's angles and energy beside the twin's."""
    module = present("loop_mujoco")
    if isinstance(module, str):
        yield f"{module}."
        return
    rig, duration = problem.twin("viscous"), 5.0
    changes = {"axis.friction": None, "drive.motor.viscous": 0.0, "drive.motor.coulomb": 0.0}
    angles, energy = module.free_swing(rig, 1.0, duration)
    free = simulate_run(
        rig.changed(changes), duration=duration, rate=1000.0, drive=np.zeros(len(angles)), initial_angle=1.0
    )
    apart = max(np.abs(angles[:, 0] - free.truth.angle).max(), np.abs(angles[:, 1] - free.truth.wheel_angle).max())
    yield (
        f"Without friction and voltage, let go at 1 rad, MuJoCo's angles are those of the twin to {apart:.1g} rad over "
        f"{duration:g} s, and its energy stays the same to {np.ptp(energy):.1g} J of {abs(energy[0]):.2g} J."
    )


def machine() -> Iterator[str]:
    """Versions and processor."""
    names = ["swingid", "numpy", "numba", *(p for name in FITS + LOOPS for p in importlib.import_module(name).PACKAGES)]
    versions = []
    for name in dict.fromkeys(names):
        try:
            versions.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            versions.append(f"{name} not installed")
    text = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    model = re.search(r"^model name\s*:\s*(.+)$", text, re.M)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    yield f"{model[1] if model else platform.processor() or platform.machine()}, {cores} cores; {platform.system()};"
    yield f"Python {platform.python_version()}; {', '.join(versions)}."


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--print", action="store_true", help="only print; leave docs/benchmarks.md as it is")
    only_print = parser.parse_args().print
    text = PAGE.read_text(encoding="utf-8")
    for part in (fits, loops, check, machine):
        lines = []
        for line in part():
            print(line, flush=True)
            lines.append(line)
        print()
        block = "\n".join(lines)
        pattern = re.compile(MARKS.format(part.__name__), re.DOTALL)
        assert pattern.search(text), f"docs/benchmarks.md has no place for {part.__name__}"
        text = pattern.sub(lambda match, block=block: f"{match[1]}\n{block}\n\n{match[2]}", text)
    if not only_print:
        PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
