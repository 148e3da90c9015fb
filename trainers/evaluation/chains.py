"""Evaluation of chains: instructions one after another in the same world, each given after the last was carried out.

A chain ends at the first instruction that is not carried out in time. The figures are those of CALVIN, Mees et al. 2022
(arXiv:2112.03227): the shares of chains in which 1, 2, ... instructions were carried out in a row, and their mean.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from tensordict.nn import TensorDictModuleBase
from torchrl.envs.utils import ExplorationType, set_exploration_type

from core.errors import Interrupted
from trainers.environment import TrainingEnv
from trainers.evaluation.evaluation import quotas, wilson

KIND = ("privileged", "kind")
DRAWS = 2000  # of the bootstrap
START = "start"  # in place of a kind: before the first instruction


@dataclass(frozen=True)
class InstructionChain:
    """kinds: of the instructions that were said, indices. reached: how many of them were carried out in a row."""

    kinds: tuple[int, ...]
    reached: int


@torch.no_grad()
def run_chains(
    env: TrainingEnv,
    policy: TensorDictModuleBase,
    chains: int,
    seed: int,
    stop: Callable[[], bool] = lambda: False,
) -> list[InstructionChain]:
    """Run exactly `chains` episodes with the deterministic policy.

    Args:
        env: batch_size (N,); its episodes have as many instructions as a chain.
        policy: writes "action"; it does not receive the privileged keys.
        chains: their number over all worlds.
        seed: set on the environment first.
        stop: called at each step; True interrupts the evaluation.

    Raises:
        Interrupted: `stop` returned True.
    """
    env.set_seed(seed)
    worlds = env.batch_size[0]
    left: list[int] = quotas(chains, worlds)
    said: list[list[int]] = [[] for _ in range(worlds)]
    found: list[InstructionChain] = []
    state = env.reset()
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        while any(left):
            if stop():
                raise Interrupted
            state["action"] = policy(state.exclude("privileged"))["action"]
            kind = state[KIND].tolist()
            step, state = env.step_and_maybe_reset(state)
            success, done = (step["next", name].flatten().tolist() for name in ("success", "done"))
            for world in range(worlds):
                if success[world] or done[world]:
                    said[world].append(kind[world])
                if done[world]:
                    if left[world]:
                        left[world] -= 1
                        found.append(InstructionChain(tuple(said[world]), len(said[world]) - (not success[world])))
                    said[world] = []
    return found


def summarize_chains(chains: Sequence[InstructionChain], length: int, kind_names: Sequence[str]) -> dict[str, Any]:
    """Return plain values for JSON: `mean_length`, `reached`, and success by task and by transition, with intervals.

    reached: for 1, 2, ... `length`, the share of chains in which at least as many instructions were carried out in a
    row, with Wilson's intervals. mean_length_ci95: bootstrap over chains. by_task: of each kind. by_transition: of each
    pair of kinds, the earlier one carried out.
    """
    reached = np.array([chain.reached for chain in chains])
    counts = [int((reached >= count).sum()) for count in range(1, length + 1)]
    means = np.random.default_rng(0).choice(reached, (DRAWS, len(reached))).mean(1)
    tried = [
        (before, kind, i < chain.reached)
        for chain in chains
        for i, (before, kind) in enumerate(pairwise([START, *(kind_names[kind] for kind in chain.kinds)]))
    ]
    return {
        "chains": len(chains),
        "length": length,
        "mean_length": float(reached.mean()),
        "mean_length_ci95": [float(value) for value in np.percentile(means, (2.5, 97.5))],
        "reached": [count / len(chains) for count in counts],
        "reached_ci95": [list(wilson(count, len(chains))) for count in counts],
        "by_task": _shares((kind, done) for _, kind, done in tried),
        "by_transition": _shares((f"{before} -> {kind}", done) for before, kind, done in tried),
    }


def _shares(tried: Iterable[tuple[str, bool]]) -> dict[str, dict[str, Any]]:
    """Return success of those of each name, the worst first."""
    groups: dict[str, list[bool]] = {}
    for name, done in tried:
        groups.setdefault(name, []).append(done)
    worst_first = sorted(groups.items(), key=lambda item: sum(item[1]) / len(item[1]))
    return {
        name: {"tried": len(group), "success": sum(group) / len(group), "ci95": list(wilson(sum(group), len(group)))}
        for name, group in worst_first
    }
