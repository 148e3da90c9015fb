"""Scenes that are drawn and described but never simulated, to learn the meaning of words from."""

from __future__ import annotations

import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase

from envs.mdp.gestures import RAY_WIDTH, ray_of
from envs.mdp.goals import Goal, tokens
from envs.mdp.object_rows import COLUMNS, FACING, OBJECT_WIDTH, OFFSET, offsets, static_rows
from envs.mdp.observation_terms import Observer, Setup
from envs.mdp.observations import OBSERVATIONS
from envs.sim.devices import facing


class SceneSampler:
    """Draws episodes and observes what can be observed without a simulator.

    Offsets are relative to random gripper positions in the workspace. The gesture is the finger's own ray, even where
    episodes show the ray that a camera reads.

    Args:
        setup: its task draws the episodes, and decides on the shapes and bounds of the observations.
    """

    def __init__(self, setup: Setup) -> None:
        self._setup, self._observer = setup, Observer(OBSERVATIONS, setup)

    def __call__(self, count: int, seed: int) -> TensorDictBase:
        """Draws `count` scenes.

        Args:
            count: number of scenes.
            seed: of all randomness.

        Returns:
            (count,) objects, objects_mask, instruction, privileged/referent; where there are targets,
            privileged/target; where there are several verbs, privileged/verb; where a person points, gesture.
        """
        task, rng = self._setup.task, np.random.default_rng(seed)
        slots, width = self._observer.shape("objects")
        rows, shown = np.zeros((count, slots, width)), np.zeros((count, slots), bool)
        instructions, goals = np.zeros((count, self._setup.tokenizer.length), np.int64), np.zeros((count, 3), np.int64)
        low, high = np.reshape(self._setup.workspace.bounds, (3, 2)).T.astype(np.float32)
        grippers = rng.uniform(low, high, (count, 3)) if task.moves else None
        rays = np.zeros((count, RAY_WIDTH))
        columns = np.zeros((count, slots, len(task.columns)))
        for i in range(count):
            episode = task.draw(rng)
            order = rng.permutation(slots)[: len(episode.scene)]
            rows[i, order, :OBJECT_WIDTH], shown[i, order] = static_rows(episode.scene, episode.yaw), True
            instructions[i] = tokens(episode, self._setup.tokenizer)
            goal = Goal.of(episode, order)
            goals[i] = goal.referent, goal.target, goal.kind
            rays[i] = ray_of(episode.gesture)
            described = task.described(episode)
            columns[i, order, : described.shape[1]] = described  # what only a simulation tells stays 0
        if grippers is not None:
            rows[..., OFFSET] = offsets(rows[..., :3], grippers[:, None])
            rows[..., COLUMNS] = columns
        if task.marks and not task.speaks:
            rows[np.arange(count), goals[:, 0], COLUMNS.start] = 1.0
        if task.operates:
            rows[..., FACING] = np.where(shown[..., None], facing(rows[..., 3:7]), 0.0)
        values = {"objects": rows, "objects_mask": shown, "instruction": instructions}
        if task.points:
            values["gesture"] = rays
        tensors = {key: self._observer.tensor(key, value) for key, value in values.items()}
        referents, targets, kinds = (torch.from_numpy(numbers.copy()) for numbers in goals.T)
        privileged = {"referent": referents} | ({"target": targets} if task.places else {})
        privileged |= {"verb": kinds} if task.verbs else {}
        return TensorDict(tensors | {"privileged": TensorDict(privileged, [count])}, [count])
