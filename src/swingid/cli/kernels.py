"""Say so when a command is about to compile its kernels, which happens once per version."""

from __future__ import annotations

from swingid.cli.output import say

KERNELS = {"simulate": ("loop", 15), "identify": ("test_functions", 20), "calibrate": ("wheel_motion", 20)}
"""For each command a module with a kernel that every run of it calls, and about how long compiling takes (s)."""


def announce_compilation(command: str) -> None:
    """One line on standard error if the kernels of `command` are not compiled yet."""
    from swingid.numerics.compiled import CACHE, first_use

    module, seconds = KERNELS[command]
    if first_use() or not any(CACHE.rglob(f"{module}.*.nbc")):
        say(f"compiling kernels, once per version, about {seconds} s")
