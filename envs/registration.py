"""Building environments from Hydra overrides, and the Gymnasium ids: one for every option of `task=`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import gymnasium

from core.errors import ConfigError
from core.overrides import check, compose, groups
from core.plugins import own_files
from envs.config import EnvConfig, read_env
from envs.sim.window import Window, display_problem

if TYPE_CHECKING:
    from envs.workspace_env import WorkspaceEnv

ENTRY_POINT, VECTOR_ENTRY_POINT = "envs.gym_env:GymEnv", "envs.gym_vector_env:GymVectorEnv"


def make_env(
    overrides: Sequence[str] = (),
    num_worlds: int = 1,
    seed: int = 0,
    render: bool = False,
    window: str | None = None,
) -> WorkspaceEnv:
    """Build the TorchRL environment that Hydra overrides describe: `make_env(["robot=panda"], num_worlds=16)`.

    Args:
        overrides: Hydra overrides of conf/config.yaml.
        num_worlds: the number N of PyBullet worlds, which is the batch size.
        seed: seed of the worlds' random generators.
        render: load visual shapes, for `WorkspaceEnv.render`.
        window: None, or the setting that asks for a window of the only world, for errors: "render_mode=human".

    Raises:
        ConfigError: for an unknown or invalid override, or a window that cannot be opened.
    """
    check_list(overrides)
    from envs.workspace_env import WorkspaceEnv  # torch is imported only where an environment is built

    config = _config(tuple(overrides), own_files())
    shown = None if window is None else Window(config.workspace.film, window)
    try:
        return WorkspaceEnv(config, num_worlds, seed, render, shown)
    except BaseException:
        if shown is not None:
            shown.close()
        raise


def can_show(mode: str) -> bool:
    """Whether this machine can render in this mode of Gymnasium's."""
    return mode != "human" or display_problem() is None


def check_list(overrides: Sequence[str]) -> None:
    """Raise ConfigError unless these are overrides in a list."""
    if not isinstance(overrides, list | tuple) or not all(isinstance(word, str) for word in overrides):
        example = f"[{overrides!r}]" if isinstance(overrides, str) else '["robot=panda", "seed=1"]'
        raise ConfigError(f"overrides={overrides!r} must be a list of words, such as {example}")


@lru_cache(maxsize=256)
def _config(overrides: tuple[str, ...], own: tuple[tuple[str, int], ...]) -> EnvConfig:
    """Compose the config of these overrides. It is immutable, so that environments share it: Hydra takes 0.4 s."""
    check(overrides)
    return read_env(compose(overrides))


def gym_id(task: str) -> str:
    """Return the Gymnasium id of an option of `task=`: "nl_pick_and_place" gives "Deixis/NLPickAndPlace-v0"."""
    words = ["NL" if word == "nl" else word.capitalize() for word in task.split("_")]
    return f"Deixis/{''.join(words)}-v0"


def register_gym_ids() -> None:
    """Register an id for every task of conf/task with Gymnasium."""
    for task in groups()["task"]:
        gymnasium.register(
            gym_id(task), entry_point=ENTRY_POINT, vector_entry_point=VECTOR_ENTRY_POINT, kwargs={"task": task}
        )
