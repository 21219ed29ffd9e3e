"""Which motion to record so that the inertia comes out as certain as wanted."""

from __future__ import annotations

from swingid.study.design.design import Design, Proposal, design, refused

__all__ = ["Design", "Proposal", "design", "refused"]
