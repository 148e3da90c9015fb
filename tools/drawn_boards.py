"""Pictures of printed boards and markers as a camera takes them: exact, anti-aliased, with noise and blur."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.cameras import Camera, CameraFrame
from envs.perception.camera_files import Lens, Picture
from envs.perception.printed_board import CELLS, COLUMNS, MARKER_SHARE, ROWS, PrintedBoard, marker_cells

Array = NDArray[np.float64]
SUPERSAMPLING = 4
UNBENDING = 8  # iterations
PAPER, INK, MARGIN = 235.0, 25.0, 0.012  # gray levels, and metres of white around what is printed


@dataclass(frozen=True)
class Print:
    """What is printed on a sheet. cells: (R, C) bool, which are white. side: of a cell, metres."""

    cells: NDArray[np.bool_]
    side: float

    @classmethod
    def of_board(cls, board: PrintedBoard) -> Print:
        """Return a board. A cell is a twenty-fourth of a square, so that markers have whole cells."""
        fine = 24
        image = np.ones((ROWS * fine, COLUMNS * fine), bool)
        edge, unit = round((1 - MARKER_SHARE) / 2 * fine), round(MARKER_SHARE * fine / CELLS)
        numbers = iter(range(COLUMNS * ROWS))
        for row in range(ROWS):
            for column in range(COLUMNS):
                top, left = row * fine, column * fine
                if (row + column) % 2 == 0:
                    image[top : top + fine, left : left + fine] = False
                else:
                    marker = np.kron(marker_cells(next(numbers)), np.ones((unit, unit), bool))
                    inside = slice(edge, edge + len(marker))
                    image[top : top + fine, left : left + fine][inside, inside] = marker
        return cls(image, board.square / fine)

    @classmethod
    def of_marker(cls, number: int, side: float) -> Print:
        """Return a marker of this side, metres."""
        return cls(marker_cells(number), side / CELLS)

    @property
    def size(self) -> Array:
        """(2,) width and height, metres."""
        return self.side * np.array(self.cells.shape[::-1])


def gray(camera: Camera) -> Picture:
    """Return an empty picture, as of a gray table."""
    return np.full((camera.height, camera.width, 3), 150, np.uint8)


def lens_of(camera: Camera) -> Lens:
    """Return the ideal lens of a camera."""
    return Lens.ideal(camera.fov, camera.width, camera.height)


def draw(
    picture: Picture,
    sheet: Print,
    to_camera: Array,
    lens: Lens,
    depths: NDArray[np.float32] | None = None,
    supersampling: int = SUPERSAMPLING,
) -> Picture:
    """Return a picture (H, W, 3) with a sheet drawn into it.

    Args:
        picture: what is behind.
        sheet: whose frame is that of its print: x right, y down, from the upper left corner, metres.
        to_camera: (4, 4) from the sheet's frame into the camera's.
        lens: of the camera.
        depths: (H, W) metres of what is in the picture: what is nearer than the sheet covers it; None: nothing does.
        supersampling: rays of a pixel along each side.
    """
    window = _window(sheet, to_camera, lens)
    part = picture[window]
    near = None if depths is None else depths[window]
    total = np.zeros(part.shape, np.float64)
    steps = (np.arange(supersampling) + 0.5) / supersampling
    for down in steps:
        for right in steps:
            value, covered = _sampled(sheet, to_camera, _rays(lens, (right, down), window), near)
            total += np.where(covered[..., None], value[..., None], part)
    drawn = picture.copy()
    drawn[window] = np.rint(total / supersampling**2)
    return drawn


def _window(sheet: Print, to_camera: Array, lens: Lens) -> tuple[slice, slice]:
    """Return the rows and columns of a picture in which a sheet can be."""
    along = np.linspace(-1, 1, 9)
    grid = np.stack(np.meshgrid(along, along), -1).reshape(-1, 2) * (sheet.size / 2 + MARGIN) + sheet.size / 2
    inside = np.pad(grid, ((0, 0), (0, 1))) @ to_camera[:3, :3].T + to_camera[:3, 3]
    if (inside[:, 2] < 0.01).any():
        return slice(0, lens.height), slice(0, lens.width)
    pixels = lens.project(inside)
    low = np.clip(np.floor(pixels.min(0)).astype(int) - 3, 0, [lens.width, lens.height])
    high = np.clip(np.ceil(pixels.max(0)).astype(int) + 4, 0, [lens.width, lens.height])
    return slice(low[1], high[1]), slice(low[0], high[0])


def _sampled(
    sheet: Print, to_camera: Array, rays: Array, depths: NDArray[np.float32] | None
) -> tuple[Array, NDArray[np.bool_]]:
    """Return gray levels and whether the sheet is seen, (h, w) each, along rays (h, w, 3)."""
    normal, corner = to_camera[:3, 2], to_camera[:3, 3]
    facing = rays @ normal
    depth = np.where(np.abs(facing) > 1e-9, (corner @ normal) / np.where(np.abs(facing) > 1e-9, facing, 1.0), -1.0)
    places = (rays * depth[..., None] - corner) @ to_camera[:3, :2]
    columns, rows = np.floor(places[..., 0] / sheet.side).astype(int), np.floor(places[..., 1] / sheet.side).astype(int)
    high, wide = sheet.cells.shape
    printed = (columns >= 0) & (columns < wide) & (rows >= 0) & (rows < high)
    white = sheet.cells[np.clip(rows, 0, high - 1), np.clip(columns, 0, wide - 1)] | ~printed
    covered = (depth > 0) & (places > -MARGIN).all(-1) & (places < sheet.size + MARGIN).all(-1)
    if depths is not None:
        covered &= depth < depths + 0.002
    return np.where(white, PAPER, INK), covered


def _rays(lens: Lens, shift: tuple[float, float], window: tuple[slice, slice]) -> Array:
    """Return directions (h, w, 3) with depth 1 in the camera's frame, of one place in every pixel of a window."""
    high, wide = window
    columns, rows = np.meshgrid(
        np.arange(wide.start, wide.stop) + shift[0], np.arange(high.start, high.stop) + shift[1]
    )
    if lens.is_ideal:
        across = (np.stack((columns, rows), -1) - np.array(lens.middle)) / lens.focal
    else:
        bent = (np.stack((columns, rows), -1) - np.array(lens.middle)) / lens.focal
        across = bent.copy()
        for _ in range(UNBENDING):  # the lens bends little, so that this converges
            ahead = np.concatenate((across, np.ones_like(across[..., :1])), -1).reshape(-1, 3)
            seen = (lens.project(ahead).reshape(across.shape) - np.array(lens.middle)) / lens.focal
            across += bent - seen
    return np.concatenate((across, np.ones_like(across[..., :1])), -1)


def board_to_camera(frame: CameraFrame, at: Array, turn: float, board: PrintedBoard) -> Array:
    """Return the transform (4, 4) from the frame of a board that lies on the table into that of a camera."""
    origin, right, down = board.points(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), at, turn)
    matrix = np.eye(4)
    axes = np.column_stack((right - origin, down - origin, np.cross(right - origin, down - origin)))
    matrix[:3, :3], matrix[:3, 3] = frame.axes @ axes, frame.axes @ (origin - frame.place)
    return matrix


def worn(picture: Picture, rng: np.random.Generator, noise: float = 4.0, blur: float = 0.6, motion: int = 0) -> Picture:
    """Return a picture with blur (standard deviation, pixels), motion along rows (pixels), uneven light and noise."""
    image: Any = picture.astype(np.float64)
    if blur:
        image = cv2.GaussianBlur(image, (0, 0), blur)
    if motion > 1:
        image = cv2.blur(image, (motion, 1))
    light = np.linspace(rng.uniform(0.75, 1.05), rng.uniform(0.75, 1.05), picture.shape[1])[None, :, None]
    return np.clip(np.rint(image * light + rng.normal(0, noise, picture.shape)), 0, 255).astype(np.uint8)


def resized(camera: Camera, width: int, height: int) -> Camera:
    """Return a camera with this size and the same vertical field of view."""
    return replace(camera, width=width, height=height)
