"""A report as Markdown with image files, and as one HTML file with embedded images."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from trainers.utils.atomic_io import write_text

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; max-width: 1200px; margin: 2em auto; padding: 0 1em; color: #222; }
img { max-width: 100%; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 13px; margin: 1em 0; }
th, td { border-bottom: 1px solid #ddd; padding: 4px 9px; text-align: left; vertical-align: top; }
th { border-bottom: 2px solid #888; }
"""


@dataclass(frozen=True)
class Heading:
    """A heading of the second level."""

    text: str

    def markdown(self) -> str:
        return f"## {self.text}"

    def html(self, folder: Path) -> str:
        return f"<h2>{escape(self.text)}</h2>"


@dataclass(frozen=True)
class Paragraph:
    """A paragraph of plain text."""

    text: str

    def markdown(self) -> str:
        return self.text

    def html(self, folder: Path) -> str:
        return f"<p>{escape(self.text)}</p>"


@dataclass(frozen=True)
class Picture:
    """An image. file: the name of a PNG in the report's directory. title: alternative text."""

    file: str
    title: str

    def markdown(self) -> str:
        return f"![{self.title}]({self.file})"

    def html(self, folder: Path) -> str:
        data = base64.b64encode((folder / self.file).read_bytes()).decode()
        return f'<img alt="{escape(self.title)}" src="data:image/png;base64,{data}">'


@dataclass(frozen=True)
class Table:
    """A table of text cells."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]

    def markdown(self) -> str:
        lines = [self.header, ["---"] * len(self.header), *self.rows]
        return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)

    def html(self, folder: Path) -> str:
        head = "".join(f"<th>{escape(cell)}</th>" for cell in self.header)
        body = "\n".join("<tr>" + "".join(f"<td>{escape(c)}</td>" for c in row) + "</tr>" for row in self.rows)
        return f'<div class="wide"><table><tr>{head}</tr>\n{body}</table></div>'


Block = Heading | Paragraph | Picture | Table


def write_page(folder: Path, title: str, blocks: Sequence[Block]) -> Path:
    """Write report.md and report.html to `folder`, which holds the images.

    Returns:
        The path of the HTML file.
    """
    write_text(folder / "report.md", "\n\n".join([f"# {title}", *(block.markdown() for block in blocks)]) + "\n")
    body = "\n".join(block.html(folder) for block in blocks)
    head = f'<meta charset="utf-8"><title>{escape(title)}</title><style>{STYLE}</style>'
    page = f"<head>{head}</head>\n<body>\n<h1>{escape(title)}</h1>\n{body}\n</body>"
    write_text(folder / "report.html", f'<!doctype html>\n<html lang="en">\n{page}\n</html>\n')
    return folder / "report.html"
