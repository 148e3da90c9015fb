"""Verbs: the tasks that an instruction can name, with their sentence templates. Both `say` and the grammar use them.

    "wave": Verb(("wave at {object}", "greet {object}"))

Nothing else is needed for a new verb; a further template is a further string.
"""

from __future__ import annotations

from dataclasses import dataclass

from language.errors import LanguageError

OBJECT, GOAL = "{object}", "{goal}"  # slots of a template: the object's phrase, and the words for the place
BASE = "{base}"  # slot of a template: the phrase of the object that it is put on

POINTING = ("this", "that")  # with or without a noun; a gesture identifies the object
HERE = ("here", "there")  # the object at the place that a gesture shows
IT = "it"  # the object of the previous step
EVERY = "every"  # each object that the phrase fits, one after another

# Words before the object that marks a place; `say` uses the first. `here` and `there` stand without them.
PLACES = ("to the same position as", "to the position of", "at the position of", "to the place of", "to", "at")


@dataclass(frozen=True)
class Verb:
    """A verb and its sentence templates.

    templates: all are understood; `say` uses the first whose slots are all filled.
    reward, networks: of the original system's training: the reward's name, and the number of networks, one per phase.
    moves: whether the object is moved ("init"); otherwise the gripper goes to it ("goal").
    takes_every: whether its object may be "every red cube".
    effect: the position of the moved object afterwards: "goal" (where the goal was), "on" (on top of the goal, a real
        object), "in" (in the goal, a fitting), "out" (no longer in it), "hand" (on the person's hand, which no template
        names), "up" (LIFTED higher) or "" (unchanged).

    Raises LanguageError for a template that lacks its slots, or has them in another order.
    """

    templates: tuple[str, ...]
    reward: str = "distance"
    networks: int = 1
    moves: bool = False
    effect: str = ""
    takes_every: bool = False

    def __post_init__(self) -> None:
        for template in self.templates:
            before, _, behind = template.partition(OBJECT)
            if template.count(OBJECT) != 1 or has_goal(before) or behind.count(GOAL) + behind.count(BASE) > 1:
                raise LanguageError(
                    f"{template!r}: a template has one {OBJECT} and, if any, one {GOAL} or {BASE} after it"
                )

    @property
    def takes_goal(self) -> bool:
        """Whether a template has a goal."""
        return any(map(has_goal, self.templates))

    @property
    def goal_is_real(self) -> bool:
        """Whether its goal is a real object, not a target that only marks a place."""
        return self.effect in ("on", "in", "out")

    @property
    def needs_goal(self) -> bool:
        """Whether all templates have a goal."""
        return all(map(has_goal, self.templates))


def has_goal(template: str) -> bool:
    """Returns whether the template has a slot for the goal."""
    return GOAL in template or BASE in template


OPERATED = ("open", "close")  # what is done to fittings

LIFTED = 0.15  # metres by which a lifted object rises

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
    "open": Verb(("open {object}", "pull {object} open"), "open", 3),
    "close": Verb(("close {object}", "shut {object}"), "close", 3),
    "put_in": Verb(
        ("put {object} in {base}", "put {object} into {base}", "place {object} in {base}"),
        reward="pnp",
        networks=3,
        moves=True,
        effect="in",
    ),
    "take_out": Verb(
        ("take {object} out of {base}", "remove {object} from {base}"), "pnp", 3, moves=True, effect="out"
    ),
    "hand_over": Verb(
        (
            "hand me {object}",
            "give me {object}",
            "pass me {object}",
            "bring me {object}",
            "hand {object} to me",
            "give {object} to me",
            "pass {object} to me",
            "bring {object} to me",
            "hand over {object}",
            "bring {object} over to me",
            "put {object} in my hand",
            "take {object} and put it in my hand",
        ),
        reward="pnp",
        networks=3,
        moves=True,
        effect="hand",
    ),
    "unstack": Verb(
        ("unstack {object}", "take {object} down", "take {object} off the stack"), "unstack", 3, moves=True
    ),
    "sort": Verb(
        (
            "sort {object} to {base}",
            "gather {object} at {base}",
            "collect {object} at {base}",
            "bring {object} to {base}",
        ),
        reward="pnp",
        networks=3,
        moves=True,
        effect="goal",
        takes_every=True,
    ),
}

OPENINGS = ("please", "first", "could you", "can you", "would you", "now", "robot", "hey", "i want you to")
CLOSINGS = ("please", "now", "thanks", "thank you")
THEN = ("then", "and then", "and", "after that")  # between steps; `say` uses the first
AFTER = ("after you", "once you")  # before the step that is executed first
NO = ("no", "no i meant", "i meant", "no i mean", "i mean", "sorry", "actually")  # begins a correction
NOT = ("not", "no not")  # begins a correction that rejects an object
BUT = ("but", "i meant", "i mean")  # optional before the object that is meant instead
