"""Which messages of a browser the page takes: those that its own elements send, with values that these can have.

viser sets any attribute of an element that a message names, to any value, for all browsers. So each message is checked
before viser sees it, and what passes is written anew from the values that were checked.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
import viser

MAX_TEXT = 2000  # characters of a typed text
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


class SetValue(msgspec.Struct, forbid_unknown_fields=True):
    """What a browser sets of an element: nothing but its value."""

    value: bool | int | float | Annotated[str, msgspec.Meta(max_length=MAX_TEXT)]


class ElementUpdate(ClientMessage, tag="GuiUpdateMessage"):
    """A value that was chosen or typed, or a button that was pressed."""

    uuid: Name
    updates: SetValue


class FormSubmit(ClientMessage, tag="GuiFormSubmitMessage"):
    """A form that was sent off, by a key."""

    uuid: Name


class FormDirty(ClientMessage, tag="GuiFormDirtyMessage"):
    """A form in which something was typed."""

    uuid: Name


class CommandTrigger(ClientMessage, tag="CommandTriggerMessage"):
    """A key with a command."""

    uuid: Name


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


KINDS = (
    ElementUpdate
    | FormSubmit
    | FormDirty
    | CommandTrigger
    | CameraPose
    | NodeClick
    | NodeDrag
    | HandleUpdate
    | HandleGrip
    | HandleRelease
)


class MessageCheck:
    """Checks the messages to a server. Until `attach`, none passes. dropped: number of messages that did not."""

    def __init__(self) -> None:
        self.dropped = 0
        self._gui: Any = None
        self._decode = msgspec.msgpack.Decoder(KINDS).decode

    def attach(self, server: viser.ViserServer) -> None:
        """Let messages to the elements of this server pass."""
        self._gui = server.gui

    def read(self, raw: bytes | str) -> ClientMessage | None:
        """The message, or None if the page does not take it."""
        try:
            message = self._decode(raw) if isinstance(raw, bytes) else None
        except (msgspec.MsgspecError, ValueError, RecursionError):
            message = None
        return message if message is not None and self._is_allowed(message) else None

    def is_press(self, message: ClientMessage) -> bool:
        """Whether each of these messages is served, however many there are: of values, only the latest one is."""
        if isinstance(message, ElementUpdate):
            return isinstance(self._input(message.uuid), viser.GuiButtonHandle | viser.GuiButtonGroupHandle)
        return isinstance(message, FormSubmit | CommandTrigger | NodeClick)

    def _is_allowed(self, message: ClientMessage) -> bool:
        """What the types do not say. viser itself ignores unknown commands and things of the scene."""
        if self._gui is None:
            return False
        if isinstance(message, ElementUpdate):
            return _can_be(self._input(message.uuid), message.updates.value)
        if isinstance(message, FormSubmit | FormDirty):
            return isinstance(self._gui._container_handle_from_uuid.get(message.uuid), viser.GuiFormHandle)
        if isinstance(message, HandleUpdate):
            return sum(number**2 for number in message.wxyz) > MIN_QUATERNION**2
        return True

    def _input(self, uuid: str) -> Any:
        """The element that browsers may set; None if there is none."""
        return self._gui._gui_input_handle_from_uuid.get(uuid)  # viser has no public way


def _can_be(element: Any, value: Any) -> bool:
    """Whether a person can give an element this value in the browser."""
    if element is None or element.disabled or not element.visible:
        return False
    if isinstance(element, viser.GuiButtonHandle):
        return value is True
    if isinstance(element, viser.GuiCheckboxHandle):
        return isinstance(value, bool)
    if isinstance(element, viser.GuiTextHandle):
        return isinstance(value, str)
    if isinstance(element, viser.GuiDropdownHandle | viser.GuiButtonGroupHandle):
        return isinstance(value, str) and value in element.options
    if isinstance(element, viser.GuiSliderHandle):
        return _is_on(element, value)
    return False


def _is_on(slider: Any, value: Any) -> bool:
    """Whether a slider can be moved to a value. Comparisons with NaN are false."""
    if isinstance(value, bool | str) or not slider.min <= value <= slider.max:
        return False
    return not isinstance(slider.value, int) or int(value) == value
