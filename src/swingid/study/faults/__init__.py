"""Faults of rigs, rig files and logs: their registry, and experiments of the twin that have them."""

from swingid.study.faults.experiment import FaultyExperiment, with_faults
from swingid.study.faults.registry import FAULTS, Drawn, Fault, every_fault, parse_fault

__all__ = ["FAULTS", "Drawn", "Fault", "FaultyExperiment", "every_fault", "parse_fault", "with_faults"]
