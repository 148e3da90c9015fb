"""A gate before the page: other machines reach it only with a token, which is part of the printed address.

The page's server listens on this machine only. The gate listens on the address that others reach. It reads the head of
each connection's first request, and passes the bytes on if the request has the token: in its query, or in the cookie
that an answer to such a query sets. Later requests of a connection come from the same browser.
"""

from __future__ import annotations

import asyncio
import hmac
import secrets
import threading
from collections.abc import Awaitable
from contextlib import suppress
from urllib.parse import parse_qs, urlsplit

COOKIE = "deixis_token"
MAX_HEAD = 16 * 1024  # bytes of a request's head
HEAD_SECONDS = 10.0  # within which the head must arrive
REFUSED = b"401 Unauthorized", b"This page needs the address with the token that play.py has printed.\n"


class TokenGate:
    """Serves until `close`, in a thread of its own.

    Attributes:
        token: what a request must have, 32 letters that nobody can guess.
        port: the port that the gate listens on.
    """

    def __init__(self, host: str, port: int, inner_port: int) -> None:
        """Begins to listen. inner_port: of the page's server, on 127.0.0.1. Raises OSError for a taken port."""
        self.token = secrets.token_urlsafe(24)
        self._inner_port = inner_port
        self._loop = asyncio.new_event_loop()
        self._server = self._loop.run_until_complete(asyncio.start_server(self._serve, host, port, limit=MAX_HEAD))
        self.port: int = self._server.sockets[0].getsockname()[1]
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stops listening and ends all connections."""
        self._loop.call_soon_threadsafe(self._server.close)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(timeout=5)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, TimeoutError):
            head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), HEAD_SECONDS)
            if self._has_cookie(head):
                await self._pass_on(head, reader, writer)
            elif self._has_query(head):
                cookie = f"Set-Cookie: {COOKIE}={self.token}; HttpOnly; SameSite=Strict; Path=/\r\nLocation: /\r\n"
                await _answer(writer, b"303 See Other", b"", cookie.encode())
            else:
                await _answer(writer, *REFUSED)
        writer.close()

    def _has_cookie(self, head: bytes) -> bool:
        for line in head.decode("latin-1").split("\r\n")[1:]:
            name, _, value = line.partition(":")
            if name.strip().lower() == "cookie":
                pairs = (pair.strip().partition("=") for pair in value.split(";"))
                if any(key == COOKIE and self._is_token(given) for key, _, given in pairs):
                    return True
        return False

    def _has_query(self, head: bytes) -> bool:
        target = head.decode("latin-1").split(" ", 2)[1:2]
        with suppress(ValueError):
            return any(map(self._is_token, parse_qs(urlsplit(target[0] if target else "").query).get("token", [])))
        return False

    def _is_token(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(), self.token.encode())

    async def _pass_on(self, head: bytes, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        inner_reader, inner_writer = await asyncio.open_connection("127.0.0.1", self._inner_port)
        inner_writer.write(head)
        both: list[Awaitable[None]] = [_copy(reader, inner_writer), _copy(inner_reader, writer)]
        await asyncio.gather(*both)
        inner_writer.close()


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Passes bytes on until one side ends."""
    with suppress(OSError):
        while data := await reader.read(2**16):
            writer.write(data)
            await writer.drain()
        writer.write_eof()


async def _answer(writer: asyncio.StreamWriter, status: bytes, body: bytes, headers: bytes = b"") -> None:
    lines = b"Content-Type: text/plain\r\nCache-Control: no-store\r\nConnection: close\r\n" + headers
    writer.write(b"HTTP/1.1 %s\r\n%sContent-Length: %d\r\n\r\n%s" % (status, lines, len(body), body))
    await writer.drain()
