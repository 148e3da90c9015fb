"""A room with cubes, a drawer, a fridge, devices and the hand of a person, for tests of what is said there."""

from dataclasses import replace

from language import Dialogue, Object, Scene, WorldModel, table
from language.verbs import ROOM

NAMES = ("yellow", "blue", "red", "drawer", "fridge", "button", "lever", "hand", "mark")
YELLOW, BLUE, RED, DRAWER, FRIDGE, BUTTON, LEVER, HAND, MARK = range(9)
OBJECTS = [
    Object("cube", "yellow", (0.34, 0.0, 0.025)),
    Object("cube", "blue", (0.44, -0.18, 0.025)),
    Object("cube", "red", (0.37, 0.18, 0.025)),
    Object("drawer", "blue", (0.46, -0.46, 0.08)),
    Object("fridge", "red", (0.27, 0.46, 0.1)),
    Object("button", "gray", (0.58, 0.18, 0.058), 0.07),
    Object("lever", "cyan", (0.62, -0.14, 0.066), 0.07),
    Object("palm", "pink", (0.57, -0.45, 0.15)),
    Object("cube", "gray", (0.45, 0.1, 0.025), role="target"),
]


def room(objects=OBJECTS, **facts) -> WorldModel:
    """The room with these facts in place of those at the start."""
    fields = {"bounds": (0.32, 0.47, -0.21, 0.21), "flat_only": True, "verbs": ROOM, "moved": {LEVER: 1.0}}
    return table(Scene(objects), **{**fields, **facts})


def outcome_of(turns, world=None):
    """The outcome of the last of some turns, which ' / ' separates."""
    dialogue = Dialogue()
    first, *others = turns.split(" / ")
    outcome = dialogue.answer(first, world or room())
    for turn in others:
        outcome = dialogue.answer(turn)
    return outcome


ORANGE, CYAN, WHEEL = range(len(OBJECTS), len(OBJECTS) + 3)
MORE = [
    Object("cube", "orange", (0.36, -0.08, 0.025)),
    Object("cube", "cyan", (0.46, 0.04, 0.025)),
    Object("wheel", "red", (0.63, 0.03, 0.056), 0.07),
]


def larger_room(orange=MORE[0]):
    """A room with some more things, where everything is at its home."""
    world = room([*OBJECTS, orange, *MORE[1:]])
    return replace(world, home={i: (thing.x, thing.y) for i, thing in enumerate(world.things)})


def asked_steps(outcome):
    """What is done with which thing; what is only taken to be put somewhere is left out."""
    found = outcome.steps
    return [(s.verb, s.object) for s, after in zip(found, [*found[1:], None], strict=True) if not s.takes or not after]
