"""Several axes of one body into one: its inertia tensor about the centre of mass."""

from __future__ import annotations

from swingid.body.tensor import tensor

__all__ = ["tensor"]
