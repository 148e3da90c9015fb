"""The moves of the Robot Commands Treebank on real physics: does the arm get from each board to the next?

    python -m benchmarks.rearrange --data FOLDER --robot kuka --jobs 2

FOLDER has `commands.txt` and `configuration.txt`. Each scene is laid out as the board before, the scripted expert
carries out the move that leads to the board after, and the scene counts as right if every block is then within half a
cell of where that board has it, at the right level, and held or not as there. Words are not read.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from tensordict import TensorDict

from benchmarks.treebank_data import PARTS, Block, World, read
from conf.overrides import compose
from envs import read_env
from envs.experts.moves import Move, carry_out
from envs.tasks import EpisodeSpec
from envs.tasks.grid import Grid
from envs.tasks.rearrange import SHAPES
from envs.tasks.types import GripperStart
from envs.workspace_env import WorkspaceEnv
from language import COLORS, NOUNS, Scene

SIZES = (16, 40, 120)  # blocks: a world is made for as many, since parked ones cost time as well
SETTLING = 10  # control steps after the move
NEAREST = {"magenta": "purple", "white": "pink"}  # colours that the language lacks; physics does not see them
ENOUGH = 0.97


@dataclass(frozen=True)
class Board:
    """A scene of the Treebank: the boards before and after, and which block of the first one goes where."""

    number: int
    before: World
    after: World
    moved: int
    goal: Block

    @property
    def kind(self) -> str:
        """move, take or drop."""
        return "take" if self.after.closed else "drop" if self.before.closed else "move"


def boards(folder: Path, part: str) -> list[Board]:
    """The scenes in which exactly one block differs, in the order of their numbers. Raises OSError."""
    known = {item.scene: (item.before, item.after) for item in read(folder, part).items}
    return [board for number in sorted(known) if (board := _board(number, *known[number])) is not None]


def _board(number: int, before: World | None, after: World | None) -> Board | None:
    if before is None or after is None:
        return None
    gone = list((Counter(before.blocks) - Counter(after.blocks)).elements())
    come = list((Counter(after.blocks) - Counter(before.blocks)).elements())
    if len(gone) != 1 or len(come) != 1:
        return None
    return Board(number, before, after, before.blocks.index(gone[0]), come[0])


def episode(board: Board, grid: Grid) -> EpisodeSpec:
    """The board before as an episode."""
    blocks = board.before.blocks
    scene = Scene.from_arrays(
        [list(NOUNS).index("cube")] * len(blocks),
        [list(COLORS).index(NEAREST.get(color, color)) for *_, color, _ in blocks],
        [grid.place(x, y, z) for x, y, z, *_ in blocks],
        grid.size,
    )
    shapes = np.array([SHAPES.index(shape) for *_, shape in blocks])
    start = GripperStart(np.zeros(3), held=True) if board.before.closed else None
    everything = np.ones(len(blocks), bool)
    return EpisodeSpec(scene, board.moved, 0, "", shapes=shapes, resting=everything, start=start)


def error(env: WorkspaceEnv, board: Board) -> str:
    """What is wrong after the move was carried out; "" if nothing is."""
    task = env.config.task
    grid = Grid(env.config.workspace.object_area, task.spacing, task.object_size)
    env.start([episode(board, grid)], seed=board.number)
    shown = env.state.objects[0, env.state.shown[0]]
    wanted = np.array([grid.place(x, y, z) for x, y, z, *_ in board.before.blocks])
    order = np.linalg.norm(shown[None] - wanted[:, None], axis=2).argmin(1)  # number of each block among those shown
    wanted[board.moved] = grid.place(*board.goal[:3])
    carry_out(env, [Move(int(order[board.moved]), wanted[board.moved], release=not board.after.closed)])
    for _ in range(SETTLING):
        env.step(TensorDict({"action": env.towards(env.commanded_gripper)}, env.batch_size))
    offset = np.abs(env.state.objects[0, env.state.shown[0]][order] - wanted)
    wrong = (offset[:, :2].max(1) > task.spacing / 2) | (offset[:, 2] > task.object_size / 2)
    held = env.state.held[0] >= 0
    if held != board.after.closed:
        return "held" if held else "not held"
    return "the block" if wrong[board.moved] else f"{wrong.sum()} other blocks" if wrong.any() else ""


def results(given: Sequence[Board], robot: str) -> Iterator[tuple[Board, str]]:
    """Each board with its error."""
    config = read_env(compose(["task=rearrange", f"robot={robot}", "task.curriculum={near: 0, held: 1, placed: 0}"]))
    for few, many in zip((0, *SIZES), SIZES, strict=False):
        chosen = [board for board in given if few < len(board.before.blocks) <= many]
        if chosen:
            sized = replace(config, task=replace(config.task, num_objects=many))
            with closing(WorkspaceEnv(sized)) as env:
                yield from ((board, error(env, board)) for board in chosen)


def _results(work: tuple[Sequence[Board], str]) -> list[tuple[Board, str]]:
    return list(results(*work))


def main() -> int:
    """Prints how many moves were carried out. Returns 1 if those are too few."""
    options = _arguments().parse_args()
    given = boards(options.data, options.part)
    random.Random(0).shuffle(given)
    given = given[: options.count]
    parts = [(given[i :: options.jobs], options.robot) for i in range(options.jobs)]
    with get_context("spawn").Pool(options.jobs) as pool:
        found = [pair for part in pool.imap_unordered(_results, parts) for pair in part]
    right = sum(not wrong for _, wrong in found)
    for kind, count in sorted(Counter(board.kind for board, _ in found).items()):
        print(f"{kind}: {sum(not wrong for board, wrong in found if board.kind == kind)} of {count}")
    if options.errors:
        for board, wrong in sorted((pair for pair in found if pair[1]), key=lambda pair: pair[0].number):
            print(f"scene {board.number}, {board.kind}, {len(board.before.blocks)} blocks: wrong is {wrong}")
    share = right / max(len(found), 1)
    print(f"{options.robot}: {right} of {len(found)} boards reached, {share:.3f}")
    if options.json:
        print(json.dumps({"right": right, "total": len(found), "success": round(share, 4), "robot": options.robot}))
    return int(share < ENOUGH)


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--data", type=Path, required=True, help="folder with commands.txt and configuration.txt")
    parser.add_argument("--part", choices=PARTS, default="all", help="which scenes (all)")
    parser.add_argument("--robot", default="kuka", help="an option of robot= (kuka)")
    parser.add_argument("--count", type=int, help="this many scenes, drawn by a fixed seed (all of them)")
    parser.add_argument("--jobs", type=int, default=2, help="processes (2)")
    parser.add_argument("--errors", action="store_true", help="list the scenes that went wrong")
    parser.add_argument("--json", action="store_true", help="the last line is JSON")
    return parser


if __name__ == "__main__":
    sys.exit(main())
