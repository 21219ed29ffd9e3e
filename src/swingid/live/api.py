"""Live rigs from Python: `connect` gives a `LiveRig`, its `run` a Recording.

with connect("twin://paper") as rig:
log = rig.run("sine 0.8 rad 8.5 rad/s", duration=25)
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Self

from swingid.errors import UsageError
from swingid.live.experiment import Done, Order, require_usable, required
from swingid.live.processes import conductor_of

if TYPE_CHECKING:
    from swingid.control.compensator import Compensator
    from swingid.control.references import Reference
    from swingid.live.progress import Progress
    from swingid.model.rig import Rig
    from swingid.recording.recording import Recording


class LiveRig:
    """A device and its rig file, for Python: `connect` makes it.

    rig: the rig file. last: what the last run left, None before.
    """

    def __init__(self, address: str, rig: Rig) -> None:
        self.address, self.rig = address, rig
        self.last: Done | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Each run connects and disconnects by itself, so nothing is left open."""

    def run(
        self,
        reference: str | Reference,
        controller: Compensator | None = None,
        *,
        duration: float = 25.0,
        until: float = 0.0,
        out: str | Path | None = None,
        show: Callable[[Progress], None] | None = None,
        clear: bool = False,
    ) -> Recording:
        """Follow a reference for `duration` (s) and give the log; identify it as any other.

        reference: words as of ``swingid simulate``, or a motion. controller: default the paper's gains. until: relative
        standard uncertainty at which the run stops, 0 for never. out: file of the journal, default none is kept. show:
        called with the progress. clear: clear a latched fault first. Raises DeviceError where the run did not begin or
        ended otherwise than planned (the journal then holds what there is), UsageError where the twin passes a limit.
        """
        from swingid.control.compensator import Compensator as Chosen
        from swingid.control.references import reference_for
        from swingid.recording.recording import Recording

        motion = reference_for(reference, self.rig) if isinstance(reference, str) else reference
        order = Order(motion, controller or Chosen.paper(self.rig), duration, until, clear=clear)
        required(order)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "run.mcap" if out is None else Path(out)
            self.last = conductor_of(self.rig, self.address, show=show).run(order, path)
            require_usable(self.last, path if out is not None else "no journal")
            return Recording.load(path, self.rig)


def connect(address: str, rig: Rig | str | Path | None = None) -> LiveRig:
    """A live rig for Python, as ``connect("twin://paper")`` or ``connect("/dev/ttyACM0", "rig.toml")``.

    rig: the rig file; of a twin:// it is that of the twin. Raises UsageError where it is missing.
    """
    from swingid.live.devices.stream import split_address
    from swingid.model.rig import Rig as File

    if rig is None:
        if not address.startswith("twin://"):
            raise UsageError(f"{address}: which rig is it? Give connect(address, 'rig.toml')", code="no-rig")
        rig = split_address(address).target
    return LiveRig(address, rig if isinstance(rig, File) else File.load(rig))
