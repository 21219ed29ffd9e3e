"""From a result and its rig to a file for another program."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from swingid.errors import UsageError
from swingid.exchange.mjcf import mjcf
from swingid.exchange.model import Model, model_of
from swingid.exchange.python_control import python_control
from swingid.exchange.simulink import simulink
from swingid.exchange.urdf import urdf
from swingid.model.rig import Rig
from swingid.result.result import Result
from swingid.system import write_whole

Writer = Callable[[Model, str], tuple[str, list[str]]]

FORMATS: dict[str, tuple[Writer, str]] = {
    "mjcf": (mjcf, ".xml"),
    "urdf": (urdf, ".urdf"),
    "python-control": (python_control, ".py"),
    "simulink-m": (simulink, ".m"),
}
"""Each format with its writer, which returns the text and what the format cannot express, and its file ending."""


@dataclass(frozen=True)
class Exported:
    """A written file: format, path, and what of the identified rig the format cannot express."""

    format: str
    path: str
    left_out: tuple[str, ...]

    def summary(self) -> str:
        """What was written, and what is not in it."""
        lines = [f"wrote {self.path} ({self.format})"]
        return "\n".join([*lines, *(f"not in it: {omitted}" for omitted in self.left_out)])


def export(result: Result, rig: Rig, to: str, out: str | Path) -> Exported:
    """Write the identified rig to `out` in a format of `FORMATS`.

    Raises UsageError for an unknown format or a name that the format does not allow, InputError where the file cannot
    be written or the result is refused, UnanswerableError where the format cannot describe the rig at all.
    """
    if to not in FORMATS:
        raise UsageError(f"unknown format {to!r}; choose one of {', '.join(FORMATS)}.", code="unknown-format")
    path = Path(out)
    writer, ending = FORMATS[to]
    if path.suffix.lower() != ending:
        raise UsageError(f"--out {path} must end in {ending} for the format {to}", code="bad-target")
    if ending in (".py", ".m") and not re.fullmatch(r"[A-Za-z]\w*", path.stem, re.ASCII):
        message = f"--out {path}: the name of the file is that of a module or function; use letters, digits and _ only"
        raise UsageError(message, code="bad-target")
    text, left_out = writer(model_of(result, rig), path.stem)
    write_whole(path, text.encode("utf-8"))
    return Exported(to, str(path), tuple(left_out))
