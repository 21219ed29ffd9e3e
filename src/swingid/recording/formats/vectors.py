"""How arrays of a file become columns: a vector under its name, a matrix as its columns or its rows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from swingid.numerics.arrays import Array

    Columns = dict[str, Array | NDArray[np.object_]]

WIDEST = 64
"""A matrix with more columns than this is a picture or a table of something else."""


def add_vectors(columns: Columns, name: str, array: NDArray[Any]) -> None:
    """Add a real array of one or two dimensions (others are left out) to `columns`.

    A vector keeps its name, a matrix gives ``name(:,2)``, or ``name(2,:)`` where its rows are longer.
    """
    if array.dtype.kind not in "biuf" or array.size < 2:
        return
    values = np.squeeze(array.astype(np.float64))
    if values.ndim == 1:
        columns[name] = values
    elif values.ndim == 2 and min(values.shape) <= WIDEST:
        if values.shape[0] >= values.shape[1]:
            columns.update({f"{name}(:,{k})": column for k, column in enumerate(values.T, start=1)})
        else:
            columns.update({f"{name}({k},:)": row for k, row in enumerate(values, start=1)})
