"""Boards as YAML files, with the colours and shapes that only the wide grammar knows.

    held: b
    blocks:
      - {id: a, noun: cube, color: magenta, cell: [1, 2, 0]}
      - {id: b, noun: pyramid, color: white, cell: [4, 4, 0]}

`cell` is x (away from the robot), y (to its left) and z (height), in cells from 0. A list of objects is a table's scene
(`language/scene_file.py`).
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from core.safe_files import FileError, read_yaml
from language.colors import COLORS
from language.commands.nouns import NEAR_COLORS, phrases
from language.commands.world import BOARD_CELLS, BOARD_HEIGHT, World, board, table
from language.errors import LanguageError, check_known
from language.objects import SHAPES
from language.scene_file import SceneFileError, read_scene
from language.viewpoint import VIEWPOINTS

BOARD_SHAPES = (*SHAPES, "pyramid")
BOARD_COLORS = tuple(dict.fromkeys((*COLORS, *(name for names in NEAR_COLORS.values() for name in phrases(names)))))
_KEYS, _BLOCK_KEYS = ("blocks", "held", "viewpoint", "front"), ("id", "noun", "color", "cell")


def read_world(path: str | Path) -> tuple[World, tuple[str, ...]]:
    """Returns the world of a file, a board's or a table's, and the ids of its things. Raises SceneFileError."""
    try:
        loaded = read_yaml(Path(path))
    except FileError:
        loaded = None  # `read_scene` says what is wrong with the file
    if not isinstance(loaded, dict):
        named = read_scene(path)
        return table(named.scene), named.ids
    try:
        return _board(loaded)
    except LanguageError as error:
        raise SceneFileError(f"{path}: {error}") from None


def _board(loaded: dict[str, Any]) -> tuple[World, tuple[str, ...]]:
    _check_keys(loaded, _KEYS, ("blocks",))
    if not isinstance(loaded["blocks"], list) or len(loaded["blocks"]) > BOARD_CELLS**2 * BOARD_HEIGHT:
        raise SceneFileError(f"blocks must be a list of at most {BOARD_CELLS**2 * BOARD_HEIGHT} blocks")
    blocks, ids = [], []
    for number, entry in enumerate(loaded["blocks"], 1):
        try:
            blocks.append(_block(entry))
        except LanguageError as error:
            raise SceneFileError(f"block {number}: {error}") from None
        ids.append(str(entry.get("id", f"o{number - 1}")))
    if len(set(ids)) < len(ids):
        raise SceneFileError("ids must be distinct")
    held = loaded.get("held")
    if held is not None:
        check_known("held", str(held), ids)
    viewpoint, front = loaded.get("viewpoint", "robot"), loaded.get("front", "near")
    check_known("viewpoint", viewpoint, VIEWPOINTS)
    check_known("front", front, ("near", "far"))
    index = None if held is None else ids.index(str(held))
    return board(blocks, index, front, viewpoint=viewpoint), tuple(ids)


def _block(entry: Any) -> tuple[str, str, int, int, int]:
    if not isinstance(entry, dict):
        raise SceneFileError(f"must be {{{', '.join(_BLOCK_KEYS)}}}")
    _check_keys(entry, _BLOCK_KEYS, ("noun", "color", "cell"))
    check_known("noun", str(entry["noun"]), BOARD_SHAPES)
    check_known("color", str(entry["color"]), BOARD_COLORS)
    cell, most = entry["cell"], (BOARD_CELLS, BOARD_CELLS, BOARD_HEIGHT)
    whole = isinstance(cell, list) and len(cell) == 3 and all(type(x) is int for x in cell)
    if not whole or not all(0 <= x < limit for x, limit in zip(cell, most, strict=True)):
        raise SceneFileError(f"cell={cell} must be three whole numbers [x, y, z] from 0 to {BOARD_CELLS - 1}")
    return entry["noun"], entry["color"], *cell


def _check_keys(entry: dict, known: Iterable[str], needed: Iterable[str]) -> None:
    for key in entry:
        check_known("key", str(key), known)
    for key in needed:
        if key not in entry:
            raise SceneFileError(f"{key} is missing")
