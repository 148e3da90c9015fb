"""The clock: one thread that steps the session in real time, and does between two steps what others ask of it."""

from __future__ import annotations

import queue
import sys
import threading
import time
import traceback
from collections.abc import Callable

from conf.schema import ConfigError
from demo.session import Session
from human import NothingPointedAt, Unreachable
from language import LanguageError

Request = Callable[[Session], object]
PLAIN = (ConfigError, LanguageError, Unreachable, NothingPointedAt)  # what a person can mend
MOST = 256  # requests that wait; a flood of more is dropped
WINDOW = 40  # control steps over which the clock is judged


class Loop:
    """Everything that touches the session or its world happens in the thread of `run`.

    seen: called after every step. told: called with a message for the person. speed: of the clock, 1 is real time.
    """

    def __init__(self, session: Session, seen: Callable[[Session], None], told: Callable[[str], None]) -> None:
        self.session, self._seen, self._told = session, seen, told
        self.paused, self.speed, self.rate = False, 1.0, 1.0
        self._steps = 0  # that a paused clock has yet to make
        self._asked: queue.Queue[Request] = queue.Queue(MOST)
        self._latest: dict[str, Request] = {}
        self._lock, self._ended = threading.Lock(), threading.Event()

    def ask(self, request: Request, only: str = "") -> None:
        """Do this before the next step. only: requests of this name replace each other while they wait."""
        if only:
            with self._lock:
                self._latest[only] = request
            return
        try:
            self._asked.put_nowait(request)
        except queue.Full:
            self._told("That is too much at once: wait a moment.")

    def single(self) -> None:
        """One step of a clock that is paused."""
        self._steps += 1

    def stop(self) -> None:
        self._ended.set()

    def run(self) -> None:
        """Until `stop`."""
        due = marked = time.monotonic()
        count = 0
        while not self._ended.is_set():
            self._serve()
            if not self.paused or self._steps:
                self._steps = max(0, self._steps - 1)
                self._guarded(Session.step)
                count += 1
            self._guarded(self._seen)
            period = self.session.period / self.speed
            due = max(due + period, time.monotonic() - period)  # late by one step at most: the rest is lost
            self._ended.wait(max(0.0, due - time.monotonic()))
            if count == WINDOW or self.paused:
                now = time.monotonic()
                self.rate = count * self.session.period / (now - marked) if count == WINDOW else self.rate
                marked, count = now, 0

    def _serve(self) -> None:
        with self._lock:
            requests, self._latest = list(self._latest.values()), {}
        while not self._asked.empty():
            requests.append(self._asked.get_nowait())
        for request in requests:
            self._guarded(request)

    def _guarded(self, request: Request) -> None:
        """One request that fails must not end the others."""
        try:
            request(self.session)
        except PLAIN as error:
            self._told(str(error))
        except Exception:
            traceback.print_exc(file=sys.stderr)
            self._told("Something went wrong; the terminal says what.")
