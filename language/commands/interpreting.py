"""`interpret`: what a sentence means in a scene, as one of three outcomes."""

from __future__ import annotations

import math
from collections.abc import Sequence

from language.commands import costs
from language.commands.choosing import Choice, Choices, choices
from language.commands.lattice import Token
from language.commands.meanings import Entity, Gesture
from language.commands.naming import examples, name, said
from language.commands.outcomes import Outcome, Question, Refusal, Understood
from language.commands.planning import Planner
from language.commands.world import World
from language.errors import NotUnderstood

_TELLING = ("nothing", "impossible", "dialogue")  # failures that are reported in preference to another reading
MOST_CANDIDATES = 6  # of a question


def settled(sentence: str, found: Choices, planner: Planner) -> Outcome:
    """Returns the outcome that the plans of a sentence lead to."""
    world = planner.world
    if not found.possible or _far_better(found):
        return refused(sentence, found, world)
    top = found.possible[0]
    rivals = [c for c in found.possible[1:] if c.cost <= top.cost + costs.CLOSE]
    if top.cost > costs.TOO_MUCH:
        return _doubted(sentence, found, world)
    if rivals and not top.plan.arbitrary:
        return _asked(sentence, [top, *rivals][:MOST_CANDIDATES], found.tokens, world)
    following = found.possible[1].cost if len(found.possible) > 1 else math.inf
    return understood(sentence, top, found.tokens, world, following)


def _far_better(found: Choices) -> bool:
    """Returns whether a reading that fails is much cheaper than all others, without the cost of fitting nothing."""
    least = min((_telling_cost(c) for c in found.failed if c.plan.reason in _TELLING), default=math.inf)
    return least < found.possible[0].cost - costs.FAR_BETTER


def _telling_cost(choice: Choice) -> float:
    """Returns the cost of a plan that fails, without the cost of fitting nothing."""
    return choice.cost - costs.EMPTY * (choice.plan.reason == "nothing")


def understood(
    sentence: str, choice: Choice, tokens: list[Token], world: World, following: float = math.inf
) -> Understood:
    """Returns the outcome of a plan. following: the cost of the next best one."""
    unused = tuple(sentence[tokens[i].start : tokens[i].end] for i in choice.reading.unused)
    gap = 1.0 if choice.plan.arbitrary else 1.0 - 0.5 * math.exp(-(following - choice.cost) / costs.CLOSE)
    confidence = min(1.0, round(gap * math.exp(-choice.cost / costs.DOUBT), 3))
    steps = choice.plan.actions
    notes = tuple(_notes(choice, sentence, tokens, world))
    span = (0, len(sentence))
    return Understood(sentence, confidence, unused, span, steps, choice.plan.world, choice.reading, notes)


def _notes(choice: Choice, sentence: str, tokens: list[Token], world: World) -> list[str]:
    """Returns the choices that the scene settled: loose colours."""
    found = {}
    todo: list[Entity] = [e for step in choice.reading.steps if step.entity for e in [step.entity]]
    todo += [a for step in choice.reading.steps for place in step.places for a in place.anchors]
    while todo:
        entity = todo.pop()
        todo += [anchor for relation in entity.relations for anchor in relation.anchors]
        for meant in entity.colors:
            taken = next((color for color in meant if color in world.colors), None)
            if taken is not None and taken != meant[0]:
                found[meant[0]] = f"{meant[0]} is taken for {taken}"
    return list(found.values())


def _asked(sentence: str, rivals: list[Choice], tokens: list[Token], world: World) -> Question:
    outcomes = tuple(understood(sentence, choice, tokens, world) for choice in rivals)
    objects = [next((a.object for a in o.steps if a.object is not None), None) for o in outcomes]
    candidates = tuple(dict.fromkeys(i for i in objects if i is not None))
    if len(candidates) == len(outcomes):
        text = f"Do you mean {' or '.join(name(world, i) for i in candidates)}?"
    else:
        text = f"Shall I {' or '.join(dict.fromkeys(said(world, o.steps) for o in outcomes))}?"
        candidates = _differing(outcomes) or candidates
    return Question(
        sentence,
        round(1 / len(rivals), 3),
        outcomes[0].unused,
        _span(rivals[0].plan.entity, tokens),
        text,
        candidates,
        outcomes,
    )


def _differing(outcomes: Sequence[Understood]) -> tuple[int, ...]:
    """Returns the things that the outcomes put something on."""
    return tuple(dict.fromkeys(a.on for o in outcomes for a in o.steps if a.on is not None))


def _doubted(sentence: str, found: Choices, world: World) -> Outcome:
    """Returns a question whether an unlikely reading is meant."""
    top = found.possible[0]
    outcome = understood(sentence, top, found.tokens, world)
    if top.cost > 2 * costs.TOO_MUCH:
        return refused(sentence, found, world)
    words = ", ".join(f"'{word}'" for word in outcome.unused)
    text = f"I did not use {words}. " if words else "I am not sure. "
    return Question(
        sentence,
        outcome.confidence,
        outcome.unused,
        text=f"{text}Shall I {said(world, outcome.steps)}?",
        choices=(outcome,),
    )


def refused(sentence: str, found: Choices, world: World) -> Outcome:
    """Returns why no plan of a sentence can be carried out, or a question for what it leaves open."""
    limit = costs.TOO_MUCH
    likely = sorted((c for c in found.failed if _telling_cost(c) <= limit), key=_telling_cost)
    if not likely:
        return unreadable(sentence, found.tokens, world)
    top = likely[0]
    plan, span = top.plan, _span(top.plan.entity, found.tokens)
    unused = tuple(sentence[found.tokens[i].start : found.tokens[i].end] for i in top.reading.unused)
    part = sentence[slice(*span)]
    if plan.reason == "where":
        text = "Where to? Say, for example, 'next to' or 'on top of' something."
        return Question(sentence, 0.0, unused, span, text, reading=top.reading)
    if plan.reason == "several":
        text = f"{plan.failure} '{part}'. Which do you mean?"
        return Question(sentence, 0.0, unused, span, text, plan.candidates)
    if plan.reason in ("nothing", "nowhere"):
        if plan.entity is not None and isinstance(plan.entity.pointed, Gesture) and plan.entity.pointed.things:
            shown = " or ".join(name(world, i) for i in plan.entity.pointed.things)
            return Refusal(sentence, 0.0, unused, span, "nothing", f"'{part}': the gesture shows {shown}")
        things = dict.fromkeys(f"a {thing.color} {thing.kind}" for thing in world.things)
        text = f"{plan.failure} '{part}'; there is {', '.join(list(things)[:8]) or 'nothing'}"
        return Refusal(sentence, 0.0, unused, span, "nothing", text, examples(world))
    return Refusal(sentence, 0.0, unused, span, plan.reason, plan.failure, examples(world))


def unreadable(sentence: str, tokens: Sequence[Token], world: World) -> Refusal:
    """Returns the refusal of a sentence without any reading."""
    text = "I do not understand that sentence; say what to take and where to put it"
    return Refusal(
        sentence, 0.0, tuple(token.text for token in tokens), (0, len(sentence)), "syntax", text, examples(world)
    )


def _span(entity: Entity | None, tokens: Sequence[Token]) -> tuple[int, int]:
    if entity is None or not tokens or entity.span[0] >= len(tokens):
        return (0, tokens[-1].end if tokens else 0)
    first, last = entity.span
    return tokens[first].start, tokens[max(first, min(last, len(tokens)) - 1)].end


def interpret_alone(sentence: str, world: World, scene_chooses: bool = True) -> Outcome:
    """Returns the outcome of a sentence without a dialogue.

    scene_chooses: False: the reading is chosen without the scene's help; for measurements.
    """
    planner = Planner(world, help=scene_chooses)
    try:
        found = choices(sentence, planner, scene_chooses)
    except NotUnderstood as error:
        return Refusal(sentence, span=(0, len(sentence)), reason="syntax", text=str(error), suggestions=examples(world))
    return settled(sentence, found, planner)
