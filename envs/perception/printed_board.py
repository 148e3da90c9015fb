"""What is printed for calibration: a ChArUco board, and an ArUco marker that a gripper carries.

A board lies on the table. Its own frame is that of its page: x to the right, y down, from the upper left corner of the
chessboard, metres. `PrintedBoard.points` places it in the workspace.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.errors import ConfigError
from core.schema import Checked, within
from core.system import import_optional

Array = NDArray[np.float64]
COLUMNS, ROWS = 5, 7  # squares
SQUARE = 0.036  # metres: such a board fits A4 and letter
MARKER_SHARE = 0.75  # of a square's side
GRIPPER_MARKER = 49  # number of the marker in the dictionary; the board has the lowest ones
GRIPPER_SIDE = 0.04  # metres
CELLS = 6  # of a marker's side: four bits, and one of the border on each side
PAPERS = {"a4": (210.0, 297.0), "letter": (215.9, 279.4), "a3": (297.0, 420.0)}  # millimetres
POINT = 25.4 / 72  # millimetres of a unit of PDF
RULER = 150.0  # millimetres
Rectangle = tuple[float, float, float, float]  # left, top, width, height, millimetres from the page's upper left corner


def opencv() -> Any:
    """Return the module cv2. Raises ConfigError if it is not installed."""
    (cv2,) = import_optional("cv2", extra="eyes", what="calibrations")
    return cv2


def dictionary() -> Any:
    """Return the dictionary of the markers."""
    return opencv().aruco.getPredefinedDictionary(opencv().aruco.DICT_4X4_50)


@dataclass(frozen=True, kw_only=True)
class PrintedBoard(Checked):
    """A board of COLUMNS x ROWS squares. square: the side of one, metres, as measured on paper."""

    square: float = within(0.005, 0.5, default=SQUARE)

    @cached_property
    def charuco(self) -> Any:
        """OpenCV's board."""
        size = (COLUMNS, ROWS)
        return opencv().aruco.CharucoBoard(size, self.square, MARKER_SHARE * self.square, dictionary())

    @property
    def size(self) -> Array:
        """(2,) width and height, metres."""
        return self.square * np.array([COLUMNS, ROWS])

    @property
    def corners(self) -> Array:
        """(N, 2) the inner corners of the chessboard, in the board's frame."""
        return np.asarray(self.charuco.getChessboardCorners(), np.float64)[:, :2]

    def points(self, corners: Array, at: Array, turn: float) -> Array:
        """Return points (N, 3) of the workspace, given points (N, 2) in the board's frame.

        Args:
            corners: in the board's frame, metres.
            at: (3,) where its middle is, metres.
            turn: degrees counterclockwise from above; 0: the page's upper edge is the far one from the robot.
        """
        right, down = (corners - self.size / 2).T
        angle = np.radians(turn)
        cosine, sine = np.cos(angle), np.sin(angle)
        flat = np.column_stack((-down, -right)) @ np.array([[cosine, sine], [-sine, cosine]])
        return np.column_stack((flat, np.zeros(len(flat)))) + at

    def rectangles(self, paper: str) -> list[Rectangle]:
        """Return the black rectangles of the board in the middle of a page."""
        side = 1000 * self.square
        left, top = (np.array(PAPERS[paper]) - 1000 * self.size) / 2
        cells = [(column, row) for row in range(ROWS) for column in range(COLUMNS)]
        black = [(left + c * side, top + r * side, side, side) for c, r in cells if (c + r) % 2 == 0]
        for number, (column, row) in enumerate((c, r) for c, r in cells if (c + r) % 2):
            edge = (1 - MARKER_SHARE) / 2 * side
            corner = (left + column * side + edge, top + row * side + edge)
            black += marker_rectangles(number, corner, MARKER_SHARE * side)
        return black


def marker_rectangles(number: int, corner: tuple[float, float], side: float) -> list[Rectangle]:
    """Return the black cells of a marker whose upper left corner is here, joined along rows; millimetres."""
    cells, unit = marker_cells(number), side / CELLS
    found = []
    for row in range(CELLS):
        column = 0
        while column < CELLS:
            end = column
            while end < CELLS and not cells[row, end]:
                end += 1
            if end > column:
                found.append((corner[0] + column * unit, corner[1] + row * unit, (end - column) * unit, unit))
            column = max(end, column + 1)
    return found


def marker_cells(number: int) -> NDArray[np.bool_]:
    """Return which cells (CELLS, CELLS) of a marker are white."""
    return np.asarray(opencv().aruco.generateImageMarker(dictionary(), number, CELLS)) > 127


# ---- the PDF


def pdf(board: PrintedBoard, paper: str) -> bytes:
    """Return a PDF with the board, and a page with the gripper's marker. Raises ConfigError if it is too large."""
    width, height = PAPERS[paper]
    if (1000 * board.size > np.array([width, height]) - 2 * 10.0).any():
        most = min((width - 20) / COLUMNS, (height - 20) / ROWS) / 1000
        raise ConfigError(f"square={board.square} is too large for paper={paper}: at most {most:.4f}")
    return _document([_board_page(board, paper), _marker_page(paper)], width, height)


def _board_page(board: PrintedBoard, paper: str) -> str:
    width, height = PAPERS[paper]
    top = (height - 1000 * board.size[1]) / 2
    middle, side = width / 2, 1000 * board.square
    ticks: list[Rectangle] = [(middle - 0.1, top - 5, 0.2, 4), (middle - 0.1, height - top + 1, 0.2, 4)]
    left = (width - 1000 * board.size[0]) / 2
    ticks += [(left - 5, height / 2 - 0.1, 4, 0.2), (width - left + 1, height / 2 - 0.1, 4, 0.2)]
    return "\n".join(
        [
            *_drawn(board.rectangles(paper) + ticks, width, height),
            _text(f"this edge away from the robot (+x). One square: {side:.2f} mm", left, top - 7, height),
            _text(
                "print at 100 %; lay it flat; at=[x,y] is where its middle is, by the ticks",
                left,
                height - top + 9,
                height,
            ),
        ]
    )


def _marker_page(paper: str) -> str:
    width, height = PAPERS[paper]
    side = 1000 * GRIPPER_SIDE
    corner = ((width - side) / 2, height / 3)
    ruler = [((width - RULER) / 2, height / 2 + 20, RULER, 2.0)]
    return "\n".join(
        [
            *_drawn(marker_rectangles(GRIPPER_MARKER, corner, side) + ruler, width, height),
            _text(
                f"for the gripper: {side:.0f} mm, with a white border of at least 5 mm",
                corner[0] - 20,
                corner[1] - 8,
                height,
            ),
            _text(
                f"this bar is {RULER:.0f} mm long; where it is not, give square= and marker= as measured",
                30,
                ruler[0][1] + 8,
                height,
            ),
        ]
    )


def _drawn(rectangles: list[Rectangle], width: float, height: float) -> list[str]:
    """Return operators that fill rectangles. PDF's y goes up from the lower edge."""
    lines = ["0 g"]
    for left, top, wide, high in rectangles:
        numbers = (left / POINT, (height - top - high) / POINT, wide / POINT, high / POINT)
        lines.append(" ".join(f"{number:.4f}" for number in numbers) + " re f")
    return lines


def _text(words: str, left: float, baseline: float, height: float) -> str:
    escaped = words.replace("\\", "\\\\").replace("(", "\\(").replace(")", "\\)")
    return f"BT /F1 9 Tf {left / POINT:.2f} {(height - baseline) / POINT:.2f} Td ({escaped}) Tj ET"


def _document(pages: list[str], width: float, height: float) -> bytes:
    """Return a PDF of these content streams, all of one page size in millimetres."""
    count = len(pages)
    kids = " ".join(f"{4 + 2 * index} 0 R" for index in range(count))
    box = f"[0 0 {width / POINT:.3f} {height / POINT:.3f}]"
    objects = [
        "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
        f"<< /Type /Pages /Kids [{kids}] /Count {count} >>",
        "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
    ]
    for index, content in enumerate(pages):
        resources = f"/Resources << /Font << /F1 3 0 R >> >> /Contents {5 + 2 * index} 0 R"
        objects.append(f"<< /Type /Page /Parent 2 0 R /MediaBox {box} {resources} >>")
        objects.append(f"<< /Length {len(content)} >>\nstream\n{content}\nendstream")
    text, offsets = "%PDF-1.4\n", []
    for number, body in enumerate(objects, 1):
        offsets.append(len(text))
        text += f"{number} 0 obj\n{body}\nendobj\n"
    table = "".join(f"{offset:010d} 00000 n \n" for offset in offsets)
    size, start = len(objects) + 1, len(text)
    text += f"xref\n0 {size}\n0000000000 65535 f \n{table}trailer\n<< /Size {size} /Root 1 0 R >>\n"
    text += f"startxref\n{start}\n%%EOF\n"
    return text.encode("ascii")
