"""How a recording of the twin was made, for its metadata."""

from __future__ import annotations

import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.simulation.draws import Draws

PACKAGES = ("swingid", "numpy", "numba")


@cache
def versions() -> dict[str, str]:
    """Versions of Python and of what computes the motion."""
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "unknown"
    return found


def describe(reference: object) -> str | None:
    """A reference in words: its own `describe()`, else its name; None stays None."""
    if reference is None:
        return None
    own = getattr(reference, "describe", None)
    return str(own()) if callable(own) else str(getattr(reference, "__name__", type(reference).__name__))


def how_made(
    *,
    duration: float,
    rate: float,
    seed: int,
    drawn: bool,
    initial_angle: float,
    initial_speed: float,
    encoder_zero: tuple[float, float],
    controller: object,
    reference: object,
) -> dict[str, object]:
    """The arguments of `simulate` for the metadata; controller None: the loop was open."""
    return {
        "duration": duration,
        "rate": rate,
        "seed": seed,
        "drawn": drawn,
        "initial_angle": initial_angle,
        "initial_speed": initial_speed,
        "encoder_zero": list(encoder_zero),
        "controller": "open loop" if controller is None else repr(controller),
        "reference": describe(reference),
    }


def truth(draws: Draws) -> dict[str, object]:
    """What the run was really made with (SI), under the names of identified parameters.

    For comparisons after the fact only: no method of identification may read it.
    """
    values = draws.values
    found: dict[str, object] = {
        "inertia": values["axis.inertia"],
        "gravity_torque": values["axis.gravity_torque"],
    }
    prefix = "axis.friction."
    found |= {key.removeprefix(prefix): value for key, value in values.items() if key.startswith(prefix)}
    found["constants"] = dict(values)
    for i, name in enumerate(("angle", "wheel")):
        encoder = draws.encoders[i]
        found[f"{name}_encoder"] = {
            "nonlinearity_cosine": encoder.alpha,
            "nonlinearity_sine": encoder.beta,
            "latency": draws.latencies[i],
        }
    return found


def metadata(rig: Rig, how: dict[str, object], draws: Draws) -> dict[str, object]:
    """Metadata of a twin's recording: how it was made, rig, versions, and the truth for comparisons."""
    return {
        "made_by": "swingid simulate",
        "simulation": how,
        "rig": rig.text,
        "rig_name": rig.name,
        "rig_source": str(rig.source),
        "versions": dict(versions()),
        "truth": truth(draws),
    }
