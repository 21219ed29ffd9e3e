"""The folder of compiled kernels, without loading the compiler.

numba's own cache notices an edit of the file that holds a function, not of another file whose function it
inlines. The cache folder is therefore named by a hash of all sources of the package that hold kernels.
"""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path

from swingid.system import user

PACKAGE = Path(__file__).resolve().parents[1]


def kernel_hash(package: Path = PACKAGE) -> str:
    """Hash of all sources below `package` that mention `njit`, with numba's version."""
    digest = hashlib.sha256(version("numba").encode())
    for path in sorted(package.rglob("*.py")):
        source = path.read_bytes()
        if b"njit" in source:
            digest.update(str(path.relative_to(package)).encode())
            digest.update(source)
    return digest.hexdigest()[:16]


def wanted_folder() -> Path | None:
    """The folder of the environment or the user in which the caches of all versions lie; None without a home."""
    if given := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(given).absolute()
    if given := os.environ.get("XDG_CACHE_HOME"):
        return Path(given).absolute() / "swingid"
    with suppress(RuntimeError):  # a user without an entry, as in some containers
        return Path.home() / ".cache" / "swingid"
    return None


def cache_folder() -> Path:
    """Folder of this version's compiled kernels, made if it can be made.

    Where it cannot be written and was not prepared by `swingid compile` either, it is one of the user in the temporary
    folder. Where that cannot be had, nothing can be kept, and each process compiles what it calls.
    """
    name, wanted = kernel_hash(), wanted_folder()
    if wanted is not None:
        with suppress(OSError):
            (wanted / name).mkdir(parents=True, exist_ok=True)
            if os.access(wanted / name, os.W_OK) or any((wanted / name).glob(f"ready-*-{machine()}")):
                return wanted / name
    with suppress(OSError):
        temporary = Path(tempfile.gettempdir()) / f"swingid-{user()}"
        temporary.mkdir(mode=0o700, exist_ok=True)
        if _is_mine(temporary):  # else another's code would be run
            (temporary / name).mkdir(exist_ok=True)
            return temporary / name
    return (wanted or Path(tempfile.gettempdir()) / "swingid") / name


def _is_mine(path: Path) -> bool:
    """Return whether a file belongs to this user; on Windows the temporary folder is the user's own."""
    return path.stat().st_uid == os.getuid() if hasattr(os, "getuid") else True


@cache
def machine() -> str:
    """What one folder's kernels differ by, as a short name: processor, Python, place of the package.

    numba keeps kernels of different ones beside each other, so that what is ready for one is not for another.
    """
    from llvmlite import binding

    processor = os.environ.get("NUMBA_CPU_NAME") or binding.get_host_cpu_name()
    features = os.environ.get("NUMBA_CPU_FEATURES") or binding.get_host_cpu_features().flatten()
    text = f"{processor} {features} {sys.version_info[:2]} {getattr(sys, 'abiflags', '')} {PACKAGE}"
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:8]


CACHE = cache_folder()


def kept_kernels() -> int:
    """Number of kernels of this version that are compiled on this machine."""
    return sum(1 for _ in CACHE.rglob("*.nbc"))
