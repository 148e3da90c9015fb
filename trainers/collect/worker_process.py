"""A process that is forked from the fork server, with a pipe to it. It can be killed at any time."""

from __future__ import annotations

import copy
import multiprocessing
import os
import pickle
import signal
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from typing import Any

import torch
from tensordict import TensorDictBase

from core.system import signal_at_parent_death
from trainers.collect import fork_server
from trainers.collect.worker import Beginning, Episodes, MakeEnv, Worker, WorkerSpec
from trainers.collect.worker_pool import Failure, RequestClock, WorkerLostError
from trainers.models.policy import ExpertMixture, Policy

KILL_SECONDS = 10.0  # to wait for the end of a process that was killed
EXIT_SECONDS = 1.0  # to wait for the exit code of a process whose pipe is closed


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
        """How the process ended, as a clause. Its pipe is closed."""
        self.process.join(EXIT_SECONDS)
        code = self.process.exitcode
        if code is not None and code < 0:
            return f"was killed by signal {-code} ({signal.Signals(-code).name})"
        return f"ended with exit code {code}"


def detach() -> None:
    """Use one thread, ignore SIGINT, which a terminal sends to all processes, and end with the main process."""
    torch.set_num_threads(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal_at_parent_death(signal.SIGKILL)  # the parent is the fork server, which ends with the main process
    main = multiprocessing.parent_process()
    if main is None or not main.is_alive():  # it ended before the call
        os._exit(1)


Policies = Sequence[Policy | ExpertMixture]

RECEIVE_SECONDS = 10.0  # to read an answer that has begun


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
        """The batch, None if it is in its buffer, and the beginnings from `Worker.collect`. Raises WorkerLostError.

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


class ProcessHost:
    """Starts workers as processes of this machine.

    Args:
        make_env: builds a worker's environment; picklable.
        policy: on the CPU; `publish` copies its weights.
        ahead: how many batches workers collect ahead of the one that the pool waits for.

    Attributes:
        weights: the number of the copy that has the latest weights. A copy is overwritten once all batches that were
            asked for with it have been received.
        buffers: how many batches are in use at a time: the one that is learned from, and those ahead.
    """

    def __init__(self, make_env: MakeEnv, policy: Policy | ExpertMixture, ahead: int) -> None:
        self.make_env, self.policy = make_env, policy
        self.policies = [copy.deepcopy(policy).share_memory() for _ in range(1 + ahead)]
        self.weights, self.buffers = 0, 1 + ahead

    def publish(self) -> None:
        """Copy the policy's weights to the copy that has been in use for longest."""
        self.weights = (self.weights + 1) % len(self.policies)
        self.policies[self.weights].load_state_dict(self.policy.state_dict())

    def start(self, spec: WorkerSpec, episodes: Episodes | None, buffers: Sequence[TensorDictBase]) -> WorkerProcess:
        """A new process."""
        return WorkerProcess(self.make_env, self.policies, spec, episodes, buffers)

    def wait(self, workers: Sequence[WorkerProcess], seconds: float) -> list[WorkerProcess]:
        """The workers that have answered or ended, after at most `seconds`."""
        waited: dict[Any, WorkerProcess] = {worker.connection: worker for worker in workers}
        return [waited[connection] for connection in wait(list(waited), seconds)]

    def moved(self, workers: Sequence[WorkerProcess]) -> list[int]:
        """None: there is one machine."""
        return []

    def allocate(self, batch: TensorDictBase) -> TensorDictBase:
        """The batch in shared memory."""
        return batch.share_memory_()

    def status(self, workers: Sequence[WorkerProcess], restarts: int, age: int) -> dict[str, str]:
        """Nothing: the progress bar is for the results."""
        return {}

    def close(self) -> None:
        """Nothing: the pool has ended the processes."""


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
