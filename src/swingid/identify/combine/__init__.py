"""Several results into one: the pooled answer of several logs, and the inertia of an added body."""

from __future__ import annotations

from swingid.identify.combine.difference import difference
from swingid.identify.combine.several import identify_several

__all__ = ["difference", "identify_several"]
