"""Random messages to the page of `play.py` and its scene, from what a browser may send to what no program should."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np

from tools.page_client import CAMERA, PageClient, SceneClient

Rng = np.random.Generator
NUMBERS = [math.nan, math.inf, -math.inf, 0, -1, 1, 0.5, 1e308, -1e308, 1e-320, 2**63 - 1, -(2**63), 2**31, 7, 3.0]
WORDS = ["", "x", "kuka", "None", "../../etc/passwd", "\0", "\u202e", "<script>alert(1)</script>", "é" * 50, "a" * 5000]
VALUES: list[Any] = [*NUMBERS, *WORDS, True, False, None, [], {}, [1, [2, [3]]], {"value": 1}, ["kuka"] * 500]
TYPES = (
    ("GuiUpdateMessage", "GuiRemoveMessage", "ResetGuiMessage", "RemoveSceneNodeMessage", "SetPositionMessage")
    + ("GuiFormSubmitMessage", "GuiFormDirtyMessage", "GuiButtonHoldMessage", "CommandTriggerMessage", "Message")
    + ("ShareUrlRequest", "ShareUrlDisconnect", "GetRenderResponseMessage", "LocalStorageGetItemResponseMessage")
    + ("FileTransferStartUpload", "FileTransferPart", "FileTransferPartAck", "RunJavascriptMessage", "GuiModalMessage")
    + ("SceneNodeClickMessage", "SceneNodeDragMessage", "ScenePointerMessage", "ViewerCameraMessage")
    + ("TransformControlsUpdateMessage", "TransformControlsDragStartMessage", "TransformControlsDragEndMessage", "")
)  # fmt: skip
FIELDS = ("uuid", "name", "updates", "value", "position", "wxyz", "owner", "frequency", "phase", "content", "more")
SENTENCES = (
    *WORDS[:-1],
    "a" * 2000,
    "reach the red cube",
    "stop",
    "no, the blue one",
    "what do you see?",
    "slower",
    "go home",
    "go on",
)
ACTIONS: dict[str, dict[str, list[Any]]] = {  # what a tab asks for, with values that it may send; none loads a robot
    "say": {"text": list(SENTENCES)},
    "preview": {"text": list(SENTENCES)},
    "hear": {"pcm": ["", "AAAA", "/38AgP9/AIA="], "rate": [16_000, 8_000, 1]},  # in base64
    "click": {"button": ["stop", "shuffle", "point", "step", "picture", "link", "stop arm", "release arm"]},
    "move": {"object": [0, 2, 99], "to": ["left", "right", "away", "near"]},
    "nudge": {"to": ["left", "right", "away", "near", "up", "down"]},
    "hover": {"at": [None, [0.5, 0.5], [0, 1]]},
    "driver": {"value": ["policy", "expert", "hand"]},
    "viewpoint": {"value": ["robot", "human"]},
    "flag": {"name": ["paused", "gripper closed", "names", "glow", "looks", "compares"], "value": [True, False]},
    "speed": {"value": [0.1, 0.5, 1]},
    "camera": {"value": ["front", "nothing"]},
    "scene": {"text": ["no such scene", "", "eJwDAAAAAAE"]},
    "export": {"kind": ["lerobot", "minari"]},
    "hand": {"place": [[0.4, 0, 0.2], [20, -20, 0]]},
    "change": {"robot": ["x"], "control": ["step"], "task": ["nl_reach"]},
}


def _any(rng: Rng, values: Any) -> Any:
    return values[int(rng.integers(len(values)))]


def _point(rng: Rng) -> list[float]:
    return rng.uniform(-1, 1, 3).tolist() if rng.random() < 0.7 else [_any(rng, NUMBERS) for _ in range(3)]


# ---- To the page


def sensible_message(rng: Rng) -> dict[str, Any]:
    """What a person could do."""
    action = _any(rng, list(ACTIONS))
    return {"do": action} | {name: _any(rng, values) for name, values in ACTIONS[action].items()}


def _wrong_message(rng: Rng) -> dict[str, Any]:
    """What a person could do, with a value or a field that is wrong."""
    action = sensible_message(rng)
    action[_any(rng, [*action, *FIELDS])] = _any(rng, VALUES)
    return action


def tab_message(rng: Rng) -> bytes | str:
    """Draw a message to the page."""
    message = copy.deepcopy(_any(rng, [sensible_message, _wrong_message])(rng))
    return _spoiled(rng, json.dumps(message).encode()) if rng.random() < 0.15 else json.dumps(message)


# ---- To the scene


def _typed(rng: Rng, things: list[str]) -> Any:
    """A message of a type that viser knows, with random fields."""
    fields = {_any(rng, FIELDS): _any(rng, VALUES) for _ in range(int(rng.integers(0, 5)))}
    names = {"name": _any(rng, things)} if rng.random() < 0.5 else {}
    return {"type": _any(rng, TYPES), **fields, **names}


def _scene(rng: Rng, things: list[str]) -> Any:
    """Clicks, drags and cameras, with points that are nowhere."""
    pixel = rng.uniform(0, 1, 2).tolist()
    drag = {
        "start_position": _point(rng),
        "start_screen_pos": pixel,
        "end_position": _point(rng),
        "end_screen_pos": pixel,
    }
    common = {"name": _any(rng, things), "instance_index": None, "modifier": None, "owner": ""}
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


def scene_message(rng: Rng, things: list[str]) -> bytes | str:
    """Draw a message to the scene. things: names of what is in it."""
    if rng.random() < 0.1:
        return _any(rng, [rng.bytes(int(rng.integers(0, 300))), *WORDS])
    message = msgspec.msgpack.encode(copy.deepcopy(_any(rng, [_typed, _scene])(rng, things)))
    return _spoiled(rng, message) if rng.random() < 0.15 else message


def _spoiled(rng: Rng, message: bytes) -> bytes:
    """The bytes with a few of them changed."""
    raw = bytearray(message)
    for _ in range(int(rng.integers(1, 4))):
        raw[int(rng.integers(len(raw)))] = int(rng.integers(256))
    return bytes(raw)


def send_hostile_messages(rng: Rng, address: str, count: int) -> int:
    """Send random messages to both sockets of the page; whenever it closes one, a new client goes on.

    Return the number of closes.
    """
    closes = 0
    makers: list[Callable[[str], Any]] = [PageClient, SceneClient]
    clients = [make(address) for make in makers]
    clients[1].listen(1.0)
    things = sorted(clients[1].things) or ["/finger"]
    for _ in range(count):
        at = int(rng.integers(2))
        clients[at].send_raw(tab_message(rng) if at == 0 else scene_message(rng, things))
        clients[at].listen()
        if clients[at].closed is not None:
            closes += 1
            clients[at] = makers[at](address)
    for client in clients:
        client.__exit__()
    return closes
