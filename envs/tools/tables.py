"""What every task observes and every robot does, as tables: `python -m envs.tools.tables` writes docs/reference/*.md.

    out=docs/reference   the folder that they go to
    check=false          true: write nothing, and fail where the pages there are not what would be written

Shapes, types and bounds come from the environments' own specs. `envs.mdp.observations` describes the keys.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from torchrl.data import Composite

from conf import overrides
from conf.arguments import out_folder, run, split
from conf.overrides import compose, groups
from conf.schema import Checked, ConfigError, read
from envs.config import EnvConfig, read_env
from envs.mdp.controls import CONTROLS
from envs.mdp.object_rows import CLOSE, NEAR
from envs.mdp.observations import descriptions
from envs.tasks import TASKS
from envs.workspace_env import WorkspaceEnv
from language import DEVICES, SHAPES

DEFAULTS = {"out": "docs/reference", "check": False}
NOTE = "<!-- Written by `python -m envs.tools.tables` from the specs: not to be edited. -->"
COLUMNS = ["x", "y", "z (m)", "quaternion x", "y", "z", "w", "red", "green", "blue", "opacity"]
OFFSETS = [f"offset {axis} within {near} m" for near in (NEAR, CLOSE) for axis in "xyz"]
PLACE, TURNED = ["gripper x", "y", "z (m)"], [f"rotation, {i}. column, {axis}" for i in (1, 2) for axis in "xyz"]
ARM = {
    "step": ["move x", "move y", "move z"],
    "absolute": ["place x", "place y", "place z"],
}
EXAMPLES = ("nl_reach", "nl_pick_and_place", "pick_and_rotate")  # of tasks that grip and turn nothing; grip; and turn
TASKS_PAGE = (
    "Of every option of `task=`, as they stand in `conf/task/`: what an episode is, what rewards it, and every key",
    "of the observation with its shape and type, for the default robot and control (kuka, `step`). N is the number",
    "of worlds. How other robots and controls differ is in [one table](#numbers-of-robot-and-action), and column by",
    "column under [robots](robots.md). Losses and tests alone may read what is under `privileged`.",
)
ROBOTS_PAGE = (
    "Of every option of `robot=`, as they stand in `conf/robot/`: each number of the observation `robot`, and of the",
    "action by control (`control=`). Actions are in [-1, 1]; *unit* is how far one may be from `hold`, the action that",
    "keeps the arm where it is, to be carried out within one control step. Rows in *italics* are there where the task",
    "grips; the action's yaw, where it turns things.",
)

Rows = Sequence[Sequence[Any]]


@dataclass(frozen=True, kw_only=True)
class TablesConfig(Checked):
    out: str
    check: bool


@dataclass(frozen=True)
class Specs:
    """What one environment says of itself."""

    config: EnvConfig
    observed: Composite
    unit: tuple[float, ...]
    terms: tuple[str, ...]
    moves: bool
    operates: bool
    grips: bool
    turns: bool


def specs(config: EnvConfig) -> Specs:
    """Those of one world built for this."""
    with closing(WorkspaceEnv(config)) as env:
        task = env.task
        flags = task.moves, task.operates, task.grips, task.turns
        return Specs(config, env.observation_spec, env.action_unit, env.reward_names, *flags)


def option(group: str, name: str) -> EnvConfig:
    """The default config with another option of a group."""
    return read_env(compose([f"{group}={name}"]))


def pages() -> dict[str, str]:
    """The text of each page by its file's name."""
    tasks = {name: specs(option("task", name)) for name in groups()["task"]}
    robots = {name: option("robot", name).robot for name in groups()["robot"]}
    controls = {name: option("control", name).control for name in groups()["control"]}
    made = {
        (robot, control, task): specs(replace(tasks[task].config, robot=robots[robot], control=controls[control]))
        for robot, control, task in itertools.product(robots, controls, EXAMPLES)
    }
    return {"tasks.md": _tasks_page(tasks, made), "robots.md": _robots_page(made)}


def _tasks_page(tasks: dict[str, Specs], made: dict[tuple[str, str, str], Specs]) -> str:
    lines = [
        NOTE,
        "# Tasks: what is observed",
        "",
        *TASKS_PAGE,
        "",
        "## What the keys hold",
        "",
        *_table(["key", "what it holds"], [[f"`{key}`", text] for key, text in descriptions().items()]),
        "",
        "## Rows of `objects`",
        "",
        "One row a slot, with as many numbers as the task needs:",
        "",
        *_table(["columns", "of", "in tasks that"], _object_rows(tasks)),
        "",
        "## Numbers of `robot` and `action`",
        "",
        "How many `robot` and `action` (and `hold`) hold, by robot and control:",
        "",
        *_table(
            ["tasks", "robot", "`robot`", *(f"`action`, `{control}`" for control in CONTROLS)], _widths(tasks, made)
        ),
    ]
    for name, each in tasks.items():
        lines += ["", *_task_section(name, each)]
    return "\n".join(lines) + "\n"


def _object_rows(tasks: dict[str, Specs]) -> Rows:
    """Which columns there are; raises where the names are not as many as the spec's columns."""
    rows: list[list[Any]] = []
    for some, kinds, title in (
        ("nl_reach", SHAPES, "go to objects"),
        ("nl_pick_and_place", SHAPES, "move objects"),
        ("nl_push", SHAPES, "push objects"),
        ("press", DEVICES, "operate devices"),
    ):
        task = TASKS[tasks[some].config.task.name]
        more = [*OFFSETS, *(column.name for column in task.columns)] if task.moves else []
        named = [*COLUMNS, *kinds, "size (m)", "role (1: target)", *more]
        assert len(named) == tasks[some].observed["objects"].shape[-1], some
        rows.append([len(named), ", ".join(named), title])
    return rows


def _widths(tasks: dict[str, Specs], made: dict[tuple[str, str, str], Specs]) -> Rows:
    rows = []
    for example in EXAMPLES:
        flags = tasks[example].grips, tasks[example].turns
        alike = ", ".join(f"`{name}`" for name, each in tasks.items() if (each.grips, each.turns) == flags)
        for robot in dict.fromkeys(key[0] for key in made):
            each = [made[robot, control, example] for control in CONTROLS]
            rows.append([alike, robot, each[0].observed["robot"].shape[-1], *(len(one.unit) for one in each)])
            alike = ""
    return rows


def _task_section(name: str, each: Specs) -> list[str]:
    task = each.config.task
    objects = f"{task.min_objects} to {task.num_objects}" if task.min_objects < task.num_objects else task.num_objects
    facts: Rows = [
        ["class", f"`{TASKS[task.name].__name__}`"],
        ["objects", f"{objects}: {', '.join(task.nouns)}, {task.object_size} m"],
        ["see-through targets", task.num_targets],
        ["sentences", ", ".join(task.kinds) or "none"],
        ["workspace", each.config.workspace.name],
        ["control steps at most", task.max_steps],
        [
            "the action",
            "grips, and turns the gripper" if each.turns else "grips" if each.grips else "moves the arm alone",
        ],
        ["reward", ", ".join(f"{term} {task.reward[term]:g}" for term in each.terms)],
    ]
    return [
        f"## {name}",
        "",
        overrides.comment("task", name),
        "",
        *_table(["", ""], facts),
        "",
        *_table(["key", "shape", "type"], _keys(each.observed)),
    ]


def _keys(observed: Composite) -> Rows:
    rows = []
    for key, leaf in observed.items(True, True):
        name = key if isinstance(key, str) else "/".join(key)
        shape = ", ".join(["N", *map(str, leaf.shape[1:])]) + "," * (len(leaf.shape) == 1)
        rows.append([f"`{name}`", f"({shape})", str(leaf.dtype).removeprefix("torch.")])
    return sorted(rows)


def _robots_page(made: dict[tuple[str, str, str], Specs]) -> str:
    lines = [
        NOTE,
        "# Robots: what they observe and do",
        "",
        *ROBOTS_PAGE,
    ]
    for robot in dict.fromkeys(key[0] for key in made):
        lines += ["", f"## {robot}", "", overrides.comment("robot", robot), "", *_robot_tables(robot, made)]
    return "\n".join(lines) + "\n"


def _robot_tables(robot: str, made: dict[tuple[str, str, str], Specs]) -> list[str]:
    some = made[robot, "step", "pick_and_rotate"]
    joints = some.config.robot.joints
    named = [f"angle of `{joint}` (rad)" for joint in joints] + [f"speed of `{joint}` (rad/s)" for joint in joints]
    named += [*PLACE, *TURNED, "how far the fingers are open", "*how far it is told to be shut*", "*whether it holds*"]
    spec = some.observed["robot"]
    low, high = spec.space.low[0].tolist(), spec.space.high[0].tolist()
    rows = [[i, *row] for i, row in enumerate(zip(named, map(_number, low), map(_number, high), strict=True))]
    lines = ["### `robot`", "", *_table(["column", "what", "least", "greatest"], rows)]
    for control in CONTROLS:
        unit = made[robot, control, "pick_and_rotate"].unit
        arm = ARM.get(control, [f"angle of `{joint}`" for joint in joints])
        yaw = [] if control == "joints" else ["yaw of the gripper, where the task turns things"]
        parts = [*arm, *yaw, "*shut the gripper: above 0*"]
        rows = [[i, *row] for i, row in enumerate(zip(parts, map(_number, unit), strict=True))]
        lines += ["", f"### `action`, `control={control}`", "", *_table(["number", "what", "unit"], rows)]
    return lines


def _number(value: float) -> str:
    return f"{round(value, 3):g}"


def _table(head: list[str], rows: Rows) -> list[str]:
    return [
        f"| {' | '.join(head)} |",
        "|" + "---|" * len(head),
        *(f"| {' | '.join(map(str, row))} |" for row in rows),
    ]


def main(arguments: list[str]) -> None:
    """Write the pages, or compare them. Raises ConfigError."""
    own, rest = split(arguments, [field.name for field in fields(TablesConfig)], "out=docs/reference")
    config = read(TablesConfig, DEFAULTS | own | dict(word.split("=", 1) for word in rest), "")
    folder = Path(config.out) if config.check else out_folder(config.out)
    for name, text in pages().items():
        path = folder / name
        if not config.check:
            path.write_text(text, encoding="utf-8")
            print(path)
        elif not path.is_file() or path.read_text(encoding="utf-8") != text:
            raise ConfigError(f"{path} is not what the specs say; python -m envs.tools.tables writes it anew")


if __name__ == "__main__":
    run(main, __doc__)
