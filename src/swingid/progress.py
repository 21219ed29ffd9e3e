"""How far long work is: loops that take long go through `tracked`, and a command or a program shows it by `shown`."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

Show = Callable[[int, int], None]
"""Called with the items that are done and all items."""

Item = TypeVar("Item")

_show: ContextVar[Show | None] = ContextVar("show", default=None)


@contextmanager
def shown(show: Show) -> Iterator[None]:
    """Within the block the outermost loop through `tracked` calls `show`."""
    token = _show.set(show)
    try:
        yield
    finally:
        _show.reset(token)


def tracked(items: Collection[Item]) -> Iterator[Item]:
    """The items one by one; before the first and after each the progress is shown, within a block of `shown`.

    Loops inside such a loop show nothing.
    """
    show = _show.get()
    if show is None or len(items) < 2:
        yield from items
        return
    show(0, len(items))
    for done, item in enumerate(items, start=1):
        token = _show.set(None)
        try:
            yield item
        finally:
            _show.reset(token)
        show(done, len(items))


def advanced(done: int, total: int) -> None:
    """Show the progress of work that is no loop over items, within a block of `shown`."""
    show = _show.get()
    if show is not None:
        show(done, total)
