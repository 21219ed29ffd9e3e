"""A page of `swingid dashboard` in a real Chromium, for tests; screenshots stay in out/pages."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from page_server import free_port, served

__all__ = ["browser", "free_port", "listen", "picture", "served"]

PAGES = Path(__file__).resolve().parents[1] / "out" / "pages"
NAMES = "chromium", "chromium-browser", "google-chrome"
CHROMIUM = next((found for name in NAMES if (found := shutil.which(name))), "")
pytest.importorskip("playwright", reason="playwright is not installed: pip install 'swingid[dev]'")
if not CHROMIUM:
    pytest.skip("no Chromium on this machine (apt-get install chromium)", allow_module_level=True)


@contextmanager
def browser() -> Iterator[Any]:
    """A headless Chromium."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        chromium = play.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        try:
            yield chromium
        finally:
            chromium.close()


def picture(page: Any, name: str) -> None:
    """Keep a screenshot of the whole page."""
    PAGES.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=PAGES / f"{name}.png", full_page=True)


def listen(page: Any) -> list[str]:
    """Errors that the page writes to the browser's console from now on."""
    found: list[str] = []
    page.on("pageerror", lambda error: found.append(str(error)))
    page.on("console", lambda message: found.append(message.text) if message.type == "error" else None)
    return found
