"""Processor time of the server of `swingid dashboard` while it draws a run of 1 kHz, beside that of the rig's process.

    python benchmarks/page.py [--seconds 15]

Needs Linux (/proc), a Chromium and playwright. The rig is `swingid emulate`, in real time: on a machine that is busy
otherwise its guard may end the run for want of a heartbeat. Prints shares of one core.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from browser import browser, free_port, served


def used(pid: int) -> float:
    """Seconds of processor time of a process so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def children(pid: int) -> list[int]:
    """Processes that were started by this one, and theirs."""
    own = [
        int(word) for task in Path(f"/proc/{pid}/task").iterdir() for word in (task / "children").read_text().split()
    ]
    return own + [each for child in own for each in children(child)]


def prepare(page: Any, seconds: float) -> None:
    """Connect, check, rehearse and begin."""
    page.set_default_timeout(120_000)
    for name, button, done in (
        ("Connect", "Connect", "samples per second"),
        ("Check", "Check", "signs: axis"),
        ("Rehearse", "Rehearse on the twin", "within the limits"),
    ):
        page.locator(".q-tab:not(.disabled)", has_text=name).click()
        if name == "Rehearse":
            page.get_by_label("duration, s").fill(f"{seconds + 15:g}")
        page.get_by_role("button", name=button, exact=True).click()
        page.get_by_text(done).first.wait_for()
    page.locator(".q-tab:not(.disabled)", has_text="Run").click()
    page.get_by_role("button", name="Run", exact=True).click()
    page.get_by_text(re.compile(r"running · [3-9]\.\d s")).wait_for()


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=15.0)
    seconds = parser.parse_args().seconds
    port = free_port()
    emulator = subprocess.Popen([sys.executable, "-m", "swingid", "emulate", "--rig", "paper", "--tcp", str(port)])
    time.sleep(5)
    try:
        with tempfile.TemporaryDirectory() as folder:
            arguments = ("--rig", "paper", "--device", f"tcp://127.0.0.1:{port}", "--folder", folder)
            with served(*arguments) as (address, server), browser() as chromium:
                page = chromium.new_page(viewport={"width": 1200, "height": 1400})
                came: list[float] = []
                page.on("websocket", lambda link: link.on("framereceived", lambda _: came.append(time.monotonic())))
                page.goto(address)
                prepare(page, seconds)
                own, others = used(server.pid), {pid: used(pid) for pid in children(server.pid)}
                began = time.monotonic()
                page.wait_for_timeout(1000 * seconds)
                took = time.monotonic() - began
                share = (used(server.pid) - own) / took
                rest = {pid: (used(pid) - before) / took for pid, before in others.items()}
                draws = sum(at > began for at in came) / took
                print(f"server of the page: {100 * share:.1f} % of a core, {draws:.0f} messages per second from it")
                for pid, each in rest.items():
                    if each > 0.005:
                        print(f"process {pid} of the rig: {100 * each:.1f} %")
                page.keyboard.press("Escape")
                page.wait_for_timeout(2000)
    finally:
        emulator.terminate()


if __name__ == "__main__":
    main()
