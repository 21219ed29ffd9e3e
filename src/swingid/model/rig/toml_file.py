"""TOML files of users: their text, their tables, and these checked; what is wrong with one, in one sentence."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from swingid.errors import InputError
from swingid.model.rig.errors import describe
from swingid.system import LARGEST_FILE, read_input

T = TypeVar("T", bound=BaseModel)


def text_of(path: str | Path, *, missing: str, folder: str, most: int = LARGEST_FILE) -> str:
    """The text of a file; InputError where there is none. missing, folder: what to do where there is no file."""
    content = read_input(path, missing=missing, folder=("not-a-file", folder), most=most)
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        message = f"{path} is not UTF-8 text (byte {error.start}); save it as UTF-8"
        raise InputError(message, code="not-utf8") from None


def tables_of(text: str, source: str, hint: str = "") -> dict[str, Any]:
    """The tables of TOML text; InputError that names the source, and ends in the hint, for text that is none."""
    try:
        return tomllib.loads(text.removeprefix("\ufeff"))
    except (ValueError, RecursionError) as error:
        # RecursionError: brackets nested thousands deep
        problem = "nested too deeply" if isinstance(error, RecursionError) else " ".join(str(error).split())
        raise InputError(f"{source} is not TOML: {problem[:200]}{hint}", code="not-toml") from None


def checked(
    raw: object, table: type[T], source: str, what: str = "a rig file", context: Mapping[str, Any] | None = None
) -> T:
    """Tables as a model of them; InputError that names the source and the key. what: the kind of file, in words."""
    try:
        return table.model_validate(raw, context=context)
    except ValidationError as error:
        code, problem = describe(error, table, what)
        raise InputError(f"{source}: {problem}", code=code) from None
