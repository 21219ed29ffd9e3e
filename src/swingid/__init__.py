"""swingid: moment of inertia and bearing friction of a swinging body, from logged angles or rates.

    import swingid as sw
    rig = sw.Rig.load("rig.toml")
    log = sw.Recording.load("run.csv", rig)
    result = sw.identify(log, rig)
    print(result.summary())

Everything here is imported on first use, so that ``import swingid`` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from swingid import errors as errors
    from swingid.body import tensor as tensor
    from swingid.calibration.encoders import calibrate_encoders as calibrate_encoders
    from swingid.calibration.motor import calibrate as calibrate
    from swingid.control.backstepping import Backstepping as Backstepping
    from swingid.control.compensator import Compensator as Compensator
    from swingid.control.references import parse_reference as parse_reference
    from swingid.identification import identify as identify
    from swingid.model.rig import Rig as Rig
    from swingid.pooling import difference as difference
    from swingid.recording.large import LargeLog as LargeLog
    from swingid.recording.recording import Recording as Recording
    from swingid.recursive import online as online
    from swingid.result.result import Result as Result
    from swingid.simulation import simulate as simulate
    from swingid.study.compare import compare as compare
    from swingid.study.design import design as design
    from swingid.study.inspect import inspect_log
    from swingid.study.rehearse import rehearse as rehearse
    from swingid.study.validate import validate as validate

    inspect = inspect_log
    __version__: str

_HOMES = {
    "Backstepping": "swingid.control.backstepping",
    "Compensator": "swingid.control.compensator",
    "LargeLog": "swingid.recording.large",
    "Recording": "swingid.recording.recording",
    "Result": "swingid.result.result",
    "Rig": "swingid.model.rig",
    "online": "swingid.recursive",
    "calibrate": "swingid.calibration.motor",
    "calibrate_encoders": "swingid.calibration.encoders",
    "compare": "swingid.study.compare",
    "design": "swingid.study.design",
    "difference": "swingid.pooling",
    "identify": "swingid.identification",
    "inspect": "swingid.study.inspect",
    "parse_reference": "swingid.control.references",
    "rehearse": "swingid.study.rehearse",
    "simulate": "swingid.simulation",
    "tensor": "swingid.body",
    "validate": "swingid.study.validate",
}

_THERE = {"inspect": "inspect_log"}
"""What a name is called in its home, where that differs."""

_MODULES = ("errors", "live")

__all__ = ["errors", "live", *_HOMES]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        value: Any = version("swingid")
    elif name in _MODULES:
        value = import_module(f"swingid.{name}")
    elif name in _HOMES:
        value = getattr(import_module(_HOMES[name]), _THERE.get(name, name))
    else:
        raise AttributeError(f"module 'swingid' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
