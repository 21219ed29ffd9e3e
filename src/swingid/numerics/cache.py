"""The folder of compiled kernels, without loading the compiler.

numba's own cache notices an edit of the file that holds a function, not of another file whose function it
inlines. The cache folder is therefore named by a hash of all sources of the package that hold kernels.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
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


def cache_folder() -> Path:
    """Folder of this version's compiled kernels, made if it can be made, else one in the temporary folder."""
    home = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    wanted = Path(os.environ.get("NUMBA_CACHE_DIR", Path(home) / "swingid")) / kernel_hash()
    try:
        wanted.mkdir(parents=True, exist_ok=True)
    except OSError:
        wanted = Path(tempfile.gettempdir()) / f"swingid-{user()}" / wanted.name
        wanted.mkdir(parents=True, exist_ok=True)
    return wanted


CACHE = cache_folder()


def kept_kernels() -> int:
    """Number of kernels of this version that are compiled on this machine."""
    return sum(1 for _ in CACHE.rglob("*.nbc"))
