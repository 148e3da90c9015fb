"""Reference tables of observations and actions: `python -m tools.reference_tables` writes docs/reference/*.md.

    out=docs/reference   the folder of the pages
    check=false          true: write nothing, and fail if a page in the folder is out of date

Shapes, types and bounds come from the environments' specs, descriptions of the keys from `envs.mdp.observations`.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from torchrl.data import Composite

from core import overrides
from core.command_line import out_folder, split
from core.errors import ConfigError
from core.overrides import compose, groups
from core.program import run_program
from core.schema import Checked, any_path, read
from envs.config import EnvConfig, read_env
from envs.experts import EXPERTS
from envs.mdp.controls import CONTROLS
from envs.mdp.object_rows import CLOSE, NEAR
from envs.mdp.observations import descriptions
from envs.tasks import TASK_VERBS, TASKS
from envs.workspace_env import WorkspaceEnv
from language import DEVICES, SHAPES

DEFAULTS = {"out": "docs/reference", "check": False}
NOTE = "<!-- Written by `python -m tools.reference_tables` from the specs; do not edit. -->"
COLUMNS = ["x", "y", "z (m)", "quaternion x", "y", "z", "w", "red", "green", "blue", "opacity"]
OFFSETS = [f"offset {axis} within {near} m" for near in (NEAR, CLOSE) for axis in "xyz"]
GRIPPER_POSITION = ["gripper x", "y", "z (m)"]
GRIPPER_ROTATION = [f"rotation, column {i}, {axis}" for i in (1, 2) for axis in "xyz"]
ARM_ACTIONS = {  # of controls whose actions are not joint angles
    "step": ["move x", "move y", "move z"],
    "absolute": ["position x", "position y", "position z"],
}
EXAMPLES = ("nl_reach", "nl_pick_and_place", "pick_and_rotate")  # a task without a gripper; with; one that turns it
TASKS_INTRODUCTION = (
    "Every option of `task=` (`conf/task/`): the episode, the reward weights, and every key of the observation with",
    "its shape and type, for the default robot and control (kuka, `step`). N is the number of worlds. For other robots",
    "and controls, see [the widths of `robot` and `action`](#numbers-of-robot-and-action), and [robots](robots.md) for",
    "each column. Only losses and tests may read the keys under `privileged`.",
)
ROBOTS_INTRODUCTION = (
    "Every option of `robot=` (`conf/robot/`): each number of the observation `robot`, and of the action for every",
    "`control=`. Actions are in [-1, 1]. `hold` is the action that keeps the arm where it is; *unit* is the largest",
    "difference from `hold` that one control step can carry out. Rows in *italics* exist only in tasks that grip, the",
    "yaw of the action only in tasks that turn objects.",
)

Rows = Sequence[Sequence[Any]]


@dataclass(frozen=True, kw_only=True)
class TablesConfig(Checked):
    out: str = any_path()
    check: bool


@dataclass(frozen=True)
class EnvironmentSpecs:
    """The specs and properties of one environment."""

    config: EnvConfig
    observed: Composite
    unit: tuple[float, ...]
    terms: tuple[str, ...]
    moves: bool
    operates: bool
    grips: bool
    turns: bool


def specs(config: EnvConfig) -> EnvironmentSpecs:
    """Return the specs of an environment with this config."""
    with closing(WorkspaceEnv(config)) as env:
        task = env.task
        flags = task.traits.moves, task.traits.operates, task.traits.grips, task.traits.turns
        return EnvironmentSpecs(config, env.observation_spec, env.action_unit, env.reward_names, *flags)


def option(group: str, name: str) -> EnvConfig:
    """Return the default config with this option of a group."""
    return read_env(compose([f"{group}={name}"]))


def pages() -> dict[str, str]:
    """Return the text of each page by its file name."""
    tasks = {name: specs(option("task", name)) for name in groups()["task"]}
    robots = {name: option("robot", name).robot for name in groups()["robot"]}
    controls = {name: option("control", name).control for name in groups()["control"]}
    made = {
        (robot, control, task): specs(replace(tasks[task].config, robot=robots[robot], control=controls[control]))
        for robot, control, task in itertools.product(robots, controls, EXAMPLES)
    }
    return {"tasks.md": _tasks_page(tasks, made), "robots.md": _robots_page(made)}


def _tasks_page(tasks: dict[str, EnvironmentSpecs], made: dict[tuple[str, str, str], EnvironmentSpecs]) -> str:
    lines = [
        NOTE,
        "# Tasks",
        "",
        *TASKS_INTRODUCTION,
        "",
        "## Index",
        "",
        "Where each option is defined: its class, its YAML, its scripted expert, and the verb of its sentences.",
        "",
        *_table(["`task=`", "class", "YAML", "expert", "verb"], _index(tasks)),
        "",
        "## Keys",
        "",
        *_table(["key", "content"], [[f"`{key}`", text] for key, text in descriptions().items()]),
        "",
        "## Rows of `objects`",
        "",
        "One row for each slot. The number of columns depends on the task:",
        "",
        *_table(["columns", "content", "in tasks that"], _object_rows(tasks)),
        "",
        "## Numbers of `robot` and `action`",
        "",
        "The widths of `robot` and `action` (and `hold`), by robot and control:",
        "",
        *_table(
            ["tasks", "robot", "`robot`", *(f"`action`, `{control}`" for control in CONTROLS)], _widths(tasks, made)
        ),
    ]
    for name, each in tasks.items():
        lines += ["", *_task_section(name, each)]
    return "\n".join(lines) + "\n"


def _index(tasks: dict[str, EnvironmentSpecs]) -> Rows:
    """The class, YAML, expert and verb of each option."""
    rows = []
    for option_name, each in tasks.items():
        name = each.config.task.name
        verbs = TASKS[name].verbs or (TASK_VERBS[name],)
        rows.append(
            [
                f"[`{option_name}`](#{option_name})",
                _source(TASKS[name]),
                f"`conf/task/{option_name}.yaml`",
                _source(EXPERTS[name]),
                f"`{verbs[0]}`" if len(verbs) == 1 else "several",
            ]
        )
    return rows


def _source(cls: type) -> str:
    """A class, and the file that defines it."""
    return f"`{cls.__name__}`, `{cls.__module__.replace('.', '/')}.py`"


def _object_rows(tasks: dict[str, EnvironmentSpecs]) -> Rows:
    """Return the columns of `objects` for each kind of task. The assertion keeps their number equal to the spec's."""
    rows: list[list[Any]] = []
    for some, kinds, title in (
        ("nl_reach", SHAPES, "reach objects"),
        ("nl_pick_and_place", SHAPES, "move objects"),
        ("nl_push", SHAPES, "push objects"),
        ("press", DEVICES, "operate devices"),
        ("nl_press", SHAPES, "have devices among their objects"),
        ("nl_open", SHAPES, "have fittings among their objects"),
    ):
        task = TASKS[tasks[some].config.task.name]
        more = [*OFFSETS, *(column.name for column in task.columns)] if task.traits.moves else []
        named = [*COLUMNS, *kinds, "size (m)", "role (1: target)", *more]
        assert len(named) == tasks[some].observed["objects"].shape[-1], some
        rows.append([len(named), ", ".join(named), title])
    return rows


def _widths(tasks: dict[str, EnvironmentSpecs], made: dict[tuple[str, str, str], EnvironmentSpecs]) -> Rows:
    rows = []
    for example in EXAMPLES:
        flags = tasks[example].grips, tasks[example].turns
        alike = ", ".join(f"`{name}`" for name, each in tasks.items() if (each.grips, each.turns) == flags)
        for robot in dict.fromkeys(key[0] for key in made):
            each = [made[robot, control, example] for control in CONTROLS]
            rows.append([alike, robot, each[0].observed["robot"].shape[-1], *(len(one.unit) for one in each)])
            alike = ""
    return rows


def _task_section(name: str, each: EnvironmentSpecs) -> list[str]:
    task = each.config.task
    objects = f"{task.min_objects} to {task.num_objects}" if task.min_objects < task.num_objects else task.num_objects
    facts: Rows = [
        ["class", f"`{TASKS[task.name].__name__}`"],
        ["objects", f"{objects}: {', '.join(task.nouns)}, {task.object_size} m"],
        ["see-through targets", task.num_targets],
        ["sentences", ", ".join(task.kinds) or "none"],
        ["workspace", each.config.workspace.name],
        ["maximum control steps", task.max_steps],
        ["the action", _action_words(each)],
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


def _action_words(each: EnvironmentSpecs) -> str:
    if each.turns:
        return "moves, turns and closes the gripper"
    return "moves and closes the gripper" if each.grips else "moves the arm"


def _keys(observed: Composite) -> Rows:
    rows = []
    for key, leaf in observed.items(True, True):
        name = key if isinstance(key, str) else "/".join(key)
        shape = ", ".join(["N", *map(str, leaf.shape[1:])]) + "," * (len(leaf.shape) == 1)
        rows.append([f"`{name}`", f"({shape})", str(leaf.dtype).removeprefix("torch.")])
    return sorted(rows)


def _robots_page(made: dict[tuple[str, str, str], EnvironmentSpecs]) -> str:
    lines = [
        NOTE,
        "# Robots: observations and actions",
        "",
        *ROBOTS_INTRODUCTION,
    ]
    for robot in dict.fromkeys(key[0] for key in made):
        lines += ["", f"## {robot}", "", overrides.comment("robot", robot), "", *_robot_tables(robot, made)]
    return "\n".join(lines) + "\n"


def _robot_tables(robot: str, made: dict[tuple[str, str, str], EnvironmentSpecs]) -> list[str]:
    some = made[robot, "step", "pick_and_rotate"]
    joints = some.config.robot.joints
    named = [f"angle of `{joint}` (rad)" for joint in joints] + [f"speed of `{joint}` (rad/s)" for joint in joints]
    named += [
        *GRIPPER_POSITION,
        *GRIPPER_ROTATION,
        "opening of the fingers",
        "*commanded closing*",
        "*whether it holds*",
    ]
    spec = some.observed["robot"]
    low, high = spec.space.low[0].tolist(), spec.space.high[0].tolist()
    rows = [[i, *row] for i, row in enumerate(zip(named, map(_number, low), map(_number, high), strict=True))]
    lines = ["### `robot`", "", *_table(["column", "content", "least", "greatest"], rows)]
    for control in CONTROLS:
        unit = made[robot, control, "pick_and_rotate"].unit
        arm = ARM_ACTIONS.get(control, [f"angle of `{joint}`" for joint in joints])
        yaw = [] if control == "joints" else ["yaw of the gripper, in tasks that turn objects"]
        parts = [*arm, *yaw, "*gripper: closed above 0*"]
        rows = [[i, *row] for i, row in enumerate(zip(parts, map(_number, unit), strict=True))]
        lines += ["", f"### `action`, `control={control}`", "", *_table(["number", "content", "unit"], rows)]
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
    """Write the pages, or checks them. Raises ConfigError."""
    own, rest = split(arguments, [field.name for field in fields(TablesConfig)], "out=docs/reference")
    config = read(TablesConfig, DEFAULTS | own | dict(word.split("=", 1) for word in rest), "")
    folder = Path(config.out) if config.check else out_folder(config.out)
    for name, text in pages().items():
        path = folder / name
        if not config.check:
            path.write_text(text, encoding="utf-8")
            print(path)
        elif not path.is_file() or path.read_text(encoding="utf-8") != text:
            raise ConfigError(f"{path} is out of date; run python -m tools.reference_tables")


if __name__ == "__main__":
    run_program(main, __file__)
