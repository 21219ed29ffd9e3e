"""Where a result comes from: file and its hash, rig, versions, method and options; and what was taken as exact."""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from importlib.metadata import version

from swingid.identify.result import Message
from swingid.model.rig import Rig
from swingid.recording.recording import Recording


@cache
def _versions() -> dict[str, str]:
    return {"swingid": version("swingid"), "numpy": version("numpy"), "python": platform.python_version()}


def provenance(log: Recording, rig: Rig, options: dict[str, object] | None = None) -> dict[str, object]:
    """File, hashes, rig and versions, as plain data."""
    return {
        "log": log.source.path,
        "log_sha256": log.source.sha256,
        "rows": len(log),
        "rig": rig.name,
        "rig_source": rig.source,
        "rig_sha256": hashlib.sha256(rig.text.encode()).hexdigest(),
        "options": options or {},
        "versions": _versions(),
    }


def exact_constants(keys: list[str]) -> list[Message]:
    """The note that names the constants used without a stated uncertainty."""
    if not keys:
        return []
    text = f"taken as exact, because the rig states no uncertainty: {', '.join(keys)}."
    return [Message("exact-constants", text)]
