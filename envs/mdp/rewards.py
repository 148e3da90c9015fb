"""Weighted rewards and terminations of a control step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.sim.kinematics import Array
from envs.tasks import State, Task


def reward_weights(task: Task) -> Array:
    """(T,) the weight of each reward term, in the order of `terms`."""
    return np.array([task.config.reward[name] for name in task.terms])


def compute_outcome(task: Task, state: State, weights: Array) -> dict[str, NDArray]:
    """Advance the task by one control step: reward_terms (N, T), reward (N, 1) and flags, (N, 1) each.

    "terminated" is among the flags. The env adds truncation.
    """
    outcome = task.step(state)
    terms = np.stack([outcome.terms[name] for name in task.terms], axis=1) * weights
    never = np.zeros_like(outcome.success)
    wrong_target = never if outcome.wrong_target is None else outcome.wrong_target
    flags = {
        "success": outcome.success,
        "wrong_object": outcome.wrong_object,
        "wrong_target": wrong_target,
        "at_goal": outcome.at_goal,
        "terminated": outcome.terminated,
    }
    return {
        "reward_terms": terms.astype(np.float32),
        "reward": terms.sum(1, keepdims=True).astype(np.float32),
        **{name: flag[:, None] for name, flag in flags.items()},
    }
