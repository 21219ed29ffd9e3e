"""The planned experiment on the twin of the user's own rig, many times, before anyone touches the rig."""

from __future__ import annotations

from swingid.study.rehearse.rehearsal import Expectation, Rehearsal, rehearse

__all__ = ["Expectation", "Rehearsal", "rehearse"]
