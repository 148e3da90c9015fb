"""What can be asked for, and in which words: one table, read by `say` and by the grammar alike.

    "wave": Verb(("wave at {object}", "greet {object}"))

That is all a verb needs; one more template is one more string.
"""

from __future__ import annotations

from dataclasses import dataclass

from language.errors import LanguageError

OBJECT, GOAL = "{object}", "{goal}"  # where the name of the object goes, and where the words for the place
BASE = "{base}"  # where the name of the object goes that it is put on

POINTING = ("this", "that")  # with or without a noun: a gesture tells which one
HERE = ("here", "there")  # what stands there: a gesture tells where
IT = "it"  # the object of the step before

# How a place is said, by the object that is there. The first is what we say. (`here` and `there` need none of them.)
PLACES = ("to the same position as", "to the position of", "at the position of", "to the place of", "to", "at")


@dataclass(frozen=True)
class Verb:
    """templates: the first with the slots that are filled is what we say, all are what we understand.

    reward, networks: what the original system trains the task with: the reward's name, and one network a phase.
    moves: the named object is what is moved ("init"); otherwise it is where the gripper goes ("goal").
    effect: what becomes of the moved object: "goal" (it is where the goal was), "on" (it stands on the goal, a real
    object), "up" (it is LIFTED higher) or "".
    Raises LanguageError for a template that lacks its slots, or has them in another order.
    """

    templates: tuple[str, ...]
    reward: str = "distance"
    networks: int = 1
    moves: bool = False
    effect: str = ""

    def __post_init__(self) -> None:
        for template in self.templates:
            before, _, behind = template.partition(OBJECT)
            if template.count(OBJECT) != 1 or has_goal(before) or behind.count(GOAL) + behind.count(BASE) > 1:
                raise LanguageError(
                    f"{template!r}: a template has one {OBJECT} and, if any, one {GOAL} or {BASE} after it"
                )

    @property
    def takes_goal(self) -> bool:
        """Whether a place can be said."""
        return any(map(has_goal, self.templates))

    @property
    def needs_goal(self) -> bool:
        """Whether a place must be said."""
        return all(map(has_goal, self.templates))


def has_goal(template: str) -> bool:
    """Whether the template has a slot for the goal."""
    return GOAL in template or BASE in template


LIFTED = 0.15  # metres

VERBS: dict[str, Verb] = {
    "reach": Verb(
        ("reach {object}", "touch {object}", "go to {object}", "move to {object}", "reach for {object}"),
    ),
    "push": Verb(
        ("push {object} {goal}", "shove {object} {goal}"),
        moves=True,
        effect="goal",
    ),
    "pick_and_place": Verb(
        (
            "pick {object} and place it {goal}",
            "pick up {object} and place it {goal}",
            "pick {object} up and place it {goal}",
            "pick {object} and put it {goal}",
            "pick up {object} and put it {goal}",
            "take {object} and put it {goal}",
            "put {object} {goal}",
            "place {object} {goal}",
            "move {object} {goal}",
        ),
        reward="pnp",
        networks=3,
        moves=True,
        effect="goal",
    ),
    "pick_and_rotate": Verb(
        (
            "pick {object} and rotate it {goal}",
            "pick {object} and rotate it",
            "pick up {object} and rotate it {goal}",
            "pick up {object} and rotate it",
            "rotate {object} {goal}",
            "rotate {object}",
        ),
        reward="pnprot",
        networks=3,
        moves=True,
        effect="goal",
    ),
    "swipe": Verb(
        ("swipe {object} along the line {goal}", "swipe {object} {goal}", "drag {object} along the line {goal}"),
        reward="pnpswipe",
        networks=3,
        moves=True,
        effect="goal",
    ),
    "throw": Verb(("throw {object} {goal}", "toss {object} {goal}"), "throw", 3, moves=True, effect="goal"),
    "poke": Verb(
        ("poke {object} {goal}", "poke {object}", "nudge {object} {goal}", "nudge {object}"),
        reward="poke",
        networks=3,
        moves=True,
        effect="goal",
    ),
    "stack": Verb(
        (
            "stack {object} on {base}",
            "stack {object} on top of {base}",
            "put {object} on top of {base}",
            "place {object} on top of {base}",
        ),
        reward="stack",
        networks=3,
        moves=True,
        effect="on",
    ),
    "press": Verb(("press {object}", "press down on {object}"), "press", 3),
    "turn": Verb(("turn {object}", "twist {object}"), "turn", 3),
    "switch": Verb(("switch {object}", "flip {object}", "toggle {object}"), "switch", 3),
    "grasp": Verb(
        ("grasp {object}", "grab {object}", "take hold of {object}", "take {object}", "get {object}"), "grasp", 1
    ),
    "lift": Verb(
        (
            "lift {object}",
            "lift up {object}",
            "lift {object} up",
            "raise {object}",
            "pick up {object}",
            "pick {object}",
            "pick {object} up",
        ),
        reward="lift",
        networks=3,
        moves=True,
        effect="up",
    ),
}

OPENINGS = ("please", "first", "could you", "can you", "would you", "now", "robot", "hey", "i want you to")
CLOSINGS = ("please", "now", "thanks", "thank you")
THEN = ("then", "and then", "and", "after that")  # between steps; the first is what we say
AFTER = ("after you", "once you")  # before the step that comes first
NO = ("no", "no i meant", "i meant", "no i mean", "i mean", "sorry", "actually")  # opens a correction
NOT = ("not", "no not")  # opens a correction that says what was not meant
BUT = ("but", "i meant", "i mean")  # may stand before what was meant instead
