"""Workers: each collects its part of every batch, in this process or in one of its own.

A batch depends on the worker's spec, the policy's weights, the episodes that the worlds are in and the number of the
iteration alone. So a worker can be lost at any time: its successor collects the same bits.
"""

from __future__ import annotations

import copy
import io
import math
import multiprocessing
import os
import pickle
import signal
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any, Protocol

import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor
from torchrl.collectors import Collector

from core.system import signal_at_parent_death
from trainers.collect import fork_server
from trainers.environment import TrainingEnv
from trainers.models.policy import ExpertMixture, Policy

NOISE = 2  # the third word of noise seeds; that of other seeds is 0 or 1
START_SECONDS = 120.0  # to start a worker, to build its worlds and to replay their episodes
KILL_SECONDS = 10.0  # to wait for the end of a process that was killed
EXIT_SECONDS = 1.0  # to wait for the exit code of a process whose pipe is closed
RECEIVE_SECONDS = 10.0  # to read an answer that has begun

MakeEnv = Callable[[int, int], TrainingEnv]  # (number of worlds, seed)
Beginning = Mapping[str, Any]  # the state of a world's generator when its episode began: plain values
Policies = Sequence[Policy | ExpertMixture]


def derive_seed(seed: int, index: int, evaluation: bool = False) -> int:
    """Return a seed of 31 bits for worker or evaluation `index` of a run.

    Bit 30 separates evaluation from training, so that an evaluation never uses a seed of training.
    """
    word = int(np.random.SeedSequence([seed, index, int(evaluation)]).generate_state(1)[0])
    return (word & 0x3FFFFFFF) | (int(evaluation) << 30)


def noise_seed(seed: int, worker: int, iteration: int) -> int:
    """Return the seed of a worker's exploration noise in one batch, so that no worker's generator need be saved."""
    return int(np.random.SeedSequence([seed, worker, NOISE, iteration]).generate_state(1, np.uint64)[0])


@dataclass(frozen=True)
class Episodes:
    """The episodes that N worlds are in after a batch.

    beginnings: for each world, the state of its generator when the episode began. actions: (N, T, A), those of the
    latest T steps. lengths: (N,) how many of them, the last ones, belong to the present episode.
    """

    beginnings: Sequence[Beginning]
    actions: Tensor
    lengths: Tensor

    def part(self, first: int, count: int) -> Episodes:
        """Return those of worlds first to first + count - 1."""
        worlds = slice(first, first + count)
        lengths = self.lengths[worlds]
        return Episodes(self.beginnings[worlds], self.actions[worlds, -int(lengths.max()) or None :], lengths)

    def state_dict(self) -> dict[str, Any]:
        """Return plain values and tensors."""
        return {"beginnings": list(self.beginnings), "actions": self.actions.clone(), "lengths": self.lengths.clone()}


class EpisodeLog:
    """Follows the worlds of all workers. `episodes` is None before the first batch."""

    def __init__(self, episodes: Episodes | None = None) -> None:
        self.episodes = episodes

    def add(self, batch: TensorDictBase, beginnings: Mapping[int, Beginning]) -> None:
        """Take a batch (worlds, steps). beginnings: of the worlds whose episode began in it, or of all worlds."""
        done, steps = batch["next", "done"][..., 0], batch.shape[1]
        since = steps - 1 - _last(done)  # steps after the last end; all of them where no episode ended
        actions, lengths = batch["action"], since
        known = [beginnings.get(i) for i in range(len(done))]
        if self.episodes is not None:
            known = [new or old for new, old in zip(known, self.episodes.beginnings, strict=True)]
            lengths = torch.where(done.any(1), since, self.episodes.lengths + steps)
            actions = torch.cat((self.episodes.actions, actions), 1)
        keep = int(lengths.max())
        self.episodes = Episodes([each or {} for each in known], actions[:, actions.shape[1] - keep :].clone(), lengths)


def _last(flags: Tensor) -> Tensor:
    """Return the index (N,) of the last true value in each row of (N, T); -1 where there is none."""
    order = torch.arange(1, flags.shape[1] + 1)
    return (flags * order).amax(1) - 1


@dataclass(frozen=True)
class WorkerSpec:
    """Which worker of a run it is.

    index: among the workers. worlds: of this worker. horizon: steps of a batch. seed: of all workers of the run. end:
    steps of the whole run; the last batch is shortened to it. None: the run has no end.
    """

    index: int
    worlds: int
    horizon: int
    seed: int
    end: int | None = None

    def steps(self, iteration: int) -> int:
        """Steps of the batch of this iteration; 0 after the end."""
        left = math.inf if self.end is None else self.end - iteration * self.horizon
        return int(max(0, min(self.horizon, left)))


class Worker:
    """Collects batches (worlds, steps).

    A batch depends on the spec, the policy's weights, the episodes that the worlds are in and the number of the
    iteration, and on nothing else: another worker that starts with the same values collects the same bits.

    Args:
        make_env: builds the environment.
        act: the module from observations to "action". It acts on the CPU; whoever owns it changes its weights.
        spec: which worker it is.
        episodes: to continue; None to begin new ones.
    """

    def __init__(
        self, make_env: MakeEnv, act: TensorDictModuleBase, spec: WorkerSpec, episodes: Episodes | None = None
    ) -> None:
        self.spec = spec
        self.env = make_env(spec.worlds, derive_seed(spec.seed, spec.index))
        options: dict[str, Any] = {"frames_per_batch": spec.worlds * spec.horizon, "total_frames": -1}
        self.collector = Collector(self.env, act, use_buffers=False, auto_register_policy_transforms=False, **options)
        if episodes is not None:
            self.env.continue_episodes(episodes.beginnings, episodes.actions, episodes.lengths)
            self.collector.reset()
        self.reported: list[Beginning | None] = [None] * spec.worlds

    def collect(self, iteration: int) -> tuple[TensorDictBase, dict[int, Beginning]]:
        """Return a batch (worlds, steps), and the generators' states of those worlds whose episode began in it.

        The first call returns the states of all worlds.
        """
        self.collector.frames_per_batch = self.spec.steps(iteration)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(noise_seed(self.spec.seed, self.spec.index, iteration))
            batch = self.collector.rollout()
        new = {
            i: state
            for i, (state, old) in enumerate(zip(self.env.beginnings, self.reported, strict=True))
            if state is not old
        }
        self.reported = list(self.env.beginnings)
        return batch, new

    def close(self) -> None:
        """Close the environment."""
        self.collector.shutdown()


# ---- a worker outside of this process


class WorkerLostError(Exception):
    """A worker has ended, raised an exception or does not answer. The text says which.

    frame: the input of the environment's step that raised, if its exception has a `frame`.
    """

    frame: TensorDictBase | None = None


def raised(error: BaseException) -> str:
    """Return an exception as a clause: "raised ValueError: <the first line of its text>"."""
    return f"raised {type(error).__name__}: {(str(error).splitlines() or [''])[0]}"


@dataclass(frozen=True)
class Failure:
    """The answer of a worker that raised an exception: its text, and its `frame` if it has one.

    frame: written by `torch.save`. Tensors that are sent as they are cannot be read once their process has ended.
    """

    text: str
    frame: bytes | None

    @classmethod
    def of(cls, error: Exception) -> Failure:
        """Of an exception that a worker raised."""
        frame = getattr(error, "frame", None)
        if frame is None:
            return cls(raised(error), None)
        torch.save(frame.to_dict(), file := io.BytesIO())
        return cls(raised(error), file.getvalue())

    def error(self) -> WorkerLostError:
        """Return the error to raise in the main process."""
        error = WorkerLostError(self.text)
        if self.frame is not None:
            error.frame = TensorDict.from_dict(torch.load(io.BytesIO(self.frame), weights_only=True))
        return error


class RemoteWorker(Protocol):
    """A worker outside of this process. Requests are answered in their order.

    answered: whether a batch was received; until then it may still be starting. collect_seconds: seconds that it took
    to collect the batch received last.
    """

    spec: WorkerSpec
    answered: bool
    collect_seconds: float

    def request(self, iteration: int, weights: Any) -> None:
        """Ask for the batch of this iteration with these weights of the host. Raises WorkerLostError."""

    def use_buffers(self, buffers: Sequence[TensorDictBase]) -> None:
        """Have the batches that are requested from now on written to these buffers in turn, if the worker can.

        Raises WorkerLostError.
        """

    def receive(self) -> tuple[TensorDictBase | None, Mapping[int, Beginning]]:
        """Return the batch, None if it is in its buffer, and the beginnings from `Worker.collect`.

        Raises WorkerLostError.
        """

    def overdue(self, patience: float, waiting_since: float) -> bool:
        """Return whether it has not answered for `patience` seconds, or more if it is starting.

        waiting_since: as `time.monotonic` has it. The seconds count from then, or from a later request.
        """

    def kill(self) -> None:
        """End it, whatever it is doing."""


class RequestClock:
    """The part of a `RemoteWorker` that is the same on any machine: since when its answer is waited for.

    requested_at: when a batch was asked for last, as `time.monotonic` has it; 0 before.
    """

    def __init__(self) -> None:
        self.answered = False
        self.requested_at = self.collect_seconds = 0.0

    def overdue(self, patience: float, waiting_since: float) -> bool:
        """As `RemoteWorker.overdue`."""
        limit = patience + (0.0 if self.answered else START_SECONDS)
        return time.monotonic() - max(waiting_since, self.requested_at) > limit


class ChildProcess:
    """Starts at once.

    Args:
        serve: called in the process with its end of the pipe and the arguments; it calls `detach` first.
        arguments: picklable; tensors are shared.
    """

    def __init__(self, serve: Callable[..., None], *arguments: Any) -> None:
        context: Any = fork_server.start()
        self.connection, theirs = context.Pipe()
        self.process = context.Process(target=serve, args=(theirs, *arguments), daemon=True)
        self.process.start()
        theirs.close()

    def send(self, message: object) -> None:
        """Send a message. If the process has ended, reading from the pipe reports it after the earlier answers."""
        with suppress(OSError):
            self.connection.send(message)

    def kill(self) -> None:
        """End the process, whatever it is doing."""
        self.process.kill()
        self.process.join(KILL_SECONDS)  # until the fork server, which may be stopped itself, says so
        self.connection.close()

    def ending(self) -> str:
        """Return how the process ended, as a clause. Its pipe is closed."""
        self.process.join(EXIT_SECONDS)
        code = self.process.exitcode
        if code is not None and code < 0:
            return f"was killed by signal {-code} ({signal.Signals(-code).name})"
        return f"ended with exit code {code}"


def detach() -> None:
    """Use one thread, ignore SIGINT, which a terminal sends to all processes, and end with the main process."""
    torch.set_num_threads(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal_at_parent_death()  # the parent is the fork server, which ends with the main process
    main = multiprocessing.parent_process()
    if main is None or not main.is_alive():  # it ended before the call
        os._exit(1)


class WorkerProcess(ChildProcess, RequestClock):
    """Batches are received in the order of their requests.

    Args:
        make_env, spec, episodes: of `Worker`.
        policies: in shared memory; a request says which one's weights to use.
        buffers: each (worlds, horizon) in shared memory, where batches are written in turns; (): batches are sent
            themselves until `use_buffers`.
    """

    def __init__(
        self,
        make_env: MakeEnv,
        policies: Policies,
        spec: WorkerSpec,
        *,
        episodes: Episodes | None = None,
        buffers: Sequence[TensorDictBase] = (),
    ) -> None:
        RequestClock.__init__(self)
        ChildProcess.__init__(self, _serve, make_env, policies, spec, episodes, buffers)
        self.spec = spec

    def request(self, iteration: int, weights: int) -> None:
        """Ask for the batch of this iteration. weights: the number of a policy."""
        self.requested_at = time.monotonic()
        self.send((iteration, weights))

    def use_buffers(self, buffers: Sequence[TensorDictBase]) -> None:
        """Have all batches that are requested from now on written to these buffers, in turn."""
        self.send(tuple(buffers))

    def receive(self) -> tuple[TensorDictBase | None, Mapping[int, Beginning]]:
        """Return the batch, None if it is in its buffer, and the beginnings from `Worker.collect`.

        Raises WorkerLostError.

        To be called once the connection has something to read. A process that was stopped while it wrote its answer
        does not block for more than RECEIVE_SECONDS.
        """
        answers: list[Any] = []
        reader = threading.Thread(target=self._read, args=(answers,), daemon=True)
        reader.start()
        reader.join(RECEIVE_SECONDS)
        if reader.is_alive():
            raise WorkerLostError(f"did not finish its answer within {RECEIVE_SECONDS:.0f} s")
        if not answers:
            raise WorkerLostError(self.ending())
        if isinstance(answers[0], Failure):
            raise answers[0].error()
        batch, beginnings, self.collect_seconds = answers[0]
        self.answered = True
        return None if batch is None else pickle.loads(batch), beginnings

    def _read(self, answers: list[Any]) -> None:
        """Append the answer; nothing if the process has ended."""
        with suppress(EOFError, OSError):
            answers.append(self.connection.recv())


def _serve(
    connection: Connection,
    make_env: MakeEnv,
    policies: Policies,
    spec: WorkerSpec,
    episodes: Episodes | None,
    buffers: Sequence[TensorDictBase],
) -> None:
    """Answer requests until the main process closes the pipe. An exception's text is sent as its answer."""
    detach()
    try:
        policy = copy.deepcopy(policies[0])
        worker = Worker(make_env, policy.act, spec, episodes)
        while True:
            message = connection.recv()
            if isinstance(message[0], TensorDictBase):
                buffers = message
                continue
            iteration, weights = message
            policy.load_state_dict(policies[weights].state_dict())
            start = time.monotonic()
            batch, beginnings = worker.collect(iteration)
            if buffers:
                buffers[iteration % len(buffers)][:, : batch.shape[1]].update_(batch)
            # By value: shared tensors cannot be read once this process has ended, which it may before they are.
            sent = None if buffers else pickle.dumps(batch)
            connection.send((sent, beginnings, time.monotonic() - start))
    except (EOFError, BrokenPipeError, ConnectionResetError):
        pass
    except Exception as error:
        connection.send(Failure.of(error))
