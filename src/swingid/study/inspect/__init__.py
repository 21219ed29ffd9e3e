"""`inspect_log`: what a log holds, how much of it is usable, and whether it fits the rig."""

from swingid.study.inspect.inspection import Inspection, inspect_log, inspect_table
from swingid.study.inspect.motion import Service
from swingid.study.inspect.verdict import Verdict

__all__ = ["Inspection", "Service", "Verdict", "inspect_log", "inspect_table"]
