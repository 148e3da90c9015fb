"""Names of things and descriptions of plans, for questions and refusals."""

from __future__ import annotations

from language.commands.outcomes import Action
from language.commands.world import World


def name(world: World, index: int) -> str:
    """Returns a name that distinguishes a thing from the others: "the red cube", "the red cube on the blue cube"."""
    thing = world.things[index]
    plain = f"the {thing.color} {thing.kind}"
    same = [i for i, other in enumerate(world.things) if (other.kind, other.color) == (thing.kind, thing.color)]
    if len(same) == 1:
        return plain
    below, above = world.below[index], world.above[index]
    if below is not None:
        under = world.things[below]
        return f"{plain} on the {under.color} {under.kind} at {_where(world, thing.x, thing.y)}"
    if above is not None:
        upper = world.things[above]
        return f"{plain} under the {upper.color} {upper.kind} at {_where(world, thing.x, thing.y)}"
    return f"{plain} at {_where(world, thing.x, thing.y)}"


def _where(world: World, x: float, y: float) -> str:
    return f"({x:.0f}, {y:.0f})" if world.cells else f"({x:.2f}, {y:.2f})"


def described(world: World, action: Action) -> str:
    """Returns an action in words."""
    thing = "" if action.object is None else f" {name(world, action.object)}"
    if action.kind in ("place", "push") and action.position is not None:
        where = f"on {name(world, action.on)}" if action.on is not None else f"at {_where(world, *action.position)}"
        return f"{'put' if action.kind == 'place' else 'push'}{thing} {where}"
    return f"{action.kind}{thing}{f' the {action.fixture}' if action.fixture else ''}"


def said(world: World, actions: tuple[Action, ...]) -> str:
    """Returns a plan in words. For a thing that is put somewhere, the words leave out that it is taken first."""
    placed = {action.object for action in actions if action.kind == "place"}
    kept = [action for action in actions if action.kind != "take" or action.object not in placed]
    return ", then ".join(described(world, action) for action in kept) or "nothing"


def examples(world: World) -> tuple[str, ...]:
    """Returns sentences that can be carried out in a world."""
    loose = [
        i for i, above in enumerate(world.above) if above is None and not world.things[i].target and i != world.held
    ]
    first = [f"take {name(world, i).partition(' at ')[0]}" for i in loose[:1]]
    second = [f"put it on {name(world, i).partition(' at ')[0]}" for i in loose[1:2] if world.things[i].kind == "cube"]
    return (*first, *second, "stop") if world.held is None else (*second, "drop it", "stop")
