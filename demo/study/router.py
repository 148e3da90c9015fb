"""The one port of a study: looks at each request, and hands its connection on to the server that it is for.

The servers behind it listen on this machine only and are asked with tokens that only the router knows.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from http import HTTPStatus

from demo.guarded_server import HEADERS, Allowance
from demo.page_gate import FOREIGN, PageGate

MAX_HEAD = 16 * 1024  # bytes of a request
HEAD_SECONDS, CONNECT_SECONDS = 10.0, 10.0
MAX_CONNECTIONS = 256
CHUNK = 64 * 1024  # bytes
HOP = ("host", "origin")  # headers that are replaced: the router has checked them
GUESSES = 60, 1.0  # wrong codes: at once, and a second for ever


@dataclass(frozen=True)
class Backend:
    """A server on this machine. name: the host that it goes by. prefix: of the paths that it is asked for."""

    port: int
    name: str
    prefix: str


@dataclass(frozen=True)
class Moved:
    """Where a browser should ask instead."""

    path: str


class Router:
    """Listens for browsers.

    Args:
        gate: knows the names of this server.
        find: returns the backend for the parts of a path, with what is left of the path; a text for the person where
            there is none.
    """

    def __init__(self, gate: PageGate, find: Callable[[str], tuple[Backend, str] | Moved | str]) -> None:
        self._gate, self._find = gate, find
        self._open = 0
        self._guesses = Allowance(*GUESSES)

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve one connection."""
        if self._open >= MAX_CONNECTIONS:
            writer.close()
            return
        self._open += 1
        try:
            await self._serve(reader, writer)
        except (OSError, TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, ValueError):
            pass  # a browser that left, or that speaks no HTTP
        finally:
            self._open -= 1
            with suppress(OSError, RuntimeError):
                writer.close()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        async with asyncio.timeout(HEAD_SECONDS):
            head = await reader.readuntil(b"\r\n\r\n")
        if len(head) > MAX_HEAD:
            return
        start, *lines = head.decode("latin-1").removesuffix("\r\n\r\n").split("\r\n")
        method, target, version = start.split(" ")
        headers = [line.partition(":")[::2] for line in lines]
        named = {name: [v.strip() for n, v in headers if n.lower() == name] for name in HOP}
        local_ip = str(writer.get_extra_info("sockname")[0])
        named_right = self._gate.is_named_right(named["host"], named["origin"], local_ip)
        if method != "GET" or version != "HTTP/1.1" or not named_right:
            await _answer(writer, HTTPStatus.FORBIDDEN, FOREIGN)
            return
        found = self._find(target)
        if isinstance(found, str):
            if not self._guesses.take():
                return
            await _answer(writer, HTTPStatus.NOT_FOUND, found)
            return
        if isinstance(found, Moved):
            await _answer(writer, HTTPStatus.SEE_OTHER, "", Location=found.path)
            return
        backend, rest = found
        kept = [f"{name}:{value}" for name, value in headers if name.lower() not in HOP]
        asked = "\r\n".join([f"GET {backend.prefix}{rest} HTTP/1.1", f"Host: {backend.name}", *kept, "", ""])
        await _connect(backend.port, asked.encode("latin-1"), reader, writer)


async def _connect(port: int, first: bytes, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Send the first bytes to a port of this machine, then pass on what comes from either side until one leaves."""
    async with asyncio.timeout(CONNECT_SECONDS):
        back_reader, back_writer = await asyncio.open_connection("127.0.0.1", port)
    back_writer.write(first)
    ways = [asyncio.create_task(_pass_on(reader, back_writer)), asyncio.create_task(_pass_on(back_reader, writer))]
    try:
        await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
        if ways[0].done() and not ways[1].done():  # the browser has sent all; the answer may still come
            await asyncio.wait(ways[1:], timeout=HEAD_SECONDS)
    finally:
        for way in ways:
            way.cancel()
        await asyncio.gather(*ways, return_exceptions=True)
        with suppress(OSError, RuntimeError):
            back_writer.close()


async def _pass_on(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with suppress(OSError):
        while data := await reader.read(CHUNK):
            writer.write(data)
            await writer.drain()
        writer.write_eof()


async def _answer(writer: asyncio.StreamWriter, status: HTTPStatus, text: str, **more: str) -> None:
    headers: Mapping[str, str] = HEADERS | more | {"Content-Type": "text/plain; charset=utf-8", "Connection": "close"}
    body = text.encode()
    lines = [f"HTTP/1.1 {status.value} {status.phrase}", *(f"{name}: {value}" for name, value in headers.items())]
    writer.write("\r\n".join([*lines, f"Content-Length: {len(body)}", "", ""]).encode() + body)
    await writer.drain()
