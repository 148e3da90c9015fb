"""Imitation from a recorded dataset, then success in the environment.

python record.py expert=true task=reach episodes=100 format=lerobot out=outputs/demos-v0
python examples/imitation.py outputs/demos-v0

A LeRobot dataset is read by `trainers.datasets.dataset.read`, which needs no LeRobot; one of Minari
(`format=minari`) by Minari itself. Both need `pip install -e ".[record]"`.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch
from tensordict.nn import TensorDictModule
from torch import Tensor, nn

from core.program import program
from envs import make_env
from trainers.datasets.dataset import read
from trainers.evaluation.evaluation import evaluate

KEYS = ("robot", "objects")  # the task has no words


def lerobot_episodes(folder: Path) -> Iterator[tuple[dict[str, np.ndarray], np.ndarray]]:
    """Yield observations before each action, by key, and the actions (T, A) of each episode."""
    for episode in read(folder)[1]:
        yield {key: episode.observations[key][: len(episode)] for key in KEYS}, episode.actions


def minari_episodes(folder: Path) -> Iterator[tuple[dict[str, np.ndarray], np.ndarray]]:
    """Yield observations before each action, by key, and the actions (T, A) of each episode."""
    os.environ["MINARI_DATASETS_PATH"] = str(folder.resolve().parent)
    import minari

    for episode in minari.load_dataset(folder.name).iterate_episodes():
        yield {key: episode.observations[key][:-1] for key in KEYS}, episode.actions


def join(robot: Tensor, objects: Tensor) -> Tensor:
    """(N, O) all numbers of an observation."""
    return torch.cat((robot, objects.flatten(1)), 1)


def main(words: list[str] | None = None) -> float:
    """Train; return success in new episodes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--steps", type=int, default=2000, help="gradient steps")
    parser.add_argument("--episodes", type=int, default=200, help="of the evaluation")
    args = parser.parse_args(words)
    torch.manual_seed(0)
    minari_kind = (args.folder / "data" / "main_data.hdf5").exists()
    episodes = list((minari_episodes if minari_kind else lerobot_episodes)(args.folder))
    seen = join(*(torch.as_tensor(np.concatenate([each[0][key] for each in episodes])).float() for key in KEYS))
    actions = torch.as_tensor(np.concatenate([each[1] for each in episodes]))
    inputs, outputs = seen.shape[1], actions.shape[1]
    net = nn.Sequential(nn.Linear(inputs, 256), nn.ReLU(), nn.Linear(256, 256), nn.ReLU(), nn.Linear(256, outputs))
    middle, spread = seen.mean(0), seen.std(0) + 1e-3
    optimizer = torch.optim.Adam(net.parameters(), 1e-3)
    for _ in range(args.steps):
        rows = torch.randint(len(seen), (256,))
        error = (net((seen[rows] - middle) / spread) - actions[rows]).square().mean()
        optimizer.zero_grad()
        error.backward()
        optimizer.step()

    def act(robot: Tensor, objects: Tensor) -> Tensor:
        return net((join(robot, objects) - middle) / spread).clamp(-1, 1)

    env = make_env(["task=reach"], num_worlds=20)
    policy = TensorDictModule(act, list(KEYS), ["action"])
    result = evaluate(env, policy, args.episodes, seed=2**30)
    env.close()
    print(f"{len(seen)} frames of {len(episodes)} episodes; success {result.success_at_end:.3f} in {args.episodes}")
    return result.success_at_end


if __name__ == "__main__":
    with program():
        main()
