"""Blocks of a report as Markdown and HTML."""

from __future__ import annotations

import base64
from pathlib import Path

from trainers.reports.report import Heading, Paragraph, Picture, Table, write_page


def test_a_table_escapes_its_cells():
    table = Table(["name", "value"], [["a|b", "<i>"]])
    assert table.markdown() == "| name | value |\n| --- | --- |\n| a\\|b | <i> |"
    assert "<td>a|b</td><td>&lt;i&gt;</td>" in table.html(Path())


def test_both_pages_hold_every_block(tmp_path):
    (tmp_path / "x.png").write_bytes(b"image")
    blocks = [Heading("Results"), Paragraph("1 < 2"), Picture("x.png", "curve"), Table(["a"], [["b"]])]
    html = write_page(tmp_path, "Title", blocks).read_text()
    assert "<h1>Title</h1>" in html
    assert "<h2>Results</h2>" in html
    assert "<p>1 &lt; 2</p>" in html
    assert base64.b64encode(b"image").decode() in html
    markdown = (tmp_path / "report.md").read_text()
    assert markdown.startswith("# Title\n\n## Results\n\n1 < 2\n\n![curve](x.png)\n\n| a |")
