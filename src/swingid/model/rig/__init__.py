"""The rig file: its tables, its checks, the rigs that are built in."""

from __future__ import annotations

from swingid.model.rig.rig import BUILTIN_RIGS, Rig

__all__ = ["BUILTIN_RIGS", "Rig"]
