"""The choice of a plan among all readings.

It is the cheapest one that can be carried out, unless another one is about as cheap.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from language.commands import costs
from language.commands.meanings import Reading
from language.commands.planning import ENOUGH_EFFORT, Plan, Planner
from language.commands.sentences import readings


class Choice(NamedTuple):
    """A reading with its plan and total cost."""

    reading: Reading
    plan: Plan
    cost: float


class Choices(NamedTuple):
    """The plans that can be carried out, the cheapest first, one for each outcome; the failed ones; and the words."""

    possible: list[Choice]
    failed: list[Choice]
    tokens: list
    readings: list[Reading]


def choices(sentence: str, planner: Planner, scene_chooses: bool = True) -> Choices:
    """Returns the plans of a sentence.

    Args:
        sentence: as a person writes it.
        planner: of the scene.
        scene_chooses: False: the reading is chosen by its cost alone, before it is compared with the scene.

    Raises:
        NotUnderstood: the sentence is too long or can be read in too many ways.
    """
    found, lattice = readings(sentence, planner.judge if scene_chooses else None, planner.gestures)
    if not scene_chooses:
        found = found[:1]
    possible: list[Choice] = []
    failed: list[Choice] = []
    least = math.inf
    for reading in found:
        if possible and planner.effort > ENOUGH_EFFORT:
            break
        telling = costs.EMPTY <= reading.cost < least + costs.EMPTY - costs.FAR_BETTER  # why a cheaper reading fails
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
    return Choices(_distinct(possible), failed, lattice.tokens, found)


def _distinct(possible: list[Choice]) -> list[Choice]:
    """Returns the cheapest choice of each outcome."""
    best: dict[tuple, Choice] = {}
    for choice in possible:
        best.setdefault(result(choice.plan), choice)
    return list(best.values())


def result(plan: Plan) -> tuple:
    """Returns the effects of a plan, for comparison: where things end, what is held, and all other actions."""
    acts = tuple((a.kind, a.object, a.fixture) for a in plan.actions if a.kind not in ("take", "place", "push"))
    ends = {a.object: (a.position, a.bottom) for a in plan.actions if a.kind in ("take", "place", "push")}
    rounded = tuple(
        (i, (round(p[0], 2), round(p[1], 2), round(z or 0.0, 2)) if p else None) for i, (p, z) in sorted(ends.items())
    )
    return plan.world.held, rounded, acts
