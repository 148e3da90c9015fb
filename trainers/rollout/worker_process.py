"""A worker in a process of its own, which can be killed and replaced at any time."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from typing import Any

import torch
import torch.multiprocessing  # sends tensors by their shared memory
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase

from trainers.rollout import fork_server
from trainers.rollout.episode_log import Beginning, Episodes
from trainers.rollout.worker import MakeEnv, Worker, WorkerSpec
from trainers.rollout.worker_host import START_SECONDS, Failure, WorkerLostError
from trainers.utils.parent_death import signal_at_parent_death

RECEIVE_SECONDS = 10.0  # to read an answer that has begun, or the end of a process that was killed
EXIT_SECONDS = 1.0  # to wait for the exit code of a process whose pipe is closed


class WorkerProcess:
    """Starts at once; `request` and `receive` take turns.

    Args:
        make_env, act, spec, episodes: of `Worker`. The module's parameters are in shared memory.
        buffer: (worlds, horizon) in shared memory, where batches are written; None: the first one is sent itself.
    """

    def __init__(
        self,
        make_env: MakeEnv,
        act: TensorDictModuleBase,
        spec: WorkerSpec,
        episodes: Episodes | None = None,
        buffer: TensorDictBase | None = None,
    ) -> None:
        self.spec = spec
        self.answered = False  # whether a batch was received: until then it may still be starting
        self.requested_at = 0.0
        context: Any = fork_server.start()
        self.connection, theirs = context.Pipe()
        arguments = (theirs, make_env, act, spec, episodes, buffer)
        self.process = context.Process(target=_serve, args=arguments, daemon=True)
        self.process.start()
        theirs.close()

    def request(self, iteration: int, weights: Any = None) -> None:
        """Ask for the batch of this iteration, with the weights in shared memory. Raises WorkerLostError."""
        self.requested_at = time.monotonic()
        self._send(iteration)

    def use_buffer(self, buffer: TensorDictBase) -> None:
        """Have all further batches written there. Raises WorkerLostError."""
        self._send(buffer)

    def receive(self) -> tuple[TensorDictBase | None, Mapping[int, Beginning]]:
        """The batch, None if it is in the buffer, and what `Worker.collect` says of it. Raises WorkerLostError.

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
            raise WorkerLostError(self._ending())
        if isinstance(answers[0], Failure):
            raise answers[0].error()
        self.answered = True
        return answers[0]

    def _read(self, answers: list[Any]) -> None:
        """Append the answer; nothing if the process has ended."""
        with suppress(EOFError, OSError):
            answers.append(self.connection.recv())

    def overdue(self, patience: float) -> bool:
        """Whether it has not answered for so many seconds, or more where it is starting."""
        return time.monotonic() - self.requested_at > patience + (0.0 if self.answered else START_SECONDS)

    def kill(self) -> None:
        """End the process, whatever it is doing."""
        self.process.kill()
        self.process.join(RECEIVE_SECONDS)  # until the fork server, which may be stopped itself, says so
        self.connection.close()

    def _send(self, message: object) -> None:
        try:
            self.connection.send(message)
        except OSError:
            raise WorkerLostError(self._ending()) from None

    def _ending(self) -> str:
        self.process.join(EXIT_SECONDS)
        code = self.process.exitcode
        if code is not None and code < 0:
            return f"was killed by signal {-code} ({signal.Signals(-code).name})"
        return f"ended with exit code {code}"


class ProcessHost:
    """Starts workers as processes of this machine.

    Args:
        make_env: builds a worker's environment; picklable.
        act: the policy's module, its parameters in shared memory.
    """

    weights = None

    def __init__(self, make_env: MakeEnv, act: TensorDictModuleBase) -> None:
        self.make_env, self.act = make_env, act

    def publish(self) -> None:
        """Nothing: the processes read the parameters themselves."""

    def start(self, spec: WorkerSpec, episodes: Episodes | None, buffer: TensorDictBase | None) -> WorkerProcess:
        """A new process."""
        return WorkerProcess(self.make_env, self.act, spec, episodes, buffer)

    def wait(self, workers: Sequence[WorkerProcess], seconds: float) -> list[WorkerProcess]:
        """Those that have answered or ended, after at most so many seconds."""
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
    act: TensorDictModuleBase,
    spec: WorkerSpec,
    episodes: Episodes | None,
    buffer: TensorDictBase | None,
) -> None:
    """Answer requests until the main process closes the pipe. An exception's text is sent as its answer."""
    _detach()
    try:
        worker = Worker(make_env, act, spec, episodes)
        while True:
            message = connection.recv()
            if isinstance(message, TensorDictBase):
                buffer = message
                continue
            batch, beginnings = worker.collect(message)
            if buffer is not None:
                buffer.update_(batch)
            connection.send((batch if buffer is None else None, beginnings))
    except (EOFError, BrokenPipeError, ConnectionResetError):
        pass
    except Exception as error:
        connection.send(Failure.of(error))


def _detach() -> None:
    """One thread; no SIGINT, which a terminal sends to all processes; and an end with the main process."""
    torch.set_num_threads(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal_at_parent_death(signal.SIGKILL)  # the parent is the fork server, which ends with the main process
    main = multiprocessing.parent_process()
    if main is None or not main.is_alive():  # it ended before the call
        os._exit(1)
