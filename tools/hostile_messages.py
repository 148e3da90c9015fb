"""Random messages to the page of `play.py`, from what a browser may send to what no program should."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
import numpy as np

from tools.page_client import CAMERA, PageClient

Rng = np.random.Generator
NUMBERS = [math.nan, math.inf, -math.inf, 0, -1, 1, 0.5, 1e308, -1e308, 1e-320, 2**63 - 1, -(2**63), 2**31, 7, 3.0]
WORDS = ["", "x", "kuka", "None", "../../etc/passwd", "\0", "\u202e", "<script>alert(1)</script>", "é" * 50, "a" * 5000]
VALUES: list[Any] = [*NUMBERS, *WORDS, True, False, None, [], {}, [1, [2, [3]]], {"value": 1}, b"bytes", ["kuka"] * 500]
ATTRIBUTES = (
    ("value", "sync_cb", "update_cb", "removed", "is_button", "uuid", "gui_api", "props", "update_timestamp")
    + ("label", "visible", "disabled", "options", "min", "max", "content", "hold_cbs_from_freq", "__class__")
)  # fmt: skip
TYPES = (
    ("GuiUpdateMessage", "GuiRemoveMessage", "ResetGuiMessage", "RemoveSceneNodeMessage", "SetPositionMessage")
    + ("GuiFormSubmitMessage", "GuiFormDirtyMessage", "GuiButtonHoldMessage", "CommandTriggerMessage", "Message")
    + ("ShareUrlRequest", "ShareUrlDisconnect", "GetRenderResponseMessage", "LocalStorageGetItemResponseMessage")
    + ("FileTransferStartUpload", "FileTransferPart", "FileTransferPartAck", "RunJavascriptMessage", "GuiModalMessage")
    + ("SceneNodeClickMessage", "SceneNodeDragMessage", "ScenePointerMessage", "ViewerCameraMessage")
    + ("TransformControlsUpdateMessage", "TransformControlsDragStartMessage", "TransformControlsDragEndMessage", "")
)  # fmt: skip
FIELDS = ("uuid", "name", "updates", "value", "position", "wxyz", "owner", "frequency", "phase", "content", "more")
UNTOUCHED = ("Change", "Picture", "Start video")  # buttons that load a robot, or a file


def _any(rng: Rng, values: Any) -> Any:
    return values[int(rng.integers(len(values)))]


def _point(rng: Rng) -> list[float]:
    return rng.uniform(-1, 1, 3).tolist() if rng.random() < 0.7 else [_any(rng, NUMBERS) for _ in range(3)]


def _attribute(rng: Rng, client: PageClient) -> Any:
    """An attribute of an element, such as `sync_cb`, or several."""
    names = [_any(rng, ATTRIBUTES) for _ in range(int(rng.integers(1, 3)))]
    updates = {name: _any(rng, VALUES) for name in names}
    return {"type": "GuiUpdateMessage", "uuid": _any(rng, list(client.elements)), "updates": updates}


def _value(rng: Rng, client: PageClient) -> Any:
    """A value of an element that it mostly cannot have."""
    uuid = _any(rng, list(client.elements))
    if client.elements[uuid]["props"].get("label") in UNTOUCHED:
        return {}
    return {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": _any(rng, VALUES)}}


def _choice(rng: Rng, client: PageClient) -> Any:
    """What a person could do."""
    uuid = _any(rng, list(client.elements))
    props, value = client.elements[uuid]["props"], client.elements[uuid].get("value", True)
    if props.get("label") in UNTOUCHED:
        return {}
    if options := props.get("options"):
        value = _any(rng, options)
    elif "min" in props:
        value = float(rng.uniform(props["min"], props["max"]))
    elif value is not True:
        value = _any(rng, [*WORDS, "reach the red cube", "stop", "no, the blue one"])
    return {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}}


def _typed(rng: Rng, client: PageClient) -> Any:
    """A message of a type that viser knows, with random fields."""
    fields = {_any(rng, FIELDS): _any(rng, VALUES) for _ in range(int(rng.integers(0, 5)))}
    uuids = {"uuid": _any(rng, list(client.elements))} if rng.random() < 0.5 else {}
    return {"type": _any(rng, TYPES), **fields, **uuids}


def _scene(rng: Rng, client: PageClient) -> Any:
    """Clicks, drags and cameras, with points that are nowhere."""
    name = _any(rng, sorted(client.things) or ["/finger"])
    pixel = rng.uniform(0, 1, 2).tolist()
    drag = {
        "start_position": _point(rng),
        "start_screen_pos": pixel,
        "end_position": _point(rng),
        "end_screen_pos": pixel,
    }
    common = {"name": name, "instance_index": None, "modifier": None, "owner": ""}
    ray = {"ray_origin": _point(rng), "ray_direction": _point(rng), "screen_pos": pixel}
    phase = _any(rng, ["start", "update", "end", "x"])
    pose = {"name": "/finger", "owner": "", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": _point(rng)}
    return _any(
        rng,
        [
            {"type": "SceneNodeClickMessage", **common, **ray},
            {"type": "SceneNodeDragMessage", **common, **drag, "phase": phase, "button": "left"},
            {"type": "TransformControlsUpdateMessage", **pose},
            {**CAMERA, "position": _point(rng)},
        ],
    )


def _bytes(rng: Rng, client: PageClient) -> Any:
    """Bytes that are no message, or one with a few bytes changed, or text."""
    if rng.random() < 0.3:
        return rng.bytes(int(rng.integers(0, 300)))
    if rng.random() < 0.2:
        return _any(rng, WORDS)
    raw = bytearray(msgspec.msgpack.encode(_any(rng, WRITERS[:5])(rng, client)))
    for _ in range(int(rng.integers(1, 4))):
        raw[int(rng.integers(len(raw)))] = int(rng.integers(256))
    return bytes(raw)


WRITERS: list[Callable[[Rng, PageClient], Any]] = [_attribute, _value, _choice, _typed, _scene, _bytes]


def hostile_messages(rng: Rng, client: PageClient, count: int) -> Iterator[Any]:
    """Draw messages to the elements that a client knows."""
    for _ in range(count):
        yield copy.deepcopy(_any(rng, WRITERS)(rng, client))


def send_hostile_messages(rng: Rng, address: str, count: int) -> int:
    """Send random messages; whenever the page closes the socket, a new client goes on. Return the number of closes."""
    closes, sent = 0, 0
    while sent < count:
        with PageClient(address) as client:
            client.uuid("Say")
            for message in hostile_messages(rng, client, count - sent):
                client.send(message)
                client.listen()
                sent += 1
                if client.closed is not None:
                    closes += 1
                    break
    return closes
