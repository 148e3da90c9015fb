"""Scenes that are drawn and described but never simulated: all that is needed to learn what is meant."""

from __future__ import annotations

import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase

from envs.mdp.gestures import RAY_WIDTH, ray_of
from envs.mdp.goals import Goal, tokens
from envs.mdp.observation_spec import FACING, OBJECT_WIDTH, OFFSET, Bounds, clipped, lasting_rows, offsets
from envs.sim.devices import facing
from envs.tasks import Task
from language import Tokenizer


def described(task: Task, tokenizer: Tokenizer, bounds: Bounds, slots: int, count: int, seed: int) -> TensorDictBase:
    """(count,) objects, objects_mask, instruction, privileged/referent, where there are targets privileged/target and,
    where a person points, gesture.

    They have the shapes and bounds of the observation of a world with so many slots; offsets are seen from grippers
    that are anywhere. The gesture is the finger's own ray, even where episodes are shown the one that a camera reads.
    """
    rng = np.random.default_rng(seed)
    rows, shown = np.zeros((count, slots, bounds.objects.shape[1])), np.zeros((count, slots), bool)
    words, meant = np.zeros((count, tokenizer.length), np.int64), np.zeros((count, 2), np.int64)
    grippers = rng.uniform(bounds.position[0], bounds.position[1], (count, 3)) if task.moves else None
    rays = np.zeros((count, RAY_WIDTH))
    for i in range(count):
        episode = task.draw(rng)
        order = rng.permutation(slots)[: len(episode.scene)]
        rows[i, order, :OBJECT_WIDTH], shown[i, order] = lasting_rows(episode.scene, episode.yaw), True
        words[i] = tokens(episode, tokenizer)
        goal = Goal.of(episode, order)
        meant[i] = goal.referent, goal.target
        rays[i] = ray_of(episode.gesture)
    if grippers is not None:
        rows[..., OFFSET] = offsets(rows[..., :3], grippers[:, None])
    if task.operates:
        rows[..., FACING] = np.where(shown[..., None], facing(rows[..., 3:7]), 0.0)
    referents, targets = (torch.from_numpy(slots.copy()) for slots in meant.T)
    names = {"referent": referents} | ({"target": targets} if task.places else {})
    values = {
        "objects": clipped(rows, bounds.objects),
        "objects_mask": torch.from_numpy(shown),
        "instruction": torch.from_numpy(words),
        "privileged": TensorDict(names, [count]),
    }
    if task.points:
        values["gesture"] = clipped(rays, bounds.gesture)
    return TensorDict(values, [count])
