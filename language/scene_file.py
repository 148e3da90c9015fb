"""Scenes as YAML files: lists of objects with ids. Every error is one line that names its place.

- {id: a, noun: cube, color: red, position: [0.5, 0.1, 0.0]}
- {id: t, noun: cube, color: red, position: [0.4, -0.2, 0.0], size: 0.05, role: target}

Boards, with the colours and shapes that only people's words know: `cell` is x (away from the robot), y (to its left)
and z (height), in cells from 0.

held: b
blocks:
  - {id: a, noun: cube, color: magenta, cell: [1, 2, 0]}
  - {id: b, noun: pyramid, color: white, cell: [4, 4, 0]}
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from core.safe_files import FileError, read_yaml
from language.colors import COLORS
from language.errors import LanguageError, check_known
from language.objects import NOUNS, ROLES, SHAPES, Object, Scene
from language.viewpoint import VIEWPOINTS
from language.words import colors
from language.world import BOARD_CELLS, BOARD_HEIGHT, WorldModel, board, table

MAX_OBJECTS = 64  # time and memory to distinguish objects grow with the third power of their number
MAX_BYTES = 64 * 1024  # of a file; MAX_OBJECTS take a quarter of it
MAX_NODES = 4096  # keys and values of a file
MAX_COORDINATE = 1000.0  # metres; also the largest size
REQUIRED, OPTIONAL = ("noun", "color", "position"), ("id", "size", "role")
BOARD_SHAPES = (*SHAPES, "pyramid")
BOARD_COLORS = tuple(dict.fromkeys((*COLORS, *(name for names in colors().values() for name in names))))
_KEYS, _BLOCK_KEYS = ("blocks", "held", "viewpoint", "front"), ("id", "noun", "color", "cell")
_CHOICES: dict[str, Iterable[str]] = {"noun": NOUNS, "color": COLORS, "role": ROLES}
_FORM = "{id, noun, color, position: [x, y, z], size, role}"


class SceneFileError(LanguageError):
    """A scene file that cannot be used. The text names file, object, key, value and what would be right."""


@dataclass(frozen=True)
class NamedScene:
    """A scene whose K objects have ids: K distinct strings, in the scene's order."""

    scene: Scene
    ids: tuple[str, ...]

    def index(self, name: str) -> int:
        """Return the index of the object with this id. Raises LanguageError for an unknown id."""
        check_known("object id", name, self.ids)
        return self.ids.index(name)

    def id(self, index: int | None) -> str | None:
        """Return the id of the object with this index; None for None."""
        return None if index is None else self.ids[index]


def read_scene(path: str | Path, viewpoint: str = "robot") -> NamedScene:
    """Return the scene of a YAML file.

    Positions and sizes are in metres. Defaults: the id is "o" and the position in the list, from 0; the size is 0.05;
    the role is "real". Raises SceneFileError.
    """
    try:
        entries = _load(Path(path))
        objects, ids = _objects(entries)
    except SceneFileError as error:
        raise SceneFileError(f"{path}: {error}") from None
    return NamedScene(Scene(objects, viewpoint), tuple(ids))


def as_entries(named: NamedScene) -> list[dict[str, Any]]:
    """Return the entries of a scene file; positions are rounded to tenths of a millimetre."""
    return [
        {
            "id": name,
            "noun": thing.noun,
            "color": thing.color,
            "position": [round(x, 4) for x in thing.position],
            "size": thing.size,
            "role": thing.role,
        }
        for name, thing in zip(named.ids, named.scene, strict=True)
    ]


def _load(path: Path) -> list:
    try:
        loaded = read_yaml(path, MAX_BYTES, MAX_NODES)
    except FileError as error:
        raise SceneFileError(str(error)) from None
    if not isinstance(loaded, list):
        raise SceneFileError(f"must be a list of objects {_FORM}, not {_shown(loaded)}")
    if not 0 < len(loaded) <= MAX_OBJECTS:
        raise SceneFileError(f"lists {len(loaded)} objects; give 1 to {MAX_OBJECTS}")
    return loaded


def _objects(entries: list) -> tuple[list[Object], list[str]]:
    objects: list[Object] = []
    ids: list[str] = []
    for index, entry in enumerate(entries):
        where = f"object {index + 1}"
        if not isinstance(entry, dict):
            raise SceneFileError(f"{where}: must be {_FORM}, not {_shown(entry)}")
        try:
            name = _id(entry.get("id", f"o{index}"), ids)
            where += f" ({name!r})"
            objects.append(_object(entry))
        except LanguageError as error:
            raise SceneFileError(f"{where}: {error}") from None
        ids.append(name)
    return objects, ids


def _id(name: Any, taken: list[str]) -> str:
    if not isinstance(name, str):
        raise SceneFileError(f"id {_shown(name)} must be text; put it in quotes")
    if not name.strip() or not name.isprintable() or len(name) > 40:
        raise SceneFileError(f"id {_shown(name)} must be 1 to 40 printable characters")
    if name in taken:
        raise SceneFileError(f"id {name!r} is taken by object {taken.index(name) + 1}; give each one its own")
    return name


def _object(entry: dict) -> Object:
    for key in entry:
        if key not in (*REQUIRED, *OPTIONAL):
            check_known("key of an object", key if isinstance(key, str) else _shown(key), (*REQUIRED, *OPTIONAL))
    for key in REQUIRED:
        if key not in entry:
            raise SceneFileError(f"{key} is missing; an object needs {', '.join(REQUIRED)}")
    words = {key: _word(key, entry.get(key, "real"), choices) for key, choices in _CHOICES.items()}
    x, y, z = _position(entry["position"])
    size = _number("size", entry.get("size", 0.05))
    if size <= 0:
        raise SceneFileError(f"size {size} must be above 0 metres")
    return Object(words["noun"], words["color"], (x, y, z), size, words["role"])


def _word(key: str, value: Any, choices: Iterable[str]) -> str:
    if not isinstance(value, str):
        raise SceneFileError(f"{key} {_shown(value)} must be a word: {', '.join(choices)}")
    try:
        check_known(key, value, choices)
    except LanguageError as error:
        raise SceneFileError(f"{key} {error}") from None
    return value


def _position(value: Any) -> list[float]:
    if not isinstance(value, list):
        raise SceneFileError(f"position {_shown(value)} must be a list of three numbers [x, y, z] in metres")
    if len(value) != 3:
        raise SceneFileError(f"position {_shown(value)} has {len(value)} numbers; give three, [x, y, z] in metres")
    return [_number(f"position[{axis}]", number) for axis, number in enumerate(value)]


def _number(key: str, value: Any) -> float:
    """Return the value as a finite number of metres. Raises SceneFileError."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise SceneFileError(f"{key} {_shown(value)} must be a number of metres{_as_number(value)}")
    if not -MAX_COORDINATE <= value <= MAX_COORDINATE or math.isnan(value):
        raise SceneFileError(
            f"{key} {_shown(value)} must be a number from {-MAX_COORDINATE:g} to {MAX_COORDINATE:g} metres"
        )
    return float(value)


def _as_number(text: Any) -> str:
    """Return a hint for text that looks like a number but is a string in YAML, such as 1e-1."""
    try:
        number = float(text) if isinstance(text, str) else math.nan
    except ValueError:
        return ""
    return f"; write {number}" if math.isfinite(number) else ""


def _shown(value: Any) -> str:
    """Return the value as text, truncated if it is long or deeply nested."""
    try:
        return "nothing" if value is None else reprlib.repr(value)
    except ValueError:  # Python does not convert integers of more than 4300 digits
        return "a number of thousands of digits"


def read_world(path: str | Path) -> tuple[WorldModel, tuple[str, ...]]:
    """Return the world of a file, a board's or a table's, and the ids of its things. Raises SceneFileError."""
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


def _board(loaded: dict[str, Any]) -> tuple[WorldModel, tuple[str, ...]]:
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
