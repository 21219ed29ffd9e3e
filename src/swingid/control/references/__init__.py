"""Reference motions: those with formulas, those given by samples, and `parse_reference` that reads them from text."""

from swingid.control.references.base import Reference, require_axis
from swingid.control.references.motions import Chirp, Multisine, Sine, Strokes, Triangle
from swingid.control.references.parse import parse_reference, reference_for
from swingid.control.references.sampled import Motion, Sampled

__all__ = [
    "Chirp",
    "Motion",
    "Multisine",
    "Reference",
    "Sampled",
    "Sine",
    "Strokes",
    "Triangle",
    "parse_reference",
    "reference_for",
    "require_axis",
]
