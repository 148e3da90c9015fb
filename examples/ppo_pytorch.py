"""PPO in one file of plain PyTorch on the worlds of a Gymnasium VectorEnv: `python examples/ppo_pytorch.py`."""

from __future__ import annotations

import argparse
from typing import Any

import gymnasium
import numpy as np
import torch
from torch import Tensor, nn
from torch.distributions import Normal

import envs  # noqa: F401  registers the ids

WORLDS, STEPS, EPOCHS, MINIBATCHES = 32, 32, 6, 4
GAMMA, LAMBDA, CLIP, LEARNING_RATE = 0.9, 0.9, 0.2, 1e-3


def flat(observation: dict[str, Any]) -> Tensor:
    """(N, O) all numbers of an observation."""
    return torch.cat([torch.as_tensor(part).float().flatten(1) for part in observation.values()], 1)


def network(inputs: int, outputs: int) -> nn.Sequential:
    """A network of two hidden layers, whose first outputs are near 0."""
    layers = nn.Sequential(nn.Linear(inputs, 128), nn.Tanh(), nn.Linear(128, 128), nn.Tanh(), nn.Linear(128, outputs))
    nn.init.normal_(layers[-1].weight, std=0.01)
    return layers


class Agent(nn.Module):
    """An actor with Gaussian noise, and a critic."""

    def __init__(self, inputs: int, actions: int) -> None:
        super().__init__()
        self.mean, self.value = network(inputs, actions), network(inputs, 1)
        self.log_std = nn.Parameter(torch.full((actions,), -0.7))

    def forward(self, seen: Tensor) -> Normal:
        """The distribution of actions (..., A)."""
        return Normal(self.mean(seen), self.log_std.exp())


@torch.no_grad()
def collect(agent: Agent, worlds: Any, seen: Tensor) -> tuple[dict[str, Tensor], Tensor, list[bool]]:
    """Return frames (STEPS, N, ...) with advantages, the next observation, and the successes of what ended."""
    rows: list[dict[str, Tensor]] = []
    ends: list[bool] = []
    for _ in range(STEPS):
        policy = agent(seen)
        action = policy.sample()
        observation, reward, terminated, truncated, infos = worlds.step(action.clamp(-1, 1).numpy())
        after, over = flat(observation), terminated | truncated
        last = after.clone()
        for i in np.flatnonzero(over):
            last[i] = flat({key: part[None] for key, part in infos["final_obs"][i].items()})[0]
            ends.append(bool(infos["final_info"]["is_success"][i]))
        row = {"seen": seen, "action": action, "log_prob": policy.log_prob(action).sum(-1)}
        row |= {"value": agent.value(seen)[:, 0], "next_value": agent.value(last)[:, 0] * ~torch.as_tensor(terminated)}
        rows.append(row | {"reward": torch.as_tensor(reward).float(), "over": torch.as_tensor(over).float()})
        seen = after
    frames = {key: torch.stack([row[key] for row in rows]) for key in rows[0]}
    advantage = torch.zeros(worlds.num_envs)
    advantages = torch.empty_like(frames["reward"])
    errors = frames["reward"] + GAMMA * frames["next_value"] - frames["value"]
    for step in reversed(range(STEPS)):
        advantage = errors[step] + GAMMA * LAMBDA * (1 - frames["over"][step]) * advantage
        advantages[step] = advantage
    return frames | {"advantage": advantages, "target": advantages + frames["value"]}, seen, ends


def update(agent: Agent, optimizer: torch.optim.Optimizer, frames: dict[str, Tensor]) -> None:
    """Train on frames (STEPS, N, ...)."""
    flattened = {key: value.flatten(0, 1) for key, value in frames.items()}
    count = len(flattened["reward"])
    for _ in range(EPOCHS):
        for rows in torch.randperm(count).chunk(MINIBATCHES):
            batch = {key: value[rows] for key, value in flattened.items()}
            log_prob = agent(batch["seen"]).log_prob(batch["action"]).sum(-1)
            ratio, advantage = (log_prob - batch["log_prob"]).exp(), batch["advantage"]
            advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
            gain = torch.min(ratio * advantage, ratio.clamp(1 - CLIP, 1 + CLIP) * advantage).mean()
            error = (agent.value(batch["seen"])[:, 0] - batch["target"]).square().mean()
            optimizer.zero_grad()
            (0.5 * error - gain).backward()
            nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
            optimizer.step()


def main(words: list[str] | None = None) -> float:
    """Train; return success in the last episodes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--env", default="Deixis/Reach-v0")
    parser.add_argument("--frames", type=int, default=60_000)
    args = parser.parse_args(words)
    if args.frames < WORLDS * STEPS:
        parser.error(f"--frames {args.frames} is less than one batch: give at least {WORLDS * STEPS}")
    torch.manual_seed(0)
    worlds = gymnasium.make_vec(args.env, num_envs=WORLDS, autoreset_mode="SameStep", instruction="embedding")
    seen = flat(worlds.reset(seed=0)[0])
    agent = Agent(seen.shape[1], worlds.single_action_space.shape[0])
    optimizer = torch.optim.Adam(agent.parameters(), LEARNING_RATE)
    success: list[bool] = []
    for done in range(WORLDS * STEPS, args.frames + 1, WORLDS * STEPS):
        frames, seen, ends = collect(agent, worlds, seen)
        update(agent, optimizer, frames)
        success = [*success, *ends][-200:]
        print(f"{done} frames, success {np.mean(success or [0]):.2f} of the last {len(success)} episodes", flush=True)
    worlds.close()
    return float(np.mean(success or [0]))


if __name__ == "__main__":
    main()
