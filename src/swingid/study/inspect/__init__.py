"""`inspect_log`: what a log holds, what it is worth, and whether it fits the rig."""

from swingid.study.inspect.inspection import Inspection, Verdict, inspect_log, inspect_table
from swingid.study.inspect.services import Service

__all__ = ["Inspection", "Service", "Verdict", "inspect_log", "inspect_table"]
