"""Evaluation in shards: environments with seeds of their own, one after another here or side by side on a cluster."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from trainers.rollout.evaluation import EpisodeOutcome, quotas, summarize

EPISODES = 500  # of a shard on a cluster, if their number is not given

# (the shard's number, its number of episodes) to its episodes and the names of the kinds of instructions
Evaluate = Callable[[tuple[int, int]], tuple[list[EpisodeOutcome], Sequence[str]]]


def evaluate_shards(evaluate: Evaluate, episodes: int, shards: int | None, on_cluster: bool) -> dict[str, Any]:
    """The result over all shards as plain values. It depends on their number, and not on where they are evaluated.

    Args:
        evaluate: evaluates a shard; picklable.
        episodes: of all shards.
        shards: their number; None for 1, and on a cluster for one for each EPISODES.
        on_cluster: whether they are tasks of a Ray cluster.
    """
    count = min(episodes, shards or (-(-episodes // EPISODES) if on_cluster else 1))
    inputs = list(enumerate(quotas(episodes, count)))
    if on_cluster:
        from trainers.cluster.ray_map import map_on_cluster

        parts = list(map_on_cluster(evaluate, inputs, "shard"))
    else:
        parts = [evaluate(each) for each in inputs]
    result = summarize([outcome for part, _ in parts for outcome in part], parts[0][1]).as_dict()
    return result | ({"shards": count} if count > 1 else {})
