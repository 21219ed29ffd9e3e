"""The door of identification: a log, a rig, the name of a method; a result."""

from __future__ import annotations

from collections.abc import Callable

from swingid.errors import UsageError
from swingid.identify.result import Result
from swingid.model.rig import Rig
from swingid.recording.recording import Recording


def _momentum(log: Recording, rig: Rig, **options: object) -> Result:
    from swingid.identify.momentum import momentum

    return momentum(log, rig, **options)


def _energy(log: Recording, rig: Rig, **options: object) -> Result:
    from swingid.identify.energy import energy

    return energy(log, rig, **options)  # type: ignore[arg-type]


METHODS: dict[str, Callable[..., Result]] = {"momentum": _momentum, "energy": _energy}


def identify(log: Recording, rig: Rig, method: str = "momentum", **options: object) -> Result:
    """Moment of inertia and friction of the body that `log` shows, by the named method.

    Parameters
    ----------
    log : Recording
        Measured angles, and voltage or torque where the method needs them. Nothing else of it is used.
    rig : Rig
        The constants of the rig with their uncertainties. `axis.inertia` and `axis.friction` are never read.
    method : {"momentum", "energy"}
        "momentum": test functions on the angles, no motor constant (default). "energy": the paper's (6) and (7).
    options
        ``variant="printed"`` for "energy": the formulas as printed; then also ``nodes`` and ``work``.

    Raises
    ------
    UsageError
        Unknown method or option.
    UnanswerableError
        The log cannot answer: no motion, too short, not identifiable, no scale.
    """
    if method not in METHODS:
        raise UsageError(f"unknown method {method!r}; choose one of {', '.join(METHODS)}.", code="unknown-method")
    return METHODS[method](log, rig, **options)
