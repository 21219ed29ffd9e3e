"""How far long work is: loops that take long go through `tracked`, and a command or a program shows it by `shown`."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from contextvars import ContextVar, copy_context
from threading import Thread
from typing import TypeVar

Show = Callable[[int, int], None]
"""Called with the items that are done and all items."""

Item = TypeVar("Item")
Found = TypeVar("Found")

LOOK = 0.2
"""Seconds between two looks at a kernel that runs."""

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


class _Steps:
    """Steps of the work around: all, how many are done, and what shows them."""

    def __init__(self, total: int, show: Show | None) -> None:
        self.total, self.done, self.show = total, 0, show

    def reach(self, done: int) -> None:
        """So many are done, if more than before and no more than all."""
        self.done = max(self.done, min(done, self.total))
        if self.show is not None:
            self.show(self.done, self.total)


_steps: ContextVar[_Steps | None] = ContextVar("steps", default=None)


@contextmanager
def stepwise(total: int) -> Iterator[None]:
    """Work of about `total` steps that is no single loop; functions that it calls say `stepped`.

    Loops through `tracked` inside show nothing, nor do such blocks.
    """
    if _steps.get() is not None:
        yield
        return
    steps = _Steps(total, _show.get())
    tokens = _steps.set(steps), _show.set(None)
    try:
        steps.reach(0)
        yield
        steps.reach(total)
    finally:
        _steps.reset(tokens[0])
        _show.reset(tokens[1])


def stepped(steps: int = 1) -> None:
    """So many steps more of the block of `stepwise` around are done, or left out; nothing outside of one."""
    around = _steps.get()
    if around is not None:
        around.reach(around.done + steps)


def watched(kernel: Callable[[], Found], done: Callable[[], int], total: int) -> Found:
    """What a kernel that releases the interpreter returns; within a block of `shown` its progress is shown meanwhile.

    done: looks at what it has written so far. There the kernel runs in a thread of its own, so that Ctrl-C acts at
    once; it ends with the process.
    """
    if _show.get() is None:
        return kernel()
    returned: list[Found] = []
    failed: list[BaseException] = []

    def run() -> None:
        try:
            returned.append(kernel())
        except BaseException as error:
            failed.append(error)

    thread = Thread(target=copy_context().run, args=(run,), daemon=True)
    thread.start()
    thread.join(LOOK)
    long = thread.is_alive()
    while thread.is_alive():
        advanced(min(done(), total - 1), total)
        thread.join(LOOK)
    if failed:
        raise failed[0]
    if long:
        advanced(total, total)
    return returned[0]
