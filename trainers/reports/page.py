"""A report as Markdown, with its pictures beside it, and as one HTML file that holds them."""

from __future__ import annotations

import base64
import os
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

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
    text: str

    def markdown(self) -> str:
        return f"## {self.text}"

    def html(self, folder: Path) -> str:
        return f"<h2>{escape(self.text)}</h2>"


@dataclass(frozen=True)
class Paragraph:
    text: str

    def markdown(self) -> str:
        return self.text

    def html(self, folder: Path) -> str:
        return f"<p>{escape(self.text)}</p>"


@dataclass(frozen=True)
class Picture:
    """file: the name of a PNG in the report's directory."""

    file: str
    title: str

    def markdown(self) -> str:
        return f"![{self.title}]({self.file})"

    def html(self, folder: Path) -> str:
        data = base64.b64encode((folder / self.file).read_bytes()).decode()
        return f'<img alt="{escape(self.title)}" src="data:image/png;base64,{data}">'


@dataclass(frozen=True)
class Table:
    header: Sequence[str]
    rows: Sequence[Sequence[str]]

    def markdown(self) -> str:
        lines = [self.header, ["---"] * len(self.header), *self.rows]
        return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)

    def html(self, folder: Path) -> str:
        head = "".join(f"<th>{escape(cell)}</th>" for cell in self.header)
        body = "\n".join("<tr>" + "".join(f"<td>{escape(c)}</td>" for c in row) + "</tr>" for row in self.rows)
        return f'<div class="wide"><table><tr>{head}</tr>\n{body}</table></div>'


Part = Heading | Paragraph | Picture | Table


def write(folder: Path, title: str, parts: Sequence[Part]) -> Path:
    """report.md and report.html in `folder`, where the pictures are. The HTML file."""
    _whole(folder / "report.md", "\n\n".join([f"# {title}", *(part.markdown() for part in parts)]) + "\n")
    body = "\n".join(part.html(folder) for part in parts)
    head = f'<meta charset="utf-8"><title>{escape(title)}</title><style>{STYLE}</style>'
    page = f"<head>{head}</head>\n<body>\n<h1>{escape(title)}</h1>\n{body}\n</body>"
    _whole(folder / "report.html", f'<!doctype html>\n<html lang="en">\n{page}\n</html>\n')
    return folder / "report.html"


def _whole(path: Path, text: str) -> None:
    """Written whole or not at all."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    beside.write_text(text, encoding="utf-8")
    os.replace(beside, path)
