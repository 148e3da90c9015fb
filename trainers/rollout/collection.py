"""Worlds to batches: TorchRL's collectors, in this process or in several, and what the episodes came to."""

from __future__ import annotations

import copy
import multiprocessing
import multiprocessing.connection
import signal
import threading
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import torch
from tensordict import TensorDictBase
from torchrl.collectors import Collector, MultiSyncCollector
from torchrl.envs import EnvBase

from conf.schema import RunError
from trainers.config import CollectorConfig, workers
from trainers.models.policy import Policy

DIED = "collecting in worker processes failed: one of them died (exit code -9, if it was killed)"
GRACE = 5.0  # seconds in which TorchRL may notice by itself that a worker is gone
MakeEnv = Callable[[int, int], EnvBase]  # worlds, seed


class CollectionError(RunError):
    """A worker process is gone or stuck. The run cannot go on."""


def derive_seed(seed: int, index: int, evaluation: bool = False) -> int:
    """A seed of 31 bits for worker or evaluation `index` of a run.

    Bit 30 tells training from evaluation, so that no evaluation ever sees a seed that was trained on.
    """
    word = int(np.random.SeedSequence([seed, index, int(evaluation)]).generate_state(1)[0])
    return (word & 0x3FFFFFFF) | (int(evaluation) << 30)


class Rollouts:
    """Batches (worlds of all workers, horizon) of the latest policy given to `sync`. Close it in a `finally`.

    The policy acts on the CPU, where the worlds are, whatever device it learns on.
    """

    def __init__(self, make_env: MakeEnv, policy: Policy, config: CollectorConfig, horizon: int, seed: int) -> None:
        self.acting = copy.deepcopy(policy).cpu()
        count = workers(config)
        share = config.worlds // count
        common: dict[str, Any] = {
            "frames_per_batch": config.worlds * horizon,
            "total_frames": -1,
            "auto_register_policy_transforms": False,
        }
        act = self.acting.act
        if count == 1:
            make = partial(make_env, share, derive_seed(seed, 0))
            self.collector = Collector(make, act, use_buffers=False, **common)
        else:
            makes = [partial(_in_worker, make_env, share, derive_seed(seed, i)) for i in range(count)]
            self.collector = MultiSyncCollector(makes, act, cat_results=0, use_buffers=True, num_threads=1, **common)
        self.processes = list(getattr(self.collector, "procs", []))
        self.batches = iter(self.collector)
        self.watch = Watch(self.processes) if self.processes else None

    def sync(self, policy: Policy) -> None:
        """Collect with these weights from now on."""
        self.acting.load_state_dict(policy.state_dict())
        if self.processes:
            self.collector.update_policy_weights_()

    def next(self) -> TensorDictBase:
        """The next batch. Its memory is reused by the one after. Raises CollectionError."""
        torch.set_num_threads(1)  # networks of one batch of worlds are too small to share among cores
        if not self.processes:
            return next(self.batches)
        try:
            return next(self.batches)
        except ValueError as error:  # from its own cleaning up, where another worker takes long to end
            raise CollectionError(f"{DIED}: {error}") from error
        except (RuntimeError, OSError, EOFError) as error:
            raise CollectionError(f"collecting in worker processes failed: {error}") from error

    def close(self) -> None:
        """End every worker process, with force where it must be."""
        if self.watch is None:
            return self.collector.shutdown()
        self.watch.end()
        try:
            self.collector.shutdown(raise_on_error=False)
        finally:
            for child in multiprocessing.active_children():
                if child in self.processes:
                    child.kill()
                    child.join()


class Watch:
    """Raises CollectionError in the main thread when a worker process dies and nobody notices.

    TorchRL looks at its processes while it waits for a batch, but waits without end for one that dies just before it
    would have acknowledged new weights.
    """

    def __init__(self, processes: Sequence[Any]) -> None:
        self.ended = threading.Event()
        self.sentinels = [process.sentinel for process in processes]
        self.former: Any = None
        if hasattr(signal, "SIGUSR1") and threading.current_thread() is threading.main_thread():
            self.former = signal.signal(signal.SIGUSR1, self._interrupt)
            threading.Thread(target=self._look, daemon=True).start()

    def end(self) -> None:
        """Stop looking; workers may end from now on."""
        self.ended.set()
        if self.former is not None:
            signal.signal(signal.SIGUSR1, self.former)
            self.former = None

    def _look(self) -> None:
        multiprocessing.connection.wait(self.sentinels)
        while not self.ended.wait(GRACE):  # again, where TorchRL swallows it: as it waits for each acknowledgement
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGUSR1)

    def _interrupt(self, *_: object) -> None:
        raise CollectionError(DIED)


def _in_worker(make_env: MakeEnv, worlds: int, seed: int) -> EnvBase:
    """An environment in a worker process: one thread, a noise of its own, deaf to the Ctrl-C meant for its parent."""
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    return make_env(worlds, seed)


class Episodes:
    """What the episodes that ended in a batch came to; those still running are carried over to the next.

    reward_names: what the columns of reward_terms are.
    """

    def __init__(self, reward_names: Sequence[str] = ()) -> None:
        self.reward_names = reward_names
        self.running: np.ndarray | None = None

    @property
    def metrics(self) -> tuple[str, ...]:
        """The names that `measure` returns."""
        names = ("success", "wrong_object", "return", "length", "episodes")
        return (*(f"train/{name}" for name in names), *(f"reward/{name}" for name in self.reward_names))

    def measure(self, batch: TensorDictBase) -> dict[str, float]:
        """Means over the episodes ended in a batch (worlds, steps), and over its steps for the named rewards.

        NaN where no episode ended.
        """
        after = batch["next"]
        done = after["done"].squeeze(-1).numpy()
        total, length = self._accumulate(after["reward"].squeeze(-1).numpy(), done)
        flags = (after[name].squeeze(-1).numpy()[done] for name in ("success", "wrong_object"))
        means = [float(x.mean()) if len(x) else float("nan") for x in (*flags, total, length)]
        terms = after["reward_terms"].flatten(0, 1).mean(0).tolist() if self.reward_names else []
        return dict(zip(self.metrics, [*means, float(done.sum()), *terms], strict=True))

    def _accumulate(self, reward: np.ndarray, done: np.ndarray) -> np.ndarray:
        """Returns and lengths (2, ended) of the episodes that ended, step by step over (worlds, steps)."""
        running = np.zeros((2, len(reward))) if self.running is None else self.running
        ended = []
        for r, d in zip(reward.T, done.T, strict=True):
            running = running + np.stack([r, np.ones_like(r)])
            ended.append(running[:, d])
            running = np.where(d, 0.0, running)
        self.running = running
        return np.concatenate(ended, axis=1)
