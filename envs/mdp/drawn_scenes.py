"""Pictures of scenes that are drawn and described but not simulated, from which words are learned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
import torch
from numpy.random import Generator
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase

from envs.mdp.controls import Control
from envs.mdp.goals import Goal, tokens
from envs.tasks import EpisodeSpec, GripperStart, Task
from language import Tokenizer

SENTENCES = 3  # of each scene: a picture costs more than a sentence, in rendering and in learning
KEYS = ("pixels", "tip", "objects", "objects_mask", ("privileged", "seen_at"))


class PhotographedEnv(Protocol):
    """The part of `WorkspaceEnv` that is needed here."""

    task: Task
    control: Control
    tokenizer: Tokenizer

    @property
    def grip_depth(self) -> float: ...

    @property
    def slots(self) -> Sequence[NDArray[np.int64]]: ...

    def start(self, episodes: Sequence[EpisodeSpec], seed: int) -> TensorDictBase: ...

    def close(self) -> Any: ...


class DrawnScenes:
    """Draws scenes, each with several sentences and with the gripper anywhere in its box, and photographs them.

    env: of one world, with pictures, by `EnvConfig.drawn_anywhere`. `close` closes it.
    """

    def __init__(self, env: PhotographedEnv) -> None:
        self._env, self.close = env, env.close

    def __call__(self, count: int, seed: int) -> TensorDictBase:
        """Draw `count` scenes.

        Args:
            count: number of scenes.
            seed: of all randomness.

        Returns:
            (count,) pixels, tip, objects, objects_mask and privileged/seen_at as the environment observes them, and
            for S sentences instruction (S, L), privileged/referent (S,) and, where there are targets,
            privileged/target (S,).
        """
        rng = np.random.default_rng(seed)
        return torch.stack([self._scene(rng) for _ in range(count)])

    def _scene(self, rng: Generator) -> TensorDictBase:
        env = self._env
        episodes = env.task.each_in_turn(rng)
        chosen = [episodes[k] for k in rng.permutation(max(len(episodes), SENTENCES))[:SENTENCES] % len(episodes)]
        offset = rng.uniform(*env.control.box) - chosen[0].scene.positions[chosen[0].referent]
        start = GripperStart(offset - [0.0, 0.0, env.grip_depth], held=False)
        observed = env.start([replace(chosen[0], start=start)], int(rng.integers(2**31)))[0].select(*KEYS)
        goals = [Goal.of(episode, env.slots[0]) for episode in chosen]
        labels = {"referent": torch.tensor([goal.referent for goal in goals])}
        if env.task.traits.places:
            labels["target"] = torch.tensor([goal.target for goal in goals])
        observed["instruction"] = torch.from_numpy(np.stack([tokens(episode, env.tokenizer) for episode in chosen]))
        return observed.update({"privileged": TensorDict(labels, [])})
