"""Reference motions: one file each, and `parse_reference` that reads them from text."""

from swingid.control.references.base import Reference, require_axis
from swingid.control.references.chirp import Chirp
from swingid.control.references.multisine import Multisine
from swingid.control.references.parse import parse_reference
from swingid.control.references.sampled import Motion, Sampled
from swingid.control.references.sine import Sine
from swingid.control.references.strokes import Strokes
from swingid.control.references.triangle import Triangle

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
    "require_axis",
]
