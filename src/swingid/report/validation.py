"""The page of a validation: how a model predicts logs that it was not fitted to."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from swingid.report.html import environment, write_page

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.study.validate import Validation


def write_validation(validation: Validation, rig: Rig, path: str | Path) -> Path:
    """Write the page of `validation` to `path` and return it. Raises InputError when the file cannot be written."""
    from markupsafe import Markup

    from swingid.report.figures.validation import draw_validation
    from swingid.report.style import house_style, to_svg
    from swingid.study.validate.text import cells

    logs = []
    with house_style():
        for k, prediction in enumerate(validation.predictions):
            figure = draw_validation(prediction, linear=validation.linear)
            svg = Markup(to_svg(figure, f"validation{k}", f"Measured and predicted angle of {prediction.log}"))
            logs.append({"cells": cells(prediction, linear=validation.linear, fine=True), "svg": svg})
    template = environment().get_template("validation.html.j2")
    page = template.render(rig=rig, logs=logs, method=validation.method, notes=validation.notes)
    return write_page(page, Path(path))
