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


def judge(item: dict[str, Any], answer: dict[str, Any], scene: dict[str, Any]) -> tuple[str, bool, str]:
    """Returns the class of an answer, whether it meets an expectation, and a note."""
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


# ---- Whether a refusal helps: it names something of the sentence, states a true reason or offers something to say

# Words that no refusal may claim not to understand.
_PLAIN_WORDS = """
    a an the this that these those it them they one ones other another both each every all any some i me my mine we
    us our you your yours he him she her his robot arm gripper hand person table in into inside out of off from on
    onto at to toward towards by next near close beside between behind front above below under over top bottom left
    right up down upwards downwards back forward away side edge corner middle center centre here there where what
    which who why how when is are was be do does did done can could will would shall should want need like please
    thanks thank hello hi hey ok okay yes no not now then and or but if until while before after again first last
    more less little bit lot two three four five six take taken pick grab grasp get give bring pass put place set
    drop leave store keep let go come move push pull slide lift raise lower stack unstack build make remove open
    shut press turn rotate twist switch flip toggle touch reach point find look see show stop wait start continue
    undo home clear clean sort swap tower row cube cubes block blocks box boxes object objects thing things drawer
    fridge refrigerator door lid button knob lever handle wheel dial light lamp red green blue yellow orange cyan
    gray grey pink white black with without for so just very too same everything anything something nothing target
    mark marker spot goal leftmost rightmost nearest farthest far big small tell help fetch carry approach what's
    where's who's let's it's i'm i'd don't
"""
PLAIN = frozenset(_PLAIN_WORDS.split())
_EMPTY_WORDS = """
    the a an this that it is are was be to of in on at and or not no do does you i me my your there here with for as
    what which can than then so if by from up out into now one any some them they we us
"""
EMPTY = frozenset(_EMPTY_WORDS.split())
OFFER = re.compile(
    r"expected here:|\btry\b|\bsay\b|for example|did you mean|\binstead\b|you can|can do|\bname\b|\bask\b"
    r"|there (is|are) (a|an|the) \w+ \w+,|\bor\b.*\?$|\bshall i\b"
)
REASON = re.compile(
    r"understood|understand|don't know|do not know|unknown|no such|there (is|are) no|nothing|cannot|can't|unable"
    r"|already"
    r"|\bfull\b|\bshut\b|\bclosed\b|\bopen\b|\bhold|in (your|the|my) hand|in the way|out of reach|outside|too (far"
    r"|high)"
    r"|stands? on|stays|fixed|needs|not what|only|language|does not|doesn't|\bmust\b|\bfirst\b|marks no place"
)
IMPOSSIBLE = re.compile(
    r"can be opened and closed|is a place and no thing|does not go with|not what (this robot|task)|is fixed|stays "
    r"where it is"
    r"|cannot|can't|unable|is not possible|impossible"
)
STEP, BIT = 0.08, 0.05  # metres of a plain move, and of "a bit"


def words_of(text: str) -> list[str]:
    """Returns the words of a text in lower case."""
    return re.findall(r"[^\W\d_]+(?:'[^\W\d_]+)?", text.lower())


def own_part(text: str) -> str:
    """Returns a refusal without the offers at its end."""
    return re.split(
        r"; there is a|\.? ?expected here|; did you mean|: try |\btry\b|for example|: name ", text, flags=re.I
    )[0]


def helps(item: dict[str, Any], text: str, facts: Facts) -> tuple[bool, str, str]:
    """Returns whether a refusal helps, why not, and its own part without offers."""
    part, expect = own_part(text), item["expect"]
    refusals = [each for each in expect if "refuse" in each]
    known = _scene_words(facts) - EMPTY
    said = set(words_of(item["say"])) - EMPTY
    about = any(mentions(part, each.get("mention") or []) for each in refusals)
    if not text.strip():
        return False, "no text", part
    if not about and not (said | known) & set(words_of(part if said else text)):
        return False, "names nothing of the sentence or the scene", part
    if not OFFER.search(text.lower()) and not REASON.search(part.lower()):
        return False, "neither a reason nor an offer", part
    plans = [each["plan"] for each in expect if "plan" in each]
    why = _false(part.lower(), set(words_of(item["say"])), facts, plans, about)
    if not why and len(refusals) == len(expect) and not about:
        why = "does not mention what it is about"
    return not why, why, part


def _scene_words(facts: Facts) -> set[str]:
    words = {word for each in facts.things.values() for word in (each["noun"], each["color"])}
    return words | {
        "block",
        "box",
        "cubes",
        "blocks",
        "boxes",
        "grey",
        "refrigerator",
        "door",
        "hand",
        "knob",
        "handle",
        "table",
    }


def _false(low: str, sentence: set[str], facts: Facts, plans: list, about: bool) -> str:
    """Returns why the reason of a refusal is false; "" if it may be true."""
    for quoted in re.findall(r"(?<!\w)'(\w+)'", low):
        if quoted not in sentence | PLAIN | _scene_words(facts):
            return f"{quoted!r} is not in the sentence"
    unknown = re.search(r"'([^']+)' is not understood|do(?:n't| not) (?:know|understand) (?:the word )?'([^']+)'", low)
    if unknown and set(words_of(unknown[1] or unknown[2])) <= PLAIN | _scene_words(facts):
        return f"{unknown[1] or unknown[2]!r} is plain"
    missing = re.search(r"(?:nothing|no place|\d+ things) fits? ?'?([^';]*)'?|there (?:is|are) no ([^;,.]*)", low)
    if missing and _exists(missing[1] or missing[2] or "", facts):
        return "what it says is missing is there"
    return _false_state(low, facts, plans) or _false_place(low, facts, plans, about)


def _false_state(low: str, facts: Facts, plans: list) -> str:
    takes = any(verb_of(step) == "take" for plan in plans for step in plan[:-1])
    if (
        re.search(r"gripper is full|(gripper|i|robot|arm) (is|am|already )?\s?(holds|hold|holding)", low)
        and facts.held is None
        and not takes
    ):
        return "the gripper is empty"
    given = sum(verb_of(step) == "hand_over" for step in (plans[0] if plans else []))
    if "your hand is full" in low and facts.in_hand is None and given < 2:
        return "the hand is empty"
    for box in ("drawer", "fridge"):
        stored = sum(step.get("goal") == box for step in (plans[0] if plans else []))
        if re.search(rf"{box} is (shut|closed|not open)", low) and box in facts.open:
            return f"the {box} is open"
        if re.search(rf"{box} is (open already|already open)", low) and box not in facts.open:
            return f"the {box} is closed"
        if re.search(rf"{box} is full", low) and box not in facts.inside.values() and stored < 2:
            return f"the {box} is empty"
    for match in re.finditer(r"the (\w+) cube is in the (?:\w+ )?(drawer|fridge|way)", low):
        if match[2] != "way" and facts.inside.get(match[1]) != match[2]:
            return f"the {match[1]} cube is not in the {match[2]}"
        if match[2] == "way" and not _in_way(match[1], plans, facts):
            return f"the {match[1]} cube is not in the way"
    return ""


def _false_place(low: str, facts: Facts, plans: list, about: bool) -> str:
    taken = re.search(r"stands there already|in the way", low) and not re.search(r"the (\w+) cube is in the way", low)
    if taken and not any(_in_way(name, plans, facts) for name in facts.cubes):
        return "nothing is in the way"
    if re.search(r"outside what the arm reaches|out of (my |the )?reach|too far", low):
        x0, x1, y0, y1 = facts.area
        inside = [x0 - 0.01 <= x <= x1 + 0.01 and y0 - 0.01 <= y <= y1 + 0.01 for _, (x, y) in _nominal(plans, facts)]
        if all(inside):
            return "it can be reached"
    if match := re.search(r"the \w+ (\w+) marks no place", low):
        return f"things go into a {match[1]}" if match[1] in ("drawer", "fridge") else ""
    return "it can be done" if not about and IMPOSSIBLE.search(low) else ""


def _exists(phrase: str, facts: Facts) -> bool:
    """Whether a phrase names something of the scene, as far as its words tell."""
    words, things = words_of(phrase), facts.things.values()
    if any(re.search(rf"\b{facts.things[name]['color']} (cube|block|box)s?\b", phrase) for name in facts.cubes):
        return True
    if not set(words) <= PLAIN | _scene_words(facts):
        return any(word in _scene_words(facts) for word in words) and len(words) > 4
    named = {"green", "purple", "white", "black", "brown", "pink"} | {each["color"] for each in things}
    colors = set(words) & named
    return not colors or bool(colors & {each["color"] for each in things})


def _nominal(plans: list, facts: Facts) -> list[tuple[str, tuple[float, float]]]:
    """Returns each thing that moves with the places that are asked for, as if nothing stood there."""
    found: list[tuple[str, tuple[float, float]]] = []
    x0, x1, y0, y1 = facts.area
    beside = {"left_of": (0, 1), "right_of": (0, -1), "in_front_of": (-1, 0), "behind": (1, 0)}
    for step in (step for plan in plans for step in plan if verb_of(step) == "place"):
        goal = step.get("goal")
        for name in several(step["object"]):
            x, y = facts.positions[name][:2]
            if not isinstance(goal, dict):
                found += [(name, facts.positions[each][:2]) for each in several(goal) if each in facts.positions]
                continue
            if "shift" in goal:
                length = BIT if goal.get("metres") else STEP
                dx, dy = (sum(SIDES[side][axis] for side in several(goal["shift"])) for axis in (0, 1))
                found += [(name, (x + k * dx * length, y + k * dy * length)) for k in (1.0, 1.5)]
            if "side" in goal:
                sides = several(goal["side"])
                px = x1 if "far" in sides else x0 if "near" in sides else (x0 + x1) / 2
                found.append((name, (px, y1 if "left" in sides else y0 if "right" in sides else (y0 + y1) / 2)))
            around = [(goal[key], way) for key, way in beside.items() if key in goal]
            around += [(goal.get("near", []), way) for way in beside.values()]
            for anchors, (dx, dy) in around:
                for each in several(anchors) if anchors else []:
                    ax, ay = facts.positions[each][:2]
                    found.append((name, (ax + dx * STEP, ay + dy * STEP)))
            found += [(name, facts.positions[each][:2]) for each in several(goal.get("at", []))]
    return found


def _in_way(name: str, plans: list, facts: Facts) -> bool:
    if name not in facts.positions:
        return False
    places = [at for thing, at in _nominal(plans, facts) if thing != name]
    return not plans or any(math.dist(at, facts.positions[name][:2]) < 1.6 * WIDTH for at in places)
