"""Programs in place of a browser: they speak with the page of `play.py`, or with its scene, well or badly."""

from __future__ import annotations

import json
import re
import secrets
import socket
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any, Self
from urllib.parse import urlsplit

import msgspec
import viser
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

PROTOCOL, TAB_PROTOCOL = f"viser-v{viser.__version__}", "deixis"  # of the scene's socket, and of the page's
CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [1.2, -1.9, 0.9],
    "fov": 1.0,
    "near": 0.01,
    "far": 1000.0,
    "image_height": 400,
    "image_width": 400,
    "look_at": [1.0, 0.0, 0.3],
    "up_direction": [0.0, 0.0, 1.0],
}
TIMEOUT = 60.0  # seconds


def socket_address(address: str, kind: str, number: str = "") -> str:
    """Return the address of a socket.

    Args:
        address: of the page, with its token.
        kind: "socket", the page's, or "scene".
        number: of the tab; "": a new one.
    """
    parts = urlsplit(address)
    token = parts.query.removeprefix("token=") if parts.query else parts.path.strip("/")
    return f"ws://{parts.netloc}/{token}/{kind}/{number or secrets.token_hex(8)}"


class Client(ABC):
    """A socket. closed: code and reason, once the page has closed it. Raises OSError, or InvalidStatus if refused."""

    def __init__(self, address: str, protocol: str) -> None:
        self._socket = connect(address, subprotocols=[protocol], compression=None, max_size=None, proxy=None)  # type: ignore[list-item]
        self.closed: tuple[int, str] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def send_raw(self, message: bytes | str) -> None:
        """Send bytes or text. Nothing is sent once the page has closed the socket."""
        try:
            self._socket.send(message)
        except ConnectionClosed as error:
            self._note(error)

    def listen(self, seconds: float = 0.0) -> None:
        """Take in what the page has sent, and what it sends in the next seconds."""
        end = time.monotonic() + seconds
        while self.closed is None:
            try:
                self._take(self._socket.recv(max(end - time.monotonic(), 0.0)))
            except TimeoutError:
                return
            except ConnectionClosed as error:
                self._note(error)

    def _note(self, error: ConnectionClosed) -> None:
        self.closed = (error.rcvd.code, error.rcvd.reason) if error.rcvd else (1006, "")

    @abstractmethod
    def _take(self, raw: bytes | str) -> None:
        """Take a message of the server."""


class SceneClient(Client):
    """A client of the scene. things: names of what is in it, by the messages that made them."""

    def __init__(self, address: str) -> None:
        super().__init__(socket_address(address, "scene"), PROTOCOL)
        self.things: dict[str, dict[str, Any]] = {}
        self.send(CAMERA)

    def send(self, message: Any) -> None:
        """Send a message; bytes and text are sent as they are."""
        self.send_raw(message if isinstance(message, bytes | str) else msgspec.msgpack.encode(message))

    def _take(self, raw: bytes | str) -> None:
        assert isinstance(raw, bytes)
        size, packed = (int.from_bytes(raw[at : at + 8], "little") for at in (0, 8))
        plain = zstandard.ZstdDecompressor().decompress(raw[16 : 16 + packed], max_output_size=size)
        for message in msgspec.msgpack.decode(plain)["messages"]:
            if "name" in message and "props" in message:
                self.things[message["name"]] = message


class PageClient(Client):
    """A tab of the page at `address`. sections: what the page shows, by name."""

    def __init__(self, address: str) -> None:
        super().__init__(socket_address(address, "socket"), TAB_PROTOCOL)
        self.sections: dict[str, Any] = {}

    def _take(self, raw: bytes | str) -> None:
        for name, value in json.loads(raw).items():
            self.sections[name] = value
            if value is None:
                del self.sections[name]

    # ---- What a person does

    def send(self, action: Any, **fields: Any) -> None:
        """Send a message of a tab; bytes are sent as they are."""
        self.send_raw(action if isinstance(action, bytes) else json.dumps({"do": action, **fields}))

    def wait_until_ready(self, seconds: float = TIMEOUT) -> None:
        """Wait until the robot has been loaded: what is said before is not heard.

        Raises TimeoutError, or ConnectionResetError where the page has closed the socket.
        """
        end = time.monotonic() + seconds
        while "sayable" not in self.sections:
            if self.closed is not None:
                raise ConnectionResetError("the page has gone")
            if time.monotonic() > end:
                raise TimeoutError("the page is not ready")
            self.listen(0.02)

    def say(self, sentence: str) -> None:
        """Say a sentence."""
        self.wait_until_ready()
        self.send("say", text=sentence)

    def say_and_wait(self, sentence: str) -> str:
        """Say a sentence, wait until it has ended, and return the page's words for that. Raises TimeoutError."""
        turn = self.newest
        self.say(sentence)
        return self.wait_for_text("Done in|Not done.*", after=turn)

    def start_over(self) -> None:
        """Have a new scene, and choose again what any tab may have changed."""
        turn = self.newest
        self.press("shuffle")
        self.wait_for_text("This is a new scene", after=turn)
        self.listen(0.5)  # a last message of another tab may be answered after it
        self.send("flag", name="paused", value=False)
        self.send("speed", value=1.0)
        self.send("driver", value="expert")

    def press(self, button: str) -> None:
        """Press a button."""
        self.send("click", button=button)

    def change(self, **values: Any) -> None:
        """Choose another robot, task or policy; what is not given stays."""
        self.wait_until_ready()
        shown = self.sections["choice"]["shown"]
        self.send("change", **{name: shown[name] for name in ("robot", "control", "task", "workspace")} | values)

    @property
    def newest(self) -> int:
        """The number of the latest turn of the conversation; -1: there is none."""
        return max(self._turns(), default=-1)

    @property
    def last(self) -> str:
        """All text of the latest turn of the conversation."""
        return self.since(self.newest - 1)

    def since(self, turn: int) -> str:
        """Return all text of the turns after that one."""
        later = sorted(number for number in self._turns() if number > turn)
        return " ".join(text for number in later for text in strings(self.sections[f"entry {number}"]))

    def _turns(self) -> list[int]:
        return [int(name.split()[1]) for name in self.sections if name.startswith("entry ")]

    def text(self) -> str:
        """Return all text that the page shows, one a line."""
        return "\n".join(strings(self.sections))

    def wait_for_text(
        self, pattern: str, seconds: float = TIMEOUT, last: bool = False, after: int | None = None
    ) -> str:
        """Return what matches a pattern, once the page shows it. Raises TimeoutError.

        Args:
            pattern: a regular expression.
            seconds: to wait.
            last: whether the latest turn of the conversation must show it.
            after: the number of a turn; one of those after it must show it.
        """
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            shown = self.text() if after is None else self.since(after)
            if found := re.search(pattern, self.last if last else shown):
                return found[0]
            self.listen(0.02)
        raise TimeoutError(f"the page does not show {pattern!r} but:\n{self.text()}")

    def names(self) -> list[str]:
        """Return the names of the scene's objects."""
        self.wait_until_ready()
        return self.sections["lab"]["names"]


def strings(value: Any) -> Iterator[str]:
    """Yield the texts in a value of JSON; the parts of a sentence as one."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for name, each in value.items():
            if name == "said":
                yield "".join(part[0] for part in each)
            else:
                yield from strings(each)
    elif isinstance(value, list):
        for each in value:
            yield from strings(each)


def request(address: str, target: str = "/", *headers: str) -> str:
    """Return the whole answer to a request that is written by hand; "" if there is none.

    Args:
        address: whose host and port are asked.
        target: path and query.
        headers: lines; without a Host among them, that of the address is sent.
    """
    where = urlsplit(address)
    lines = [f"GET {target} HTTP/1.1", *headers]
    if not any(line.lower().startswith("host") for line in headers):
        lines.insert(1, f"Host: {where.netloc}")
    with socket.create_connection((where.hostname, where.port), timeout=10) as connection:
        connection.sendall("\r\n".join([*lines, "", ""]).encode("latin-1"))
        try:
            data = connection.recv(2**16)
            while data and b"101 Switching" not in data and (more := connection.recv(2**16)):
                data += more
        except ConnectionError:
            pass
    return data.decode("latin-1")


def socket_headers(protocol: str = PROTOCOL) -> tuple[str, ...]:
    """Return the header lines by which a browser asks for a socket of the page, but Host and Origin."""
    key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ=="
    upgrade = "Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13"
    return *upgrade, key, f"Sec-WebSocket-Protocol: {protocol}"
