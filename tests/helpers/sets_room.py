"""The room of the instruction sets, and what is done in it."""

from pathlib import Path

from core.safe_files import read_yaml
from language import Dialogue, Object, Plan, Scene, table
from language.verbs import ROOM as VERBS

ROOM = read_yaml(Path(__file__).parents[2] / "benchmarks" / "sets" / "room.yaml")
NAMES = [each["id"] for each in ROOM["objects"]]
FACTS = {**ROOM["states"], "H": {"in_hand": "orange", "positions": {"orange": [0.5694, -0.4556, 0.1742]}}}


def room(facts):
    """The room of the instruction sets with the facts of a state; its things are in the order of `NAMES`."""
    at, ids = facts.get("positions", {}), NAMES.index
    objects = [
        Object(each["noun"], each["color"], tuple(at.get(each["id"], each["position"])), each["size"], each["role"])
        for each in ROOM["objects"]
    ]
    inside = {ids(thing): ids(box) for thing, box in facts.get("inside", {}).items()}
    inside |= {ids(facts["in_hand"]): ids("hand")} if "in_hand" in facts else {}
    opened, x = frozenset(map(ids, facts.get("open", ()))), tuple(ROOM["area"])
    held, moved = facts.get("held"), {ids(device): share for device, share in ROOM["devices"].items()}
    held = None if held is None else ids(held)
    return table(Scene(objects), held, bounds=x, inside=inside, open=opened, moved=moved, flat_only=True, verbs=VERBS)


def said(sentence, state="A"):
    """The outcome of a sentence in a state of the room."""
    return Dialogue().answer(sentence, room(FACTS[state]))


def done(sentence, state="A"):
    """What is done with what and where, as words; what is only taken to be put somewhere is left out."""
    outcome = said(sentence, state)
    assert isinstance(outcome, Plan), outcome
    steps = [s for s, after in zip(outcome.steps, [*outcome.steps[1:], None], strict=True) if not s.takes or not after]
    return named(steps)


def named(steps):
    """What steps do with what and where, as words."""
    goals = [[NAMES[step.goal]] if step.goal is not None else [] for step in steps]
    return [" ".join([step.verb, NAMES[step.object], *goal]) for step, goal in zip(steps, goals, strict=True)]
