"""The server of the page behind its gate: requests, messages and floods are looked at before viser is."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from functools import partial
from http import HTTPStatus
from io import StringIO
from typing import Any

import msgspec
import viser
import websockets.asyncio.server as websocket_server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from demo.client_messages import MessageCheck
from demo.page_gate import PageGate

MAX_SOCKETS = 32  # open at the same time; each is sent the whole scene
MAX_MESSAGE = 2**20  # bytes
MESSAGES = 3000, 200.0  # of a socket: at once, and a second for ever; a browser sends up to 60 a second
BYTES = 2**22, 2.0**18  # the same
PRESSES = 60, 30.0  # the same, of buttons and keys; further ones are dropped
FLOOD = 1008, "too many messages"  # code and reason of the close
PROTOCOL = f"viser-v{viser.__version__}"
HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",  # the address has the token
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}

ProcessRequest = Callable[[ServerConnection, Request], Response | None]


class Allowance:
    """How much may still come: `burst` at once, and `per_second` more with time."""

    def __init__(self, burst: float, per_second: float) -> None:
        self._burst, self._per_second = burst, per_second
        self._left, self._at = burst, time.monotonic()

    def take(self, amount: float = 1.0) -> bool:
        """Use up some. Return whether there was that much."""
        now = time.monotonic()
        self._left = min(self._burst, self._left + (now - self._at) * self._per_second)
        self._at = now
        if self._left < amount:
            return False
        self._left -= amount
        return True


class GuardedConnection(ServerConnection):
    """The socket of a browser: `recv` returns only messages that pass the check, and a flood closes it."""

    def __init__(self, check: MessageCheck, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._check = check
        self._messages, self._bytes, self._presses = Allowance(*MESSAGES), Allowance(*BYTES), Allowance(*PRESSES)
        self._flooded = False

    def data_received(self, data: bytes) -> None:
        """Called with bytes as they come."""
        if self._flooded:
            return
        if not self._bytes.take(len(data)):
            self._end_flood()
            return
        super().data_received(data)

    def process_event(self, event: Any) -> None:
        """Called with the request, and then with each frame, pings included."""
        if self._flooded:
            return
        if not self._messages.take():
            self._end_flood()
            return
        super().process_event(event)

    def _end_flood(self) -> None:
        self._flooded = True
        if self.request is not None:
            self.protocol.fail(*FLOOD)
            self.send_data()
        self.loop.call_later(1.0, self.transport.abort)

    async def recv(self, decode: bool | None = None) -> Any:
        """The next message that passes, as bytes. Raises ConnectionClosed."""
        while True:
            message = self._check.read(await super().recv(decode))
            if message is not None and (not self._check.is_press(message) or self._presses.take()):
                return msgspec.msgpack.encode(message)
            self._check.dropped += 1


def open_guarded_server(host: str, port: int, gate: PageGate, check: MessageCheck, **options: Any) -> viser.ViserServer:
    """A server of viser behind the gate.

    Args:
        host: address to listen on.
        port: port to listen on; viser takes a later one if it is taken.
        gate: decides about requests.
        check: decides about messages.
        **options: of viser's server.

    Raises:
        RuntimeError: this version of viser serves in another way, and would serve without the gate.
    """
    with _serving(gate, check) as served, redirect_stdout(StringIO()):  # viser prints an address without the token
        server = viser.ViserServer(host, port, verbose=False, **options)
    if not served:
        server.stop()
        raise RuntimeError(f"viser {viser.__version__} does not serve through websockets.asyncio.server.serve")
    check.attach(server)
    return server


@contextmanager
def _serving(gate: PageGate, check: MessageCheck) -> Iterator[list[int]]:
    """Put the gate before what viser serves in the block. Yields a list of the ports that were tried.

    viser cannot be given a gate, so the function by which it serves is replaced while it starts.
    """
    original: Any = websocket_server.serve
    ports: list[int] = []

    def serve(handler: Any, host: str, port: int, *, process_request: ProcessRequest, **options: Any) -> Any:
        ports.append(port)
        options |= {"max_size": MAX_MESSAGE, "logger": _logger(), "server_header": None}
        options["create_connection"] = partial(GuardedConnection, check)
        return original(handler, host, port, process_request=partial(_answer, gate, process_request), **options)

    websocket_server.serve = serve  # type: ignore[assignment,misc]
    try:
        yield ports
    finally:
        websocket_server.serve = original  # type: ignore[misc]


def _answer(gate: PageGate, answer: ProcessRequest, connection: ServerConnection, request: Request) -> Response | None:
    """The answer to a request; None for a socket that may be opened."""
    headers = request.headers
    is_socket = "Upgrade" in headers
    local_ip = str(connection.local_address[0])
    verdict = gate.check(request.path, headers.get_all("Host"), headers.get_all("Origin"), local_ip, is_socket)
    if verdict.refused is not None:
        return _text(HTTPStatus.FORBIDDEN, verdict.refused)
    if verdict.moved_to is not None:
        return _text(HTTPStatus.SEE_OTHER, "", Location=verdict.moved_to)
    assert verdict.path is not None
    if is_socket:
        return _refused_socket(connection, headers)
    request.path = verdict.path
    response = answer(connection, request)
    assert response is not None
    response.headers.update(HEADERS)
    return response


def _refused_socket(connection: ServerConnection, headers: Headers) -> Response | None:
    """The answer to who asks for a socket and cannot have one."""
    if headers.get_all("Upgrade") != ["websocket"] or headers.get_all("Sec-WebSocket-Protocol") != [PROTOCOL]:
        return _text(HTTPStatus.BAD_REQUEST, f"The socket of this page speaks {PROTOCOL}: load the page again.\n")
    if len(connection.server.connections) >= MAX_SOCKETS:
        return _text(HTTPStatus.SERVICE_UNAVAILABLE, f"{MAX_SOCKETS} browsers are looking already.\n")
    return None


def _text(status: HTTPStatus, text: str, **more: str) -> Response:
    body = text.encode()
    headers = {"Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(body)), "Connection": "close"}
    return Response(status.value, status.phrase, Headers(headers | HEADERS | more), body)


def _logger() -> logging.Logger:
    """A logger that says nothing of requests that are no requests."""
    logger = logging.getLogger("deixis.page")
    if not logger.filters:
        logger.addFilter(lambda record: not record.getMessage().startswith("opening handshake failed"))
    return logger
