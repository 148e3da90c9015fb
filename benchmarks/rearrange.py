"""The moves of the Robot Commands Treebank on real physics: does the arm get from each board to the next?

    python -m benchmarks.rearrange --data FOLDER --robot kuka --jobs 2
    python -m benchmarks.rearrange --data FOLDER --words --part develop
    python -m benchmarks.rearrange --data FOLDER --policy rearrange_kuka

FOLDER has `commands.txt` and `configuration.txt`. Each scene is laid out as the board before, the scripted expert
carries out the move that leads to the board after, and the scene counts as right if every block is then within half a
cell of where that board has it, at the right level, and held or not as there.

With `--words`, the expert carries out the steps that `language` understands, for each command of the part.
Commands of one scene with the same steps are carried out once. The place at which a block is held in the air is not
compared then.

With `--policy`, a policy of `task=rearrange` carries out the move in place of the expert, on scenes that have no more
blocks than its task. It observes which block moves, and a see-through target at its place.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from tensordict import TensorDict

from benchmarks.treebank import world_of
from benchmarks.treebank_data import PARTS, Block, BoardState, TreebankSentence, read
from core.overrides import apply, compose
from core.schema import ConfigError
from deixis.policy import LoadedPolicy, load_policy
from envs import read_env
from envs.experts.board import Move, carry_out, moves_of
from envs.tasks import EpisodeSpec
from envs.tasks.board import SHAPES, Grid
from envs.tasks.shared.types import GripperStart
from envs.workspace_env import WorkspaceEnv
from language import COLORS, NOUNS, LanguageError, Plan, Scene, Step
from language.settling import interpret_alone

SIZES = (16, 40, 120)  # blocks: a world is made for as many, since parked ones cost time as well
SETTLING = 10  # control steps after the move
NEAREST = {"magenta": "purple", "white": "pink"}  # colours that the language lacks; physics does not see them
ENOUGH, ENOUGH_OF_POLICY = 0.97, 0.90
TASK = "rearrange"
CURRICULUM = "task.curriculum={near: 0, held: 1, placed: 0}"  # lets an episode begin with a block held


@dataclass(frozen=True)
class Board:
    """A scene of the Treebank: the boards before and after, and which block of the first one goes where."""

    number: int
    before: BoardState
    after: BoardState
    moved: int
    goal: Block

    @property
    def kind(self) -> str:
        """move, take or drop."""
        return "take" if self.after.closed else "drop" if self.before.closed else "move"


@dataclass(frozen=True)
class Job:
    """A board, and the steps that are carried out on it; None: the move that leads to the board after."""

    board: Board
    steps: tuple[Step, ...] | None = None

    @property
    def number(self) -> int:
        """The scene's number."""
        return self.board.number


def boards(folder: Path, part: str) -> list[Board]:
    """Return the scenes in which exactly one block differs, in the order of their numbers. Raises OSError."""
    known = {item.scene: (item.before, item.after) for item in read(folder, part).items}
    return [board for number in sorted(known) if (board := _board(number, *known[number])) is not None]


def _board(number: int, before: BoardState | None, after: BoardState | None) -> Board | None:
    if before is None or after is None:
        return None
    gone = list((Counter(before.blocks) - Counter(after.blocks)).elements())
    come = list((Counter(after.blocks) - Counter(before.blocks)).elements())
    if len(gone) != 1 or len(come) != 1:
        return None
    return Board(number, before, after, before.blocks.index(gone[0]), come[0])


def episode(board: Board, grid: Grid, marked: bool = False) -> EpisodeSpec:
    """Return the board before as an episode. marked: with a see-through target where the block goes."""
    blocks = [*board.before.blocks, *[board.goal] * marked]
    scene = Scene.from_arrays(
        [list(NOUNS).index("cube")] * len(blocks),
        [list(COLORS).index(NEAREST.get(color, color)) for *_, color, _ in blocks],
        [grid.place(x, y, z) for x, y, z, *_ in blocks],
        grid.size,
        np.arange(len(blocks)) >= len(board.before.blocks),
    )
    shapes = np.array([SHAPES.index(shape) for *_, shape in blocks])
    start = GripperStart(np.zeros(3), held=True) if board.before.closed else None
    target, everything = len(blocks) - 1 if marked else None, np.ones(len(blocks), bool)
    return EpisodeSpec(scene=scene, referent=board.moved, shapes=shapes, resting=everything, start=start, target=target)


def begin(env: WorkspaceEnv, board: Board, marked: bool = False) -> tuple[Grid, Sequence[int]]:
    """Lay out the board before; return its cells, and the number of each block among the objects that are shown."""
    task = env.config.task
    grid = Grid(env.config.workspace.object_area, task.spacing, task.object_size)
    env.start([episode(board, grid, marked)], seed=board.number)
    shown = env.state.objects[0, env.state.shown[0]]
    places = np.array([grid.place(x, y, z) for x, y, z, *_ in board.before.blocks])
    return grid, np.linalg.norm(shown[None] - places[:, None], axis=2).argmin(1).tolist()


def moves(job: Job, grid: Grid, order: Sequence[int]) -> list[Move]:
    """Return the moves of a job. order: as `begin` returns it."""
    board = job.board
    if job.steps is None:
        return [Move(order[board.moved], grid.place(*board.goal[:3]), release=not board.after.closed)]
    return moves_of(job.steps, [block[:2] for block in board.before.blocks], order, grid)


def error(env: WorkspaceEnv, job: Job, policy: LoadedPolicy | None = None) -> str:
    """Return the error after the job was carried out, by the expert or by a policy; "" if there is none."""
    grid, order = begin(env, job.board, marked=policy is not None)
    try:
        if policy is not None:
            _act(env, policy)
        else:
            carry_out(env, moves(job, grid, order))
    except LanguageError as problem:
        return str(problem)
    for _ in range(SETTLING):
        env.step(TensorDict({"action": env.towards(env.commanded_gripper)}, env.batch_size))
    return difference(env, job, grid, order)


def difference(env: WorkspaceEnv, job: Job, grid: Grid, order: Sequence[int]) -> str:
    """Return how the present state differs from the board after; "" if it does not."""
    board, task, state = job.board, env.config.task, env.state
    wanted = np.array([grid.place(x, y, z) for x, y, z, *_ in board.before.blocks])
    wanted[board.moved] = grid.place(*board.goal[:3])
    slots = np.flatnonzero(state.shown[0])[order]
    offset = np.abs(state.objects[0, slots] - wanted)
    wrong = (offset[:, :2].max(1) > task.spacing / 2) | (offset[:, 2] > task.object_size / 2)
    if board.after.closed and job.steps is not None:
        wrong[board.moved] = state.held[0] != slots[board.moved]
    held = state.held[0] >= 0
    if held != board.after.closed:
        return "held" if held else "not held"
    return "the block" if wrong[board.moved] else f"{wrong.sum()} other blocks" if wrong.any() else ""


def most_blocks(name: str) -> int:
    """Return the most blocks of the policy's task. Raises ConfigError for a policy of another task than `rearrange`."""
    config = load_policy(name).config
    if (task := config["task"]["name"]) != TASK:
        raise ConfigError(f"--policy {name} was trained with task={task}: choose one of task={TASK}")
    return int(config["task"]["num_objects"])


def policy_env(policy: LoadedPolicy) -> WorkspaceEnv:
    """Return one world as the policy was trained in."""
    return WorkspaceEnv(read_env(apply(policy.config, [CURRICULUM])))


def _act(env: WorkspaceEnv, policy: LoadedPolicy) -> bool:
    """Have the policy act until the episode that has begun ends; return whether in success."""
    hold = env.towards(env.commanded_gripper)
    observed = env.step(TensorDict({"action": hold}, env.batch_size))["next"]  # `begin` keeps no observation
    while not observed["done"]:
        observed = env.step(policy(observed))["next"]
    return bool(observed["success"])


def results_of_policy(given: Sequence[Job], name: str) -> Iterator[tuple[Job, str]]:
    """Yield each job with its error. name: of a policy or its checkpoint."""
    policy = load_policy(name)
    with closing(policy_env(policy)) as env:
        yield from ((job, error(env, job, policy)) for job in given)


def results(given: Sequence[Job], robot: str) -> Iterator[tuple[Job, str]]:
    """Yield each job with its error."""
    config = read_env(compose([f"task={TASK}", f"robot={robot}", CURRICULUM]))
    for few, many in zip((0, *SIZES), SIZES, strict=False):
        chosen = [job for job in given if few < len(job.board.before.blocks) <= many]
        if chosen:
            sized = replace(config, task=replace(config.task, num_objects=many))
            with closing(WorkspaceEnv(sized)) as env:
                yield from ((job, error(env, job)) for job in chosen)


def _results(work: tuple[Sequence[Job], str, str | None]) -> list[tuple[Job, str]]:
    given, robot, policy = work
    return list(results(given, robot) if policy is None else results_of_policy(given, policy))


def understood(
    folder: Path, part: str, numbers: Collection[str] | None = None
) -> Iterator[tuple[TreebankSentence, Job | None]]:
    """Generate each command with its job; None if it is not understood.

    Args:
        folder: of the Treebank.
        part: of the boards.
        numbers: of the commands; None: all of the part.

    Raises:
        OSError: a file cannot be read.
    """
    known = {board.number: board for board in boards(folder, part)}
    for item in read(folder, part).items:
        if item.scene in known and (numbers is None or item.number in numbers):
            outcome = interpret_alone(item.text, world_of(known[item.scene].before))
            steps = outcome.steps if isinstance(outcome, Plan) else None
            yield item, None if steps is None else Job(known[item.scene], steps)


def main() -> int:
    """Print how many moves were carried out; return 1 if those are too few."""
    options = _arguments().parse_args()
    if options.words:
        commands = [job for _, job in understood(options.data, options.part)]
    else:
        most = most_blocks(options.policy) if options.policy else max(SIZES)
        every = boards(options.data, options.part)
        commands = [Job(board) for board in every if len(board.before.blocks) <= most]
    random.Random(0).shuffle(commands)
    commands = commands[: options.count]
    given = [job for job in commands if job is not None]
    found = _carry_out_all(list(dict.fromkeys(given)), options)
    right = _print_by_kind(given, found)
    if options.errors:
        for job, wrong in sorted(
            ((job, wrong) for job, wrong in found.items() if wrong), key=lambda pair: pair[0].number
        ):
            blocks = len(job.board.before.blocks)
            print(f"scene {job.number}, {job.board.kind}, {blocks} blocks: wrong is {wrong}")
    share = right / max(len(given), 1)
    if options.words:
        print(f"{len(given)} of {len(commands)} commands are understood; {len(found)} of them differ")
    print(f"{options.policy or options.robot}: {right} of {len(given)} boards reached, {share:.3f}")
    if options.json:
        figures = {"right": right, "total": len(given), "success": round(share, 4), "robot": options.robot}
        figures |= {"policy": options.policy} if options.policy else {}
        print(json.dumps(figures | ({"commands": len(commands)} if options.words else {})))
    return int(share < (ENOUGH_OF_POLICY if options.policy else ENOUGH))


def _carry_out_all(given: Sequence[Job], options: argparse.Namespace) -> dict[Job, str]:
    """Return the error of each job."""
    parts = [(given[i :: options.jobs], options.robot, options.policy) for i in range(options.jobs)]
    with get_context("spawn").Pool(options.jobs) as pool:
        return dict(pair for part in pool.imap_unordered(_results, parts) for pair in part)


def _print_by_kind(given: Sequence[Job], found: dict[Job, str]) -> int:
    """Print how many moves of each kind are right; return how many are right in all."""
    for kind, count in sorted(Counter(job.board.kind for job in given).items()):
        print(f"{kind}: {sum(not found[job] for job in given if job.board.kind == kind)} of {count}")
    return sum(not found[job] for job in given)


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--data", type=Path, required=True, help="folder with commands.txt and configuration.txt")
    parser.add_argument("--part", choices=PARTS, default="all", help="which scenes (all)")
    actor = parser.add_mutually_exclusive_group()
    actor.add_argument("--words", action="store_true", help="carry out what is understood of each command")
    actor.add_argument("--policy", help="a policy of task=rearrange, by its name or checkpoint (the expert)")
    parser.add_argument("--robot", default="kuka", help="an option of robot= (kuka)")
    parser.add_argument("--count", type=int, help="this many scenes, drawn by a fixed seed (all of them)")
    parser.add_argument("--jobs", type=int, default=2, help="processes (2)")
    parser.add_argument("--errors", action="store_true", help="list the scenes that went wrong")
    parser.add_argument("--json", action="store_true", help="the last line is JSON")
    return parser


if __name__ == "__main__":
    sys.exit(main())
