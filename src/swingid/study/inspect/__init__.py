"""`inspect_log`: what a log holds, how much of it is usable, and whether it fits the rig."""

from swingid.study.inspect.inspection import Inspection, Verdict, inspect_log, inspect_table
from swingid.study.inspect.motion import Service

__all__ = ["Inspection", "Service", "Verdict", "inspect_log", "inspect_table"]
