"""swingid: moment of inertia and bearing friction of a swinging body, from logged angles.

    import swingid as sw
    rig = sw.Rig.load("rig.toml")
    log = sw.Recording.load("run.csv", rig)
    result = sw.identify(log, rig)
    print(result.summary())

Everything here is imported on first use, so that ``import swingid`` costs nothing.
"""

from __future__ import annotations

import sys
from importlib import import_module
from inspect import Signature, signature
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from swingid import errors as errors
    from swingid.control.backstepping import Backstepping as Backstepping
    from swingid.control.compensator import Compensator as Compensator
    from swingid.control.references import parse_reference as parse_reference
    from swingid.identify import identify as identify
    from swingid.identify.combine import difference as difference
    from swingid.identify.encoder_calibration import calibrate_encoders as calibrate_encoders
    from swingid.identify.motor_calibration import calibrate as calibrate
    from swingid.identify.online import online as online
    from swingid.identify.result import Result as Result
    from swingid.model.rig import Rig as Rig
    from swingid.recording.large import LargeLog as LargeLog
    from swingid.recording.recording import Recording as Recording
    from swingid.simulate import simulate as simulate
    from swingid.study.compare import compare as compare
    from swingid.study.design import design as design
    from swingid.study.rehearse import rehearse as rehearse
    from swingid.study.validate import validate as validate

    __version__: str

_HOMES = {
    "Backstepping": "swingid.control.backstepping",
    "Compensator": "swingid.control.compensator",
    "LargeLog": "swingid.recording.large",
    "Recording": "swingid.recording.recording",
    "Result": "swingid.identify.result",
    "Rig": "swingid.model.rig",
    "online": "swingid.identify.online",
    "calibrate": "swingid.identify.motor_calibration",
    "calibrate_encoders": "swingid.identify.encoder_calibration",
    "compare": "swingid.study.compare",
    "design": "swingid.study.design",
    "difference": "swingid.identify.combine",
    "parse_reference": "swingid.control.references",
    "rehearse": "swingid.study.rehearse",
    "validate": "swingid.study.validate",
}
_VERBS = ("identify", "simulate")
_PACKAGES = ("errors", *_VERBS)

__all__ = [
    "Backstepping",
    "Compensator",
    "LargeLog",
    "Recording",
    "Result",
    "Rig",
    "calibrate",
    "calibrate_encoders",
    "compare",
    "design",
    "difference",
    "errors",
    "identify",
    "online",
    "parse_reference",
    "rehearse",
    "simulate",
    "validate",
]


class _Verb(ModuleType):
    """A package that is called as the function of its own name: ``swingid.identify(log, rig)``.

    `identify` and `simulate` are each a function of the interface and the package that holds it. Python binds
    the package to the name as soon as any of its modules is imported, so the package answers calls itself.
    """

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return self._function(*arguments, **options)

    @property
    def __signature__(self) -> Signature:
        return signature(self._function)

    @property
    def _function(self) -> Any:
        return getattr(self, self.__name__.rpartition(".")[2])

    def __reduce__(self) -> tuple[Any, ...]:
        return import_module, (self.__name__,)


class _Package(ModuleType):
    """The type of this package; makes the packages in `_VERBS` callable when they are bound to it."""

    def __setattr__(self, name: str, value: Any) -> None:
        if name in _VERBS and type(value) is ModuleType:
            value.__class__ = _Verb
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        value: Any = version("swingid")
    elif name in _PACKAGES:
        value = import_module(f"swingid.{name}")
    elif name in _HOMES:
        value = getattr(import_module(_HOMES[name]), name)
    else:
        raise AttributeError(f"module 'swingid' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, "__version__"})
