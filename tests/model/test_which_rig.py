"""The pictures of docs/which-rig.md are those that tools/draw_rigs.py draws, and the page shows each."""

from __future__ import annotations

import importlib.util
import re
import xml.etree.ElementTree as ET
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "which-rig.md").read_text(encoding="utf-8")


def drawing():
    found = importlib.util.spec_from_file_location("draw_rigs", ROOT / "tools" / "draw_rigs.py")
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def test_pictures_are_those_of_the_script_and_on_the_page():
    tool = drawing()
    files = {path.stem: path.read_text(encoding="utf-8") for path in tool.FOLDER.glob("*.svg")}
    assert files == {name: tool.picture(name) for name in tool.RIGS}
    assert re.findall(r"images/rigs/([\w-]+)\.svg", PAGE) == list(tool.RIGS)


def test_pictures_lie_within_their_frame_and_have_a_dark_form():
    tool = drawing()
    for name in tool.RIGS:
        text = tool.picture(name)
        assert "prefers-color-scheme: dark" in text
        for one in ET.fromstring(text).iter("{http://www.w3.org/2000/svg}text"):
            width = 0.65 * 13 * len(one.text)  # of a wide font without serifs
            left = float(one.get("x")) - {"start": 0.0, "middle": 0.5}[one.get("text-anchor")] * width
            assert 0 < left < left + width < tool.WIDTH + 8, one.text
            assert 0 < float(one.get("y")) < tool.HEIGHT


def test_every_kind_says_what_to_log_to_know_and_to_expect():
    kinds = PAGE.split("\n## ")[1:]
    assert len(kinds) == 8
    for kind in kinds:
        if not kind.startswith("A flywheel"):
            assert all(f"**{word}**" in kind for word in ("Log", "Know", "Expect")), kind.splitlines()[0]
