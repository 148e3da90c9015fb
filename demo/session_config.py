"""The parts of a session: its config, the environment, and the policy that fits or was chosen."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from core.errors import ConfigError, did_you_mean
from core.overrides import apply, compose, groups
from core.schema import Checked, any_path, checked_by, one_of, read, within
from deployment.connecting import ArmChoice, connect
from deployment.safe_arm import Person
from envs.config import read_env
from envs.interactive.interactive_env import InteractiveEnv
from envs.sim.window import Window
from envs.tasks import TASKS
from language import FITTINGS, HAND
from trainers.export import policy_file
from trainers.run import checkpoint
from trainers.run.checkpoint import fitted_policy

DRIVERS = ("policy", "expert", "hand")  # who drives the robot
GROUPS = ("task", "robot", "control", "workspace")  # config groups that a person chooses
MOST_OBJECTS = 6  # that a person can choose
NOT_A_RUN = "the run folder is not a folder of a run that can be read here"
DEFAULTS: dict[str, Any] = {
    "task": "nl_reach",
    "robot": "kuka",
    "control": "step",
    "workspace": None,
    "objects": None,
    "driver": "policy",
    "checkpoint": None,
    "second_try": True,
    "overrides": [],
}


@dataclass(frozen=True, kw_only=True)
class SessionConfig(Checked):
    """The choices of a person.

    task, robot, control, workspace: options of the config groups. Without a workspace: a board for tasks with stacks,
        a room for tasks with fittings, a workbench with a person for handing over, else a table with a person.
    objects: number of objects that can be the referent; None: as many as the task has.
    driver: who drives the robot, one of DRIVERS.
    checkpoint: run directory, checkpoint file or pretrained policy; None: the pretrained policy that fits, if any.
    second_try: whether the expert tries once more what the policy did not manage; never where a real arm is driven.
    overrides: of any other key of the environment's config, as in `train.py`.
    """

    task: str = checked_by("the config group")
    robot: str = checked_by("the config group")
    control: str = checked_by("the config group")
    workspace: str | None = checked_by("the config group")
    objects: int | None = within(1, MOST_OBJECTS)
    driver: str = one_of(*DRIVERS)
    checkpoint: str | None = any_path()
    second_try: bool
    overrides: list[str] = checked_by("core.overrides.check")

    def __post_init__(self) -> None:
        super().__post_init__()
        for group in GROUPS:
            option, options = getattr(self, group), groups()[group]
            if option not in options and (group, option) != ("workspace", None):
                raise ConfigError(f"{group}={option} is not known{did_you_mean(option, options)}")


def default_workspace(task: str) -> str | None:
    """The workspace of a task, unless a person chooses another one; None: the one that its config chooses."""
    if {*FITTINGS, HAND} & set(TASKS[task].fixtures):
        return None
    return "board" if TASKS[task].traits.stacks else "collabtable"


def default_task(robot: str) -> str:
    """The task of `play.py` with this robot where nothing else is chosen: everything, if there is a policy for it."""
    return "anything" if f"anything_{robot}" in policy_file.names() else DEFAULTS["task"]


def make_config(**values: Any) -> SessionConfig:
    """The config with these values, and DEFAULTS for the others. Raises ConfigError."""
    return read(SessionConfig, DEFAULTS | values, "")


@dataclass(frozen=True)
class SavedPolicy:
    """A policy on disk, and the options that it was trained for."""

    path: Path
    task: str
    robot: str
    control: str

    @property
    def name(self) -> str:
        """The name of its folder."""
        return self.path.name


@cache
def pretrained_policies() -> tuple[SavedPolicy, ...]:
    """The policies that come with the project. Their configs are not composed, which would take a second for all."""
    folders = [policy_file.FOLDER / name for name in policy_file.names()]
    return tuple(_saved_policy(folder, _load(folder, given=None)) for folder in folders)


def _saved_policy(path: Path, payload: dict[str, Any]) -> SavedPolicy:
    config = payload["config"]
    return SavedPolicy(path, config["task"]["name"], config["robot"]["name"], config["control"]["name"])


def _load(path: Path, given: Sequence[str] | None = ()) -> dict[str, Any]:
    return checkpoint.load(checkpoint.find(path), given=given)


def check_run(folder: str) -> None:
    """Raises ConfigError, with one sentence whatever else is there: the page does not tell which files exist."""
    try:
        _saved_policy(Path(folder), _load(Path(folder)))
    except (ConfigError, LookupError, OSError, TypeError, ValueError):
        raise ConfigError(NOT_A_RUN) from None


def check_choices(values: Mapping[str, str]) -> None:
    """Raises ConfigError if a checkpoint was trained for another task, robot or control than are chosen with it."""
    if "checkpoint" not in values:
        return
    saved = _saved_policy(Path(values["checkpoint"]), _load(Path(values["checkpoint"])))
    for key in ("task", "robot", "control"):
        if key in values and values[key] != getattr(saved, key):
            raise ConfigError(
                f"{key}={values[key]} does not go with checkpoint={values['checkpoint']}, which was trained with "
                f"{key}={getattr(saved, key)}; leave {key} out"
            )


@dataclass(frozen=True)
class Setup:
    """The parts of a session. config: with the task, robot and control of a checkpoint, and a driver that exists.

    own_workspace: where the task takes place unless a person chooses another workspace. policy: None if there is none.
    note: a warning for the person, or "".
    """

    config: SessionConfig
    env: InteractiveEnv
    own_workspace: str
    policy: Callable | None
    note: str = ""


def build(
    config: SessionConfig,
    seed: int,
    gui: bool = False,
    arm: ArmChoice | None = None,
    person: Person | None = None,
) -> Setup:
    """Builds environment and policy.

    Args:
        config: the person's choice.
        seed: of the environment.
        gui: whether PyBullet's window shows it.
        arm: to be driven in place of a simulated one; None: none.
        person: who can stop the arm.

    Raises:
        ConfigError: environment or policy cannot be built.
        ArmError: the arm does not answer.
    """
    payload, config, note = _find_policy(config)
    options = [f"{group}={getattr(config, group)}" for group in ("task", "robot", "control")]
    composed = compose(options) if payload is None else payload["config"]
    own_workspace = default_workspace(config.task) or composed["workspace"]["name"]
    config = replace(config, workspace=config.workspace or own_workspace)
    changes = _changes(config, composed)
    composed = compose([*options, *changes]) if payload is None else apply(composed, changes)
    config = replace(config, workspace=composed["workspace"]["name"])
    env_config = read_env(composed).without_curriculum()
    if arm is not None:
        env: InteractiveEnv = connect(arm, env_config, person, seed)
    else:
        env = InteractiveEnv(env_config, seed, Window(env_config.workspace.film, "--gui") if gui else None)
    try:
        policy = None if payload is None else fitted_policy(payload, composed, env).act
        return Setup(config, env, own_workspace, policy, note)
    except BaseException:
        env.close()
        raise


def _find_policy(config: SessionConfig) -> tuple[dict[str, Any] | None, SessionConfig, str]:
    """The checkpoint's payload or None, the config completed by it, and a note for the person."""
    if config.checkpoint is not None:
        path = Path(config.checkpoint)
        payload = _load(path, config.overrides)
        saved = _saved_policy(path, payload)
        return payload, replace(config, task=saved.task, robot=saved.robot, control=saved.control), ""
    wanted = config.task, config.robot, config.control
    fitting = (each.path for each in pretrained_policies() if (each.task, each.robot, each.control) == wanted)
    if (folder := next(fitting, None)) is not None:
        return _load(folder), config, ""
    if config.driver != "policy":
        return None, config, ""
    choice = f"task={config.task} with robot={config.robot} and control={config.control}"
    note = f"There is no trained policy for {choice}: the scripted expert drives. You can train one with train.py."
    return None, replace(config, driver="expert"), note


def _changes(config: SessionConfig, composed: Any) -> list[str]:
    """Overrides that turn the composed config into that of the session."""
    changes = []
    if config.workspace not in (None, composed["workspace"]["name"]):
        changes.append(f"workspace={config.workspace}")
    has_cue = composed["task"]["kinds"] or composed["gesture"]["source"] != "none"  # else no cue names the referent
    if has_cue and config.objects is not None:
        changes += [f"task.num_objects={config.objects}", f"task.min_objects={config.objects}"]
    return [*changes, *config.overrides]
