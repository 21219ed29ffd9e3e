"""The commands as one typer application; what each does is imported when it is called."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence
from typing import Annotated

import typer

from swingid.cli.failure import CLOSED_PIPE, INTERRUPTED, attending, exit_code, interrupted, settle_output
from swingid.cli.groups import FIRST, GROUPS, Grouped
from swingid.cli.output import flush
from swingid.errors import UsageError
from swingid.system import WRITTEN

app = typer.Typer(
    name="swingid",
    cls=Grouped,
    invoke_without_command=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for members in GROUPS.values():
    for command, _ in members:
        app.command()(command)


@app.command("help", hidden=True)
def _help(context: typer.Context, command: Annotated[str | None, typer.Argument()] = None) -> None:
    """Print the help of all commands, or of one, or what the code of a warning or a note means."""
    from swingid.result.codes import meaning

    root = context.find_root()
    if command is None:
        typer.echo(root.get_help())
        return
    target = root.command.get_command(root, command)  # type: ignore[attr-defined]
    if target is None and (words := meaning(command)) is not None:
        typer.echo(words)
        return
    if target is None:
        raise UsageError(f"there is no command, warning or note {command!r}; see swingid --help", code="no-command")
    typer.echo(target.get_help(target.make_context(command, [], root, resilient_parsing=True)))


@app.command("version", hidden=True)
def _print_version() -> None:
    """Print the version."""
    _version(wanted=True)


def _version(wanted: bool) -> None:
    if wanted:
        import swingid

        typer.echo(f"swingid {swingid.__version__}")
        raise typer.Exit


@app.callback()
def _swingid(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Moment of inertia and bearing friction of a swinging body, from logged angles or rates.

    Exit codes: 0 fine, 2 wrong usage, 3 unusable input, 4 the data cannot answer, 5 no device, 70 a bug of swingid.
    """
    if context.invoked_subcommand is None:
        typer.echo(FIRST)
        raise typer.Exit(UsageError.exit_code)


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
