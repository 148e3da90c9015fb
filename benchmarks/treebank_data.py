"""Reads the Robot Commands Treebank (SemEval-2014 task 6): commands, the boards before and after, and a fixed split.

The format is that of the published files: `commands.txt` has a command a line, `configuration.txt` a board a paragraph.
Lines that cannot be read are skipped and counted, so that a damaged file is never mistaken for a smaller one.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

PARTS = ("all", "develop", "held_out")
SPLIT_SEED, HELD_OUT_SHARE = 2014, 0.2
COLORS = {
    "B": "blue",
    "C": "cyan",
    "R": "red",
    "Y": "yellow",
    "G": "green",
    "M": "magenta",
    "X": "gray",
    "W": "white",
}
SHAPES = {"1": "cube", "2": "pyramid"}

Block = tuple[int, int, int, str, str]  # x, y, z in cells, z up; colour; shape


@dataclass(frozen=True)
class BoardState:
    """A board: the arm's position in cells, whether its gripper is closed, and the blocks."""

    arm: tuple[int, int, int]
    closed: bool
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class TreebankSentence:
    """A command and the worlds before and after it; None if the configuration lacks one."""

    number: str
    scene: int
    text: str
    before: BoardState | None
    after: BoardState | None


@dataclass
class Data:
    """The commands of a folder in the file's order, and the lines that could not be read."""

    items: list[TreebankSentence] = field(default_factory=list)
    unreadable: list[str] = field(default_factory=list)


def world_keys(scene: int) -> tuple[tuple[int, int], tuple[int, int]]:
    """Returns the keys (group, index) of the worlds before and after a scene's move.

    The scenes of a pair show the same two worlds: an odd scene leads from the group's first world to the other one,
    the even scene after it leads back. Every "pick up" and "drop" of the develop part agrees with this.
    """
    pair = (scene - 1) // 2
    group, before, after = pair // 4, pair % 4 + 1, 0
    if scene % 2 == 1:
        before, after = after, before
    return (group + 1, before + 1), (group + 1, after + 1)


def read(folder: Path, part: str = "all") -> Data:
    """Returns the commands of one part. Raises OSError if a file is missing."""
    data = Data()
    worlds = dict(_worlds((folder / "configuration.txt").read_text("utf-8", "replace"), data))
    held = held_out_groups({group for group, _ in worlds})
    for line in (folder / "commands.txt").read_text("utf-8", "replace").splitlines():
        words = line.split(None, 2)
        if not words:
            continue
        if len(words) < 2 or not words[1].isdecimal():
            data.unreadable.append(line)
            continue
        scene = int(words[1])
        before, after = world_keys(scene)
        if part == "all" or (before[0] in held) == (part == "held_out"):
            text = words[2] if len(words) == 3 else ""
            data.items.append(TreebankSentence(words[0], scene, text, worlds.get(before), worlds.get(after)))
    return data


def held_out_groups(groups: set[int]) -> set[int]:
    """Returns the groups of worlds that are held out: one fifth, by a fixed seed.

    The five worlds of a group share most of their blocks, so a group is never divided.
    """
    order = sorted(groups)
    random.Random(SPLIT_SEED).shuffle(order)
    return set(order[: round(len(order) * HELD_OUT_SHARE)])


def _worlds(text: str, data: Data) -> Iterator[tuple[tuple[int, int], BoardState]]:
    for paragraph in text.replace("\r", "").split("\n\n"):
        lines = [line for line in paragraph.splitlines() if line.strip()]
        if not lines:
            continue
        try:
            group, index = map(int, lines[0].split())
            x, y, z, grip = lines[1].split()
            blocks = tuple(_block(line) for line in lines[2:])
            yield (group, index), BoardState((int(x), int(y), int(z)), grip == "C", blocks)
        except (ValueError, LookupError):
            data.unreadable.append(lines[0])


def _block(line: str) -> Block:
    x, y, z, color, shape = line.split()
    return int(x), int(y), int(z), COLORS[color], SHAPES[shape]
