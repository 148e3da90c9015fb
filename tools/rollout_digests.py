"""Digests of rollouts: equal digests on two machines or versions of Python mean equal bits.

    python -m tools.rollout_digests > here.json

Each row is a task with a robot and a control mode, with random actions, or a pretrained policy in its own environment.
Every array of the rollout counts: observations, rewards, ends.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from itertools import product
from typing import Any

import torch

from deixis import load_policy
from demo.session_config import pretrained_policies
from envs import make_env
from envs.workspace_env import WorkspaceEnv

TASKS = (
    "nl_reach",
    "nl_reach_gesture",
    "nl_pick_and_place",
    "nl_push",
    "nl_stack",
    "nl_grasp",
    "nl_lift",
    "rearrange",
)
ROBOTS = "kuka", "panda", "jaco"
CONTROLS = "step", "absolute", "joints"
WORLDS, STEPS = 2, 25


def digests() -> Iterator[tuple[str, str]]:
    """Yield the name and the digest of each rollout."""
    for number, (task, robot) in enumerate(product(TASKS, ROBOTS)):
        control = CONTROLS[number % len(CONTROLS)]
        overrides = [f"task={task}", f"robot={robot}", f"control={control}"]
        yield f"{task} {robot} {control}", _digest(make_env(overrides, WORLDS, seed=number))
    for each in pretrained_policies():
        policy = load_policy(each.name)
        yield each.name, _digest(policy.make_env(WORLDS, seed=0), policy)


def _digest(env: WorkspaceEnv, policy: Any = None) -> str:
    """Roll out for `STEPS`, close the environment, and return the digest of all arrays in the order of their names."""
    torch.manual_seed(0)
    with torch.no_grad():
        rollout = env.rollout(STEPS, policy, break_when_any_done=False)
    env.close()
    sha = hashlib.sha256()
    for key in sorted(rollout.keys(include_nested=True, leaves_only=True), key=str):
        sha.update(str(key).encode())
        sha.update(rollout[key].contiguous().numpy().tobytes())
    return sha.hexdigest()[:16]


if __name__ == "__main__":
    torch.set_num_threads(1)
    print(json.dumps(dict(digests()), indent=1))
