"""Coverage-guided fuzzing of the readers by atheris, which is no dependency: pip install atheris, then

    python tests/fuzz_with_atheris.py csv -max_total_time=600

reads what libFuzzer makes of the valid files of tests/fuzz/corpus.py (csv, mat, mcap, json, rig). It ends with the
bytes of a case (crash-…, slow-…) that gives a traceback, or no answer within 10 s.
"""

from __future__ import annotations

import contextlib
import random
import sys
import tempfile
import warnings
from importlib import import_module
from pathlib import Path

import atheris

SEEN = ["swingid.recording", "swingid.model", "swingid.units", "mcap", "tomllib", "json"]

with atheris.instrument_imports(include=SEEN):
    from fuzz.cases import read_case
    from fuzz.corpus import FILES, rig_files
    from swingid.errors import SwingidError

    for module in ("load", "formats", "formats.csv", "formats.dialect", "formats.memory", "header_units", "repair"):
        import_module(f"swingid.recording.{module}")
    for module in ("swingid.model.rig.rig", "swingid.units", "mcap.reader", "tomllib", "json.decoder"):
        import_module(module)

TARGETS = {**{name: FILES[name] for name in ("csv", "mat", "mcap", "json")}, "rig": (rig_files, ".toml")}


def main() -> None:
    """Fuzz the reader that the first argument names; the others are libFuzzer's."""
    target = sys.argv.pop(1)
    make, ending = TARGETS[target]
    warnings.simplefilter("ignore")

    def one(content: bytes) -> None:
        with contextlib.suppress(SwingidError):
            read_case(target, content, f"log{ending}", random.Random(len(content)))

    with tempfile.TemporaryDirectory() as folder:
        for k, content in enumerate(make()):
            (Path(folder) / str(k)).write_bytes(content)
        atheris.Setup([sys.argv[0], "-timeout=10", "-rss_limit_mb=2000", "-max_len=20000", *sys.argv[1:], folder], one)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
