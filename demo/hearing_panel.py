"""The part of the page that hears: sounds of tabs become words in a process of its own, so that the clock goes on."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from importlib.util import find_spec

from demo.session import Session
from demo.shared_state import SharedState, Tab
from language import LanguageError
from language.hearing import checked, heard, samples
from language.speech_grammar import speech_grammar
from language.verbs import ROOM

MOST_WAITING = 4  # sounds
NOT_INSTALLED = 'Speech needs this browser\'s own recogniser, or pip install -e ".[speech]" where play.py runs.'
BUSY = "Several people speak at once: say it again in a moment."
ENDED = "The recogniser ended: say it again, or type it."


class HearingPanel:
    """Tells a tab the words of its sound, as `heard`: {"words": ..., "note": ...}, one of them "".

    Args:
        state: of the page; `speech` is {"installed": ...}.
        hear: returns words and a reason, as `heard` does.
    """

    def __init__(self, state: SharedState, hear: Callable[[bytes, int, str], tuple[str, str]] = heard) -> None:
        self._hear, self._waiting = hear, 0
        self._pool: ProcessPoolExecutor | None = None
        self._installed = find_spec("pocketsphinx") is not None
        state.put("speech", {"installed": self._installed, "note": "" if self._installed else NOT_INSTALLED})

    def take(self, session: Session, tab: Tab, content: bytes, rate: int) -> None:
        """Begin to hear a sound: 16-bit samples. Returns at once."""
        try:
            if not self._installed:
                raise LanguageError(NOT_INSTALLED)
            if self._waiting >= MOST_WAITING:
                raise LanguageError(BUSY)
            checked(samples(content, rate))
        except LanguageError as error:
            tab.send("heard", {"words": "", "note": str(error)})
            return
        task = session.env.task
        verbs = task.verbs or dict.fromkeys((task.verb, *ROOM))
        grammar = speech_grammar(session.scene(), verbs, session.env.has_person)
        if self._pool is None:
            self._pool = ProcessPoolExecutor(1, multiprocessing.get_context("spawn"))
        self._waiting += 1
        self._pool.submit(self._hear, content, rate, grammar).add_done_callback(lambda done: self._tell(tab, done))

    def _tell(self, tab: Tab, done: Future[tuple[str, str]]) -> None:
        """Send what was heard. Called in the pool's thread."""
        self._waiting -= 1
        try:
            words, note = done.result()
        except BrokenProcessPool:
            self._pool, words, note = None, "", ENDED
        tab.send("heard", {"words": words, "note": note})

    def close(self) -> None:
        """End the process."""
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)
