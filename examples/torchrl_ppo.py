"""PPO by TorchRL's own collector, advantages and loss, on our environment: `python examples/torchrl_ppo.py`."""

from __future__ import annotations

import argparse

import torch
from tensordict.nn import NormalParamExtractor, TensorDictModule, TensorDictSequential
from torch import nn
from torchrl.collectors import Collector
from torchrl.envs import RewardSum, TransformedEnv
from torchrl.modules import ProbabilisticActor, TanhNormal, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

from core.program import program
from envs import make_env

WORLDS, HORIZON, EPOCHS, MINIBATCH = 32, 32, 6, 256


def network(inputs: int, outputs: int) -> nn.Sequential:
    """A network of two hidden layers."""
    return nn.Sequential(nn.Linear(inputs, 128), nn.Tanh(), nn.Linear(128, 128), nn.Tanh(), nn.Linear(128, outputs))


def main(words: list[str] | None = None) -> float:
    """Train on a task without words; return success in the last episodes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="reach")
    parser.add_argument("--frames", type=int, default=60_000)
    args = parser.parse_args(words)
    torch.manual_seed(0)
    env = TransformedEnv(make_env([f"task={args.task}"], num_worlds=WORLDS), RewardSum())
    spec = env.observation_spec
    inputs, actions = sum(spec[key].shape[1:].numel() for key in ("robot", "objects")), env.action_spec.shape[-1]
    join = TensorDictModule(
        lambda robot, objects: torch.cat((robot, objects.flatten(-2)), -1), ["robot", "objects"], ["seen"]
    )
    mean = nn.Sequential(network(inputs, 2 * actions), NormalParamExtractor(scale_mapping="biased_softplus_0.5"))
    actor = ProbabilisticActor(
        TensorDictSequential(join, TensorDictModule(mean, ["seen"], ["loc", "scale"])),
        in_keys=["loc", "scale"],
        distribution_class=TanhNormal,
        return_log_prob=True,
    )
    critic = TensorDictSequential(join, ValueOperator(network(inputs, 1), in_keys=["seen"]))
    loss = ClipPPOLoss(actor, critic, entropy_bonus=False, normalize_advantage=True)
    advantages = GAE(gamma=0.9, lmbda=0.9, value_network=critic)
    optimizer = torch.optim.Adam(loss.parameters(), 1e-3)
    success: list[bool] = []
    sizes = {"frames_per_batch": WORLDS * HORIZON, "total_frames": args.frames}
    for frames in Collector(env, actor, **sizes, auto_register_policy_transforms=False):
        for _ in range(EPOCHS):
            advantages(frames)
            for rows in torch.randperm(frames.numel()).split(MINIBATCH):
                losses = loss(frames.reshape(-1)[rows])
                optimizer.zero_grad()
                (losses["loss_objective"] + losses["loss_critic"]).backward()
                nn.utils.clip_grad_norm_(loss.parameters(), 0.5)
                optimizer.step()
        ended = frames["next", "done"]
        success = [*success, *frames["next", "success"][ended].tolist()][-200:]
        print(f"success {sum(success) / max(len(success), 1):.2f} of the last {len(success)} episodes", flush=True)
    return sum(success) / max(len(success), 1)


if __name__ == "__main__":
    with program():
        main()
