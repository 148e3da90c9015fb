"""Plans for sentences of the project's own grammar, which is tried first: `language.parse` names exactly one object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from language.commands.outcomes import Action
from language.commands.places import Point, Spot, settle
from language.commands.plans import Plan, obstacle
from language.commands.world import World
from language.errors import LanguageError
from language.instruction import Correction
from language.objects import Scene
from language.understanding import GroundedStep, parse

TAKES = ("grasp", "lift")
CARRIES = ("pick_and_place", "stack", "hand_over", "sort")
ASIDE = 0.1  # metres from a marked place to the places for what is sorted there besides
SORTED = tuple((x * ASIDE, y * ASIDE) for x, y in ((0, 0), (0, 1), (0, -1), (1, 0), (-1, 0)))
_KINDS = {"pick_and_rotate": "rotate"}


def precise_plan(sentence: str, scene: Scene, world: World, pointed: Sequence[int]) -> Plan | None:
    """Returns the plan of a sentence that the precise grammar understands in this scene, or None.

    A plan whose preconditions fail says why, as others do.
    """
    try:
        if isinstance(parse(sentence), Correction):
            return None
        understood = parse(sentence, scene, pointed)
    except LanguageError:
        return None
    if any(step.task == "hand_over" and step.goal is None for step in understood.steps):
        return None  # nobody holds out a hand
    plan = Plan(world)
    for step in understood.steps:
        plan = plan if plan.failure else _after(plan, step)
    return plan


def _after(plan: Plan, step: GroundedStep) -> Plan:
    index = step.goal if step.init is None else step.init
    assert index is not None
    world = plan.world
    plan = replace(plan, it=(index,), mentioned=(index,))
    if step.task in (*TAKES, *CARRIES):
        held = world.held == index
        why = "" if held else obstacle(world, (index,)) or ("the gripper is full" if world.held is not None else "")
        if why:
            return replace(plan, failure=why, reason="impossible", candidates=(index,))
        if not held:
            plan = replace(plan, world=world.taken(index), actions=(*plan.actions, Action("take", index)))
        return plan if step.task in TAKES else _put(plan, step, index)
    goal = None if step.init is None or step.goal is None else world.things[step.goal]
    position = None if goal is None else (goal.x, goal.y)
    action = Action(_KINDS.get(step.task, step.task), index, position, world.ground if position else None)
    return replace(plan, actions=(*plan.actions, action))


def _put(plan: Plan, step: GroundedStep, index: int) -> Plan:
    assert step.goal is not None
    goal = plan.world.things[step.goal]
    on = None if goal.target else step.goal
    if step.goal == plan.world.hand:
        spot = Spot(*plan.world.in_hand, 0.0)
    elif step.task == "sort":
        points = [Point(goal.x + dx, goal.y + dy, 0.0, free=True) for dx, dy in SORTED]
        found = [settle(plan.world, index, point) for point in points]
        spot = min(found, key=lambda each: bool(each.why_not))
        on = None
    else:
        spot = settle(plan.world, index, Point(goal.x, goal.y, 0.0, on))
    if spot.why_not or (on is not None and spot.on != on):
        why = spot.why_not or f"the {goal.color} {goal.kind} is under something"
        return replace(plan, failure=why, reason="impossible", candidates=(step.goal,))
    action = Action("place", index, (spot.x, spot.y), spot.bottom, spot.on)
    return replace(plan, world=plan.world.moved(index, spot.x, spot.y, spot.bottom), actions=(*plan.actions, action))
