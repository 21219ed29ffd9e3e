"""Experiment design: which motion to record for an inertia with the required standard uncertainty."""

from __future__ import annotations

from swingid.study.design.design import design, required
from swingid.study.design.proposal import Design, Proposal, refused

__all__ = ["Design", "Proposal", "design", "refused", "required"]
