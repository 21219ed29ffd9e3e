"""From a Recording to a file that loads back as the same Recording."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import InputError
from swingid.recording.conventions import Conventions
from swingid.recording.formats import writer_for
from swingid.recording.rates import rate_of
from swingid.system import write_whole

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array
    from swingid.recording.findings import Finding


def write_log(
    path: str | Path,
    rig: Rig | None,
    channels: Mapping[str, Array],
    metadata: Mapping[str, object],
    findings: Sequence[Finding],
    *,
    held: bool,
) -> Path:
    """Write the channels of a Recording, see `Recording.save`. The file appears whole or not at all."""
    target = Path(path)
    module = writer_for(target)
    conventions = Conventions.plain() if rig is None else Conventions.of(rig)
    kept = ("time", *conventions.channels)
    written = {name: values for name, values in channels.items() if name in kept}
    if "angle_speed" in kept and "angle_speed" not in written:
        written["angle_speed"] = rate_of(channels["time"], channels["angle"], conventions.axis_rate_is)
    if "angle" not in kept:
        written["angle"] = channels["angle"]
    if "wheel_speed" in kept and "wheel_speed" not in written and "wheel_angle" in channels:
        written["wheel_speed"] = conventions.speed_of(channels["time"], channels["wheel_angle"], channels["angle"])
    if conventions.rate is not None:
        rate, time = conventions.rate, written.pop("time")
        if np.abs(time - time[0] - np.arange(len(time)) / rate).max() > 1e-3 / rate:
            message = f"cannot write {target}: the rig's [log] has rate = {rate:g} and no time column, but the rows"
            raise InputError(f"{message} are not spaced so; set [log] time instead.", code="uneven-rows")
    more = {
        "metadata": _plain(metadata),
        "log": {**conventions.keys, "drive_held": held},
        "findings": [asdict(finding) for finding in findings],
    }
    if rig is not None:
        more["drive"] = rig.drive.kind
    content: bytes = module.write(conventions.to_log(written), more)
    write_whole(target, content)
    return target


def _plain(value: object) -> object:
    """`value` as JSON can hold it: numpy as numbers and lists, anything unknown as its text."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    return value if isinstance(value, str | int | float | bool) or value is None else str(value)
