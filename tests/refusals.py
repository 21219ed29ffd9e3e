"""What a test asserts of a refusal: its code and the keys, figures and files it names, never its prose."""

from __future__ import annotations

from collections.abc import Callable

from swingid.errors import SwingidError


def coded(code: str, *names: str) -> Callable[[SwingidError], bool]:
    """The check of ``pytest.raises`` that an error has a code and that its message contains all names."""

    def check(error: SwingidError) -> bool:
        assert error.code == code, f"{error.code}, not {code}: {error.message}"
        missing = [name for name in names if name not in error.message]
        assert not missing, f"{missing} not in: {error.message}"
        return True

    return check
