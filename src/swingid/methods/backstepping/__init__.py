"""The paper's alternative method on a recorded log: adaptation driven by a prediction error."""

from __future__ import annotations

from swingid.methods.backstepping.method import backstepping

__all__ = ["backstepping"]
