"""The paper, reproduced on the twin: its experiment, its simulations, its claims, and what could explain its errors."""

from __future__ import annotations

from swingid.study.reproduce.reproduction import Reproduction, reproduce, steps
from swingid.study.reproduce.tables import tables

__all__ = ["Reproduction", "reproduce", "steps", "tables"]
