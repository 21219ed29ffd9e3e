"""Settings of the documentation site, which `make docs` builds from the pages that tools/build_docs.py laid out."""

from __future__ import annotations

import re
from importlib.metadata import version as installed
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.utils.math import latex2mathml

project = "swingid"
author = "the authors of swingid"
version = release = installed("swingid")
copyright = author  # shown in the footer

HERE = Path(__file__).resolve().parent

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
]
root_doc = "index"
exclude_patterns = ["gallery/README.rst"]
suppress_warnings = ["config.cache"]  # the order of the gallery is a function, so the configuration is read anew

myst_heading_anchors = 5
myst_enable_extensions = ["dollarmath"]
html_math_renderer = "mathml"  # see `equation` below

html_theme = "furo"
html_title = "swingid"
html_static_path = [str(HERE / "_static")]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
python_use_unqualified_type_names = True

sphinx_gallery_conf = {
    "examples_dirs": str(HERE / "_build" / "scripts"),
    "gallery_dirs": "gallery",
    "capture_repr": (),
    "abort_on_example_error": True,
    "plot_gallery": "True",
    "download_all_examples": False,
    "remove_config_comments": True,
    "reset_modules": ("matplotlib",),
    "min_reported_time": 1000,
    "write_computation_times": False,  # that page loads scripts of other servers
    "show_signature": False,
    "image_scrapers": ("matplotlib",),
    "backreferences_dir": None,
}

ORDER = (
    *("own_rig", "phone", "video", "weigh_a_body", "compare_methods", "calibrate_encoders"),
    *("design", "campaign", "live", "class_exercise"),
)


def order_of_tutorials(filename: str) -> int:
    """Place of a script in the gallery, that of docs/index.md."""
    stem = Path(filename).stem.removeprefix("plot_")
    return ORDER.index(stem) if stem in ORDER else len(ORDER)


sphinx_gallery_conf["within_subsection_order"] = order_of_tutorials


def plain_to_rest(lines: list[str]) -> None:
    """Docstrings are plain text with `names`, indented code and doctests: as reStructuredText, in place."""
    found: list[str] = []
    literal = doctest = False
    for k, line in enumerate(lines):
        doctest = line.startswith(">>> ") or (doctest and bool(line.strip()))
        indented = line.startswith("    ") and (literal or (k > 0 and not lines[k - 1].strip()))
        if indented and not literal:
            found += ["::", ""]
        literal = indented or (literal and not line.strip())
        found.append(line if literal or doctest else _escaped(line))
    lines[:] = found


def _escaped(line: str) -> str:
    """A line of prose: code in backticks as literals, what reStructuredText would read as a mark escaped."""
    parts = re.split(r"(``.+?``|`.+?`)", line)
    return "".join(
        f"``{part.strip('`')}``"
        if part.startswith("`") and len(part) > 2
        else re.sub(r"([*|\\]|_(?=\W|$))", r"\\\1", part)
        for part in parts
    )


def on_docstring(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Handler of autodoc, before napoleon."""
    plain_to_rest(lines)


TAG = re.compile(r"\\tag\{(.+?)\}")
"""The number of an equation: the paper's, so Sphinx must not count its own."""

ACCENT = re.compile(r"(\\(?:d?dot|hat|tilde)\s*(?:\\[a-z]+|[a-zA-Z]))(?=[_^])")
"""A letter with an accent and an index, which would stand below it."""

NAMED = re.compile(r"(?<=[\w}|)])\s*(\\(?:sin|cos|operatorname\{sgn\}))(?![\w])")
"""A function behind a factor, from which nothing would separate it."""


def mathml(text: str, *, block: bool = False) -> str:
    """An equation in the notation of TeX as MathML."""
    spaced = re.sub(r"(\\(?:sin|cos|operatorname\{sgn\}))(?=\s*[\w\\])", r"\1\\,", NAMED.sub(r"\\,\1", text))
    return str(latex2mathml.tex2mathml(ACCENT.sub(r"{\1{}}", spaced), as_block=block))


def inline_equation(writer: Any, node: Any) -> None:
    """Visitor of HTML writers: an equation within a line, as MathML that browsers set without a script."""
    writer.body.append(mathml(node.astext()))
    raise nodes.SkipNode


def equation(writer: Any, node: Any) -> None:
    """Visitor of HTML writers: an equation of its own, with its number, under which it can be linked to."""
    text = node.astext()
    tags = TAG.findall(text)
    anchor = f' id="equation-{re.sub(r"[^0-9A-Za-z]+", "-", tags[0]).strip("-")}"' if tags else ""
    number = f'<span class="eqno">({tags[0]})</span>' if tags else ""
    writer.body.append(f'<div class="math"{anchor}>{mathml(TAG.sub("", text), block=True)}{number}</div>\n')
    raise nodes.SkipNode


def setup(app: Any) -> None:
    """Register the handlers."""
    app.connect("autodoc-process-docstring", on_docstring, priority=400)
    app.add_html_math_renderer("mathml", (inline_equation, None), (equation, None))
