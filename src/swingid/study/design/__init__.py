"""Which motion to record so that the inertia comes out as certain as wanted."""

from __future__ import annotations

from swingid.study.design.design import design
from swingid.study.design.proposal import Design, Proposal, refused
from swingid.study.design.wanted import asked

__all__ = ["Design", "Proposal", "asked", "design", "refused"]
