"""A learned policy in place of the expert, for `benchmarks.rearrange`."""

from __future__ import annotations

from tensordict import TensorDict

from core.errors import ConfigError
from core.overrides import apply
from deixis.policy import LoadedPolicy, load_policy
from envs import read_env
from envs.workspace_env import WorkspaceEnv

TASK = "rearrange"
CURRICULUM = "task.curriculum={near: 0, held: 1, placed: 0}"  # lets an episode begin with a block held


def most_blocks(name: str) -> int:
    """Return the most blocks of the policy's task. Raises ConfigError for a policy of another task than `rearrange`."""
    config = load_policy(name).config
    if (task := config["task"]["name"]) != TASK:
        raise ConfigError(f"--policy {name} was trained with task={task}: choose one of task={TASK}")
    return int(config["task"]["num_objects"])


def make_env(policy: LoadedPolicy) -> WorkspaceEnv:
    """Return one world as the policy was trained in."""
    return WorkspaceEnv(read_env(apply(policy.config, [CURRICULUM])))


def carry_out(env: WorkspaceEnv, policy: LoadedPolicy) -> bool:
    """Have the policy act until the episode that has begun ends; return whether in success."""
    hold = env.towards(env.commanded_gripper)
    observed = env.step(TensorDict({"action": hold}, env.batch_size))["next"]  # `begin` keeps no observation
    while not observed["done"]:
        observed = env.step(policy(observed))["next"]
    return bool(observed["success"])
