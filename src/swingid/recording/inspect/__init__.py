"""A log inspected without a rig: columns, clock, steps, limits, and which column is likely which channel."""

from swingid.recording.inspect.candidates import Role
from swingid.recording.inspect.check import Check, Clock, Level, read_clock
from swingid.recording.inspect.columns import Column, describe
from swingid.recording.inspect.rig_text import log_table
from swingid.recording.inspect.roles import Roles, guess_roles

__all__ = [
    "Check",
    "Clock",
    "Column",
    "Level",
    "Role",
    "Roles",
    "describe",
    "guess_roles",
    "log_table",
    "read_clock",
]
