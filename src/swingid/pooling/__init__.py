"""Several results into one: the pooled estimate of several logs, and the inertia of an added body."""

from __future__ import annotations

from swingid.pooling.difference import difference
from swingid.pooling.several import identify_several

__all__ = ["difference", "identify_several"]
