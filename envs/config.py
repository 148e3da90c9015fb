"""From Hydra overrides to checked configs, and from those to environments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from conf.schema import ConfigError, did_you_mean, read
from envs.controls import ControlConfig
from envs.robot import RobotConfig, urdf_path
from envs.tasks import TASKS, TaskConfig
from envs.workspace import WorkspaceConfig
from envs.world import PhysicsConfig

if TYPE_CHECKING:
    from envs.workspace_env import WorkspaceEnv


@dataclass(frozen=True)
class EnvConfig:
    """All that an environment is made from."""

    robot: RobotConfig
    control: ControlConfig
    workspace: WorkspaceConfig
    task: TaskConfig
    physics: PhysicsConfig


def read_env(config: Any) -> EnvConfig:
    """The composed config's groups, checked. Raises ConfigError before anything is loaded."""
    robot = read(RobotConfig, config["robot"], "robot")
    urdf_path(robot)
    task = read(TaskConfig, config["task"], "task")
    if task.name not in TASKS:
        raise ConfigError(f"task.name={task.name} is not a task" + did_you_mean(task.name, TASKS))
    return EnvConfig(
        robot,
        read(ControlConfig, config["control"], "control"),
        read(WorkspaceConfig, config["workspace"], "workspace"),
        task,
        read(PhysicsConfig, config["physics"], "physics"),
    )


def compose(overrides: Sequence[str] = ()) -> Any:
    """The project's config with Hydra overrides: compose(["robot=panda", "task.num_objects=6"]).

    Raises ConfigError for an unknown group, option or key.
    """
    from hydra import compose as hydra_compose
    from hydra import initialize_config_module
    from hydra.core.global_hydra import GlobalHydra
    from hydra.errors import HydraException

    if GlobalHydra.instance().is_initialized():
        GlobalHydra.instance().clear()
    try:
        with initialize_config_module("conf", version_base="1.3"):
            return hydra_compose("config", list(overrides))
    except HydraException as error:
        raise ConfigError(str(error)) from None


def make_env(
    overrides: Sequence[str] = (), num_worlds: int = 1, seed: int = 0, render: bool = False
) -> WorkspaceEnv:
    """The TorchRL environment of `overrides`, as N = num_worlds worlds: make_env(["robot=panda"], 16).

    Raises ConfigError.
    """
    from envs.workspace_env import WorkspaceEnv

    return WorkspaceEnv(read_env(compose(overrides)), num_worlds, seed, render)
