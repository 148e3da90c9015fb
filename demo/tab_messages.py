"""What a tab of the page can ask for: the messages of its socket, with the values that they can have.

It imports nothing of the project, which takes seconds to load: the page opens before.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec

MAX_TEXT = 2000  # characters of a typed text
MAX_CODE = 60_000  # characters of a link
MAX_SOUND = 20 * 16_000 * 2  # bytes: 20 seconds, of which 15 are heard
MIN_SPEED = 0.1  # of the clock; 1 is real time
Text = Annotated[str, msgspec.Meta(max_length=MAX_TEXT)]
Name = Annotated[str, msgspec.Meta(max_length=100)]
Metres = Annotated[float, msgspec.Meta(ge=-20, le=20)]  # the range refuses NaN too
Share = Annotated[float, msgspec.Meta(ge=0, le=1)]


class TabMessage(msgspec.Struct, tag_field="do", forbid_unknown_fields=True):
    """A message of a tab. The tag of each kind is what it asks for."""


class Say(TabMessage, tag="say"):
    """A sentence, or a button that says one."""

    text: Text


class Hear(TabMessage, tag="hear"):
    """A spoken sentence. pcm: 16-bit samples. rate: samples a second."""

    pcm: Annotated[bytes, msgspec.Meta(max_length=MAX_SOUND)]
    rate: Annotated[int, msgspec.Meta(ge=1, le=1_000_000)]


class Preview(TabMessage, tag="preview"):
    """What is typed so far: the tab is told how it would be understood."""

    text: Text


class Click(TabMessage, tag="click"):
    """A button."""

    button: Literal["stop", "shuffle", "point", "step", "picture", "video", "link", "stop arm", "release arm"]


class Nudge(TabMessage, tag="nudge"):
    """A key that moves the finger, or the gripper if it is driven by hand."""

    to: Literal["left", "right", "away", "near", "up", "down"]


class MoveObject(TabMessage, tag="move"):
    """A key that moves an object on the table by a little. object: its number in the list of names."""

    object: Annotated[int, msgspec.Meta(ge=0, le=99)]
    to: Literal["left", "right", "away", "near"]


class Hover(TabMessage, tag="hover"):
    """Where the mouse is in the picture of the scene: shares of its width and height; None: elsewhere."""

    at: tuple[Share, Share] | None


class SetDriver(TabMessage, tag="driver"):
    """Who drives."""

    value: Literal["policy", "expert", "hand"]


class SetViewpoint(TabMessage, tag="viewpoint"):
    """Whose left and right are meant."""

    value: Literal["robot", "human"]


class SetFlag(TabMessage, tag="flag"):
    """A box that is ticked or not."""

    name: Literal["paused", "gripper closed", "names", "glow", "looks", "compares"]
    value: bool


class SetSpeed(TabMessage, tag="speed"):
    """Speed of the clock."""

    value: Annotated[float, msgspec.Meta(ge=MIN_SPEED, le=1)]


class SetCamera(TabMessage, tag="camera"):
    """The camera whose picture is shown."""

    value: Name


class MoveHand(TabMessage, tag="hand"):
    """Where the gripper goes that is driven by hand, metres."""

    place: tuple[Metres, Metres, Metres]


class OpenScene(TabMessage, tag="scene"):
    """A prepared scene by its name, or the code of a link."""

    text: Annotated[str, msgspec.Meta(max_length=MAX_CODE)]


class ExportEpisodes(TabMessage, tag="export"):
    """The episodes as a dataset in this format."""

    kind: Literal["lerobot", "minari"]


class Change(TabMessage, tag="change"):
    """Another robot, task or policy. None: the one that fits, or the one that the task has."""

    robot: Name
    control: Name
    task: Name
    workspace: Name | None = None
    objects: Annotated[int, msgspec.Meta(ge=1, le=6)] | None = None
    policy: Name | None = None
    run: Text = ""


SETTINGS = SetDriver | SetViewpoint | SetFlag | SetSpeed | SetCamera
KINDS = (
    Say
    | Hear
    | Preview
    | Click
    | Nudge
    | MoveObject
    | Hover
    | MoveHand
    | Change
    | OpenScene
    | ExportEpisodes
    | SETTINGS
)


class KindsCheck:
    """Checks messages of these kinds. dropped: number of those that did not pass."""

    def __init__(self, kinds: Any) -> None:
        self.dropped = 0
        self._decode = msgspec.json.Decoder(kinds).decode

    def read(self, raw: bytes | str) -> Any:
        """The message, or None if the page does not take it."""
        try:
            return self._decode(raw)
        except (msgspec.MsgspecError, ValueError, RecursionError):
            return None

    def is_press(self, message: Any) -> bool:
        """Whether each of these messages is served, however many there are: here, all are."""
        return True


class TabCheck(KindsCheck):
    """Checks the messages of tabs: of values, only the latest one is served."""

    def __init__(self) -> None:
        super().__init__(KINDS)

    def is_press(self, message: Any) -> bool:
        return isinstance(message, Say | Hear | Click | Nudge | MoveObject | Change | OpenScene | ExportEpisodes)
