"""Which consistency checks an identification carried out: each marks itself when it runs (`checks.table.CHECKS`)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_ran: ContextVar[set[str] | None] = ContextVar("checks that ran", default=None)


def ran(name: str) -> None:
    """Record that the check `name` is carried out; called where it has what it needs."""
    names = _ran.get()
    if names is not None:
        names.add(name)


@contextmanager
def recorded() -> Iterator[set[str]]:
    """The names of the checks that ran inside the block, once it has ended."""
    names: set[str] = set()
    token = _ran.set(names)
    try:
        yield names
    finally:
        _ran.reset(token)
