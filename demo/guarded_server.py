"""The server of the page behind its gate: requests, messages and floods are looked at before viser is."""

from __future__ import annotations

import logging
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from contextvars import ContextVar
from dataclasses import dataclass, field
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
from demo.page_files import PageFiles
from demo.page_gate import PageGate
from demo.shared_state import SharedState

MAX_SOCKETS = 64  # open at the same time, two for each tab; one of them is sent the whole scene
MAX_MESSAGE = 2**20  # bytes
MESSAGES = 3000, 200.0  # of a socket: at once, and a second for ever; a browser sends up to 60 a second
BYTES = 2**22, 2.0**18  # the same
PRESSES = 60, 30.0  # the same, of buttons and keys; further ones are dropped
FLOOD = 1008, "too many messages"  # code and reason of the close
PROTOCOL, TAB_PROTOCOL = f"viser-v{viser.__version__}", "deixis"  # of the scene's socket, and of the page's
SOCKET, SCENE = "socket", "scene"  # paths: of the page's socket, and of viser, in a frame of the page
TAB_NUMBER = re.compile("[0-9a-f]{1,32}")
HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",  # the address has the token
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}
tab_number: ContextVar[str] = ContextVar("tab_number", default="")  # of the tab whose scene is being served

ProcessRequest = Callable[[ServerConnection, Request], Response | None]


@dataclass
class PageParts:
    """What the server serves beside the scene, which is viser's.

    check: of the messages to viser. scenes: viser's client for the scene in each tab, by the tab's number.
    """

    state: SharedState = field(default_factory=SharedState)
    files: PageFiles = field(default_factory=PageFiles)
    check: MessageCheck = field(default_factory=MessageCheck)
    scenes: dict[str, viser.ClientHandle] = field(default_factory=dict)

    @property
    def dropped(self) -> int:
        """Number of messages that no tab sends, and that were not taken."""
        return self.check.dropped + self.state.check.dropped


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
        """The next message to viser that passes, as bytes. Raises ConnectionClosed."""
        return msgspec.msgpack.encode(await self.next_message(self._check))

    async def next_message(self, check: Any) -> Any:
        """The next message that passes a check. Raises ConnectionClosed."""
        while True:
            message = check.read(await super().recv())
            if message is not None and (not check.is_press(message) or self._presses.take()):
                return message
            check.dropped += 1


def open_guarded_server(host: str, port: int, gate: PageGate, parts: PageParts, **options: Any) -> viser.ViserServer:
    """A server of viser behind the gate.

    Args:
        host: address to listen on.
        port: port to listen on; viser takes a later one if it is taken.
        gate: decides about requests.
        parts: what is served beside the scene.
        **options: of viser's server.

    Raises:
        RuntimeError: this version of viser serves in another way, and would serve without the gate.
    """
    with _serving(gate, parts) as served, redirect_stdout(StringIO()):  # viser prints an address without the token
        server = viser.ViserServer(host, port, verbose=False, **options)
    if not served:
        server.stop()
        raise RuntimeError(f"viser {viser.__version__} does not serve through websockets.asyncio.server.serve")

    async def note_tab(client: viser.ClientHandle) -> None:  # a coroutine runs in the context of the tab's socket
        parts.scenes[tab_number.get()] = client

    async def forget_tab(client: viser.ClientHandle) -> None:
        parts.scenes.pop(tab_number.get(), None)

    server.on_client_connect(note_tab)
    server.on_client_disconnect(forget_tab)
    parts.check.opened = True
    return server


@contextmanager
def _serving(gate: PageGate, parts: PageParts) -> Iterator[list[int]]:
    """Put the gate before what viser serves in the block. Yields a list of the ports that were tried.

    viser cannot be given a gate, so the function by which it serves is replaced while it starts.
    """
    original: Any = websocket_server.serve
    ports: list[int] = []

    def serve(handler: Any, host: str, port: int, *, process_request: ProcessRequest, **options: Any) -> Any:
        async def route(connection: ServerConnection) -> None:
            assert connection.request is not None
            kind, _, number = connection.request.path.removeprefix("/").partition("/")
            if kind == SOCKET:
                await parts.state.serve(connection, number)
            else:
                tab_number.set(number)
                await handler(connection)

        ports.append(port)
        options |= {"max_size": MAX_MESSAGE, "logger": page_logger(), "server_header": None}
        options["create_connection"] = partial(GuardedConnection, parts.check)
        options["select_subprotocol"] = lambda _, offered: offered[0]  # the only one: see `_refused_socket`
        answer = partial(_answer, gate, parts.files, process_request)
        return original(route, host, port, process_request=answer, **options)

    websocket_server.serve = serve  # type: ignore[assignment,misc]
    try:
        yield ports
    finally:
        websocket_server.serve = original  # type: ignore[misc]


def _answer(
    gate: PageGate, files: PageFiles, of_viser: ProcessRequest, connection: ServerConnection, request: Request
) -> Response | None:
    """The answer to a request; None for a socket that may be opened."""
    headers = request.headers
    is_socket = "Upgrade" in headers
    local_ip = str(connection.local_address[0])
    verdict = gate.check(request.path, headers.get_all("Host"), headers.get_all("Origin"), local_ip, is_socket)
    if verdict.refused is not None:
        return text_response(HTTPStatus.FORBIDDEN, verdict.refused)
    if verdict.moved_to is not None:
        return text_response(HTTPStatus.SEE_OTHER, "", Location=verdict.moved_to)
    assert verdict.path is not None
    request.path = verdict.path
    if is_socket:
        return _refused_socket(connection, request)
    kind, _, rest = verdict.path.removeprefix("/").partition("/")
    number, _, path = rest.partition("/")
    if kind == SCENE and TAB_NUMBER.fullmatch(number):
        request.path = f"/{path}"
        answer = of_viser(connection, request)
        assert answer is not None
        answer.headers.update(HEADERS | {"X-Frame-Options": "SAMEORIGIN"})
        return answer
    found = files.get(verdict.path.removeprefix("/"))
    if found is None:
        return text_response(HTTPStatus.NOT_FOUND, "There is no such file.\n")
    return response(HTTPStatus.OK, found[0], found[1])


def _refused_socket(connection: ServerConnection, request: Request) -> Response | None:
    """The answer to who asks for a socket and cannot have one."""
    kind, _, number = request.path.removeprefix("/").partition("/")
    protocol = {SOCKET: TAB_PROTOCOL, SCENE: PROTOCOL}.get(kind)
    if protocol is None or not TAB_NUMBER.fullmatch(number):
        return text_response(HTTPStatus.NOT_FOUND, "There is no such socket.\n")
    headers = request.headers
    if headers.get_all("Upgrade") != ["websocket"] or headers.get_all("Sec-WebSocket-Protocol") != [protocol]:
        text = f"This socket of the page speaks {protocol}: load the page again.\n"
        return text_response(HTTPStatus.BAD_REQUEST, text)
    if len(connection.server.connections) >= MAX_SOCKETS:
        return text_response(HTTPStatus.SERVICE_UNAVAILABLE, f"{MAX_SOCKETS // 2} browsers are looking already.\n")
    return None


def text_response(status: HTTPStatus, text: str, **more: str) -> Response:
    """An answer of plain text. more: headers."""
    return response(status, text.encode(), {"Content-Type": "text/plain; charset=utf-8"} | more)


def response(status: HTTPStatus, body: bytes, headers: dict[str, str]) -> Response:
    """An answer with a body and headers."""
    lengths = {"Content-Length": str(len(body)), "Connection": "close"}
    return Response(status.value, status.phrase, Headers(HEADERS | headers | lengths), body)


def page_logger() -> logging.Logger:
    """A logger that says nothing of requests that are no requests."""
    logger = logging.getLogger("deixis.page")
    if not logger.filters:
        logger.addFilter(lambda record: not record.getMessage().startswith("opening handshake failed"))
    return logger
