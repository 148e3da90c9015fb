"""Work that is shared out over a Ray cluster: a function over many inputs, and an evaluation in shards.

A shard is a part of an evaluation with a seed of its own, so the result is the same wherever it is evaluated.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from typing import Any, TypeVar

from core.errors import ConfigError, Interrupted, RunError
from trainers.cluster.ray_session import RaySession
from trainers.collect.worker import raised
from trainers.evaluation.evaluation import EpisodeOutcome, quotas, summarize

EPISODES = 500  # of a shard on a cluster, if their number is not given

# (the shard's number, its number of episodes) to its episodes and the names of the kinds of instructions
Evaluate = Callable[[tuple[int, int]], tuple[list[EpisodeOutcome], Sequence[str]]]


POLL_SECONDS = 0.2
RETRIES = 3  # of an input whose task was lost
WINDOW = 2  # tasks that are started for each core: few, so that few results wait for an earlier one
T = TypeVar("T")


def evaluate_shards(evaluate: Evaluate, episodes: int, shards: int | None, on_cluster: bool) -> dict[str, Any]:
    """Return the result over all shards as plain values.

    It depends on their number, and not on where they are evaluated.

    Args:
        evaluate: evaluates a shard; picklable.
        episodes: of all shards.
        shards: their number; None for 1, and on a cluster for one for each EPISODES.
        on_cluster: whether they are tasks of a Ray cluster.
    """
    count = min(episodes, shards or (-(-episodes // EPISODES) if on_cluster else 1))
    inputs = list(enumerate(quotas(episodes, count)))
    parts = list(map_on_cluster(evaluate, inputs, "shard") if on_cluster else map(evaluate, inputs))
    result = summarize([outcome for part, _ in parts for outcome in part], parts[0][1]).as_dict()
    return result | ({"shards": count} if count > 1 else {})


def map_on_cluster(
    function: Callable[[Any], T],
    inputs: Sequence[Any],
    name: str,
    address: str | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> Iterator[T]:
    """Return the results of `function(each)`, in order.

    It must depend on its input alone, since a lost task is done again.

    Args:
        function: picklable.
        inputs: picklable.
        name: of the work, for Ray's dashboard and for messages.
        address: of the cluster, as of `RaySession`.
        stop: called while it waits; True gives up.

    Raises:
        ConfigError: there is no such cluster, a node has other versions, or the function refused its input.
        RunError: the function raised another exception, or an input's tasks were lost too often.
        Interrupted: `stop` returned True.
    """
    with closing(RaySession(address)) as session:
        session.check_nodes()
        yield from _Tasks(session, function, inputs, name).results(stop)


class _Tasks:
    """The tasks of a `map_on_cluster`."""

    def __init__(self, session: RaySession, function: Callable[[Any], Any], inputs: Sequence[Any], name: str) -> None:
        self.session, self.ray, self.inputs, self.name = session, session.ray, inputs, name
        options = {"num_cpus": 1, "max_retries": 0, "scheduling_strategy": "SPREAD"}
        self.task = self.ray.remote(**options)(_call)
        self.function = self.ray.put(function)
        self.running: dict[Any, int] = {}  # by the reference to the result: the number of the input
        self.starts = [0] * len(inputs)

    def results(self, stop: Callable[[], bool]) -> Iterator[Any]:
        """Generate the results in order."""
        done: dict[int, Any] = {}
        started = 0
        for wanted in range(len(self.inputs)):
            while wanted not in done:
                window = wanted + WINDOW * max(1, int(self.session.cpus))
                while started < min(window, len(self.inputs)):
                    self._start(started)
                    started += 1
                ready, _ = self.ray.wait(list(self.running), num_returns=1, timeout=POLL_SECONDS)
                if stop():
                    raise Interrupted
                for reference in ready:
                    self._take(reference, self.running.pop(reference), done)
            yield done.pop(wanted)

    def _start(self, number: int) -> None:
        self.starts[number] += 1
        task = self.task.options(name=f"deixis {self.name} {number}")
        self.running[task.remote(self.function, self.inputs[number])] = number

    def _take(self, reference: Any, number: int, done: dict[int, Any]) -> None:
        """Keep a result, or start the task again if it was lost."""
        try:
            done[number] = self.ray.get(reference)
        except self.ray.exceptions.RayTaskError as error:
            cause = getattr(error, "cause", error)
            if isinstance(cause, ConfigError):
                raise ConfigError(f"{cause} (on a node of the cluster)") from None
            raise RunError(f"{self.name} {number} {raised(cause)}") from error
        except self.ray.exceptions.RayError as error:
            if self.starts[number] > RETRIES:
                raise RunError(f"{self.name} {number} was lost {RETRIES + 1} times: {type(error).__name__}") from None
            again = f"it is done again ({self.starts[number]} of at most {RETRIES} times)"
            print(f"warning: {self.name} {number} was lost: {type(error).__name__}; {again}", file=sys.stderr)
            self._start(number)


def _call(function: Callable[[Any], T], value: Any) -> T:
    """Run in a task, with one thread, so that the bits do not depend on the node's cores."""
    import torch

    torch.set_num_threads(1)
    return function(value)
