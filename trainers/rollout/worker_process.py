"""A worker in a process of its own, which can be killed and replaced at any time."""

from __future__ import annotations

import ctypes
import io
import os
import signal
import sys
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import torch
import torch.multiprocessing
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictModuleBase

from trainers.rollout.episode_log import Beginning, Episodes
from trainers.rollout.worker import MakeEnv, Worker, WorkerSpec

PR_SET_PDEATHSIG = 1  # of Linux' prctl: the signal that a process is sent when its parent ends
START_SECONDS = 120.0  # to start a process, to build its worlds and to replay their episodes
RECEIVE_SECONDS = 10.0  # to read an answer that has begun
EXIT_SECONDS = 1.0  # to wait for the exit code of a process whose pipe is closed


class WorkerLostError(Exception):
    """A worker process has ended, raised an exception or does not answer. The text says which.

    frame: what the environment's step was given that raised, if its exception has a `frame`.
    """

    frame: TensorDictBase | None = None


@dataclass(frozen=True)
class Failure:
    """What a worker answers if it raised an exception: its text, and its `frame` if it has one.

    frame: written by `torch.save`. Tensors that are sent as they are cannot be read once their process has ended.
    """

    text: str
    frame: bytes | None

    @classmethod
    def of(cls, error: Exception) -> Failure:
        """Of an exception that a worker raised."""
        text, frame = (str(error).splitlines() or [""])[0], getattr(error, "frame", None)
        if frame is None:
            return cls(f"raised {type(error).__name__}: {text}", None)
        torch.save(frame.to_dict(), file := io.BytesIO())
        return cls(f"raised {type(error).__name__}: {text}", file.getvalue())

    def error(self) -> WorkerLostError:
        """The error to raise in the main process."""
        error = WorkerLostError(self.text)
        if self.frame is not None:
            error.frame = TensorDict.from_dict(torch.load(io.BytesIO(self.frame), weights_only=True))
        return error


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
        context = torch.multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        arguments = (os.getpid(), theirs, make_env, act, spec, episodes, buffer)
        self.process = context.Process(target=_serve, args=arguments, daemon=True)
        self.process.start()
        theirs.close()

    def request(self, iteration: int) -> None:
        """Ask for the batch of this iteration. Raises WorkerLostError."""
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
        self.process.join()
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


def _serve(
    parent: int,
    connection: Connection,
    make_env: MakeEnv,
    act: TensorDictModuleBase,
    spec: WorkerSpec,
    episodes: Episodes | None,
    buffer: TensorDictBase | None,
) -> None:
    """Answer requests until the main process `parent` closes the pipe. An exception's text is sent as its answer."""
    _detach(parent)
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


def _detach(parent: int) -> None:
    """One thread; no SIGINT, which a terminal sends to all processes; and an end with the main process."""
    torch.set_num_threads(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # it ended before the call
            os._exit(1)
