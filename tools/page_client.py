"""A program in place of a browser: speaks viser's protocol with the page of `play.py`, well or badly."""

from __future__ import annotations

import html
import re
import socket
import time
from typing import Any, Self
from urllib.parse import urlsplit

import msgspec
import viser
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

PROTOCOL = f"viser-v{viser.__version__}"
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


class PageClient:
    """A client of the page at `address`. Raises OSError, or websockets' InvalidStatus if the page refuses it.

    elements: the message that made each element, by its uuid, with the changes since. things: names of the scene.
    closed: code and reason, once the page has closed the socket.
    """

    def __init__(self, address: str) -> None:
        url = "ws" + address.removeprefix("http")
        self._socket = connect(url, subprotocols=[PROTOCOL], compression=None, max_size=None, proxy=None)  # type: ignore[list-item]
        self.elements: dict[str, dict[str, Any]] = {}
        self.things: set[str] = set()
        self.closed: tuple[int, str] | None = None
        self.send(CAMERA)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    # ---- Messages

    def send(self, message: Any) -> None:
        """Send a message; bytes and text are sent as they are. Nothing is sent once the page has closed the socket."""
        try:
            self._socket.send(message if isinstance(message, bytes | str) else msgspec.msgpack.encode(message))
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

    def _take(self, raw: bytes | str) -> None:
        assert isinstance(raw, bytes)
        size, packed = (int.from_bytes(raw[at : at + 8], "little") for at in (0, 8))
        plain = zstandard.ZstdDecompressor().decompress(raw[16 : 16 + packed], max_output_size=size)
        for message in msgspec.msgpack.decode(plain)["messages"]:
            if message["type"] == "GuiUpdateMessage":
                element = self.elements.get(message["uuid"], {"props": {}})
                element["props"] |= message["updates"]
                element |= {key: value for key, value in message["updates"].items() if key == "value"}
            elif message["type"] == "GuiRemoveMessage":
                self.elements.pop(message["uuid"], None)
            elif "uuid" in message and "props" in message:
                self.elements[message["uuid"]] = message
            elif "name" in message and "props" in message:
                self.things.add(message["name"])

    # ---- What a person does

    def uuid(self, label: str) -> str:
        """Return the element with this label; of a button group, with this option. Waits for it."""
        end = time.monotonic() + TIMEOUT
        while time.monotonic() < end:
            for uuid, element in self.elements.items():
                props = element["props"]
                options = props["options"] if element["type"] == "GuiButtonGroupMessage" else ()
                if props.get("label") == label or label in options:
                    return uuid
            self.listen(0.05)
        raise TimeoutError(f"the page has no {label!r}")

    def set(self, label: str, value: Any) -> None:
        """Set the element with this label."""
        self.send({"type": "GuiUpdateMessage", "uuid": self.uuid(label), "updates": {"value": value}})

    def press(self, button: str) -> None:
        """Press a button, or one of a group."""
        is_group = self.elements[self.uuid(button)]["type"] == "GuiButtonGroupMessage"
        self.set(button, button if is_group else True)

    def say(self, sentence: str) -> None:
        """Type a sentence and send it off."""
        self.set("Say", sentence)
        self.listen(0.06)
        self.press("Do it")

    def text(self) -> str:
        """Return what the page shows, without markup."""
        shown = (element["props"].get("content") or "" for element in self.elements.values())
        return "\n".join(html.unescape(re.sub("<[^>]*>", " ", content)) for content in shown)

    def wait_for_text(self, pattern: str, seconds: float = TIMEOUT) -> str:
        """Return what matches a pattern, once the page shows it. Raises TimeoutError."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if found := re.search(pattern, self.text()):
                return found[0]
            self.listen(0.02)
        raise TimeoutError(f"the page does not show {pattern!r} but:\n{self.text()}")


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


def socket_headers() -> tuple[str, ...]:
    """Return the header lines by which a browser asks for the socket of the page, but Host and Origin."""
    key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ=="
    upgrade = "Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13"
    return *upgrade, key, f"Sec-WebSocket-Protocol: {PROTOCOL}"
