"""Which kernels each task calls from Python, with which types, and how long numba took: into numerics/kernels.json.

    python tools/list_kernels.py [TASK …]

Each task runs once in a process of its own with an empty cache of kernels. Run it again when kernels or what they are
called with have changed; `tests/numerics/test_compile.py` fails where the list names what does not exist, or misses a
kernel.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

RIG, MOTION = "paper", "sine 0.8 rad 8.5 rad/s"


def simulate(controller: str = "Compensator") -> None:
    """The closed loop with one of the controllers."""
    import swingid as sw

    rig = sw.Rig.load(RIG)
    sw.simulate(rig, sw.parse_reference(MOTION), getattr(sw, controller).paper(rig), duration=1.0)


def decay() -> None:
    """The open loop."""
    import swingid as sw

    sw.simulate(sw.Rig.load(RIG), duration=1.0, initial_angle=0.5)


def identify(log: Path, method: str, **options: str) -> None:
    """One method on the paper's experiment, from a file as a user has it."""
    import swingid as sw

    rig = sw.Rig.load(RIG)
    sw.identify(sw.Recording.load(log, rig), rig, method, **options)


def many(_log: Path) -> None:
    """Ensembles and the estimators of many logs."""
    import numpy as np

    import swingid as sw
    from swingid.batch import energy_batch, momentum_batch, plan_batch
    from swingid.simulation.ensemble import simulate_ensemble

    rig = sw.Rig.load(RIG)
    values = {"axis.inertia": 302.2e-5 * np.linspace(0.8, 1.2, 8)}
    runs = simulate_ensemble(rig, sw.parse_reference(MOTION), duration=10.0, values=values)
    plan = plan_batch([runs.recording(k) for k in (0, 7)], rig)
    angle, wheel, voltage = (runs.channel(name) for name in ("angle", "wheel_angle", "command"))
    momentum_batch(angle, wheel, 1000.0, rig, plan)
    energy_batch(angle, wheel, voltage, 1000.0, rig, plan)


def calibrate(log: Path) -> None:
    """The motor constants out of a log."""
    import swingid as sw

    rig = sw.Rig.load(RIG)
    sw.calibrate(sw.Recording.load(log, rig), rig)


def experiment(path: Path) -> None:
    """Write the log that the methods read: the paper's experiment."""
    import swingid as sw

    rig = sw.Rig.load(RIG)
    sw.simulate(rig, sw.parse_reference(MOTION), duration=25.0, seed=1).save(path, rig)


# What each task runs, given the log of `experiment`.
TASKS: dict[str, Callable[[Path], None]] = {
    "simulate": lambda _log: (simulate(), decay())[0],
    "backstepping-controller": lambda _log: simulate("Backstepping"),
    **{
        method: lambda log, method=method: identify(log, method)
        for method in ("momentum", "energy", "equation-error", "output-error", "backstepping")
    },
    # Output error with what the log states of the axis as input: the measured wheel, a torque, or nothing.
    "output-error-axis": lambda log: identify(log, "output-error", input="wheel"),
    "ensemble": many,
    "calibrate": calibrate,
}


def listed(task: str, log: Path) -> list[list[Any]]:
    """Kernels of a task that were compiled on behalf of Python, not of another kernel."""
    import numba.core.event as events

    from swingid.numerics.ahead import Kernel, word

    found: list[Kernel] = []

    class Listener(events.Listener):
        """Notes each outermost compilation."""

        def __init__(self) -> None:
            self.started: list[float] = []

        def on_start(self, event: events.Event) -> None:
            self.started.append(time.process_time())

        def on_end(self, event: events.Event) -> None:
            seconds = time.process_time() - self.started.pop()
            function = event.data["dispatcher"].py_func
            if not self.started and function.__module__.startswith("swingid."):
                arguments = ", ".join(word(kind) for kind in event.data["args"])
                found.append(Kernel(function.__module__, function.__name__, arguments, round(seconds, 2)))

    with events.install_listener("numba:compile", Listener()):
        TASKS[task](log)
    return [list(kernel) for kernel in sorted(set(found), key=lambda kernel: (kernel.module, kernel.name, kernel[2]))]


def measured(task: str, log: Path) -> list[list[Any]]:
    """`listed` in a process of its own, whose cache of kernels is empty."""
    with tempfile.TemporaryDirectory() as cache:
        done = subprocess.run(
            [sys.executable, __file__, "--one", task, str(log)],
            env=os.environ | {"NUMBA_CACHE_DIR": cache},
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        )
    return json.loads(done.stdout.splitlines()[-1])


def main() -> None:
    """Each task in a process of its own."""
    if sys.argv[1:2] == ["--one"]:
        print(json.dumps(listed(sys.argv[2], Path(sys.argv[3]))))
        return
    from swingid.numerics import ahead

    content = json.loads(ahead.LIST.read_text(encoding="utf-8")) if ahead.LIST.is_file() else {}
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "experiment.parquet"
        experiment(log)
        for task in sys.argv[1:] or TASKS:
            content[task] = measured(task, log)
            print(f"{task}: {len(content[task])} kernels, {sum(entry[3] for entry in content[task]):.1f} s")
    lines = (
        f'"{task}": [' + ",".join(f"\n {json.dumps(entry)}" for entry in content[task]) + "]"
        for task in TASKS
        if task in content
    )
    ahead.LIST.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
