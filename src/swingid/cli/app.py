"""The commands as one typer application; what each does is imported when it is called."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence
from typing import Annotated

import typer

from swingid.cli.calibrate import calibrate
from swingid.cli.campaign import campaign
from swingid.cli.commission import commission
from swingid.cli.compile import compile
from swingid.cli.dashboard import dashboard
from swingid.cli.doctor import doctor
from swingid.cli.emulate import emulate
from swingid.cli.exchange import export, schema
from swingid.cli.experiments import design, rehearse, reproduce
from swingid.cli.failure import CLOSED_PIPE, INTERRUPTED, attending, exit_code, interrupted, settle_output
from swingid.cli.firmware import firmware
from swingid.cli.identify import identify
from swingid.cli.live import recover
from swingid.cli.live import run as run_live
from swingid.cli.logs import convert, datasets, init, inspect
from swingid.cli.output import flush
from swingid.cli.record import record
from swingid.cli.results import compare, difference, validate
from swingid.cli.simulate import simulate
from swingid.cli.stop import stop
from swingid.cli.tensor import tensor
from swingid.cli.weigh import weigh
from swingid.system import WRITTEN

app = typer.Typer(
    name="swingid",
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (
    *(init, simulate, inspect, identify, calibrate, campaign, commission, compare, compile, convert, dashboard),
    *(datasets, design, difference, doctor, emulate, export, firmware, record, recover, rehearse, reproduce, schema),
    *(stop, tensor, validate, weigh),
):
    app.command()(command)
app.command("run")(run_live)


def _version(wanted: bool) -> None:
    if wanted:
        import swingid

        typer.echo(f"swingid {swingid.__version__}")
        raise typer.Exit


@app.callback()
def _swingid(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Moment of inertia and bearing friction of a swinging body, from logged angles.

    Exit codes: 0 fine, 2 wrong usage, 3 unusable input, 4 the data cannot answer, 5 no device, 70 a bug of swingid.
    """


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code. Only KeyboardInterrupt gets out."""
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    WRITTEN.clear()
    given = list(sys.argv[1:] if arguments is None else arguments)
    with attending(last=arguments is None):
        try:
            code = app(args=given, prog_name="swingid", standalone_mode=False)
            flush(sys.stdout)
            return interrupted() if code == INTERRUPTED else int(code or 0)
        except Exception as error:
            return exit_code(error, given)
        except SystemExit:  # typer's way to end when a pipe is closed
            return CLOSED_PIPE
        finally:
            settle_output()
