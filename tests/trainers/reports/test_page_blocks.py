"""Blocks of a report as Markdown and HTML."""

from __future__ import annotations

import base64
import re
from html import unescape
from pathlib import Path

import markdown
import pytest

from trainers.reports.report import Heading, Paragraph, Picture, Table, markdown_text, write_page


def test_a_table_escapes_its_cells():
    table = Table(["name", "value"], [["a|b", "<i>"]])
    assert table.markdown() == "| name | value |\n| --- | --- |\n| a\\|b | &lt;i> |"
    assert "<td>a|b</td><td>&lt;i&gt;</td>" in table.html(Path())


def test_both_pages_hold_every_block(tmp_path):
    (tmp_path / "x.png").write_bytes(b"image")
    blocks = [Heading("Results"), Paragraph("1 < 2"), Picture("x.png", "curve"), Table(["a"], [["b"]])]
    html = write_page(tmp_path, "Title", blocks).read_text()
    assert "<h1>Title</h1>" in html
    assert "<h2>Results</h2>" in html
    assert "<p>1 &lt; 2</p>" in html
    assert base64.b64encode(b"image").decode() in html
    written = (tmp_path / "report.md").read_text()
    assert written.startswith("# Title\n\n## Results\n\n1 < 2\n\n![curve](x.png)\n\n| a |")


HOSTILE = (
    "<img src=x onerror=alert(1)>",
    "a\n\n# A heading",
    "a\r\n| b | c |",
    "![x](http://evil/x.png)",
    "[x](javascript:alert(1))",
    "`</td>`",
    "&lt;script&gt;",
    "a\u2028b\x00c\x1b[31m",
    "<!-- x -->",
    "https://evil.example",
    "www.evil.example",
    "\\<b>",
    "[x]: http://evil",
    "# x",
    "> x",
    "- x",
)


@pytest.mark.parametrize("text", HOSTILE)
def test_markdown_shows_text_and_renders_nothing_of_it(text):
    for block in (Heading(text), Paragraph(text), Picture("x.png", text), Table(["a"], [[text]])):
        written = block.markdown()
        lines = {Heading: 1, Paragraph: 1, Picture: 1, Table: 3}[type(block)]
        assert len(written.splitlines()) == lines
        page = markdown.markdown(written, extensions=["tables"])
        found = set(re.findall(r"<(/?[a-z0-9]+|!--)", page)) - {"table", "thead", "tbody", "tr", "th", "td", "p", "h2"}
        found -= {f"/{tag}" for tag in ("table", "thead", "tbody", "tr", "th", "td", "p", "h2")}
        assert found <= ({"img"} if isinstance(block, Picture) else set()), page
        assert page.count("<img") == isinstance(block, Picture)
        assert "http:/" not in page
        if isinstance(block, Paragraph):
            shown = unescape(re.sub(r"</?p>", "", page))
            assert shown == " ".join("".join(c if c.isprintable() else " " for c in text).split())


def test_markdown_leaves_ordinary_text_as_it_is():
    for text in (
        "nl_reach, seed 3",
        "python train.py 'logger=[tensorboard]' task.verbs=[a,b]",
        "x < 3 & y > 2",
        "1. a",
    ):
        assert markdown_text(text) == text
