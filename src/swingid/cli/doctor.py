"""``swingid doctor``: what is installed, where files go, which ports there are, and what to do about it."""

from __future__ import annotations

import importlib.util
import os
import platform
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from swingid.cli import output
from swingid.cli.options import Json

Level = Literal["ok", "note", "fault"]

CORE = ("swingid", "numpy", "scipy", "numba", "pyarrow", "matplotlib")
NOT_FOR_USERS = ("dev", "test", "peers", "cortex", "docs")
"""Extras that no command needs."""


@dataclass(frozen=True)
class Finding:
    """One line: its group, what was looked at, what was found, what to do ("" for nothing)."""

    group: str
    level: Level
    what: str
    found: str
    remedy: str = ""


@dataclass(frozen=True)
class Diagnosis:
    """All findings."""

    findings: tuple[Finding, ...]

    def to_json(self) -> str:
        """JSON text, schema "swingid.doctor/1"."""
        from swingid.study.output import json_text

        return json_text({"schema": "swingid.doctor/1", "findings": self.findings})

    def summary(self) -> str:
        """One line per finding, by group; what to do follows an arrow."""
        width = max(len(finding.what) for finding in self.findings)
        lines: list[str] = []
        for finding in self.findings:
            title = f"[[{finding.group}]]"
            if title not in lines:
                lines.append(title)
            mark = {"ok": " ", "note": "-", "fault": "!"}[finding.level]
            remedy = f" → {finding.remedy}" if finding.remedy else ""
            lines.append(f"  {mark} {finding.what:<{width}}  {finding.found}{remedy}")
        faults = sum(finding.level == "fault" for finding in self.findings)
        return "\n".join([*lines, f"{faults} fault{'' if faults == 1 else 's'}" if faults else "no faults"])


def doctor(json: Json = None) -> None:
    """Look at the installation: versions, extras, folders, ports and permissions; say what to do about each fault."""
    output.check_writable(json)
    output.hand_over(diagnose(), json)


def diagnose() -> Diagnosis:
    """The findings. Nothing is installed, opened or sent."""
    return Diagnosis((*_versions(), *_extras(), *_folders(), *_ports()))


def _versions() -> Iterator[Finding]:
    from importlib.metadata import PackageNotFoundError, version

    yield Finding("versions", "ok", "python", f"{platform.python_version()} at {sys.executable}")
    yield Finding("versions", "ok", "system", platform.platform())
    for name in CORE:
        try:
            yield Finding("versions", "ok", name, version(name))
        except PackageNotFoundError:
            yield Finding("versions", "fault", name, "not installed", "pip install swingid")
    on_path = shutil.which("swingid")
    beside = Path(sys.executable).with_name("swingid")
    if on_path is None:
        remedy = f"run {beside} or python -m swingid, or activate the environment"
        yield Finding("versions", "note", "command", "swingid is not on PATH", remedy)
    else:
        yield Finding("versions", "ok", "command", on_path)


def _extras() -> Iterator[Finding]:
    from importlib.metadata import requires

    packages: dict[str, list[str]] = {}
    for line in requires("swingid") or ():
        match = re.match(r"([\w.-]+).*extra\s*==\s*['\"]([\w-]+)['\"]", line)
        if match and match[1].lower() != "swingid":
            packages.setdefault(match[2], []).append(match[1])
    for extra in sorted(set(packages) - set(NOT_FOR_USERS)):
        missing = [name for name in packages[extra] if not _installed(name)]
        if missing:
            remedy = f"pip install 'swingid[{extra}]' if you need it"
            yield Finding("extras", "note", extra, f"without {', '.join(missing)}", remedy)
        else:
            yield Finding("extras", "ok", extra, ", ".join(packages[extra]))


def _installed(package: str) -> bool:
    from importlib.metadata import PackageNotFoundError, version

    try:
        version(package)
    except PackageNotFoundError:
        return False
    return True


def _folders() -> Iterator[Finding]:
    from swingid.numerics.cache import CACHE, kept_kernels, wanted_folder

    kernels = kept_kernels()
    state = f"{kernels} compiled kernels" if kernels else "nothing compiled yet (swingid compile)"
    wanted = wanted_folder()
    if wanted is not None and CACHE.is_relative_to(wanted):
        yield _folder("cache of kernels", CACHE, state)
    else:
        remedy = "set NUMBA_CACHE_DIR" if wanted is None else f"make {wanted} writable, or set NUMBA_CACHE_DIR"
        yield Finding("folders", "note", "cache of kernels", f"{CACHE}: {state}", remedy)
    yield _folder("temporary folder", Path(tempfile.gettempdir()), "")
    yield _folder("working folder", Path.cwd(), "")


def _folder(what: str, path: Path, state: str) -> Finding:
    """Return whether a file can be written into a folder, and how much space it has."""
    text = f"{path}" + (f": {state}" if state else "")
    try:
        with tempfile.TemporaryFile(dir=path):
            pass
        free = shutil.disk_usage(path).free
    except OSError as error:
        remedy = "make it writable, or work in another folder"
        return Finding("folders", "fault", what, f"{text}: {error.strerror or error}", remedy)
    if free < 100_000_000:
        return Finding("folders", "fault", what, f"{text}: {free / 1e6:.0f} MB free", "make room on the disk")
    return Finding("folders", "ok", what, text)


def _ports() -> Iterator[Finding]:
    """Serial ports that are there, and whether this user may open them."""
    if importlib.util.find_spec("serialx") is None:
        yield Finding("ports", "note", "serial ports", "not looked for", "pip install 'swingid[live]' for a live rig")
        return
    from swingid.live.devices.serial_port import group_of, ports

    names = ports()
    if not names:
        yield Finding("ports", "ok", "serial ports", "none")
    for port in names:
        if os.name == "posix" and Path(port).exists() and not os.access(port, os.R_OK | os.W_OK):
            remedy = f"sudo usermod -aG {group_of(port)} $USER, then log in again"
            yield Finding("ports", "fault", port, "permission denied", remedy)
        else:
            yield Finding("ports", "ok", port, f"serial://{port}")
