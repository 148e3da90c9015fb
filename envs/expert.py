"""Scripted experts. One reads the privileged goal, so it shows that a task can be done, and how well; the other
reads the sentence with the parser and weighs the finger, so it shows what understanding both fully would come to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torch import Tensor

from envs.observation import seen_scene
from envs.workspace_env import WorkspaceEnv
from human import NothingPointedAt, meant, named, posterior, visibility
from language import Scene, parse

HOVER = 0.10  # metres above the goal until the gripper is over it, so that nothing is pushed aside
TOUCH = 0.005  # metres above the goal's top at the end
CAMERA_DEG = 2.0  # how far a ray that is read from a picture strays
OVER = 0.02  # metres beside the goal that count as over it


class ReachExpert:
    """Goes over the goal, then down on it, in every control mode. Call it like a policy: it sets "action" (N, A)."""

    def __init__(self, env: WorkspaceEnv) -> None:
        self._env = env

    def __call__(self, tensordict: TensorDictBase) -> TensorDictBase:
        return tensordict.set("action", self.towards(tensordict["privileged", "goal"].numpy().astype(np.float64)))

    def towards(self, goal: NDArray[np.float64]) -> Tensor:
        """The action (N, A) that brings each gripper over its goal (N, 3), metres, and then down on it."""
        goal = goal.copy()
        beside = np.linalg.norm((goal - self._env.gripper)[:, :2], axis=1)
        goal[:, 2] += np.where(beside < OVER, self._env.config.task.object_size / 2 + TOUCH, HOVER)
        return self._env.towards(goal)


class Oracle:
    """Parses each sentence in the scene it was said in, weighs it with the finger, and goes where both say.

    It reads nothing privileged, and knows how far the person's finger strays.
    """

    def __init__(self, env: WorkspaceEnv) -> None:
        self._env, self._expert = env, ReachExpert(env)
        self._slots = np.zeros(len(env.gripper), np.int64)
        self._seen: NDArray | None = None  # the rays that were understood

    def __call__(self, tensordict: TensorDictBase) -> TensorDictBase:
        objects, shown = tensordict["objects"].numpy(), tensordict["objects_mask"].numpy()
        rays = tensordict["gesture"].numpy() if "gesture" in tensordict.keys() else np.zeros((len(objects), 0))
        for world in np.flatnonzero(self._news(rays)).tolist():
            self._slots[world] = self._understood(world, objects[world], shown[world], rays[world])
        goal = objects[np.arange(len(objects)), self._slots, :3].astype(np.float64)
        return tensordict.set("action", self._expert.towards(goal))

    def _news(self, rays: NDArray) -> NDArray[np.bool_]:
        """(N,) which worlds begin an episode, or see another finger."""
        moved = False if self._seen is None else (rays != self._seen).any(1)
        self._seen = rays
        return (self._env.elapsed == 0) | moved

    def _understood(self, world: int, objects: NDArray, shown: NDArray[np.bool_], ray: NDArray) -> int:
        scene = seen_scene(objects[shown], self._env.config.task.viewpoint)
        sentence = self._env.sentence(world)
        if len(ray):
            object_ = self._shown(world, sentence, scene, ray)
            return int(self._slots[world] if object_ is None else np.flatnonzero(shown)[object_])
        return int(np.flatnonzero(shown)[parse(sentence, scene).steps[-1].goal])

    def _shown(self, world: int, sentence: str, scene: Scene, ray: NDArray) -> int | None:
        """The likeliest object by words and finger; None while a finger on its way shows nothing that they fit."""
        phrase = named(sentence)
        try:
            return int(meant(phrase, scene, self._weights(scene, ray)).argmax())
        except NothingPointedAt:
            if self._env.elapsed[world]:
                return None
            return int(meant(phrase, scene, np.ones(len(scene))).argmax())

    def _weights(self, scene: Scene, ray: NDArray) -> NDArray[np.float64]:
        """(K,) how likely each object is by what the person sees and shows, without the words."""
        gesture = self._env.config.gesture
        prior = visibility(self._env.eyes, scene.positions, self._env.config.task.object_size)
        if not ray[-1]:
            return prior
        noise = gesture.noise_deg if gesture.source == "ray" else float(np.hypot(gesture.noise_deg, CAMERA_DEG))
        return posterior(ray[:3], ray[3:6], scene.positions, noise, prior)
