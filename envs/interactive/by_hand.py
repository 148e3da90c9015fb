"""Episodes in which a person moves the finger with keys until it shows the referent, and then watches the robot."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torchrl.envs.utils import ExplorationType, set_exploration_type

from core.errors import ConfigError
from envs.config import EnvConfig
from envs.interactive.interactive_env import object_name
from envs.mdp.object_rows import scene_of_rows
from envs.sim.window import Window
from envs.workspace_env import WorkspaceEnv
from human import (
    Display,
    KeyboardPointer,
    KeySource,
    choose_object,
    fuse,
    pointed_object,
    posterior,
    referring_phrase,
)
from human.body.window import CLOSED, WindowDisplay, WindowKeys
from language import Scene

Array = NDArray[np.float64]
NEXT = "Enter: next scene; Escape: quit"


class ByHandEnv(WorkspaceEnv):
    """One world whose person points where keys move the finger.

    Args:
        window: whether to show the world in a window; `user_interface` gives its keys and display.

    Raises:
        ConfigError: the config has no person who points.
    """

    def __init__(self, config: EnvConfig, seed: int = 0, window: bool = True) -> None:
        if config.gesture.source == "none":
            raise ConfigError(
                f"by_hand=true requires a person who points, but task.name={config.task.name} has "
                "gesture.source=none; take a checkpoint of task=reach_gesture or task=nl_reach_gesture"
            )
        self._window = Window(config.workspace.film) if window else None
        super().__init__(config, seed=seed, window=self._window)

    def user_interface(self) -> tuple[KeySource, Display]:
        """Return the keys and the display of the window."""
        assert self._window is not None
        return WindowKeys(self._window.client), WindowDisplay(self._window.client)

    def point_at(self, target: Array) -> tuple[Array, Array]:
        """Move the finger to target (3,), metres, within `gesture.frames` physics steps, and take no control step.

        Returns the fingertip (3,) and the unit direction (3,) afterwards. Raises Unreachable, and then nothing moves.
        """
        assert self._person is not None
        gesture = self._person.aim(target)
        self._gestures.point(0, gesture)
        return gesture.origin, gesture.direction

    def set_referent(self, index: int) -> TensorDictBase:
        """Make object `index` of the scene the referent, and start the episode. Returns the observation."""
        self._arrays.read(self._arrays.index)
        slot = int(np.flatnonzero(self.sight.state.shown[0])[index])
        self._set_goal(0, replace(self._arrays.goals[0], referent=slot))
        return self._first_observation()

    def scene(self) -> Scene:
        """Return the objects as the language sees them."""
        state = self.sight.state
        shown = state.shown[0]
        return scene_of_rows(self.rows[0, shown], self.config.task.viewpoint, state.nouns[0, shown])


class ScenePointer:
    """The finger over one scene of the environment (a `human.by_hand.PointingPerson`)."""

    def __init__(self, env: ByHandEnv) -> None:
        self._env, self._scene = env, env.scene()
        sentence = env.sentence()
        self._phrase = referring_phrase(sentence) if sentence else None
        self._ray = np.zeros(3), np.zeros(3)

    def point(self, target: Array) -> Array:
        """Points at target (3,), metres. Returns the fingertip (3,). Raises Unreachable."""
        self._ray = self._env.point_at(target)
        return self._ray[0]

    def nearest(self) -> int:
        """Return the object nearest to the ray. Raises NothingPointedAt."""
        return int(pointed_object(*self._ray, self._scene.positions))

    def meant(self) -> int:
        """Return the referent by ray and words. Raises NothingPointedAt."""
        by_ray = posterior(*self._ray, self._scene.positions, noise_deg=0)
        return int((by_ray if self._phrase is None else fuse(self._phrase, self._scene, by_ray)).argmax())

    def name(self, index: int) -> str:
        """Return the object in words."""
        return object_name(index, self._scene)


@dataclass(frozen=True)
class EpisodeResult:
    """The result of an episode. referent: in words. steps: control steps. It timed out if both flags are False."""

    referent: str
    success: bool
    wrong_object: bool
    steps: int

    @property
    def ending(self) -> str:
        """The outcome in words."""
        return "success" if self.success else "wrong object" if self.wrong_object else "out of time"


@torch.no_grad()
def run_by_hand(
    env: ByHandEnv,
    policy: Callable[[TensorDictBase], TensorDictBase],
    episodes: int,
    *,
    keys: KeySource,
    display: Display,
    real_time: bool = True,
) -> list[EpisodeResult]:
    """Run episodes with the deterministic policy until there are `episodes` results or the person presses Escape.

    Args:
        policy: writes "action"; is not given the privileged keys.
        real_time: False takes control steps without waiting.
    """
    results: list[EpisodeResult] = []
    period = env.config.physics.time_step * env.config.physics.substeps if real_time else 0.0
    try:
        with set_exploration_type(ExplorationType.DETERMINISTIC):
            while len(results) < episodes and (
                result := _run_episode(env, policy, keys=keys, display=display, period=period)
            ):
                results.append(result)
                if not _wait_for_enter(keys):
                    break
    except CLOSED:
        if not keys.escape_pressed():  # an error of PyBullet's, not the closed window
            raise
    display.clear()
    return results


def _run_episode(
    env: ByHandEnv, policy: Callable, *, keys: KeySource, display: Display, period: float
) -> EpisodeResult | None:
    """Return the result; None if the person quit."""
    env.reset()
    sentence = f'"{env.sentence()}"'
    pointer, workspace = ScenePointer(env), env.config.workspace
    x0, x1, y0, y1 = workspace.object_area
    start = ((x0 + x1) / 2, (y0 + y1) / 2, env.config.task.object_size / 2)
    index = choose_object(KeyboardPointer(pointer, display, start, workspace.bounds), keys, display, [sentence])
    if index is None:
        return None
    name = pointer.name(index)
    display.write([sentence, f"meant: {name}", "Escape: quit"])
    end = _run_policy(env, policy, env.set_referent(index), keys=keys, period=period)
    if end is None:
        return None
    result = EpisodeResult(name, bool(end["success"][0]), bool(end["wrong_object"][0]), int(env.elapsed[0]))
    display.write([sentence, f"meant: {name}", result.ending, NEXT])
    return result


def _run_policy(
    env: ByHandEnv, policy: Callable, state: TensorDictBase, *, keys: KeySource, period: float
) -> TensorDictBase | None:
    """Return the last step of the episode, with a control step every `period` seconds; None if the person quit."""
    due = time.monotonic()
    while not keys.escape_pressed():
        state["action"] = policy(state.exclude("privileged"))["action"]
        state = env.step(state)["next"]
        if state["done"][0]:
            return state
        due = max(due + period, time.monotonic())
        time.sleep(max(0.0, due - time.monotonic()))
    return None


def _wait_for_enter(keys: KeySource) -> bool:
    """Wait for Enter (True) or Escape (False)."""
    while True:
        for key in keys.poll():
            if key in ("enter", "escape"):
                return key == "enter"
