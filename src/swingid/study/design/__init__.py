"""Which motion to record so that the inertia comes out as certain as wanted."""

from __future__ import annotations

from swingid.study.design.design import asked, design
from swingid.study.design.proposal import Design, Proposal, refused

__all__ = ["Design", "Proposal", "asked", "design", "refused"]
