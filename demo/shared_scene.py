"""A scene that can be shared: what a copied link holds, the scenes that are prepared, and how one is played again."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import msgspec

from core.errors import ConfigError, did_you_mean
from demo.tab_messages import Metres, Name, Text

MOST_EVENTS = 100  # of a scene; what happens later is not in its link
MAX_SEED = 2**53  # up to which JavaScript has every integer
PAUSE = 12  # control steps between the end of what was asked for and the next sentence
CHOICES = ("task", "robot", "control", "workspace", "objects", "driver")  # fields of a session's config
DAMAGED = "this link cannot be read: copy it again, as a whole"
Steps = Annotated[int, msgspec.Meta(ge=0, le=100_000)] | None


class Event(msgspec.Struct, tag_field="do", forbid_unknown_fields=True, kw_only=True, omit_defaults=True):
    """Something that a person did. after: control steps since the event before; None: with the robot at rest."""

    after: Steps = None


class Said(Event, tag="say"):
    """A sentence."""

    text: Text


class Pointed(Event, tag="point"):
    """The finger aimed at a place, metres."""

    place: tuple[Metres, Metres, Metres]


class PutThere(Event, tag="move"):
    """An object was put at x and y, metres. object: its number."""

    object: Annotated[int, msgspec.Meta(ge=0, le=99)]
    place: tuple[Metres, Metres]


class SharedScene(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, omit_defaults=True):
    """What reproduces a scene. seed: of the scene. events: in order. The other fields: as a session has them."""

    task: Name
    seed: Annotated[int, msgspec.Meta(ge=0, le=MAX_SEED)]
    robot: Name = "kuka"
    control: Name = "step"
    workspace: Name | None = None
    objects: Annotated[int, msgspec.Meta(ge=1, le=6)] | None = None
    driver: Literal["policy", "expert", "hand"] = "policy"
    viewpoint: Literal["robot", "human"] = "human"
    events: Annotated[list[Said | Pointed | PutThere], msgspec.Meta(max_length=MOST_EVENTS)] = []

    @property
    def choices(self) -> dict[str, Any]:
        """What is chosen in a session's config."""
        return {name: getattr(self, name) for name in CHOICES}

    @property
    def code(self) -> str:
        """The scene as letters, digits, - and _, as `read_code` reads them."""
        return base64.urlsafe_b64encode(msgspec.json.encode(self)).decode().rstrip("=")


def read_code(code: str) -> SharedScene:
    """Return the scene of a code. Raises ConfigError with one sentence, whatever is wrong with it."""
    try:
        padded = code.encode("ascii") + b"=" * (-len(code) % 4)
        return msgspec.json.decode(base64.b64decode(padded, b"-_", validate=True), type=SharedScene)
    except (msgspec.MsgspecError, binascii.Error, ValueError, RecursionError):
        raise ConfigError(DAMAGED) from None


# ---- Prepared scenes


@dataclass(frozen=True)
class PreparedScene:
    """A scene with a title and sentences to click."""

    title: str
    scene: SharedScene
    sentences: Sequence[str]


PREPARED: Mapping[str, PreparedScene] = {
    "sort": PreparedScene(
        "Sort the blocks",
        SharedScene(task="nl_sort", seed=0, driver="expert"),
        ("sort every yellow cube to the gray cube", "what do you see?", "go home"),
    ),
    "point": PreparedScene(
        "Someone points",
        SharedScene(task="nl_reach", seed=1, events=[Pointed(place=(0.512, 0.012, 0.025))]),
        ("reach this", "what color is this?", "now the gray one"),
    ),
    "drawer": PreparedScene(
        "The drawer",
        SharedScene(task="anything", seed=0),
        ("open the drawer", "take the green cube out of it", "put the purple cube in the drawer", "close it"),
    ),
    "which": PreparedScene(
        "Which one?",
        SharedScene(task="nl_reach", seed=0),
        ("reach the cylinder", "the green one", "no, the other one"),
    ),
    "tower": PreparedScene(
        "Build a tower",
        SharedScene(task="nl_stack", seed=0, driver="expert"),
        ("stack the gray cube on the pink cube", "stack the green cube on the gray cube", "what is on the pink cube?"),
    ),
}


def scene_of(text: str) -> SharedScene:
    """Return a prepared scene by its name, or the scene of a code. Raises ConfigError."""
    if text in PREPARED:
        return PREPARED[text].scene
    try:
        return read_code(text)
    except ConfigError:
        if len(text) < 20:  # a name, then
            raise ConfigError(f"scene={text} is not known{did_you_mean(text, PREPARED)}") from None
        raise


# ---- What happens in a scene


class EventLog:
    """What a person has done in a scene. events: in order, with their times."""

    def __init__(self) -> None:
        self.events: list[Said | Pointed | PutThere] = []
        self._at = 0

    def clear(self, step: int) -> None:
        """Begin anew at a control step."""
        self.events, self._at = [], step

    def add(self, event: Said | Pointed | PutThere, step: int, busy: bool) -> None:
        """Add what was done at a control step. busy: whether the robot was at work."""
        last = self.events[-1] if self.events else None
        follows = type(event) is type(last) and not isinstance(event, Said)
        if follows and getattr(event, "object", None) == getattr(last, "object", None):  # of a drag, its end counts
            event.after = last.after if last is not None else None
            self.events[-1] = event
        elif len(self.events) < MOST_EVENTS:
            event.after = step - self._at if busy else None
            self.events.append(event)
        self._at = step


class EventReplay:
    """Events that are still to happen."""

    def __init__(self, events: Sequence[Said | Pointed | PutThere], step: int) -> None:
        self._events, self._at, self._quiet = list(events), step, 0

    def next(self, step: int, busy: bool) -> Said | Pointed | PutThere | None:
        """Return the next event if its time has come. To be called after each control step."""
        self._quiet = 0 if busy else self._quiet + 1
        if not self._events:
            return None
        after = self._events[0].after
        if (self._quiet <= PAUSE) if after is None else (step - self._at < after):
            return None
        self._at, self._quiet = step, 0
        return self._events.pop(0)
