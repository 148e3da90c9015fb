"""The real-time loop of a session: one thread takes control steps, and serves requests from others in between."""

from __future__ import annotations

import queue
import sys
import threading
import time
import traceback
from collections.abc import Callable

import torch

from core.errors import ConfigError
from demo.session import Session
from deployment.safe_arm import SLICE
from human import NothingPointedAt, Unreachable
from language import LanguageError

Request = Callable[[Session], object]
USER_ERRORS = (ConfigError, LanguageError, Unreachable, NothingPointedAt)  # errors that a person can correct
MAX_REQUESTS = 256  # in the queue; further ones are dropped
REQUEST_SHARE = 0.5  # of a control step, after which further requests wait for the next one
RATE_STEPS = 40  # control steps over which the rate is measured


class RealTimeLoop:
    """Everything that touches the session runs in the thread of `run`.

    Args:
        on_step: called after every step, in the loop's thread.
        on_message: called with a message for the person, from any thread.

    speed: target speed, 1 is real time. rate: the measured speed, as a share of real time.
    """

    def __init__(self, session: Session, on_step: Callable[[Session], None], on_message: Callable[[str], None]) -> None:
        self.session, self._on_step, self._on_message = session, on_step, on_message
        self.paused, self.speed, self.rate = False, 1.0, 1.0
        self._single_steps = 0  # requested while paused
        self._requests: queue.Queue[Request] = queue.Queue(MAX_REQUESTS)
        self._latest: dict[str, Request] = {}
        self._lock, self._stopped = threading.Lock(), threading.Event()

    def ask(self, request: Request, replaces: str = "") -> None:
        """Queues a request, to be served before the next step. A request replaces a waiting one of the same name.

        replaces: this name; "" for a request that is always served.
        """
        if replaces:
            with self._lock:
                self._latest[replaces] = request
            return
        try:
            self._requests.put_nowait(request)
        except queue.Full:
            self._on_message("That is too much at once: wait a moment.")

    def step_once(self) -> None:
        """Takes one step while paused."""
        self._single_steps += 1

    def stop(self) -> None:
        """Ends `run` after the current step."""
        self._stopped.set()

    def run(self) -> None:
        """Runs until `stop`. Torch uses one thread: threads that wait for each other are late beside a browser."""
        torch.set_num_threads(1)
        due = marked = time.monotonic()
        steps = 0
        while not self._stopped.is_set():
            self._serve_requests()
            if not self.paused or self._single_steps:
                self._single_steps = max(0, self._single_steps - 1)
                self._call(Session.step)
                steps += 1
            self._call(self._on_step)
            period = self.session.period / self.speed
            due = max(due + period, time.monotonic() - period)  # catches up on one step at most
            self._wait(due)
            if steps == RATE_STEPS or self.paused:
                now = time.monotonic()
                self.rate = steps * self.session.period / (now - marked) if steps == RATE_STEPS else self.rate
                marked, steps = now, 0

    def _wait(self, due: float) -> None:
        """Wait until a time, at most until `stop`. An arm is watched meanwhile, in pauses and slow time too."""
        while not self._stopped.is_set():
            rest = due - time.monotonic()
            if self.session.arm is not None and (rest > 0 or self.paused):
                self._call(lambda session: session.watch(self.paused))
            if rest <= 0:
                return
            self._stopped.wait(min(rest, SLICE) if self.session.arm is not None else rest)

    def _serve_requests(self) -> None:
        with self._lock:
            requests, self._latest = list(self._latest.values()), {}
        for request in requests:
            self._call(request)
        end = time.monotonic() + REQUEST_SHARE * self.session.period
        while not self._requests.empty():
            self._call(self._requests.get_nowait())
            if time.monotonic() > end:
                return

    def _call(self, request: Request) -> None:
        """Calls with the session. An error becomes a message: a failed request must not end the loop."""
        try:
            request(self.session)
        except USER_ERRORS as error:
            self._on_message(str(error))
        except Exception:
            traceback.print_exc(file=sys.stderr)
            self._on_message("Something went wrong; see the terminal for the error.")
