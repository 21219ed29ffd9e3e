"""One table for a terminal, a page and a document: the same texts in each, whatever they hold."""

from __future__ import annotations

import re
from html import unescape

import jinja2

from swingid.table import Cell, Column, Table, pairs

TABLE = Table(
    (Column("method", "name"), Column("u", "number", True), Column("remark", "text")),
    (("momentum", "0.1 %", "a|b *c*"), (Cell("energy", "energy.key"), Cell("<b>2 %</b>", form="fails"), "")),
    chosen=1,
)


def page_of(table: Table) -> str:
    environment = jinja2.Environment(loader=jinja2.PackageLoader("swingid.report"), autoescape=True)
    return environment.from_string("{% from 'table.html.j2' import table %}{{ table(given) }}").render(given=table)


def test_terminal_page_and_document_have_the_same_texts():
    assert TABLE.lines() == [
        "    method    u           remark",
        "    momentum  0.1 %       a|b *c*",
        "    energy    <b>2 %</b>",
    ]
    assert TABLE.markdown().splitlines()[2] == r"| momentum | 0.1 % | a\|b \*c\* |"
    page = page_of(TABLE)
    cells = [re.sub("<[^>]*>", "", unescape(cell)) for cell in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", page)]
    assert cells[:6] == ["method", "u", "remark", "momentum", "0.1 %", "a|b *c*"]
    assert "<b>" not in page  # a text of a log is no markup
    assert '<span class="key">energy.key</span>' in page
    assert '<tr class="chosen"><td class="name">energy' in page
    assert 'class="number fails" data-label="u"' in page


def test_pairs_have_no_headings_and_head_each_row():
    table = pairs([("file", "a.csv")])
    assert table.lines() == ["    file  a.csv"]
    assert "thead" not in page_of(table)
    assert '<th scope="row">file</th>' in page_of(table)
    assert not Table(table.columns, ())
