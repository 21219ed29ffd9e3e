"""The inertia tensor about the centre of mass from results about at least six axes through or near one body."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from swingid.balance.identifiability import HOPELESS
from swingid.body.answer import UNIT, Tensor, direction_text
from swingid.body.axes import Axis, read_axes, shared, tilt_variances
from swingid.body.cad import CadBody, compare
from swingid.body.directions import (
    NAMES,
    condition,
    matrix_of,
    missing_direction,
    next_direction,
    rank_of,
    rows_of,
)
from swingid.body.fit import AxisRow, Fit, deviations, fit
from swingid.body.physical import closest, require_physical
from swingid.body.principal import principal
from swingid.body.tables import LEVERS, Axes, load_axes
from swingid.errors import UnanswerableError
from swingid.format import number, percent
from swingid.model.rig.gravity import UNKNOWN_PLACE
from swingid.numerics.arrays import Array
from swingid.pooling.pooling import Deviation, worst_beyond_chance
from swingid.result.data import Message
from swingid.result.provenance import exact_constants, versions
from swingid.result.result import Result
from swingid.units import Quantity

NEEDED = 6

FLAT = 1e-9
"""Smallest over largest singular value of directions that lie in one plane."""


def tensor(
    axes: str | Path | Axes,
    results: Sequence[Result | str | Path] = (),
    *,
    compare_with: CadBody | None = None,
    about: Sequence[tuple[Sequence[float], str | float]] = (),
) -> Tensor:
    """The inertia tensor of one body about its centre of mass, in the body frame.

    Parameters
    ----------
    axes : path
        The file that lists the axes, see docs/tensor.md.
    results : Results of `identify` or `difference`, or their JSON files
        For the axes that name none, in the order of the file.
    compare_with
        A tensor from CAD (`swingid.body.cad`).
    about : (direction, distance from the centre of mass in m) of further axes
        Whose inertia is predicted.

    Raises
    ------
    InputError
        Files and keys that cannot be used.
    UnanswerableError
        The axes do not determine the six elements, or no body has the tensor that they give.
    """
    stated = axes if isinstance(axes, Axes) else load_axes(axes, len(results))
    read, identities, warnings = read_axes(stated, results)
    _require_rank(stated)
    common = frozenset(identities.keys)
    fitted = fit(read, common)
    tested = deviations(read, fitted, common)
    worst = worst_beyond_chance(tested)
    _require_seen(fitted, stated)
    notes = _notes(stated, read, tested)
    values, elements = fitted.values, fitted.elements
    hint = "check the directions, levers, mass and fixture"
    if worst is not None:
        hint = f"{hint}, first of {read[worst.index].name}, which disagrees most"
        warnings.append(_disagreement(worst, tested, read))
    if not require_physical(fitted.matrix, elements, hint):
        values = closest(values, fitted.covariance)
        notes.append(_constrained(fitted, values))
    elements = tuple(replace(element, value=float(v)) for element, v in zip(elements, values, strict=True))
    direction, remaining = next_direction(fitted.reducible, _variances(read, matrix_of(values), common))
    answer = Tensor(
        status="warning" if warnings else "ok",
        elements={name: element.parameter(UNIT) for name, element in zip(NAMES, elements, strict=True)},
        sources=elements,
        covariance=fitted.covariance,
        principal=principal(matrix_of(values), elements, UNIT),
        axes=_rows(read, fitted, tested, rows_of(stated.directions) @ values),
        chi_square=fitted.chi_square,
        degrees_of_freedom=fitted.freedom,
        probability=_probability(fitted),
        condition=condition(stated.directions),
        next_direction=direction,
        next_left=remaining,
        mass=None if stated.body.mass is None else shared(stated.body.mass, "body.mass"),
        name=stated.body.name,
        warnings=tuple(warnings),
        notes=tuple(notes),
        budget=tuple(entry for name, element in zip(NAMES, elements, strict=True) for entry in element.entries(name)),
        provenance=_provenance(stated, results),
    )
    predictions = tuple((_axis_words(n, d), answer.about(n, d)) for n, d in about)
    comparison = None if compare_with is None else compare(compare_with, answer.matrix, fitted.covariance, stated.body)
    return replace(answer, predictions=predictions, comparison=comparison)


def _axis_words(direction: Sequence[float], distance: str | float) -> str:
    vector = np.asarray(direction, dtype=np.float64)
    words = direction_text(vector / max(float(np.linalg.norm(vector)), 1e-300))
    return words + (f" at {distance}" if distance else "")


def _require_rank(axes: Axes) -> None:
    """Raise UnanswerableError where the directions do not determine six elements; says which one is missing."""
    directions = axes.directions
    count, rank = len(directions), rank_of(directions)
    if rank == NEEDED:
        return
    more = "an axis" if rank == NEEDED - 1 else f"{NEEDED - rank} axes, the first"
    missing = f"add {more} along about {direction_text(missing_direction(directions))}"
    flat = count > 2 and np.linalg.svd(directions, compute_uv=False)[-1] < FLAT
    if flat:
        problem = f"the {count} axes lie in one plane, which leaves the inertia across it undetermined"
    elif count < NEEDED:
        problem = f"{count} ax{'i' if count == 1 else 'e'}s cannot determine the six elements of the tensor"
    else:
        problem = f"the {count} axes have only {rank} independent directions, and the tensor has six elements"
    raise UnanswerableError(f"{axes.source}: {problem}; {missing}", code="not-identifiable")


def _require_seen(fitted: Fit, axes: Axes) -> None:
    """Raise UnanswerableError where an element is lost in its uncertainty."""
    largest = float(np.max(np.abs(np.linalg.eigvalsh(fitted.matrix))))
    u = np.sqrt(np.diag(fitted.covariance))
    worst = int(np.argmax(u))
    if u[worst] > HOPELESS * largest:
        raise UnanswerableError(
            f"{axes.source}: J_{NAMES[worst]} is uncertain by {percent(float(u[worst]) / largest)} of the largest "
            f"moment (condition number of the directions {condition(axes.directions):.2g}); spread the axes, or "
            "measure them better",
            code="not-identifiable",
        )


def _variances(read: Sequence[Axis], matrix: Array, common: frozenset[str]) -> Array:
    """Variance of one more measurement about each direction tried: median of the axes' own, and of their tilts."""
    of_axes = [axis.central.only(lambda key: key not in common).u ** 2 for axis in read]
    tilt = float(np.median([axis.tilt for axis in read]))
    floor = (1e-9 * float(np.trace(matrix))) ** 2
    variances: Array = float(np.median(of_axes)) + tilt_variances(matrix, tilt) + floor
    return variances


def _rows(read: Sequence[Axis], fitting: Fit, tested: Sequence[Deviation | None], fitted: Array) -> tuple[AxisRow, ...]:
    return tuple(
        AxisRow(
            axis.name,
            axis.direction,
            axis.about_axis.parameter(UNIT),
            measured.parameter(UNIT),
            float(value),
            None if test is None else test.ratio,
        )
        for axis, measured, test, value in zip(read, fitting.measured, tested, fitted, strict=True)
    )


def _probability(fitted: Fit) -> float | None:
    """Probability of a chi-square as large by chance; None where there is none."""
    if not fitted.freedom:
        return None
    from scipy.special import chdtrc

    return float(chdtrc(fitted.freedom, fitted.chi_square))


def _disagreement(worst: Deviation, tested: Sequence[Deviation | None], read: Sequence[Axis]) -> Message:
    """Which axis disagrees with the others; of seven axes none can be named."""
    off = abs(worst.ratio)
    alike = [t for t in tested if t is not None and abs(t.ratio) > 0.999 * off]
    if len(alike) > 1:
        names = ", ".join(read[deviation.index].name for deviation in alike)
        text = (
            f"the axes disagree by {off:.2g} standard uncertainties, and which of {names} is off cannot be decided; "
            "add an axis, and check their directions and levers"
        )
    else:
        text = (
            f"{read[worst.index].name} disagrees with the other axes by {number(worst.value, UNIT, 2)}, {off:.2g} "
            "standard uncertainties; check its direction, lever and log, or leave it out"
        )
    return Message("axes-disagree", f"{text}. The intervals do not contain this disagreement.")


def _constrained(fitted: Fit, values: Array) -> Message:
    """Say that no body has the tensor of the fit, and how far the reported one is from it."""
    moved = float(np.max(np.abs(values - fitted.values) / np.sqrt(np.diag(fitted.covariance))))
    return Message(
        "triangle-inequality",
        "the largest principal moment exceeds the sum of the others within the uncertainty, as a thin body's may; the "
        f"elements are the closest that a body can have (log-Cholesky), up to {moved:.2g} standard uncertainties away.",
    )


def _notes(axes: Axes, read: Sequence[Axis], tested: Sequence[Deviation | None]) -> list[Message]:
    """What was taken as exact, assumed, or is not checked."""
    notes = exact_constants(_exact(axes), "no uncertainty was given")
    if axes.body.gravity is None and any(table.gravity_torque is not None for table in axes.tables):
        value = f"{UNKNOWN_PLACE.value} ± {UNKNOWN_PLACE.std} m/s²"
        text = f"body.gravity is not stated; {value}, anywhere on the ground, is taken."
        notes.append(Message("gravity-assumed", text))
    unchecked = [axis.name for axis, test in zip(read, tested, strict=True) if test is None]
    if unchecked and len(unchecked) < len(read):
        text = "without one of these axes the others do not determine the tensor, so nothing checks it"
        text = f"{text}: {', '.join(unchecked)}."
        notes.append(Message("axes-unchecked", text))
    return notes


def _exact(axes: Axes) -> list[str]:
    """Keys of quantities without uncertainty that the tensor depends on."""
    names = [name for name in ("mass", "gravity") if _no_std(getattr(axes.body, name))]
    names = [f"body.{name}" for name in names]
    if any(table.point is not None for table in axes.tables):
        names += ["body.centre_of_mass"] if all(map(_no_std, axes.body.centre_of_mass or ())) else []
    for table, name in zip(axes.tables, axes.names, strict=True):
        levers = [key for key in LEVERS if key != "point" and _no_std(getattr(table, key))]
        levers = [key for key in levers if key != "distance" or table.distance.value]  # type: ignore[union-attr]
        levers += ["point"] if table.point is not None and all(map(_no_std, table.point)) else []
        levers += ["fixture"] if _no_std(table.fixture) else []
        names += [f"{key} of {name}" for key in [*levers, *([] if table.tilt else ["direction"])]]
    return names


def _no_std(given: object) -> bool:
    return isinstance(given, Quantity) and not given.std


def _provenance(axes: Axes, results: Sequence[Result | str | Path]) -> dict[str, object]:
    """Files with their hashes."""
    files = [str(axes.folder / table.result) for table in axes.tables if table.result is not None]
    files += [str(result) for result in results if not isinstance(result, Result)]
    hashes = {name: hashlib.sha256(Path(name).read_bytes()).hexdigest() for name in files}
    return {"axes": axes.source, "results": hashes, "versions": versions()}
