"""How outcomes of instruction sets are judged: plans against goals, questions, answers and refusals against rules.

The classes and goals are described in the README of the sets.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from typing import Any

CLASSES = ("right", "asked rightly", "refused helpfully", "asked needlessly", "refused unhelpfully", "wrong")
NAMES = {  # verbs of answers and expectations -> the one as which they count
    **dict.fromkeys(("grasp", "lift", "pick_up", "unstack"), "take"),
    **dict.fromkeys(("pick_and_place", "push", "swipe", "slide", "move"), "place"),
    **dict.fromkeys(("touch", "point"), "reach"),
    "give": "hand_over",
    "pick_and_rotate": "rotate",
}
CARRYING = ("place", "stack", "put_in", "hand_over")
SIDES = {"left": (0, 1), "right": (0, -1), "far": (1, 0), "near": (-1, 0)}
WIDTH = 0.05  # metres of a cube
Place = tuple[float, ...]


class Facts:
    """The facts of a state: positions, what is open, held, inside, on things and on the person's hand."""

    def __init__(self, scene: dict[str, Any], facts: dict[str, Any]) -> None:
        self.things = {each["id"]: each for each in scene["objects"]}
        self.home = {name: tuple(each["position"]) for name, each in self.things.items()}
        self.positions = self.home | {name: tuple(at) for name, at in (facts.get("positions") or {}).items()}
        self.open = set(facts.get("open") or ())
        self.held, self.in_hand = facts.get("held"), facts.get("in_hand")
        self.inside, self.on = dict(facts.get("inside") or {}), dict(facts.get("on") or {})
        self.devices = dict(scene.get("devices") or {}) | dict(facts.get("devices") or {})
        self.area = tuple(scene["area"])

    @property
    def cubes(self) -> list[str]:
        """The loose things."""
        return [
            name for name, each in self.things.items() if each["noun"] == "cube" and each.get("role", "real") == "real"
        ]


def verb_of(step: dict[str, Any]) -> str:
    """Returns the verb as which a step counts."""
    return NAMES.get(step["verb"], step["verb"])


def several(value: Any) -> list[str]:
    """Returns an id or a list of ids as a list."""
    return list(value) if isinstance(value, list) else [value]


def merged(steps: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Returns steps without those that the next step implies, and without all but the last place of a thing."""
    kept: list[dict[str, Any]] = []
    for step in steps:
        if kept and kept[-1]["object"] == step.get("object") and not kept[-1].get("optional"):
            before, now = verb_of(kept[-1]), verb_of(step)
            taken = before == "take" and now in (*CARRYING, "take", "take_out")
            if taken or (before == "take_out" and now in CARRYING) or before == now == "place":
                kept.pop()
        kept.append(step)
    return kept


def target_of(step: dict[str, Any], places: dict[str, Place]) -> tuple[float, float] | None:
    """Returns x and y of where a step puts its object."""
    if step.get("place") is not None:
        return step["place"][0], step["place"][1]
    goal = step.get("goal")
    return (places[goal][0], places[goal][1]) if isinstance(goal, str) and goal in places else None


def goal_met(goal: Any, step: dict[str, Any], facts: Facts, places: dict[str, Place], served: dict[int, str]) -> bool:
    """Whether a step has an expected goal. places: before the step. served: number of a step -> its object."""
    if goal is None:
        return True
    if isinstance(goal, dict) and "object_of" in goal:
        return step.get("goal") == served.get(goal["object_of"])
    if verb_of(step) != "place":
        return not isinstance(goal, dict) and step.get("goal") in several(goal)
    at = target_of(step, places)
    if at is None:
        return False
    if not isinstance(goal, dict):
        return any(math.dist(at, places[name][:2]) < 0.03 * math.sqrt(2) for name in several(goal))
    return all(
        _holds(key, value, at, step["object"], facts, places, goal) for key, value in goal.items() if key != "metres"
    )


def _holds(
    key: str,
    value: Any,
    at: tuple[float, float],
    thing: str,
    facts: Facts,
    places: dict[str, Place],
    goal: dict[str, Any],
) -> bool:
    (x, y), (x0, y0) = at, places[thing][:2]
    if key == "on":
        return True
    if key == "home":
        return math.dist(at, facts.home[thing][:2]) < 0.06
    if key == "at":
        return any(math.dist(at, facts.positions[name][:2]) < 0.06 for name in several(value))
    if key == "side":
        low_x, high_x, low_y, high_y = facts.area
        middle = abs(x - (low_x + high_x) / 2) < 0.08 and abs(y - (low_y + high_y) / 2) < 0.08
        found = {"left": y > 0.05, "right": y < -0.05, "far": x > 0.40, "near": x < 0.39, "center": middle}
        return all(found[side] for side in several(value))
    if key == "shift":
        least, most = goal.get("metres") or (0.005, math.inf)
        moved = [(x - x0) * SIDES[side][0] + (y - y0) * SIDES[side][1] for side in several(value)]
        return all(least < each for each in moved) and math.dist(at, (x0, y0)) <= most
    if key == "between":
        one, other = (places[name] for name in value)
        return math.dist(at, ((one[0] + other[0]) / 2, (one[1] + other[1]) / 2)) < 0.07
    return any(_related(key, at, (x0, y0), places[name][:2]) for name in several(value) if name != thing)


def _related(key: str, at: Place, start: Place, anchor: Place) -> bool:
    now, before = math.dist(at, anchor), math.dist(start, anchor)
    return {
        "near": now < 0.17,
        "left_of": at[1] > anchor[1] + 0.02,
        "right_of": at[1] < anchor[1] - 0.02,
        "in_front_of": at[0] < anchor[0] - 0.01,
        "behind": at[0] > anchor[0] + 0.01,
        "away_from": now > before + 0.005,
        "toward": now < before - 0.02 or now < 0.17,
    }[key]


def plan_met(alternative: dict[str, Any], steps: list[dict[str, Any]], facts: Facts) -> bool:
    """Whether the steps of an answer are those of an alternative."""
    expected, given = merged(alternative["plan"]), merged(steps)
    distinct = bool(alternative.get("distinct"))

    def fits(want: dict[str, Any], step: dict[str, Any], places: dict[str, Place], served: dict[int, str]) -> bool:
        wanted, now = verb_of(want), verb_of(step)
        if wanted != now and {wanted, now} != {"take", "take_out"}:
            return False
        if wanted == "take_out" and now == "take" and step["object"] not in facts.inside:
            return False
        if step["object"] not in several(want["object"]) or (distinct and step["object"] in served.values()):
            return False
        if wanted == "stack" and step.get("goal") == step["object"]:
            return False
        return goal_met(want.get("goal"), step, facts, places, served)

    def search(
        open_ones: tuple[int, ...], rest: list[dict[str, Any]], places: dict[str, Place], served: dict[int, str]
    ) -> bool:
        if not open_ones:
            return not rest
        for number in open_ones if alternative.get("any_order") else open_ones[:1]:
            others = tuple(each for each in open_ones if each != number)
            if rest and fits(expected[number], rest[0], places, served):
                at = target_of(rest[0], places) if verb_of(rest[0]) in CARRYING else None
                after = places if at is None else places | {rest[0]["object"]: (*at, 0.025)}
                if search(others, rest[1:], after, served | {number: rest[0]["object"]}):
                    return True
            if expected[number].get("optional") and search(others, rest, places, served):
                return True
        return False

    return search(tuple(range(len(expected))), given, dict(facts.positions), {})


def mentions(text: str, wanted: Iterable[str]) -> bool:
    """Whether each entry begins a word of the text; "a|b" means either."""
    low = text.lower()
    return all(any(re.search(rf"\b{re.escape(word.lower())}", low) for word in entry.split("|")) for entry in wanted)


def judge(item: dict[str, Any], answer: dict[str, Any], scene: dict[str, Any], helps: Any) -> tuple[str, bool, str]:
    """Returns the class of an answer, whether it meets an expectation, and a note.

    helps: tells whether the text of a refusal helps, and why not; see `benchmarks.helpful_refusals`.
    """
    state = item.get("facts")
    facts = Facts(scene, state if state is not None else scene["states"][item["state"]] or {})
    expect, outcome, text = item["expect"], answer["outcome"], answer.get("text") or ""
    if outcome in ("plan", "control"):
        steps = answer.get("steps") or []
        met = (outcome == "plan" or bool(steps)) and any(
            plan_met(each, steps, facts) for each in expect if "plan" in each
        )
        met = met or (outcome == "control" and any(each.get("control") == answer.get("control") for each in expect))
        return ("right" if met else "wrong"), met, str(answer.get("control") or shown(steps))
    if outcome == "answer":
        met = bool(text.strip()) and any("answer" in each and mentions(text, each["answer"]) for each in expect)
        return ("right" if met else "wrong"), met, text
    if outcome == "question":
        given = set(answer.get("candidates") or ())
        met = any(each.get("ask") and (not each.get("about") or given <= set(each["about"])) for each in expect)
        return ("asked rightly" if met else "asked needlessly"), met, text
    good, why, own = helps(item, text, facts)
    met = good and any("refuse" in each and mentions(own, each.get("mention") or []) for each in expect)
    return ("refused helpfully" if good else "refused unhelpfully"), met, f"{text}  <{why}>" if why else text


def shown(steps: list[dict[str, Any]]) -> str:
    """Returns steps as one line."""
    return "; ".join(
        f"{s['verb']} {s['object']} -> {s.get('goal') or s.get('place') or ''}".removesuffix(" -> ") for s in steps
    )
