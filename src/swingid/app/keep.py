"""The step Keep: report, rig.toml, result, the same in five lines of Python and as a notebook."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable

from nicegui import ui

from swingid.app.analysis import Analyst, Case, answered, reported
from swingid.app.draft import Draft, case_of
from swingid.app.parts import code, html, plain_button
from swingid.errors import SwingidError
from swingid.methods.table import DEFAULT, METHODS


class Keep:
    """Content of the step."""

    def __init__(self, analyst: Analyst, draft: Draft) -> None:
        self.analyst, self.draft = analyst, draft

    def show(self) -> None:
        """A button for each file, and the lines of Python."""
        case = case_of(self.draft)
        with ui.element("div").classes("swingid-chips"):
            self.method = ui.select(list(METHODS), value=DEFAULT, label="method", on_change=self._written).classes(
                "w-44"
            )
            self.method.props("dense outlined")
            plain_button("Report, PDF", lambda: self._report(".pdf"))
            plain_button("Report, HTML", lambda: self._report(".html"))
            plain_button("rig.toml", lambda: ui.download.content(case.rig, "rig.toml"))
            plain_button("Result, JSON", self._result)
            plain_button(
                "Notebook", lambda: ui.download.content(notebook(case, str(self.method.value)), "swingid.ipynb")
            )
        self.python = self._copied("The same in Python", five_lines)
        self.terminal = self._copied("and in a terminal", command)
        self._written()

    def _copied(self, title: str, lines: Callable[[Case, str], str]) -> ui.html:
        """The place for lines that are to be copied, below a title with a button that does."""
        with ui.row().classes("items-center"):
            ui.label(title).classes("swingid-strong")
            plain_button("Copy", lambda: ui.clipboard.write(lines(case_of(self.draft), str(self.method.value))))
        return html("", "w-full")

    def _written(self) -> None:
        """The lines of the method that is chosen."""
        case, method = case_of(self.draft), str(self.method.value)
        self.python.set_content(code(five_lines(case, method), "Python"))
        self.terminal.set_content(code(command(case, method)))

    async def _report(self, ending: str) -> None:
        try:
            content = await self.analyst.do(reported, case_of(self.draft), str(self.method.value), {}, ending)
        except SwingidError as error:
            ui.notify(error.message, type="warning")
        else:
            ui.download.content(content, f"report{ending}")

    async def _result(self) -> None:
        result = await self.analyst.do(answered, case_of(self.draft), str(self.method.value), {})
        ui.download.content(result.to_json(), "result.json")


def five_lines(case: Case, method: str = DEFAULT) -> str:
    """Python that reads the logs beside rig.toml and gives the same result."""
    names = [json.dumps(name, ensure_ascii=False) for name, _ in case.logs]
    lines = ["import swingid as sw", 'rig = sw.Rig.load("rig.toml")']
    if len(names) > 1:
        lines.append(f"log = [sw.Recording.load(name, rig) for name in ({', '.join(names)})]")
    else:
        lines.append(f"log = sw.Recording.load({names[0]}, rig)")
    more = "" if method == DEFAULT else f', "{method}"'
    more += f", part={list(case.parts)!r}" if case.parts else f", added={list(case.added)!r}" if case.added else ""
    return "\n".join([*lines, f"result = sw.identify(log, rig{more})", "print(result.summary())"]) + "\n"


def command(case: Case, method: str = DEFAULT) -> str:
    """The same in a terminal."""
    words = ["swingid", "identify", *(shlex.quote(name) for name, _ in case.logs), "--rig", "rig.toml"]
    words += [] if method == DEFAULT else ["--method", method]
    words += [f"--part {start!r}:{stop!r}" for start, stop in case.parts]
    return " ".join([*words, *(f"--added {shlex.quote(body)}" for body in case.added)])


def notebook(case: Case, method: str = DEFAULT) -> str:
    """The same as a Jupyter notebook that writes rig.toml first."""
    cells = [
        _cell(
            "markdown", "# Moment of inertia, by swingid\n\nThe log lies beside this notebook; `pip install swingid`."
        ),
        _cell("code", f"%%writefile rig.toml\n{case.rig}"),
        _cell("code", five_lines(case, method).rstrip()),
        _cell("code", "result.plot();"),
    ]
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    whole = {"cells": cells, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    for number, cell in enumerate(cells):
        cell["id"] = f"cell-{number}"
    return json.dumps(whole, indent=1, ensure_ascii=False) + "\n"


def _cell(kind: str, source: str) -> dict[str, object]:
    code_keys: dict[str, object] = {"outputs": [], "execution_count": None} if kind == "code" else {}
    return {"cell_type": kind, "metadata": {}, "source": source, **code_keys}
