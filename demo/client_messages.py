"""Which messages of a browser viser is given: those of the scene, with values that they can have.

viser sets any attribute of an element that a message names, to any value, for all browsers. So each message is checked
before viser sees it, and what passes is written anew from the values that were checked. The page has no elements of
viser: what they would send is not taken.
"""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

Name = Annotated[str, msgspec.Meta(max_length=200)]
Number = Annotated[float, msgspec.Meta(ge=-1e6, le=1e6)]  # the range refuses NaN too
Metres = Annotated[float, msgspec.Meta(ge=-20, le=20)]
Unit = Annotated[float, msgspec.Meta(ge=-1.01, le=1.01)]
Positive = Annotated[float, msgspec.Meta(gt=0, le=1e6)]
WholeNumber = Annotated[int, msgspec.Meta(ge=0, le=100_000)]
Vector = tuple[Number, Number, Number]
Pair = tuple[Number, Number]
Modifier = (
    Literal["cmd/ctrl", "alt", "shift", "cmd/ctrl+alt", "cmd/ctrl+shift", "alt+shift", "cmd/ctrl+alt+shift"] | None
)
MIN_QUATERNION = 0.9  # norm


class ClientMessage(msgspec.Struct, tag_field="type", forbid_unknown_fields=True):
    """A message of viser's page. The tag of each kind is viser's name for it."""


class CameraPose(ClientMessage, tag="ViewerCameraMessage"):
    """From where a browser looks."""

    wxyz: tuple[Unit, Unit, Unit, Unit]
    position: Vector
    fov: Annotated[float, msgspec.Meta(gt=0, lt=3.2)]  # radians
    near: Positive
    far: Positive
    image_height: WholeNumber
    image_width: WholeNumber
    look_at: Vector
    up_direction: Vector


class NodeClick(ClientMessage, tag="SceneNodeClickMessage"):
    """A click at a thing in the scene."""

    name: Name
    ray_origin: Vector
    ray_direction: Vector
    screen_pos: Pair
    instance_index: WholeNumber | None = None
    modifier: Modifier = None
    owner: Literal[""] = ""


class NodeDrag(ClientMessage, tag="SceneNodeDragMessage"):
    """A thing in the scene that is being dragged."""

    phase: Literal["start", "update", "end"]
    name: Name
    start_position: Vector
    start_screen_pos: Pair
    end_position: Vector
    end_screen_pos: Pair
    button: Literal["left", "middle", "right"]
    instance_index: WholeNumber | None = None
    modifier: Modifier = None
    owner: Literal[""] = ""


class HandleUpdate(ClientMessage, tag="TransformControlsUpdateMessage"):
    """Handles, such as the finger's, that are being dragged."""

    name: Name
    wxyz: tuple[Unit, Unit, Unit, Unit]
    position: tuple[Metres, Metres, Metres]
    owner: Literal[""] = ""


class HandleGrip(ClientMessage, tag="TransformControlsDragStartMessage"):
    """Handles that are taken hold of."""

    name: Name
    owner: Literal[""] = ""


class HandleRelease(ClientMessage, tag="TransformControlsDragEndMessage"):
    """Handles that are let go."""

    name: Name
    owner: Literal[""] = ""


KINDS = CameraPose | NodeClick | NodeDrag | HandleUpdate | HandleGrip | HandleRelease


class MessageCheck:
    """Checks the messages to a server. dropped: number of those that did not pass. opened: else none passes."""

    def __init__(self) -> None:
        self.dropped, self.opened = 0, False
        self._decode = msgspec.msgpack.Decoder(KINDS).decode

    def read(self, raw: bytes | str) -> ClientMessage | None:
        """The message, or None if viser is not given it."""
        try:
            message = self._decode(raw) if isinstance(raw, bytes) else None
        except (msgspec.MsgspecError, ValueError, RecursionError):
            return None
        if not self.opened:
            return None
        if isinstance(message, HandleUpdate) and sum(number**2 for number in message.wxyz) <= MIN_QUATERNION**2:
            return None
        return message

    def is_press(self, message: ClientMessage) -> bool:
        """Whether each of these messages is served, however many there are: of values, only the latest one is."""
        return isinstance(message, NodeClick)
