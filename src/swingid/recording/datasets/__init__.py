"""Public logs of real rigs: what is known of them, and how to get them. The data are no part of swingid."""

from __future__ import annotations

from swingid.recording.datasets.catalogue import CATALOGUE, DataFile, DataSet, find
from swingid.recording.datasets.get import get

__all__ = ["CATALOGUE", "DataFile", "DataSet", "find", "get"]
