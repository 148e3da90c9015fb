"""The pictures of docs/architecture.md: `python -m tools.architecture` draws them anew from the tables of the page.

A table with the columns process, where, what it does and hands on becomes one SVG: a lane for each process, a box for
each hop, and what is handed on beside the arrow.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "architecture.md"
HEADER = "| process | where | what it does | hands on |"
PLACE = re.compile(r"`([\w/]+\.py):([\w.]+)`")
LANE, ROW, BOX, MARGIN = 330, 102, (290, 72), 20  # pixels: widths, heights
COLORS = ("#2f6db5", "#b5652f", "#4c8a3f", "#7a4fa3")  # of the lanes
STYLE = "font-family='system-ui, sans-serif'"


class Hop(NamedTuple):
    """One row of a table: where something is done, in which process, and what is handed on."""

    process: str
    file: str
    function: str
    does: str
    hands_on: str


def places(text: str) -> list[tuple[str, str]]:
    """Return each `file:function` that a page names."""
    return PLACE.findall(text)


def pictures(text: str) -> Iterator[tuple[str, list[Hop]]]:
    """Yield the file name of each picture of the page, with the hops of the table below it."""
    for part in text.split("![")[1:]:
        name = re.search(r"\]\((\w+\.svg)\)", part)
        if name and HEADER in part:
            rows = part.split(HEADER)[1].strip().splitlines()[1:]
            yield name[1], [_hop(row) for row in _until_blank(rows)]


def _until_blank(rows: list[str]) -> list[str]:
    return rows[: next((i for i, row in enumerate(rows) if not row.startswith("|")), len(rows))]


def _hop(row: str) -> Hop:
    process, where, does, hands_on = (cell.strip() for cell in row.strip("|").split("|"))
    (file, function) = places(where)[0]
    return Hop(process, file, function, does.replace("`", ""), hands_on.replace("`", ""))


def svg(hops: list[Hop]) -> str:
    """Draw hops from top to bottom, each in the lane of its process."""
    lanes = list(dict.fromkeys(hop.process for hop in hops))
    width, height = LANE * len(lanes) + 2 * MARGIN, ROW * len(hops) + 3 * MARGIN
    parts = [
        f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {width} {height}' width='{width}' {STYLE}>",
        f"<rect width='{width}' height='{height}' rx='8' fill='#ffffff'/>",
        "<defs><marker id='tip' viewBox='0 0 8 8' refX='7' refY='4' markerWidth='7' markerHeight='7' orient='auto'>"
        "<path d='M0 0 8 4 0 8z' fill='#555555'/></marker></defs>",
    ]
    for i, lane in enumerate(lanes):
        x = MARGIN + LANE * i + BOX[0] / 2
        parts.append(_text(x, 22, lane, size=14, color=COLORS[i], weight="bold"))
    for i, hop in enumerate(hops):
        parts += _box(hop, *_corner(i, hop, lanes), COLORS[lanes.index(hop.process)])
        if i + 1 < len(hops):
            parts += _arrow(hop, _corner(i, hop, lanes), _corner(i + 1, hops[i + 1], lanes))
    return "\n".join([*parts, "</svg>", ""])


def _corner(index: int, hop: Hop, lanes: list[str]) -> tuple[float, float]:
    """The upper left corner of a box."""
    return MARGIN + LANE * lanes.index(hop.process), 2 * MARGIN - 4 + ROW * index


def _box(hop: Hop, x: float, y: float, color: str) -> list[str]:
    width, height = BOX
    middle, lines = x + width / 2, textwrap.wrap(hop.does, 50)[:2]
    return [
        f"<rect x='{x}' y='{y}' width='{width}' height='{height}' rx='6' fill='#f7f7f9' stroke='{color}'/>",
        _text(middle, y + 16, hop.function, size=12, weight="bold"),
        _text(middle, y + 30, hop.file, size=10, color="#666666"),
        *(_text(middle, y + 47 + 14 * i, line, size=11) for i, line in enumerate(lines)),
    ]


def _arrow(hop: Hop, one: tuple[float, float], other: tuple[float, float]) -> list[str]:
    """The arrow from a box to the next one, and what is handed on."""
    middle = BOX[0] / 2
    x0, y0, x1, y1 = one[0] + middle, one[1] + BOX[1], other[0] + middle, other[1]
    line = f"<path d='M{x0} {y0} L{x1} {y1 - 2}' stroke='#555555' fill='none' marker-end='url(#tip)'/>"
    side = 8 if x1 <= x0 else -8
    return [
        line,
        _text(x0 + side, y0 + 18, hop.hands_on, size=11, anchor="start" if side > 0 else "end", color="#555555"),
    ]


def _text(
    x: float,
    y: float,
    text: str,
    *,
    size: int,
    color: str = "#222222",
    weight: str = "normal",
    anchor: str = "middle",
) -> str:
    style = f"font-size='{size}' font-weight='{weight}' fill='{color}' text-anchor='{anchor}'"
    return f"<text x='{x}' y='{y}' {style}>{escape(text)}</text>"


def main() -> None:
    """Draw every picture of the page."""
    for name, hops in pictures(PAGE.read_text("utf-8")):
        (PAGE.parent / name).write_text(svg(hops), "utf-8")
        print(PAGE.parent / name)


if __name__ == "__main__":
    main()
