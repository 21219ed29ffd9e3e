"""The commands in groups, by what people have: a log, a rig, a plan, the paper."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from typer.core import TyperGroup

from swingid.cli.calibrate import calibrate
from swingid.cli.campaign import campaign
from swingid.cli.commission import commission
from swingid.cli.compile import compile
from swingid.cli.dashboard import dashboard
from swingid.cli.doctor import doctor
from swingid.cli.emulate import emulate
from swingid.cli.exchange import export, schema
from swingid.cli.experiments import design, rehearse, reproduce
from swingid.cli.identify import identify
from swingid.cli.live import firmware, record, recover, run, stop
from swingid.cli.logs import convert, datasets, init, inspect
from swingid.cli.results import compare, difference, validate
from swingid.cli.simulate import simulate
from swingid.cli.tensor import tensor
from swingid.cli.weigh import weigh

Command = Callable[..., Any]

GROUPS: dict[str, list[tuple[Command, str]]] = {
    "You have a log": [
        (inspect, "What the log holds, and what is wrong with it"),
        (init, "Write a rig.toml to be filled in"),
        (identify, "The inertia and the friction that the log shows"),
        (compare, "All methods on the same logs"),
        (validate, "How well a result predicts other logs"),
        (dashboard, "All of this in the browser: drop a log there"),
        (difference, "A body's inertia: with it less without it"),
        (tensor, "A body's inertia tensor from several axes"),
        (calibrate, "The motor's constants, or the encoders' errors"),
        (export, "The result for MuJoCo, URDF, Modelica and others"),
        (convert, "A log in another file format"),
        (datasets, "Public logs of other laboratories"),
    ],
    "You have a rig": [
        (firmware, "The image of a board, to be flashed"),
        (commission, "Find zero, signs, noise and counts before the first run"),
        (run, "Run an experiment, record it and identify it"),
        (stop, "Stop the run that goes on"),
        (weigh, "Weigh a body: run without it, run with it"),
        (record, "Record what a device prints"),
        (recover, "A whole journal from a broken one"),
        (emulate, "A twin in real time, in place of a device"),
    ],
    "You have a plan": [
        (simulate, "The log that a rig would make"),
        (design, "The best motion for a rig and a time"),
        (rehearse, "Error and interval to expect of a motion"),
        (campaign, "Many runs of the twin, all methods, statistics"),
    ],
    "You have the paper": [
        (reproduce, "Its experiment and its simulations, beside its numbers"),
    ],
    "This installation": [
        (doctor, "Versions, extras, folders, ports"),
        (compile, "Compile everything beforehand"),
        (schema, "JSON schema of a result, a rig file or a plan"),
    ],
}
"""What people have, and the commands for it, each in a few words."""

FIRST = """\
swingid simulate --rig paper --reference "sine 0.8 rad 8.5 rad/s" --duration 15 --out log.csv   a log to try
swingid inspect log.csv                                          what a log holds, and what next
swingid dashboard                                                the same in the browser
All commands: swingid --help."""
"""What `swingid` alone prints."""


class Grouped(TyperGroup):
    """Help that has the commands by `GROUPS`, none of its lines cut."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the groups of commands; click calls it."""
        for title, members in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl([(command.__name__, words) for command, words in members])
