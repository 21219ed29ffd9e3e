"""How well the inertia tensor of a body is found from nine axes: error and coverage of every element.

    python benchmarks/tensor.py [--draws 1000] [--end-to-end]

Each draw: a body in a random orientation, results of 0.01 % about nine axes (three, and the six diagonals of their
planes) whose true directions are off by 0.05 deg (standard deviation about each of two lines across). Errors are in
per cent of the largest moment: "worst element" is the root mean square of the worst of six, "95 %" its 95th percentile.
"covered": least and largest share of 95 % intervals that contain the true value, over the six elements, over the three
moments, of the inertia about random axes. "false": tensors with a warning. With --end-to-end the twin swings a body
about nine axes on the paper's rig, `identify` finds the inertias, and the fixture is subtracted.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import swingid as sw
from body_on_axis import inertia_about, rig_about
from swingid.body.axes import perpendicular
from swingid.body.directions import NAMES, elements_of
from swingid.body.tables import axes_from_text
from swingid.control.compensator import Compensator
from swingid.control.references import Sine
from swingid.errors import UnanswerableError
from swingid.model.rig.gravity import UNKNOWN_PLACE
from swingid.numerics.arrays import Array
from swingid.result.result import Parameter, Result, combined
from swingid.uncertainty.budget import BudgetEntry, scatter, stated

DIAGONALS = [[1, 1, 0], [1, 0, 1], [0, 1, 1], [1, -1, 0], [1, 0, -1], [0, 1, -1]]
NINE = [[1, 0, 0], [0, 1, 0], [0, 0, 1], *DIAGONALS]
THIRTEEN = [*NINE, [1, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]]
MASS = 1.2


@dataclass(frozen=True)
class Case:
    """A body by its moments (kg m²), and what its axes are."""

    name: str
    moments: tuple[float, float, float]
    directions: Sequence[Sequence[float]] = tuple(NINE)
    u: float = 1e-4
    tilt: float = 0.05
    levers: bool = False
    wheel: float = 0.0
    mounting: float = 0.0


CASES = (
    Case("brick 1 : 0.73 : 0.5", (3e-3, 2.2e-3, 1.5e-3)),
    Case("the same, levers from gravity torques", (3e-3, 2.2e-3, 1.5e-3), levers=True),
    Case("the same, wheel's inertia common, 0.1 %", (3e-3, 2.2e-3, 1.5e-3), wheel=1e-3),
    Case("the same, mounting rotated by 0.1 deg", (3e-3, 2.2e-3, 1.5e-3), mounting=0.1),
    Case("the same, thirteen axes of a cube", (3e-3, 2.2e-3, 1.5e-3), directions=THIRTEEN),
    Case("compact 1 : 0.9 : 0.8", (3e-3, 2.7e-3, 2.4e-3)),
    Case("cylinder 1 : 1 : 0.3", (3e-3, 3e-3, 0.9e-3)),
    Case("sphere", (3e-3, 3e-3, 3e-3)),
    Case("thin plate 1 : 0.6 : 0.4", (3e-3, 1.8e-3, 1.2e-3)),
    Case("slender rod 1 : 0.95 : 0.1", (3e-3, 2.85e-3, 0.3e-3)),
    Case("brick, tilt 1 deg", (3e-3, 2.2e-3, 1.5e-3), tilt=1.0),
)


@dataclass
class Tally:
    """Errors (draws, 6) over the largest moment, and hits of intervals."""

    errors: list[Array]
    elements: list[list[bool]]
    moments: list[list[bool]]
    others: list[bool]
    warned: int = 0
    refused: int = 0


def turned(rng: np.random.Generator, moments: Sequence[float]) -> Array:
    """A tensor in a random orientation."""
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    found: Array = q @ np.diag(moments) @ q.T
    return found


def tilted(rng: np.random.Generator, n: Array, tilt: float) -> Array:
    """A direction off by `tilt` (deg) about each of two lines across it."""
    first, second = perpendicular(n)
    off = n + math.radians(tilt) * (rng.normal() * first + rng.normal() * second)
    return off / np.linalg.norm(off)


def drawn(rng: np.random.Generator, case: Case, tensor: Array) -> tuple[str, list[Result]]:
    """A file of axes and its results, as a lab would have them."""
    lines = ["[every_axis]", f'tilt = "{case.tilt} deg"', "" if case.levers else 'distance = "0 mm"']
    if case.mounting:
        lines += ['mounting = "cube"', "[mounting.cube]", f'rotation = "{case.mounting} deg"']
    if case.levers:
        weighed, g = MASS * (1 + 1e-4 * rng.normal()), 9.81 * (1 + 1e-5 * rng.normal())
        lines += ["[body]", f'mass = "{weighed!r} ± 0.01 % kg"', f'gravity = "{g!r} ± 0.001 % m/s^2"']
    turn, wheel, results = math.radians(case.mounting) * rng.normal(size=3), case.wheel * rng.normal(), []
    for direction in case.directions:
        n = np.array(direction, dtype=float) / np.linalg.norm(direction)
        true = tilted(rng, n, case.tilt) + np.cross(turn, n)
        lever = 0.02 * rng.uniform() if case.levers else 0.0
        inertia, d = inertia_about(tensor, MASS, lever * perpendicular(n)[0], true, np.zeros(3))
        value = inertia * (1 + wheel + case.u * rng.normal())
        lines += ["[[axis]]", f"direction = {list(map(float, direction))}"]
        if case.levers:
            torque = MASS * 9.81 * d
            lines += [f'gravity_torque = "{torque + 1e-4 * rng.normal() * 0.2!r} ± 2e-5 N*m"']
        budget = [BudgetEntry(scatter("scatter of the windows"), "inertia", case.u * value)]
        if case.wheel:
            key = "drive.wheel.inertia"
            slope = value / 1.134e-4
            budget += [BudgetEntry(stated(key, key), "inertia", case.wheel * value, slope)]
        parameter = Parameter.of(value, combined(budget, "inertia"), "kg m^2")
        results.append(Result("momentum", "ok", {"inertia": parameter}, budget=tuple(budget)))
    return "\n".join(lines), results


def inside(parameter: Parameter, true: float) -> bool:
    """Whether the interval contains the true value."""
    assert parameter.interval95 is not None
    return parameter.interval95[0] <= true <= parameter.interval95[1]


def run(case: Case, draws: int, seed: int = 1) -> Tally:
    """So many draws of a case."""
    rng, tally = np.random.default_rng(seed), Tally([], [], [], [])
    for _ in range(draws):
        tensor = turned(rng, case.moments)
        text, results = drawn(rng, case, tensor)
        try:
            found = sw.tensor(axes_from_text(text, results=len(results)), results)
        except UnanswerableError:
            tally.refused += 1
            continue
        tally.warned += found.status == "warning"
        tally.errors.append((elements_of(found.matrix) - elements_of(tensor)) / max(case.moments))
        pairs = zip(NAMES, elements_of(tensor), strict=True)
        tally.elements.append([inside(found.elements[name], true) for name, true in pairs])
        largest_first = sorted(case.moments, reverse=True)
        tally.moments.append([inside(p.moment, m) for p, m in zip(found.principal, largest_first, strict=True)])
        n = rng.normal(size=3)
        n /= np.linalg.norm(n)
        tally.others.append(inside(found.about(n), float(n @ tensor @ n)))
    return tally


def row(case: Case, draws: int) -> str:
    """A line of the table."""
    tally = run(case, draws)
    errors = np.array(tally.errors)
    rms, tail = np.sqrt(np.mean(errors**2, axis=0)).max(), np.quantile(np.abs(errors), 0.95, axis=0).max()
    shares = [100 * np.mean(hits, axis=0) for hits in (tally.elements, tally.moments)]
    covered = "  ".join(f"{s.min():5.1f} … {s.max():5.1f}" for s in shares)
    return (
        f"{case.name:<42} {100 * rms:7.3f} {100 * tail:7.3f}  {covered}  {100 * np.mean(tally.others):5.1f} "
        f"{100 * tally.warned / draws:6.1f} {tally.refused:4d}"
    )


def end_to_end(seed: int) -> None:
    """The twin swings a body about nine axes; identified, and the empty fixture subtracted."""
    rng = np.random.default_rng(seed)
    tensor = turned(rng, (3e-3, 2.2e-3, 1.5e-3))
    plant = sw.Rig.load("paper").changed({"axis.friction": {"viscous": 1e-3, "coulomb": 1e-3}})

    def identified(rig: sw.Rig, seed: int) -> Result:
        controller = Compensator.paper(rig, sample_time=1e-3)
        log = sw.simulate(rig, Sine(0.6, 7.0), controller, duration=25.0, seed=seed)
        torque = rig.axis.gravity_torque.value
        stated = f"{torque * (1 + 3e-4 * rng.normal())!r} ± {3e-4 * torque!r} N*m"
        known = rig.changed({"axis.inertia": None, "axis.friction": None, "axis.gravity_torque": stated})
        return sw.identify(log, known)

    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "empty.json").write_text(identified(plant, 100).to_json(), encoding="utf-8")
        lines = ["[body]", f'mass = "{MASS} kg"', f'gravity = "{UNKNOWN_PLACE.value} m/s^2"']
        lines += ["[every_axis]", 'tilt = "0.05 deg"', 'fixture = "empty.json"', 'gravity_torque = "result"']
        results = []
        for k, direction in enumerate(NINE):
            n = np.array(direction, dtype=float) / np.linalg.norm(direction)
            off = 0.003 * perpendicular(n)[0]
            rig = rig_about(plant, tensor, MASS, off, tilted(rng, n, 0.05))
            results.append(identified(rig, k))
            lines += ["[[axis]]", f"direction = {direction}"]
        found = sw.tensor(axes_from_text("\n".join(lines), "nine.toml", Path(folder), 9), results)
    off = (elements_of(found.matrix) - elements_of(tensor)) / 3e-3
    u = np.sqrt(np.diag(found.covariance)) / 3e-3
    print(found.summary())
    print("end to end: errors, % of the largest moment:", np.round(100 * off, 4), "stated:", np.round(100 * u, 4))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=1000)
    parser.add_argument("--end-to-end", action="store_true")
    options = parser.parse_args()
    print(f"{'':<42} worst element   covered, %: elements, moments, other axes; false, %; refused")
    for case in CASES:
        print(row(case, options.draws), flush=True)
    if options.end_to_end:
        for seed in (3, 11, 12, 13, 14):
            end_to_end(seed)


if __name__ == "__main__":
    main()
