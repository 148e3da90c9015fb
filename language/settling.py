"""The choice of a plan among all readings, and what is said if there is none.

It is the cheapest plan that can be carried out, unless another one is about as cheap.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from language import costs
from language.errors import NotUnderstood
from language.lattice import LIMITING, STRANGERS, Lattice, is_floor
from language.meanings import Clause, Entity, Gesture, Reading, pointing_words
from language.normalise import normalised
from language.outcomes import Answer, Outcome, Plan, Question, Refusal
from language.planning import ENOUGH_EFFORT, ENOUGH_ON_BOARD, Planner, empty_box, is_like
from language.scanning import Token, text_of
from language.sentences import readings
from language.several import GRIPS_ONE
from language.spots import pinned
from language.steps import Draft, allows, reached
from language.talk import MOST_NAMED, listed, name, offers, said
from language.verbs import Act
from language.words import UNRELATED
from language.world import WorldModel

_BEGINS = (".", "!", ";", ",", "and", "then", "please")  # a verb may follow
_NEARBY = ("near", "left", "right", "front", "behind", "under", "opposite", "away")  # relations that always matter
PLAIN = (*LIMITING, "tell")  # words that no refusal calls unknown
PERSONS = ("me", "us", "myself", "him", "her", "lady", "them", "someone")
ONE_AT_A_TIME = (
    GRIPS_ONE,
    "holds one thing",
    "only one thing",
    "one cube on another",
)  # why several cannot be together
_TELLING = ("nothing", "impossible", "already", "which")  # failures that are reported in preference to another reading


class Choice(NamedTuple):
    """A reading with its plan and total cost."""

    reading: Reading
    plan: Draft
    cost: float


class Choices(NamedTuple):
    """The plans that can be carried out, the cheapest first, one for each outcome; the failed ones; and the words."""

    possible: list[Choice]
    failed: list[Choice]
    lattice: Lattice
    readings: list[Reading]


def choices(words: str | list[Token], planner: Planner, scene_chooses: bool = True, times: int = 1) -> Choices:
    """Return the plans of a sentence.

    Args:
        words: a sentence as a person writes it, or its plain words.
        planner: of the scene.
        scene_chooses: False: the reading is chosen by its cost alone, before it is compared with the scene.
        times: how often it is done.

    Raises:
        NotUnderstood: the sentence is too long or can be read in too many ways.
    """
    table = not planner.world.cells
    judge = planner.judge if scene_chooses else None
    found, lattice = readings(words, judge, planner.gestures, planner.acts, table)
    if not scene_chooses:
        found = found[:1]
    if times > 1:
        found = [replace(reading, times=times) for reading in found]
    return _planned(found, planner, lattice)


def _planned(found: list[Reading], planner: Planner, lattice: Lattice) -> Choices:
    possible: list[Choice] = []
    failed: list[Choice] = []
    least = math.inf
    for reading in found:
        if possible and planner.effort > (ENOUGH_ON_BOARD if planner.world.cells else ENOUGH_EFFORT):
            break
        fits_nothing = reading.cost >= costs.EMPTY + costs.POINTED
        telling = fits_nothing and reading.cost < least + costs.EMPTY - costs.FAR_BETTER  # why a cheaper reading fails
        if reading.cost > least + 2 * costs.CLOSE and not telling:
            continue
        for plan in planner.plans(reading):
            choice = Choice(reading, plan, reading.cost + plan.cost)
            if plan.failure:
                failed.append(choice)
            else:
                possible.append(choice)
                least = min(least, choice.cost)
    possible.sort(key=lambda choice: choice.cost)
    failed.sort(key=lambda choice: choice.cost)
    return Choices(_distinct(possible), failed, lattice, found)


def choices_of(found: list[Reading], planner: Planner, words: Choices | None = None) -> Choices:
    """Return the plans of some readings. words: of the sentence that they come from."""
    lattice = words.lattice if words is not None else Lattice([])
    return _planned([replace(reading, unused=()) for reading in found], planner, lattice)


def _distinct(possible: list[Choice]) -> list[Choice]:
    """Return the cheapest choice of each outcome."""
    best: dict[tuple, Choice] = {}
    for choice in possible:
        best.setdefault(reached(choice.plan), choice)
    return list(best.values())


def settled(sentence: str, found: Choices, planner: Planner) -> Outcome:
    """Return the outcome that the plans of a sentence lead to."""
    world = planner.world
    if likely := crowded(found):
        return refused(sentence, found._replace(failed=likely), world)
    if not found.possible or _far_better(found):
        return refused(sentence, found, world)
    top = found.possible[0]
    if not world.cells and (box := empty_box(top.reading, top.plan)) is not None:
        why = f"nothing is in {name(world, box)}"
        return Refusal(sentence, 0.5, (), (0, len(sentence)), "impossible", why, offers(world))
    impossible = [c for c in found.failed if c.plan.reason == "impossible" and not c.reading.unused]
    if not world.cells and (meant := _meant_before(found, top, impossible)):
        return refused(sentence, found._replace(failed=meant), world)
    close = [c for c in found.possible if c.cost <= top.cost + costs.CLOSE]
    rivals = close[1:]
    if not world.cells:  # only what one reading leaves open is asked about, unless another reading leaves nothing open
        same = [c for c in close if c.reading.unused == top.reading.unused]
        alone = [c for c in same if sum(other.reading is c.reading for other in close) == 1]
        top = top if top.plan.arbitrary or not alone else alone[0]
        guessed = any("verb" in e and found.lattice.is_corrected(i) for i, e in enumerate(found.lattice.edges))
        rivals = [c for c in close if c is not top and (guessed or c.reading is top.reading)]
        corners = {anchor.kind for step in top.reading.steps for place in step.places for anchor in place.anchors}
        if corners == {"corner"} and all(c.reading is top.reading and _things(c) == _things(top) for c in rivals):
            rivals = []  # one of two corners on the left
    if rivals and _changes_roles([top, *rivals], planner):
        rivals = []
    if rivals and (spoken := _of_what_was_spoken_of([top, *rivals], planner.it)) is not None:
        top, rivals = spoken, []
    if not world.cells and (doubt := _left_out(sentence, top, found, world)) is not None:
        return doubt
    whole = not top.reading.unused and not world.cells and all(step.verb is not None for step in top.reading.steps)
    clauses = len(top.reading.steps) - 1 if whole else 0
    if top.cost > costs.TOO_MUCH + costs.NO_VERB_BUT_PLACE * clauses:
        return _doubted(sentence, found, world)
    if rivals and not top.plan.arbitrary:
        if not world.cells and any(c.cost < top.cost - 3 * costs.CLOSE for c in impossible):
            return refused(sentence, found._replace(failed=impossible), world)
        return _asked(sentence, [top, *rivals], found, world)
    following = found.possible[1].cost if len(found.possible) > 1 else math.inf
    if not top.plan.steps and not world.cells:
        words = [found.lattice.tokens[i].text for i in range(len(found.lattice))]
        return Answer(sentence, 1.0, (), (0, len(sentence)), f"All right, I do not: {' '.join(words)}")
    return understood(sentence, top, found.lattice, world, following)


def _meant_before(found: Choices, top: Choice, impossible: list[Choice]) -> list[Choice]:
    """Return the failed choices that are meant before the likeliest possible one; [] if there are none."""
    tidying = [c for c in found.failed if _tidies(c, top)]
    lasts = [c.reading.steps[-1] for c in (*found.possible, *found.failed) if not c.reading.unused]
    moves = any(last.act is Act.CARRY and last.places for last in lasts)  # "shift the cube 20 cm to the right"
    never = [c for c in found.failed if c.plan.reason == "never" and not (moves and c.plan.failure == "unturnable")]
    settled_by = [*tidying, *never, *(c for c in found.failed if _is_so(c))]  # whatever else might be meant
    if any(c.cost < top.cost for c in settled_by):
        return settled_by
    measured = [c for c in impossible if any(place.measure for step in c.reading.steps for place in step.places)]
    if any(c.cost < top.cost - costs.BETTER for c in measured):  # no other reading uses the length
        return measured
    there = [c for c in impossible if any(place.name == "here" for step in c.reading.steps for place in step.places)]
    placeless = not any(step.places for step in top.reading.steps)
    return there if placeless and any(c.cost < top.cost for c in there) else []  # "in there" is no other container


def crowded(found: Choices) -> list[Choice]:
    """Return likely readings that use all words and want several things where one at a time can be."""
    failed = [c for c in found.failed if not c.reading.unused and any(e in c.plan.failure for e in ONE_AT_A_TIME)]
    if not failed or failed[0].plan.world.cells:
        return []
    other = min(found.failed[0].cost, found.possible[0].cost - 2 * costs.LIKELIER if found.possible else math.inf)
    return failed if failed[0].cost < other + costs.LIKELIER else []


def _is_so(choice: Choice) -> bool:
    """Whether what a whole sentence asks for is so already."""
    return choice.plan.reason == "already" and not choice.reading.unused


def _tidies(choice: Choice, top: Choice) -> bool:
    """Whether several things shall go "away", where nobody says. top: the plan that would move one a bit away."""
    clause, other = choice.reading.steps[-1], top.reading.steps[-1]
    several = clause.entity is not None and clause.entity.plural and not choice.reading.unused
    aside = other.places and all(place.name == "direction" for place in other.places)
    return clause.act is Act.TIDY and several and bool(aside)


def _changes_roles(close: list[Choice], planner: Planner) -> bool:
    """Whether choices differ only in which of two things is "the other one": either will do."""
    places = [place for step in close[0].reading.steps for place in step.places]
    other = next((anchor for place in places for anchor in place.anchors if anchor.other), None)
    movers = {c.plan.mover for c in close}
    if other is None or len(close) != 2 or len(movers) != 2:
        return False
    resolver = planner.resolver(planner.world, ())
    return {ref.things[-1] for ref in resolver.resolve(replace(other, other=False)) if len(ref.things) == 1} == movers


def _of_what_was_spoken_of(close: list[Choice], it: Sequence[int]) -> Choice | None:
    """Return the one of some choices whose thing was spoken of, where "the top one" names no kind; or else None."""
    entity = close[0].reading.steps[0].entity
    if entity is None or not (entity.superlative or entity.sides) or entity.noun or entity.colors or entity.relations:
        return None
    spoken = [choice for choice in close if choice.plan.mover in it]
    return spoken[0] if len({choice.plan.mover for choice in spoken}) == 1 else None


def _things(choice: Choice) -> list[tuple]:
    """Return what the steps of a choice do with which things, wherever they are put."""
    return [(step.verb, step.object, step.goal) for step in choice.plan.steps]


def _left_out(sentence: str, top: Choice, found: Choices, world: WorldModel) -> Outcome | None:
    """Return the refusal of a sentence of which words are left that could change its meaning."""
    lattice = found.lattice
    strange = [i for i in top.reading.unused if matters(lattice, i)]
    if not strange:
        return None
    whole = [choice for choice in found.failed if not choice.reading.unused]
    contradicted = [c for c in whole if _shown(c.plan) or c.cost < top.cost or _is_so(c)]
    if contradicted:  # "take this cube" of a sphere
        return refused(sentence, found._replace(failed=contradicted), world)
    return _unknown(sentence, strange, top.plan, lattice, world)


def _shown(plan: Draft) -> tuple[int, ...]:
    """Return the things that a gesture shows where a plan has found nothing."""
    if plan.entity is None or not isinstance(plan.entity.pointed, Gesture):
        return ()
    return plan.entity.pointed.things


def _typed(sentence: str, lattice: Lattice, indices: Sequence[int]) -> tuple[str, ...]:
    """Return some words as they were typed."""
    return tuple(sentence[lattice.tokens[i].start : lattice.tokens[i].end] for i in indices)


def _unknown(sentence: str, strange: Sequence[int], plan: Draft, lattice: Lattice, world: WorldModel) -> Refusal:
    words = " ".join(_typed(sentence, lattice, strange[:3]))
    asked = f", only {said(world, plan.steps)}" if plan.steps and not plan.failure else ""
    tokens = [token.text for token in lattice.tokens]
    here = {thing.color for thing in world.things}
    absent = (f"there is no {tokens[i]} {tokens[i + 1]} here" for i in strange if lattice.names_absent(i, here))
    text = _below(tokens) or next(absent, "") or f"I am not sure what you mean by {words!r}{asked}"
    return Refusal(sentence, 0.0, (words,), (0, len(sentence)), "nothing", text, offers(world, tokens))


def _below(words: Sequence[str]) -> str:
    """Return why nothing is put where no table is; "" if the words name no such place."""
    place = next((word for at, word in enumerate(words) if is_floor(words, at)), "")
    return f"I put nothing on the {place}: only on the table, on other things and into what is here" if place else ""


def matters(lattice: Lattice, index: int) -> bool:
    """Whether a word that is left out may change the meaning: not an adjective, and no adverb at the end."""
    if index >= len(lattice):
        return False
    edges = lattice.edges[index]
    if lattice.is_call(index):
        return False
    if index in lattice.unknown or lattice.is_corrected(index):
        after = lattice.edges[index + 1].keys() if index + 1 < len(lattice) else set()
        begins = index == 0 or lattice.text(index - 1) in _BEGINS
        if {"noun", "color", "size"} & after and not begins:  # an adjective; alone it may say which cube
            nouns = {edge.value for edge in lattice.get(index + 1, "noun")}
            return index in lattice.unknown and nouns == {"thing"} and not {"color", "size"} & after
        before = lattice.text(index - 1) if index else ""
        preposed = index > 0 and (
            {"relation", "any", "between", "verb"} & lattice.edges[index - 1].keys()
            or before in ("my", "your", "our", "his", "for", "with")
        )
        return bool(preposed) or (
            index in lattice.unknown
            and (index == 0 or len(lattice.text(index)) > 3 or lattice.text(index) in STRANGERS)
        )
    if lattice.text(index) in LIMITING or lattice.is_relative(index) or index in lattice.bare:
        return True
    if lattice.text(index) == "more" and index and "number" in lattice.edges[index - 1]:
        return True  # "one more"
    if any(edge.value in _NEARBY for edge in edges.get("relation", ())) and lattice.text(index) not in ("by", "around"):
        return True
    if lattice.text(index) in ("it", "that", "this", "them", "these", "those") and index:
        return "relation" in lattice.edges[index - 1]  # "on top of that"
    strong = {"noun", "color", "every", "both", "other", "never", "not", "number", "stack", "role", "order"}
    if any(edge.value == "person" for edge in edges.get("region", ())) and lattice.text(index) not in PERSONS:
        return True
    board = any(edge.value == "board" for edge in edges.get("region", ()))
    if board and index and "verb" in lattice.edges[index - 1]:
        return True  # "put the table on the cube"
    if any(edge.value not in (1, -1) for edge in edges.get("ordinal", ())):
        return True
    if "verb" in edges and (index == 0 or "join" in lattice.edges[index - 1] or lattice.text(index - 1) in ",;."):
        return True
    return bool(strong & edges.keys())


def _far_better(found: Choices) -> bool:
    """Return whether a reading that fails is much cheaper than all others, without the cost of fitting nothing."""
    least = min((_telling_cost(c) for c in found.failed if c.plan.reason in _TELLING), default=math.inf)
    return least < found.possible[0].cost - costs.FAR_BETTER


def _telling_cost(choice: Choice) -> float:
    """Return the cost of a plan that fails, without the cost of fitting nothing."""
    fits_nothing = choice.plan.reason == "nothing" and (
        choice.plan.world.cells or choice.reading.cost >= costs.EMPTY + costs.POINTED
    )
    return choice.cost - costs.EMPTY * fits_nothing


def understood(sentence: str, choice: Choice, lattice: Lattice, world: WorldModel, following: float = math.inf) -> Plan:
    """Return the outcome of a plan. following: the cost of the next best one."""
    unused = _typed(sentence, lattice, choice.reading.unused)
    gap = 1.0 if choice.plan.arbitrary else 1.0 - 0.5 * math.exp(-(following - choice.cost) / costs.CLOSE)
    confidence = min(1.0, round(gap * math.exp(-choice.cost / costs.DOUBT), 3))
    notes = (*choice.plan.notes, *_loose_colors(choice, world))
    return Plan(
        sentence, confidence, unused, (0, len(sentence)), choice.plan.steps, choice.plan.world, choice.reading, notes
    )


def _loose_colors(choice: Choice, world: WorldModel) -> list[str]:
    """Return the choices that the scene settled: loose colours."""
    found = {}
    todo: list[Entity] = [e for step in choice.reading.steps if step.entity for e in [step.entity]]
    todo += [a for step in choice.reading.steps for place in step.places for a in place.anchors]
    while todo:
        entity = todo.pop()
        todo += [anchor for relation in entity.relations for anchor in relation.anchors]
        todo += entity.parts
        for meant in entity.colors:
            taken = next((color for color in meant if color in world.colors), None)
            if taken is not None and taken != meant[0]:
                found[meant[0]] = f"{meant[0]} is taken for {taken}"
    return list(found.values())


def _asked(sentence: str, rivals: list[Choice], found: Choices, world: WorldModel) -> Question:
    outcomes = tuple(understood(sentence, choice, found.lattice, world) for choice in rivals)
    objects = [next((s.object for s in o.steps if not s.implied), None) for o in outcomes]
    candidates = tuple(dict.fromkeys(i for i in objects if i is not None))
    if len(candidates) == len(outcomes):
        text = _one_fits(outcomes, rivals[0], world) + which(world, candidates)
    else:
        goals = [s.goal for o in outcomes for s in o.steps if s.carries]
        goals = goals if world.cells else [c.plan.anchor for c in rivals]
        differing = tuple(dict.fromkeys(i for i in goals if i is not None))
        ways = list(dict.fromkeys(said(world, o.steps) for o in outcomes))[:MOST_NAMED]
        text = f"Shall I {listed(ways, 'or')}, or something else?"
        candidates = differing if len(differing) > 1 else candidates
    reading = rivals[0].reading
    span = _span(rivals[0].plan.entity, found.lattice, sentence)
    return Question(sentence, round(1 / len(rivals), 3), outcomes[0].unused, span, text, candidates, outcomes, reading)


def _one_fits(outcomes: Sequence[Plan], choice: Choice, world: WorldModel) -> str:
    """Return that one thing fits in a container, where several are to go there; "" elsewhere."""
    entity, goals = choice.reading.steps[-1].entity, {outcome.steps[-1].goal for outcome in outcomes}
    box = next(iter(goals))
    if entity is None or not entity.plural or len(goals) > 1 or box not in world.containers:
        return ""
    return f"One thing fits in {name(world, box)}. "


def which(world: WorldModel, candidates: Sequence[int]) -> str:
    """Return the question which of some things is meant: three at most are named."""
    names = [name(world, i) for i in candidates[:MOST_NAMED]]
    return f"Do you mean {', '.join(names)}, or something else?"


def _doubted(sentence: str, found: Choices, world: WorldModel) -> Outcome:
    """Return a question whether an unlikely reading is meant."""
    top = found.possible[0]
    outcome = understood(sentence, top, found.lattice, world)
    if top.cost > 2 * costs.TOO_MUCH:
        return refused(sentence, found, world)
    words = ", ".join(f"'{word}'" for word in outcome.unused)
    text = f"I did not use {words}. " if words else "I am not sure. "
    text = f"{text}Shall I {said(world, outcome.steps)}, or something else?"
    return Question(sentence, outcome.confidence, outcome.unused, text=text, choices=(outcome,), reading=top.reading)


def refused(sentence: str, found: Choices, world: WorldModel) -> Outcome:
    """Return why no plan of a sentence can be carried out, or a question for what it leaves open."""
    likely = sorted((c for c in found.failed if _telling_cost(c) <= costs.TOO_MUCH), key=_rank)
    if not likely:
        return unreadable(sentence, found.lattice, world)
    so = [choice for choice in likely if _is_so(choice) and choice.reading.steps[-1].verb is not None]
    top = so[0] if so and likely[0].plan.reason in ("where", "what") else likely[0]  # "put X in the drawer" of X in it
    outcome = _reason(sentence, top, found.lattice, world)
    if not isinstance(outcome, Refusal) or top.reading.steps[-1].verb is None:
        return outcome
    about = (top.plan.mover,) if top.plan.mover is not None else ()
    return replace(outcome, reading=top.reading, about=about)


def _reason(sentence: str, top: Choice, lattice: Lattice, world: WorldModel) -> Outcome:
    """Return why the likeliest plan cannot be carried out, or a question for what it leaves open."""
    plan = top.plan
    span = _span(plan.entity, lattice, sentence)
    unused = _typed(sentence, lattice, top.reading.unused)
    strange = [i for i in top.reading.unused if i in lattice.unknown]
    part, words = sentence[slice(*span)], [token.text for token in lattice.tokens]
    if strange and plan.reason != "never" and not world.cells:
        return _unknown(sentence, strange, plan, lattice, world)
    if plan.reason == "where":
        return _where(sentence, top, unused, span, world)
    if plan.reason == "several":
        ways, text = _each_way(sentence, top, lattice, world), which(world, plan.candidates)
        return Question(sentence, 0.0, unused, span, text, plan.candidates, ways, top.reading)
    if plan.reason == "what":
        return _what(sentence, top, unused, span, world, words)
    if plan.reason == "never":
        text = _cannot(top, lattice)
        return Refusal(sentence, 0.0, unused, span, "impossible", text, offers(world, words))
    if plan.reason in ("nothing", "nowhere", "place"):
        if _shown(plan):
            shown = " or ".join(name(world, i) for i in _shown(plan))
            return Refusal(
                sentence, 0.0, unused, span, "nothing", f"'{part}': the gesture shows {shown}", offers(world, words)
            )
        return Refusal(sentence, 0.0, unused, span, "nothing", _missing(plan, part, lattice), offers(world, words))
    if plan.reason == "which":
        return _which_one(sentence, top, part, span, world)
    text = plan.failure
    about = [i for i in plan.candidates if i < len(world.things)]
    if about and not any(word in text for word in words):
        text = f"{name(world, about[0])}: {text}"
    if plan.entity is not None and not world.cells and not {w.strip(",.'") for w in text.split()} & set(words):
        text = f"{part}: {text}" if part else text
    return Refusal(sentence, 0.0, unused, span, plan.reason, text, offers(world, words))


def _rank(choice: Choice) -> float:
    """Sort key: what is said of the likeliest reading, rather than that a verb is impossible or unclear."""
    entity = choice.plan.entity
    mixed = 0.8 * (choice.plan.reason == "nothing" and entity is not None and len(entity.colors) > 1)
    unturnable = 2.0 * (choice.plan.failure == "unturnable")  # rather "push it" without a place
    unnamed = 0.6 * (choice.plan.reason == "nothing" and choice.reading.steps[-1].verb is None)  # rather a command
    unclear = {"what": 1.2, "place": 0.8, "nowhere": 0.3, "which": 0.6}.get(choice.plan.reason, 0.0)
    return unturnable + mixed + unnamed + _telling_cost(choice) + unclear


def _missing(plan: Draft, part: str, lattice: Lattice) -> str:
    entity = plan.entity
    if plan.reason == "nothing" and entity is not None and entity.number and "things fit" in plan.failure:
        return f"{plan.failure} '{part}'"
    if plan.reason == "nothing" and entity is not None and entity.kind in ("thing", "stack", "list"):
        head = [*(colors[0] for colors in entity.colors), *([entity.noun] if entity.noun else [])]
        if head and not entity.relations and not entity.superlative and not entity.sides and not entity.other:
            said = [token.text for token in lattice.tokens[slice(*entity.span)]]
            others = [thing.color for thing in plan.world.things if thing.kind == entity.noun]
            if entity.noun not in (None, "cube") and others and entity.noun in said:
                return f"the {entity.noun} here is {' or '.join(dict.fromkeys(others))}, not {head[0]}"
            head += ["thing"] * (entity.noun is None)
            named = any({"color", "noun"} & edges.keys() for edges in lattice.edges[slice(*entity.span)])
            plain = entity.noun is None or entity.noun in said or not named  # by an earlier sentence
            return f"there is no {' '.join(head) if plain else repr(part)} here"
        if entity.colors and not any(is_like(plan.world, i, entity) for i in range(len(plan.world.things))):
            return f"there is no {' '.join((head[0], entity.noun or 'thing'))} here"  # wherever it shall be
        world, inside = plan.world, [each.anchors[0] for each in entity.relations if each.name in ("in", "from")]
        boxes = [i for i in world.containers if inside and is_like(world, i, inside[0])]
        if boxes and not any(world.contents(i) for i in boxes):
            return f"nothing is in {listed([name(world, i) for i in boxes], 'or')}"
        return f"I do not see which thing is meant by {part!r}"
    if plan.reason == "place":
        return f"{part!r} is a place, and I do not see which thing you mean"
    return f"I see no place for that at {part!r}" if part else "I do not see where it should go"


def _cannot(choice: Choice, lattice: Lattice) -> str:
    clause = next((c for c in choice.reading.steps if c.act is Act.NEVER), None) or choice.reading.steps[-1]
    tokens = lattice.tokens[slice(*clause.span)] or lattice.tokens
    words = text_of(tokens[:9])
    if not any("verb" in edges for edges in lattice.edges):  # of the sentence before
        words = f"do that with {name(choice.plan.world, choice.plan.mover or 0)}"
    why = "no arm of this kind does that"
    if clause.act is Act.OPERATE:
        why = "only buttons, levers and wheels are operated, and nothing is rotated or tipped"
    return f"I cannot {words}: {why}"


def _where(sentence: str, top: Choice, unused: tuple[str, ...], span: tuple[int, int], world: WorldModel) -> Question:
    plan = top.plan
    if plan.failure == "what shall go where":
        text = "What shall I put where? Name one thing and its place"
    else:
        thing = name(world, plan.mover) if plan.mover is not None else "it"
        text = f"Where shall I put {thing}? Say, for example, 'next to' or 'on top of' something"
    return Question(sentence, 0.0, unused, span, text, reading=top.reading)


def _what(
    sentence: str, top: Choice, unused: tuple[str, ...], span: tuple[int, int], world: WorldModel, words: list[str]
) -> Outcome:
    plan = top.plan
    things = plan.it if plan.topic is not None else ()
    said_now = offers(world, words)
    if (word := _unshown(top.reading, words)) is not None:
        text = f"What do you mean by {word!r}, and what shall I do? Name a thing, or point at one"
        return Question(sentence, 0.0, unused, span, text)
    if things and plan.topic is not None:
        examples = " or ".join(repr(each) for each in said_now)
        text = f"What shall I do with {name(world, things[0])}? For example: {examples}"
        return Question(sentence, 0.0, unused, span, text, tuple(things), reading=None)
    text = f"I do not see what I shall do about '{' '.join(words[:8])}'"
    return Refusal(sentence, 0.0, unused, span, "syntax", text, said_now)


def _unshown(reading: Reading, words: list[str]) -> str | None:
    """Return a word such as "this" or "there" to which nothing was said or shown; None if there is none."""
    entity = reading.steps[-1].entity
    if entity is None:
        return None
    here = [each.span for each in entity.relations if each.name == "here" and not each.anchors]
    spans = here + [(at, at + 1) for at in pointing_words(reading)] + [entity.span] * (entity.kind == "it")
    return " ".join(words[slice(*spans[0])]) if spans else None


def _which_one(sentence: str, top: Choice, part: str, span: tuple[int, int], world: WorldModel) -> Question:
    """Return the question which thing a word such as "this" means, to which nothing was said or shown."""
    *before, last = top.reading.steps
    named = last.entity is not None and last.entity.kind == "it"
    reading = replace(top.reading, steps=(*before, replace(last, entity=Entity())))
    fit = tuple(i for i, thing in enumerate(world.things) if not thing.target and allows(world, last.act, i))
    word = f" by {part!r}" if named else ""
    text = f"Which thing do you mean{word}? Name it, or point at it"
    return Question(sentence, 0.0, (), span, text, fit, reading=reading)


def _each_way(sentence: str, top: Choice, lattice: Lattice, world: WorldModel) -> tuple[Plan, ...]:
    """Return the plan for each candidate of an ambiguous phrase."""
    if world.cells or len(top.plan.candidates) > 8:
        return ()
    plans = []
    for index in top.plan.candidates:
        steps = tuple(_with(step, top.plan.entity, index) for step in top.reading.steps)
        drafts = Planner(world).plans(replace(top.reading, steps=steps))
        if drafts and not drafts[0].failure:
            plans.append(
                understood(sentence, Choice(replace(top.reading, steps=steps), drafts[0], top.cost), lattice, world)
            )
    return tuple(plans)


def _with(step: Clause, entity: Entity | None, index: int) -> Clause:
    named = step.entity is entity and entity is not None
    return replace(step, entity=pinned(index)) if named else step


def unreadable(sentence: str, lattice: Lattice, world: WorldModel) -> Refusal:
    """Return the refusal of a sentence without any reading."""
    words = [token.text for token in lattice.tokens]
    strange = _typed(sentence, lattice, [i for i in sorted(lattice.unknown) if words[i] not in PLAIN])
    if strange:
        many = f"I do not know the words {' '.join(strange[:5])!r}"
        named = strange[0] in UNRELATED and re.search(rf"\b(?:the|an?|my|your) {strange[0]}\b", sentence.lower())
        one = f"there is no {strange[0]} here" if named else f"I do not know the word {strange[0]!r}"
        text = _below(words) or (one if len(strange) == 1 else many)
    else:
        what = f"which thing to {world.only}" if world.only else "what to take and where to put it"
        text = f"I do not see what I shall do about '{' '.join(words[:12])}'; say {what}"
    return Refusal(sentence, 0.0, tuple(words), (0, len(sentence)), "syntax", text, offers(world, words))


def _span(entity: Entity | None, lattice: Lattice, sentence: str) -> tuple[int, int]:
    tokens = lattice.tokens
    if entity is None or not tokens or entity.span[0] >= len(tokens) or entity.span == (0, 0):
        return (0, len(sentence))
    first, last = entity.span
    return tokens[first].start, tokens[max(first, min(last, len(tokens)) - 1)].end


def interpret_alone(sentence: str, world: WorldModel, scene_chooses: bool = True) -> Outcome:
    """Return the outcome of a sentence without a dialogue.

    scene_chooses: False: the reading is chosen without the scene's help; for measurements.
    """
    planner = Planner(world, help=scene_chooses)
    try:
        return settled(sentence, choices(normalised(sentence), planner, scene_chooses), planner)
    except NotUnderstood as error:
        return Refusal(sentence, span=(0, len(sentence)), text=str(error), suggestions=offers(world))
