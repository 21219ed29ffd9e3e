"""What the page's libraries log is one line each, without a traceback, and not without end."""

from __future__ import annotations

import logging

from swingid.app.faults import MOST, OneLine


def test_an_error_is_one_line_and_there_are_few(capsys):
    logger = logging.Logger("page")
    logger.addHandler(OneLine())
    logger.error("Cancel 2 running task(s), timeout graceful shutdown exceeded")
    logger.warning("slow\nvery")
    for _ in range(100):
        try:
            {}["key"]
        except KeyError:
            logger.exception("a long story")
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == MOST
    assert lines[0] == "swingid: slow"
    assert set(lines[1:]) == {"swingid: this is a bug of the page, KeyError ('key'); please report it"}
