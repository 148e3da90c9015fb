"""Keys and a display for tests, in place of those of a window."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from numpy.typing import ArrayLike


class ScriptedKeys:
    """A key source that yields given keys one at a time, then Escape."""

    def __init__(self, script: Iterable[str]) -> None:
        self._script = list(script)

    def poll(self) -> list[str]:
        return [self._script.pop(0) if self._script else "escape"]

    def escape_pressed(self) -> bool:
        return self._script[:1] == ["escape"]


class RecordingDisplay:
    """A display that only records.

    pages: every list of lines that was written, oldest first. beam: the last line that was drawn, or None.
    """

    def __init__(self, yaw: float = 0.0) -> None:
        self.yaw = yaw
        self.pages: list[list[str]] = []
        self.beam: tuple[ArrayLike, ArrayLike] | None = None

    def write(self, lines: Sequence[str]) -> None:
        self.pages.append(list(lines))

    def draw(self, origin: ArrayLike, target: ArrayLike) -> None:
        self.beam = origin, target

    def clear(self) -> None:
        self.beam = None
