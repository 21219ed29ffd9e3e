"""Packages that only the rarer formats need; a missing one is named with the line that installs it."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from swingid.errors import InputError


def require(module: str, package: str, name: str, what: str, *, extra: str = "formats") -> Any:
    """The module, imported; InputError that names the file, what it is, and how to install what reads it (`extra`)."""
    try:
        return import_module(module)
    except ImportError:
        message = f"{name} is {what}, which needs the package {package}; run: pip install 'swingid[{extra}]'."
        raise InputError(message, code="missing-package") from None
