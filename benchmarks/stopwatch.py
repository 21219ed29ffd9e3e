"""From a file to its number on the command line: commands, keys that a person has to write, seconds that are waited.

    python benchmarks/stopwatch.py --logs FOLDER [--only NAME]

For each log: ``init --from``, the keys in which the guessed rig file differs from that of the strangers' table
(what the repository says), ``inspect --rig``, ``identify``. Reading and typing are a person's and not measured.
FOLDER holds the logs of ``benchmarks/strangers.py``, or git mirrors as owner+name/repo.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path
from typing import Any

import swingid as sw
from swingid.model.rig.edit import to_toml

HERE = Path(__file__).parent / "strangers"
NAMES = (
    *("dfki-05-ddp", "aau-cart-long-5", "cubli16-swing1", "osterholt-pendulum-1", "y-fysiks-rod-31"),
    *("wen-string-8047", "delft-chirp", "xl330-motor-sinsin-100", "gobbi-torsion-0-95618", "browser-fork-gyro"),
)
KINDS = {
    "direct": "known torque",
    "reaction-wheel": "reaction wheel",
    "motor": "motor on the axis",
    "none": "free swing",
}
NOT_NEEDED = ("name", "sensors.noise", "log.reference", "axis.model_uncertainty")
"""Keys that nobody needs for a first number."""


def content_of(entry: dict[str, Any], folder: Path) -> bytes:
    """The log as its repository has it."""
    parts = re.match(r"https://raw.githubusercontent.com/([^/]+)/([^/]+)/([0-9a-f]+)/(.*)", entry["url"])
    assert parts is not None
    mirror = folder / f"{parts[1]}+{parts[2]}" / "repo"
    path = parts[4].replace("%20", " ")
    for revision in (parts[3], "HEAD"):
        shown = subprocess.run(["git", "-C", mirror, "show", f"{revision}:{path}"], capture_output=True, check=False)
        if shown.returncode == 0:
            return shown.stdout
    return (folder / f"{entry['name']}{Path(path).suffix}").read_bytes()


def leaves(table: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Values by dotted key."""
    found: dict[str, Any] = {}
    for key, value in table.items():
        found |= leaves(value, f"{prefix}{key}.") if isinstance(value, dict) else {f"{prefix}{key}": value}
    return found


def edited(guessed: str, wanted: dict[str, Any]) -> tuple[str, list[str], list[str]]:
    """The guessed rig file with what the repository says; keys that are written, keys that are taken out."""
    have = leaves(tomllib.loads(guessed))
    want = {key: value for key, value in leaves(wanted).items() if key not in NOT_NEEDED}
    marks = "log.point" in have
    if marks:  # x alone was read as an angle by the strangers' table; the marks are better
        want = {key: value for key, value in want.items() if not key.startswith("log.")}
    written = [key for key, value in want.items() if have.get(key, _default(key)) != value]
    drops = ("axis", "drive") if marks else ("axis", "drive", "log")
    gone = [key for key in have if key.startswith(drops) and key not in want and have[key] != _default(key)]
    gone += ["log.time"] if "log.rate" in want and "log.time" in have and "log.time" not in gone else []
    unused = [key for key in have if key.startswith("log.") and key not in want and not marks]
    unused += ["sensors.counts_per_turn"] if "sensors.resolution" in want else []
    unused += [key for key in have if key.startswith("sensors.") and "log.angle_speed" in want]
    kept = {key: value for key, value in have.items() if key not in (*gone, *unused)}
    kept |= {key: want[key] for key in written}
    document: dict[str, Any] = {}
    for key, value in kept.items():
        *tables, last = key.split(".")
        place = document
        for name in tables:
            place = place.setdefault(name, {})
        place[last] = value
    return to_toml(document), written, gone


def _default(key: str) -> Any:
    """What a key is where it is not stated."""
    table, _, name = key.partition(".")
    fields = sw.Rig.model_fields
    annotation = fields[table].annotation if table in fields else None
    own = getattr(annotation, "model_fields", {}).get(name)
    return None if own is None else own.default


def run(*words: str) -> tuple[int, float]:
    """Exit code and seconds of a command."""
    begin = time.perf_counter()
    done = subprocess.run([sys.executable, "-m", "swingid", *words], capture_output=True, check=False)
    return done.returncode, time.perf_counter() - begin


def row(entry: dict[str, Any], folder: Path) -> str:
    """A line of the table."""
    with tempfile.TemporaryDirectory() as place:
        here = Path(place)
        log = here / ("log" + Path(entry["url"].split("?")[0]).suffix)
        log.write_bytes(content_of(entry, folder))
        wanted = tomllib.loads((HERE / "rigs" / entry["rig"]).read_text(encoding="utf-8"))
        code, guessing = run("init", str(here / "rig"), "--from", str(log))
        path = here / "rig" / "rig.toml"
        guessed = path.read_text(encoding="utf-8") if code == 0 else 'name = "by-hand"\n'
        path.parent.mkdir(exist_ok=True)
        text, written, gone = edited(guessed, wanted)
        path.write_text(text, encoding="utf-8")
        looked, looking = run("inspect", str(log), "--rig", str(path), "--json", str(here / "look.json"))
        part = [f"--part={a}:{b}" for a, b in [entry["part"]]] if "part" in entry else []
        answer = here / "result.json"
        code, finding = run("identify", str(log), "--rig", str(path), *part, "--json", str(answer))
        verdict = json.loads((here / "look.json").read_text())["verdict"]["status"] if looked == 0 else "-"
        found = json.loads(answer.read_text())
        shown = _answer(found, entry["evidence"]) if code == 0 else f"refused: {found['error']['message']}"
        kind = KINDS[wanted["drive"]["kind"]]
        seconds = guessing + looking + finding
        keys = len(written) + len(gone)
        print(f"# {entry['name']}: written {written}, taken out {gone}", file=sys.stderr)
    return f"| {entry['name']} | {kind} | {keys} | {seconds:.1f} s | {verdict} | {shown} |"


def _answer(found: dict[str, Any], evidence: list[float]) -> str:
    """The leading value with half its 95 % interval, and the evidence."""
    name, one = next(iter(found["parameters"].items()))
    low, high = one["interval95"]
    known = f"{evidence[0]:.5g} to {evidence[1]:.5g}"
    if "/" in name and abs(one["value"] / evidence[0] - 1) > 1:  # the evidence is of the inertia over the other
        value = sorted((1 / high, 1 / low))
        return f"{sum(value) / 2:.5g} ± {(value[1] - value[0]) / 2:.2g} s² | {known}"
    return f"{one['value']:.4g} ± {(high - low) / 2:.2g} {one['unit']} | {known}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--logs", type=Path, required=True)
    parser.add_argument("--only")
    options = parser.parse_args()
    entries = [
        one for path in sorted((HERE / "logs.d").glob("*.toml")) for one in tomllib.loads(path.read_text())["log"]
    ]
    by_name = {one["name"]: one for one in entries}
    print("| log | kind | keys | seconds | inspect | answer (95 %) | evidence |\n|---|---|---|---|---|---|---|")
    for name in NAMES:
        if options.only is None or options.only == name:
            print(row(by_name[name], options.logs), flush=True)


if __name__ == "__main__":
    main()
