"""Reading rig.toml: from file or built-in to tables, and pydantic's complaints to one sentence."""

from __future__ import annotations

import difflib
import tomllib
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import BaseModel, ValidationError

from swingid.errors import InputError, UsageError

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

Model = TypeVar("Model", bound=BaseModel)

BUILT_IN = ("paper", "paper-body")


def read_builtin(name: str) -> str:
    """TOML text of a built-in rig. Raises UsageError for an unknown name."""
    if name not in BUILT_IN:
        raise UsageError(
            f"there is no built-in rig {name!r}; use {' or '.join(BUILT_IN)}, or a path that ends in .toml.",
            code="unknown-rig",
        )
    return resources.files("swingid.model").joinpath("rigs", f"{name}.toml").read_text(encoding="utf-8")


def read_file(rig: str | Path) -> tuple[Path, str]:
    """Path and text of a rig file. Raises UsageError for a bare name, InputError for an unreadable file."""
    path = Path(rig)
    if path.suffix != ".toml" and not isinstance(rig, Path):
        read_builtin(str(rig))
    try:
        return path, path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(
            f"{path}: there is no such file; check the path, or write one with swingid init.", code="missing-file"
        ) from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: it is not UTF-8 text, so no rig.toml; check the file.", code="not-toml") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{path}: it cannot be read ({reason}); give a rig.toml.", code="unreadable") from None


def tables_of(text: str, source: str) -> dict[str, Any]:
    """The tables of TOML text. Raises InputError with the place of a syntax error."""
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        raise InputError(f"{source}: it is not valid TOML ({error}); correct it there.", code="not-toml") from None


def validate(model: type[Model], tables: dict[str, Any], context: dict[str, object], source: str, text: str) -> Model:
    """The model of the tables; InputError with one sentence for the first thing that is wrong."""
    for reserved in ("source", "text"):
        if reserved in tables:
            raise InputError(f"{source}: {_unknown(model, (reserved,))}", code="unknown-key")
    try:
        return model.model_validate({**tables, "source": source, "text": text}, context=context)
    except ValidationError as failure:
        error = min(failure.errors(), key=lambda found: found["type"] != "extra_forbidden")
        sentence, code = _sentence(model, error)
        raise InputError(f"{source}: {sentence}", code=code) from None


def _sentence(model: type[BaseModel], error: ErrorDetails) -> tuple[str, str]:
    """One sentence, which names the dotted key, and a slug."""
    place = tuple(part for part in error["loc"] if isinstance(part, str) and not _is_branch(part))
    key = ".".join(place)
    if error["type"] == "extra_forbidden":
        return _unknown(model, place), "unknown-key"
    if error["type"] == "missing":
        return f"{key} is missing; add it.", "missing-key"
    if error["type"] == "literal_error":
        return f"{key} is {error['input']!r}; it must be {error['ctx']['expected']}.", "bad-value"
    if error["type"] == "value_error":
        message = str(error["ctx"]["error"])
        return (f"{key}: {message}" if key else message), "bad-value"
    if error["type"] in ("model_type", "dict_type"):
        return f"{key} is {error['input']!r}, but it is a table of its own; write [{key}].", "bad-value"
    message = error["msg"][:1].lower() + error["msg"][1:]
    return f"{key}: {message}, but it is {error['input']!r}; correct it.", "bad-value"


def _is_branch(part: str) -> bool:
    """Parts of a location that name pydantic's choice in a union, not a key."""
    return "[" in part or "(" in part


def _unknown(model: type[BaseModel], place: tuple[str, ...]) -> str:
    known = _fields(model, place[:-1])
    near = difflib.get_close_matches(place[-1], known, n=1, cutoff=0.5)
    hint = f"did you mean {near[0]}?" if near else f"known keys here: {', '.join(known)}."
    return f"{'.'.join(place)} is an unknown key; {hint}"


def _fields(model: type[BaseModel], place: tuple[str, ...]) -> list[str]:
    """Keys that the table at `place` knows."""
    current: type[BaseModel] | None = model
    for part in place:
        found = current.model_fields.get(part) if current else None
        current = _model_in(found.annotation) if found else None
    return [name for name in current.model_fields if name not in ("source", "text")] if current else []


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """The model that a field's annotation holds, through Optional."""
    for part in (annotation, *getattr(annotation, "__args__", ())):
        if isinstance(part, type) and issubclass(part, BaseModel):
            return part
    return None
