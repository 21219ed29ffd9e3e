"""A twin of the paper's pendulum, and its inertia out of the twin's log: what ``make demo`` runs.

The twin has 14-bit encoders, a controller with the gains of the paper's experiment at 1 kHz, and a bearing whose
friction is Stribeck + quadratic. The identification gets neither that friction nor the twin's inertia, only the log's
file and the rig named "paper", as from a user.
"""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

import swingid as sw
from swingid.cli.compile import compile_first

FOLDER = Path("out/demo")
FRICTION = """[axis.friction]
viscous = 1.5e-3
coulomb = 1.0e-3
static = 1.6e-3
stribeck_speed = 0.3
quadratic = 2.0e-4
"""

DOTS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
"""Dots of a Braille character, left and right column from the top."""

console = Console(highlight=False, soft_wrap=True)


def twin() -> sw.Rig:
    """The paper's rig with another friction in its bearing."""
    text = re.sub(r"^\[axis\.friction\].*?(?=^\[)", FRICTION + "\n", sw.Rig.builtin("paper").text, flags=re.M | re.S)
    return sw.Rig.from_text(text, "the demo's twin")


def make_log(rig: sw.Rig, path: Path) -> None:
    """25 s of the twin following 0.8 sin(8.5 t), written to `path`."""
    motion = sw.parse_reference("sine 0.8 rad 8.5 rad/s")
    sw.simulate(rig, motion, sw.Compensator.paper(rig), duration=25.0, rate=1000.0, seed=1).save(path, rig)


def compare(results: dict[str, sw.Result], truth: float) -> Table:
    """The inertias found, beside the true value of the twin."""
    table = Table(title="moment of inertia J1, kg m²")
    for column in ("method", "value", "± standard uncertainty", "error", "status"):
        table.add_column(column, justify="left" if column in ("method", "status") else "right")
    table.add_row("true value of the twin", f"{truth:.6e}", "", "", "")
    for method, result in results.items():
        found = result.inertia
        spread = "unknown" if found.standard_uncertainty is None else f"{found.standard_uncertainty:.1e}"
        error = f"{100 * (found.value / truth - 1):+.4f} %"
        table.add_row(method, f"{found.value:.6e}", spread, error, result.status)
    return table


def picture(values: Sequence[float], width: int = 72, height: int = 5) -> list[str]:
    """A curve as lines of Braille characters, each two dots wide and four high."""
    low, high = min(values), max(values)
    cells = [[0] * width for _ in range(height)]
    for k in range(2 * width):
        value = values[k * (len(values) - 1) // (2 * width - 1)]
        row = round((high - value) / ((high - low) or 1.0) * (4 * height - 1))
        cells[row // 4][k // 2] |= DOTS[k % 2][row % 4]
    return ["".join(chr(0x2800 + cell) for cell in line) for line in cells]


def program() -> str:
    """The command as it can be typed in this folder, whether or not its folder is on PATH."""
    own = Path(sys.executable).with_name("swingid.exe" if os.name == "nt" else "swingid")
    if not own.exists():
        return f"{sys.executable} -m swingid"
    return os.path.relpath(own) if own.is_relative_to(Path.cwd()) else str(own)


def main() -> None:
    """Simulate, identify twice, compare, report."""
    from swingid.report import write_report

    started = time.perf_counter()
    FOLDER.mkdir(parents=True, exist_ok=True)
    path = FOLDER / "run.parquet"
    hidden = twin()
    assert hidden.axis.inertia is not None
    console.print("1/4 the twin swings for 25 s …")
    compile_first("simulate")
    make_log(hidden, path)
    console.print(f"    wrote {path}")

    rig = sw.Rig.load("paper")
    log = sw.Recording.load(path, rig)
    results = {}
    for step, method in ((2, "momentum"), (3, "energy")):
        console.print(f"{step}/4 identifying {path} with the method {method} …")
        results[method] = sw.identify(log, rig, method=method)
    console.print("4/4 writing the report …")
    page = FOLDER / "report.html"
    write_report(results["momentum"], log, rig, page)

    console.print()
    console.print(results["momentum"].summary(), markup=False)
    console.print(compare(results, hidden.axis.inertia.value))
    if console.is_terminal and "utf" in console.encoding.lower():
        console.print("the angle from 10 s to 13 s")
        for line in picture(log.angle[10000:13000].tolist()):
            console.print(f"  {line}")
    console.print(f"The report is {page.resolve()}  ({time.perf_counter() - started:.0f} s in all)", soft_wrap=True)
    console.print("Next, the methods side by side, and a rig file for your own log:")
    console.print(f"  {program()} compare {path} --rig paper --report {FOLDER / 'compare.html'}")
    console.print(f"  {program()} init my-rig")


if __name__ == "__main__":
    main()
