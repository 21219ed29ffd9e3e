"""The exceptions of swingid and the exit codes they stand for.

Every error that a user can cause is one sentence: which file, row or key; what is wrong; what to do.
"""

from __future__ import annotations

from functools import partial


class SwingidError(Exception):
    """An error that a user can act on; it can be pickled, so it also comes from a process of a pool.

    `message` is one sentence, `code` a short stable slug such as ``"missing-file"`` that scripts may test,
    `exit_code` what the command line returns.
    """

    exit_code = 70

    def __init__(self, message: str, *, code: str) -> None:
        super().__init__(message)
        self.message = message
        self.code = code

    def __reduce__(self) -> tuple[object, ...]:
        """Restore the whole error from a pickle, which would call the class with the message alone."""
        return partial(type(self).__new__, type(self), *self.args), (), vars(self)


class UsageError(SwingidError):
    """The command or the function was called in a way that it does not offer (exit code 2)."""

    exit_code = 2


class InputError(SwingidError):
    """A file, row or key cannot be used (exit code 3)."""

    exit_code = 3


class UnanswerableError(SwingidError):
    """The data are readable but do not determine the result (exit code 4)."""

    exit_code = 4


class NotIdentifiableError(UnanswerableError):
    """The motion does not determine what is sought."""

    def __init__(self, message: str) -> None:
        super().__init__(message, code="not-identifiable")


class DeviceError(SwingidError):
    """A device of a live rig cannot be reached, does not answer, or has stopped (exit code 5)."""

    exit_code = 5


def missing_package(what: str, package: str, extra: str) -> InputError:
    """The error that says which extra brings a package that is not installed; what: that needs it, in words."""
    return InputError(
        f"{what} needs the package {package}; run: pip install 'swingid[{extra}]'.", code="missing-package"
    )


def require_rig(rig: object) -> None:
    """Raise UsageError for what is no Rig, such as its name."""
    if not (hasattr(rig, "axis") and hasattr(rig, "log")):
        raise UsageError(f"{rig!r} is no Rig; load one with sw.Rig.load(name or path).", code="no-rig")
