"""The expert without privileged information: it understands the sentence and the gesture."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase

from envs.experts.base import expert
from envs.mdp.object_rows import nouns_of_rows, scene_of_rows
from envs.workspace_env import WorkspaceEnv
from human import NothingPointedAt, fuse, posterior, referring_phrase, visibility
from language import LanguageError, Scene, parse

CAMERA_DEG = 2.0  # error in degrees of a ray that is read from a picture


class Oracle:
    """Parses each sentence in its scene, combines it with the gesture, and drives the expert to the result.

    It uses public observations only, and knows the aiming noise. No policy can understand words and gesture better.
    """

    def __init__(self, env: WorkspaceEnv) -> None:
        self._env, self._expert = env, expert(env)
        self._slots = np.zeros((len(env.gripper), 2), np.int64)  # referent, target
        self._seen: NDArray | None = None  # the rays that were understood
        self._lost = np.zeros(len(env.gripper), bool)  # whose sentences fit nothing that is seen

    def __call__(self, tensordict: TensorDictBase) -> TensorDictBase:
        objects, shown = tensordict["objects"].numpy(), tensordict["objects_mask"].numpy()
        rays = tensordict["gesture"].numpy() if "gesture" in tensordict.keys() else np.zeros((len(objects), 0))
        for world in np.flatnonzero(self._news(rays)).tolist():
            sentence = self._sentence(world, tensordict)
            slots = self._understood(world, sentence, objects=objects[world], shown=shown[world], ray=rays[world])
            self._lost[world] = slots is None
            self._slots[world] = self._slots[world] if slots is None else slots
        action = self._expert.act_on_shown(*self._slots.T)
        if self._lost.any():
            action = torch.where(torch.from_numpy(self._lost)[:, None], self._env.towards(self._env.gripper), action)
        return tensordict.set("action", action)

    def _news(self, rays: NDArray) -> NDArray[np.bool_]:
        """(N,) which worlds begin an episode, observe another gesture, or were not understood so far."""
        moved = False if self._seen is None else (rays != self._seen).any(1)
        self._seen = rays
        return (self._env.elapsed == 0) | moved | self._lost

    def _sentence(self, world: int, tensordict: TensorDictBase) -> str:
        """Return the instruction: of a sentence of several steps, the one that is carried out now."""
        if not self._env.task.traits.stepwise:
            return self._env.sentence(world)
        return self._env.tokenizer.decode(tensordict["instruction"][world].tolist())

    def _understood(
        self, world: int, sentence: str, *, objects: NDArray, shown: NDArray[np.bool_], ray: NDArray
    ) -> tuple[int, int] | None:
        """Return the slots of the referent and of its target: the referent's own if there is none.

        None where the sentence fits nothing that is seen, which happens with perception=camera alone.
        """
        viewpoint, slots = self._env.config.task.viewpoint, np.flatnonzero(shown)
        rows, task = objects[shown], self._env.task
        scene = scene_of_rows(rows, viewpoint, nouns_of_rows(rows, task.traits.operates, task.fixtures))
        if not len(slots):
            return None
        if len(ray):
            object_ = self._shown(world, sentence, scene, ray)
            slot = int(self._slots[world, 0] if object_ is None else slots[object_])
            return slot, slot
        try:
            step = parse(sentence, scene).steps[-1]
        except LanguageError:
            if self._env.config.perception.sees:
                return None
            raise
        both = [index for index in (step.init, step.goal) if index is not None]
        return int(slots[both[0]]), int(slots[both[-1]])

    def _shown(self, world: int, sentence: str, scene: Scene, ray: NDArray) -> int | None:
        """Return the likeliest object by words and gesture; None while a moving finger points at none that fits."""
        phrase = referring_phrase(sentence)
        try:
            return int(fuse(phrase, scene, self._weights(scene, ray)).argmax())
        except NothingPointedAt:
            if self._env.elapsed[world]:
                return None
            return int(fuse(phrase, scene, np.ones(len(scene))).argmax())

    def _weights(self, scene: Scene, ray: NDArray) -> NDArray[np.float64]:
        """(K,) the likelihood of each object by visibility and gesture, without the words."""
        gesture = self._env.config.gesture
        prior = visibility(self._env.eyes, scene.positions, self._env.config.task.object_size)
        if not ray[-1]:
            return prior
        noise = gesture.noise_deg if gesture.source == "ray" else float(np.hypot(gesture.noise_deg, CAMERA_DEG))
        return posterior(ray[:3], ray[3:6], scene.positions, noise, prior)
