"""Episodes by hand: a person moves the finger with keys until it shows what they mean, and watches the robot."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pybullet as bullet
import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torchrl.envs.utils import ExplorationType, set_exploration_type

from conf.schema import ConfigError
from envs.config import EnvConfig
from envs.mdp.observation_spec import seen_scene
from envs.sim.window import Window
from envs.workspace_env import WorkspaceEnv
from human import Display, KeyboardPointer, KeySource, choose_object, fuse, pointed_object, posterior, referring_phrase
from human.body.window import WindowDisplay, WindowKeys
from language import LanguageError, Scene, describe

Array = NDArray[np.float64]
NEXT = "Enter: next scene; Escape: leave"


class HandEnv(WorkspaceEnv):
    """One world whose person points where they are told. Raises ConfigError where nobody points.

    window: show it in a window, whose keys and view `face` gives.
    """

    def __init__(self, config: EnvConfig, seed: int = 0, window: bool = True) -> None:
        if config.gesture.source == "none":
            raise ConfigError(
                f"by_hand=true needs a person who points, and in task.name={config.task.name} gesture.source=none; "
                "take a checkpoint of task=reach_gesture or task=nl_reach_gesture"
            )
        self._window = Window(config.workspace.camera) if window else None
        super().__init__(config, seed=seed, window=self._window)

    def face(self) -> tuple[KeySource, Display]:
        """The keys and the view of the window."""
        assert self._window is not None
        return WindowKeys(self._window.client), WindowDisplay(self._window.client)

    def point(self, target: Array) -> tuple[Array, Array]:
        """Move the finger to target (3,), metres, in `gesture.frames` physics steps; no control step passes.

        Returns the fingertip (3,) and the unit direction (3,) then. Raises Unreachable, and nothing moves.
        """
        assert self._person is not None
        gesture = self._person.aim(target)
        self._gestures.point(0, gesture)
        return gesture.origin, gesture.direction

    def mean(self, index: int) -> TensorDictBase:
        """The scene's object `index` is meant from now on. Returns what is observed, nothing having been done yet."""
        self._arrays.read(self._arrays.index)
        slot = int(np.flatnonzero(self._state.shown[0])[index])
        self._set_goal(0, replace(self._arrays.goals[0], referent=slot))
        return self._begun()

    def scene(self) -> Scene:
        """The objects, as words see them."""
        return seen_scene(self._arrays.rows[0, self._state.shown[0]], self.config.task.viewpoint, self.task.operates)


class Pointing:
    """The finger of this environment, as keys move it, and what it shows of this scene."""

    def __init__(self, env: HandEnv) -> None:
        self._env, self._scene = env, env.scene()
        sentence = env.sentence()
        self._phrase = referring_phrase(sentence) if sentence else None
        self._ray = np.zeros(3), np.zeros(3)

    def point(self, target: Array) -> Array:
        self._ray = self._env.point(target)
        return self._ray[0]

    def nearest(self) -> int:
        return int(pointed_object(*self._ray, self._scene.positions))

    def meant(self) -> int:
        shown = posterior(*self._ray, self._scene.positions, noise_deg=0)
        return int((shown if self._phrase is None else fuse(self._phrase, self._scene, shown)).argmax())

    def name(self, index: int) -> str:
        try:
            return describe(index, self._scene)
        except LanguageError:  # no words tell it from its like
            return f"a {self._scene[index].color} {self._scene[index].noun}"


@dataclass(frozen=True)
class Played:
    """An episode: what was meant, in words, how it ended (neither: out of time) and after how many control steps."""

    meant: str
    success: bool
    wrong_object: bool
    steps: int

    @property
    def ending(self) -> str:
        """How it ended, in words."""
        return "success" if self.success else "wrong object" if self.wrong_object else "out of time"


@torch.no_grad()
def play(
    env: HandEnv,
    policy: Callable[[TensorDictBase], TensorDictBase],
    episodes: int,
    keys: KeySource,
    view: Display,
    hurry: bool = False,
) -> list[Played]:
    """So many episodes with the deterministic policy, or as many as were played to their end before Escape.

    policy: writes "action"; never sees the privileged keys. hurry: don't wait for real time to pass.
    """
    played: list[Played] = []
    period = 0.0 if hurry else env.config.physics.time_step * env.config.physics.substeps
    try:
        with set_exploration_type(ExplorationType.DETERMINISTIC):
            while len(played) < episodes and (episode := _episode(env, policy, keys, view, period)):
                played.append(episode)
                if not _go_on(keys):
                    break
    except bullet.error:
        if not keys.escape_pressed():  # else the window was closed, in the middle of something
            raise
    view.clear()
    return played


def _episode(env: HandEnv, policy: Callable, keys: KeySource, view: Display, period: float) -> Played | None:
    """None: the person left."""
    env.reset()
    sentence = f'"{env.sentence()}"'
    arm, workspace = Pointing(env), env.config.workspace
    x0, x1, y0, y1 = workspace.object_area
    middle = ((x0 + x1) / 2, (y0 + y1) / 2, env.config.task.object_size / 2)
    chosen = choose_object(KeyboardPointer(arm, view, middle, workspace.bounds), keys, view, [sentence])
    if chosen is None:
        return None
    name = arm.name(chosen)
    view.write([sentence, f"meant: {name}", "Escape: leave"])
    end = _watch(env, policy, env.mean(chosen), keys, period)
    if end is None:
        return None
    played = Played(name, bool(end["success"][0]), bool(end["wrong_object"][0]), int(env.elapsed[0]))
    view.write([sentence, f"meant: {name}", played.ending, NEXT])
    return played


def _watch(
    env: HandEnv, policy: Callable, state: TensorDictBase, keys: KeySource, period: float
) -> TensorDictBase | None:
    """The end of the episode that `state` begins, a control step each `period` seconds; None: the person left."""
    due = time.monotonic()
    while not keys.escape_pressed():
        state["action"] = policy(state.exclude("privileged"))["action"]
        state = env.step(state)["next"]
        if state["done"][0]:
            return state
        due = max(due + period, time.monotonic())
        time.sleep(max(0.0, due - time.monotonic()))
    return None


def _go_on(keys: KeySource) -> bool:
    """Wait for Enter; False: it was Escape."""
    while True:
        for key in keys.poll():
            if key in ("enter", "escape"):
                return key == "enter"
