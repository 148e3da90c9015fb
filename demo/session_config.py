"""Who plays: the world, and the policy that drives the robot in it, as chosen on the command line or in the page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from conf.overrides import apply, compose, groups
from conf.schema import Checked, ConfigError, did_you_mean, one_of, read, within
from envs.config import read_env
from envs.interactive.interactive_env import InteractiveEnv
from envs.sim.window import Window
from trainers.algorithms.build import fitted_policy
from trainers.export.pretrained import FOLDER, names
from trainers.run import checkpoint

DRIVERS = ("policy", "expert", "hand")
USUAL: dict[str, Any] = {
    "task": "nl_reach",
    "robot": "kuka",
    "control": "step",
    "workspace": "collabtable",
    "objects": None,
    "driver": "policy",
    "checkpoint": None,
    "overrides": [],
}


@dataclass(frozen=True, kw_only=True)
class Choice(Checked):
    """What is on. checkpoint: a run, or a pretrained policy; none: the one that fits, where there is one.

    objects: how many can be dealt with; none: as many as the task has. overrides: of any other key, as in `train.py`.
    """

    task: str
    robot: str
    control: str
    workspace: str
    objects: int | None = within(1, 6)
    driver: str = one_of(*DRIVERS)
    checkpoint: str | None
    overrides: list[str]

    def __post_init__(self) -> None:
        super().__post_init__()
        for group in ("task", "robot", "control", "workspace"):
            options = groups()[group]
            if getattr(self, group) not in options:
                near = did_you_mean(getattr(self, group), options)
                raise ConfigError(f"{group}={getattr(self, group)} is not known{near}")


def choose(**given: Any) -> Choice:
    """A choice of these, and of what is usual for all else. Raises ConfigError."""
    return read(Choice, USUAL | given, "")


@dataclass(frozen=True)
class Trained:
    """A policy on disk, and what it was trained for."""

    path: Path
    task: str
    robot: str
    control: str

    @property
    def name(self) -> str:
        """As it is shown."""
        return self.path.name


@cache
def pretrained() -> tuple[Trained, ...]:
    """Those that come with the project."""
    return tuple(_trained(FOLDER / name, _load(FOLDER / name)) for name in names())


def _trained(path: Path, saved: dict[str, Any]) -> Trained:
    config = saved["config"]
    return Trained(path, config["task"]["name"], config["robot"]["name"], config["control"]["name"])


def _load(path: Path) -> dict[str, Any]:
    return checkpoint.load(checkpoint.find(path))


@dataclass(frozen=True)
class Cast:
    """What was chosen, as it can be had. policy: None where there is none. note: what a person should know of it."""

    choice: Choice
    stage: InteractiveEnv
    policy: Callable | None
    note: str = ""


def cast(choice: Choice, seed: int, gui: bool = False) -> Cast:
    """gui: show it in PyBullet's own window. Raises ConfigError for what cannot be built."""
    saved, choice, note = _chosen(choice)
    config = compose(_overrides(choice)) if saved is None else apply(saved["config"], _common(choice, saved["config"]))
    env = read_env(config).judged()
    stage = InteractiveEnv(env, seed, Window(env.workspace.camera, "--gui") if gui else None)
    try:
        policy = None if saved is None else fitted_policy(saved, config, stage).act
        return Cast(choice, stage, policy, note)
    except BaseException:
        stage.close()
        raise


def _chosen(choice: Choice) -> tuple[dict[str, Any] | None, Choice, str]:
    """The checkpoint's payload, and the choice with what follows from it."""
    if choice.checkpoint is not None:
        path = checkpoint.find(Path(choice.checkpoint))
        saved = checkpoint.load(path)
        known = _trained(path, saved)
        return saved, replace(choice, task=known.task, robot=known.robot, control=known.control), ""
    wanted = choice.task, choice.robot, choice.control
    fitting = (each.path for each in pretrained() if (each.task, each.robot, each.control) == wanted)
    if (folder := next(fitting, None)) is not None:
        return _load(folder), choice, ""
    if choice.driver != "policy":
        return None, choice, ""
    what = f"task={choice.task} with robot={choice.robot} and control={choice.control}"
    note = f"There is no trained policy for {what} here: the scripted expert drives. train.py makes one."
    return None, replace(choice, driver="expert"), note


def _overrides(choice: Choice) -> list[str]:
    groups_ = [f"{group}={getattr(choice, group)}" for group in ("task", "robot", "control")]
    plain = compose(groups_)
    return [*groups_, *_common(choice, plain)]


def _common(choice: Choice, config: Any) -> list[str]:
    """What differs from this config."""
    changes = []
    if choice.workspace != config["workspace"]["name"]:
        changes.append(f"workspace={choice.workspace}")
    if "reach" in config["task"]["name"]:  # it comes down on things from above, and not into them
        box = [*compose([f"workspace={choice.workspace}"])["workspace"]["gripper_box"]]
        box[4] = max(box[4], config["task"]["object_size"])
        changes.append(f"workspace.gripper_box={box}")
    speaks = config["task"]["kinds"] or config["gesture"]["source"] != "none"  # else nothing would tell objects apart
    if speaks and choice.objects is not None:
        changes += [f"task.num_objects={choice.objects}", f"task.min_objects={choice.objects}"]
    return [*changes, *choice.overrides]
