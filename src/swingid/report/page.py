"""A page of the report and its way into a file: HTML that needs nothing else, or the same content as a PDF."""

from __future__ import annotations

import datetime
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from swingid.report.pdf import Attachment, Head, to_pdf
from swingid.report.style import to_svg
from swingid.system import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def is_pdf(path: str | Path) -> bool:
    """Return whether a report of this name is a PDF."""
    return Path(path).suffix.lower() == ".pdf"


def date_of_issue() -> str:
    """Today as 2026-11-23 (UTC), or the day of SOURCE_DATE_EPOCH, by which builds are reproducible."""
    return _now().date().isoformat()


def _now() -> datetime.datetime:
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    if epoch.isdigit() and len(epoch) < 12:
        return datetime.datetime.fromtimestamp(int(epoch), datetime.UTC)
    return datetime.datetime.now(datetime.UTC).replace(microsecond=0)


def filled(template: str, **values: object) -> str:
    """A template with its values; a name that it needs and does not get is an error."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("swingid.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(values)


def picture(figure: Figure | None, name: str, title: str) -> str:
    """A figure as inline SVG for a template; "" for none."""
    from markupsafe import Markup

    return "" if figure is None else Markup(to_svg(figure, name, title))


def write_page(page: str, path: str | Path, head: Head | None = None, attachments: Sequence[Attachment] = ()) -> Path:
    """Write a page whole or not at all, see `write_whole`; returns the path. A name that ends in .pdf gives a PDF.

    head: of the pages of a PDF; attachments: files inside it. Raises InputError without the extra `pdf`, or when the
    file cannot be written.
    """
    target = Path(path)
    if is_pdf(target):
        content = to_pdf(page, head or Head("Report"), attachments, _now())
    else:
        content = page.encode("utf-8", "backslashreplace")  # names of files may hold what is no text
    write_whole(target, content)
    return target
