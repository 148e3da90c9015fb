"""The state that all tabs of the page show: named sections of JSON, which are sent to each tab as they change."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import Any

import msgspec
from websockets.exceptions import ConnectionClosed

from demo.tab_messages import TabCheck, TabMessage

PERIOD = 1 / 30  # seconds between two messages to a tab; what changes more often is sent as it is last
Handler = Callable[["Tab", TabMessage], None]


class Tab:
    """The socket of a tab. number: of the tab, as its scene has it in its address."""

    def __init__(self, connection: Any, number: str) -> None:
        self.number = number
        self._connection, self._loop = connection, asyncio.get_running_loop()
        self._waiting: dict[str, bytes] = {}
        self._lock, self._wake = threading.Lock(), asyncio.Event()

    def send(self, name: str, value: Any) -> None:
        """Send a section to this tab alone. Can be called in any thread."""
        self.send_encoded({name: msgspec.json.encode(value)})

    def send_encoded(self, sections: dict[str, bytes]) -> None:
        """Send sections of JSON. Can be called in any thread."""
        with self._lock:
            self._waiting |= sections
        try:
            self._loop.call_soon_threadsafe(self._wake.set)
        except RuntimeError:  # the server has ended
            return

    async def serve(self, handle: Handler, check: TabCheck) -> None:
        """Send and take messages until the tab leaves."""
        sender = asyncio.create_task(self._send())
        try:
            while True:
                handle(self, await self._connection.next_message(check))
        except ConnectionClosed:
            pass
        finally:
            sender.cancel()

    async def _send(self) -> None:
        while True:
            await self._wake.wait()
            self._wake.clear()
            with self._lock:
                sections, self._waiting = self._waiting, {}
            parts = (msgspec.json.encode(name) + b":" + value for name, value in sections.items())
            await self._connection.send((b"{" + b",".join(parts) + b"}").decode())
            await asyncio.sleep(PERIOD)


class SharedState:
    """Sections by name. A new tab is sent all of them.

    handle: called with a tab and its message, in the server's thread; None: messages are ignored. check: of messages.
    sections: each encoded, by its name.
    """

    def __init__(self) -> None:
        self.handle: Handler | None = None
        self.check = TabCheck()
        self.sections: dict[str, bytes] = {}
        self._tabs: dict[Tab, None] = {}
        self._lock = threading.Lock()

    def put(self, name: str, value: Any) -> None:
        """Show a section. Nothing is sent if it is as before. Can be called in any thread."""
        encoded = msgspec.json.encode(value)
        with self._lock:
            if self.sections.get(name) == encoded:
                return
            self.sections[name] = encoded
            self._spread({name: encoded})

    def drop(self, *names: str) -> None:
        """Show these sections no longer. Can be called in any thread."""
        with self._lock:
            for name in names:
                self.sections.pop(name, None)
            self._spread(dict.fromkeys(names, b"null"))

    def _spread(self, sections: dict[str, bytes]) -> None:
        for tab in self._tabs:
            tab.send_encoded(sections)

    async def serve(self, connection: Any, number: str) -> None:
        """Keep a tab up to date until it leaves."""
        tab = Tab(connection, number)
        with self._lock:
            self._tabs[tab] = None
            tab.send_encoded(dict(self.sections))
        try:
            await tab.serve(self._handle, self.check)
        finally:
            with self._lock:
                del self._tabs[tab]

    def _handle(self, tab: Tab, message: TabMessage) -> None:
        if self.handle is not None:
            self.handle(tab, message)

    @property
    def is_watched(self) -> bool:
        """Whether there is a tab."""
        return bool(self._tabs)
