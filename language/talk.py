"""What the robot says: names of things, what can be said, refusals, and answers to questions about the world."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import zip_longest

from language import costs
from language.chart import Chart
from language.lattice import Lattice
from language.meanings import Entity
from language.objects import HAND
from language.referents import Ref
from language.scanning import Token, scan
from language.spots import a_name, is_operated
from language.verbs import DEVICE_VERBS, KNOWN, Act, doing
from language.words import FILLERS, TABLE
from language.world import FLAT, WorldModel

BESIDE = 3.0  # widths of a thing from its middle within which another one is next to it
WAYS = {"left": "to the left", "right": "to the right", "far": "away from {}", "near": "towards {}"}
BACK = 0.03  # metres within which a thing is back where it was
FEW_CELLS = 3  # that a move is told by
MOST_OFFERED = 2  # sentences that can be said instead
MOST_NAMED = 3  # things that a question offers by name


def foreign(words: Sequence[str], known: set[str] | frozenset[str]) -> str:
    """Return that English is understood, in the language of these words; "" if they are English."""
    letters = [letter for word in words for letter in word if letter.isalpha()]
    if letters and sum(letter > "\u024f" for letter in letters) > 0.5 * len(letters):
        return TABLE["english_only"]["others"]
    strange = [word for word in words if word.isalpha() and word not in known]
    best, said = 0, ""
    for language, text in TABLE["languages"].items():
        table, sentence = set(text.split()), TABLE["english_only"][language]
        hits = sum(word in table for word in words)
        odd = sum(word in table for word in strange)
        written = odd > 1 or words[0] in table  # "grab the bleu cube" is English
        if odd and written and hits >= 2 and hits >= 0.5 * len(words) and hits + odd > best:
            best, said = hits + odd, sentence
    return said


# ---- Names


def name(world: WorldModel, index: int) -> str:
    """Return a thing's name: colour and kind, and where it is if others have the same."""
    thing = world.things[index]
    if world.cells:
        same = [i for i, other in enumerate(world.things) if (other.color, other.kind) == (thing.color, thing.kind)]
        return f"the {thing.color} {thing.kind}" if len(same) < 2 else _name_among(world, index, same)
    same = [
        i
        for i, other in enumerate(world.things)
        if (other.color, other.kind, other.target) == (thing.color, thing.kind, thing.target) and i != index
    ]
    plain = a_name(world, index)
    if index in world.inside:
        return f"{plain} in {a_name(world, world.inside[index])}"
    if same:
        order = sorted([*same, index], key=lambda i: -world.toward("left")[1] * world.things[i].y)
        place = order.index(index)
        if place in (0, len(order) - 1):
            return f"the {'right' if place else 'left'} {thing.color} {thing.kind}"
        return f"{plain} that is {'second' if place == 1 else 'third'} from the left"
    return plain


def _name_among(world: WorldModel, index: int, same: Sequence[int]) -> str:
    """Return the name of a thing of a board among those of its kind: by a side, its stack, a neighbour, or its cell."""
    thing = world.things[index]
    plain = f"{thing.color} {thing.kind}"
    for side in ("left", "right"):
        reached = {i: _along(world, side, world.things[i].x, world.things[i].y) for i in same}
        if all(reached[index] > reached[i] for i in same if i != index):
            return f"the {side}most {plain}"
    kinds = [(other.color, other.kind) for other in world.things]
    for neighbours, word in ((world.below, "on"), (world.above, "under")):
        other = neighbours[index]
        if other is not None and kinds.count(kinds[other]) == 1:
            return f"the {plain} {word} {a_name(world, other)}"
    if all(neighbours is None for neighbours in (world.below[index], world.above[index])):
        beside = [
            i
            for i, other in enumerate(world.things)
            if kinds.count(kinds[i]) == 1 and max(abs(other.x - thing.x), abs(other.y - thing.y)) == 1
        ]
        if beside:
            return f"the {plain} next to {a_name(world, beside[0])}"
    return f"the {plain} at {thing.x:g}, {thing.y:g}, height {thing.bottom:g}"


def listed(names: Sequence[str], join: str = "and") -> str:
    """Return names as in a sentence: "a, b and c"."""
    return f" {join} ".join(filter(None, (", ".join(names[:-1]), names[-1]))) if names else "nothing"


def said(world: WorldModel, steps: Sequence) -> str:
    """Return steps in words: "take the red cube and put it in the drawer"."""
    parts = []
    for step, after in zip_longest(steps, steps[1:]):
        if step.takes and after is not None and after.object == step.object and after.carries:
            continue
        parts.append(_step(world, step))
    return " and ".join(dict.fromkeys(parts)) or "do nothing"


def _step(world: WorldModel, step) -> str:
    thing = a_name(world, step.object)
    template = KNOWN[step.verb].templates[0] if KNOWN[step.verb].templates else ""
    if step.act is Act.TAKE or step.act is Act.HOLD:
        return f"pick up {thing}"
    if step.goal is not None and step.carries and step.goal != world.hand:
        where = "at" if world.things[step.goal].target else "in" if step.goal in world.containers else "on"
        return f"put {thing} {where} {a_name(world, step.goal)}"
    if step.carries and step.goal is None:
        return f"put {thing} {spot_words(world, step)}"
    phrase = template.replace("{object}", thing)
    if step.goal is not None:
        return phrase.replace("{base}", a_name(world, step.goal))
    return phrase.replace(" {base}", "").replace(" {goal}", "")


def spot_words(world: WorldModel, step) -> str:
    """Return where a step puts its thing: next to what is nearest, or on which side."""
    x, y = step.place
    for index, other in enumerate(world.things):
        if other.target and max(abs(other.x - x), abs(other.y - y)) < 0.02 * (1 if not world.cells else 20):
            return f"at {a_name(world, index)}"
    thing, moved = world.things[step.object], step.object == world.held or step.object in world.inside
    home = world.home.get(step.object)
    if home is not None and math.dist(home, (x, y)) < BACK and math.dist(home, (thing.x, thing.y)) > BACK:
        return "back where it was"
    dx, dy = x - thing.x, y - thing.y
    if world.cells and not moved and step.bottom == world.ground == thing.bottom and 0 in (round(dx), round(dy)):
        cells = round(abs(dx) + abs(dy))
        side = next((side for side in WAYS if _along(world, side, dx, dy) > 0), "left")
        if 0 < cells <= FEW_CELLS:
            return f"{'a cell' if cells == 1 else f'{cells} cells'} {WAYS[side].format(_viewer(world))}"
    if not world.cells and max(abs(dx), abs(dy)) < 0.13 and not moved and world.below[step.object] is None:
        most = 0.8 * max(abs(dx), abs(dy), 1e-9)
        side = next((side for side in WAYS if _along(world, side, dx, dy) >= most), "left")
        return f"{WAYS[side].format(_viewer(world))} by {100 * max(abs(dx), abs(dy)):.0f} cm"
    near = sorted(
        (i for i, other in enumerate(world.things) if i != step.object and not other.target),
        key=lambda i: abs(world.things[i].x - x) + abs(world.things[i].y - y),
    )
    close = near and abs(world.things[near[0]].x - x) + abs(world.things[near[0]].y - y) < (
        0.15 if not world.cells else 2
    )
    return f"next to {a_name(world, near[0])}" if close else f"on the {'board' if world.cells else 'table'}"


def _viewer(world: WorldModel) -> str:
    """Return who sees what is near as near: the person, or the robot that says so."""
    return "you" if world.viewpoint == "human" else "me"


def _along(world: WorldModel, side: str, dx: float, dy: float) -> float:
    ux, uy = world.toward(side)
    return ux * dx + uy * dy


def sides_of(world: WorldModel, index: int) -> tuple[str, str]:
    """Return in which part of the table a thing is: "left", "middle" or "right", and "near" or "far"."""
    (x0, x1, y0, y1), thing = world.bounds, world.things[index]
    dx, dy = thing.x - (x0 + x1) / 2, thing.y - (y0 + y1) / 2
    left, edge = _along(world, "left", dx, dy), 0.2 * (y1 - y0)
    across = "left" if left > edge else "right" if left < -edge else "middle"
    return across, "near" if _along(world, "far", dx, dy) < 0 else "far"


def where(world: WorldModel, index: int) -> str:
    """Return where a thing is, in words."""
    if index == world.held:
        return "in my gripper"
    if index in world.inside:
        box = world.inside[index]
        state = "" if box == world.hand else ", which is open" if box in world.open else ", which is closed"
        return f"in {a_name(world, box)}{state}"
    below, thing = world.below[index], world.things[index]
    if below is not None:
        return f"on top of {a_name(world, below)}"
    across, along = sides_of(world, index)
    side = [
        "in the middle" if across == "middle" else f"on the {across}",
        f"at the front, near {_viewer(world)}" if along == "near" else f"at the back, away from {_viewer(world)}",
    ]
    near = [
        i
        for i in range(len(world.things))
        if i not in (index, world.held) and world.is_loose(i) and i not in world.inside and world.below[i] is None
    ]
    near.sort(key=lambda i: abs(world.things[i].x - thing.x) + abs(world.things[i].y - thing.y))
    over = world.above[index]
    beside = ""
    if near and over is None:
        off = math.dist((thing.x, thing.y), (world.things[near[0]].x, world.things[near[0]].y))
        beside = f"; {a_name(world, near[0])} is {'next' if off < BESIDE * thing.width else 'nearest'} to it"
    beside = f"; {a_name(world, over)} is on it" if over is not None else beside
    return f"on the table, {' '.join(side)}{beside}"


# ---- What can be said


def offers(world: WorldModel, words: Sequence[str] = ()) -> tuple[str, ...]:
    """Return sentences that can be carried out now, those that share most words with what was said first."""
    found = list(dict.fromkeys(_sayable(world)))
    wanted = {*words} - FILLERS - {"a", "an", "in", "on", "of", "it", "to", "and", "cube"}
    order = sorted(found, key=lambda text: (-len(wanted & {token.text for token in scan(text)}), found.index(text)))
    kept: list[str] = []
    for text in order:
        if len(kept) < MOST_OFFERED and (world.only or text.split()[0] not in {each.split()[0] for each in kept}):
            kept.append(text)
    return tuple(kept)


def _sayable(world: WorldModel) -> Iterator[str]:
    """Yield sentences that can be carried out now."""
    loose = [i for i in range(len(world.things)) if world.is_loose(i) and world.above[i] is None]
    on_table = [i for i in loose if i not in world.inside]
    names = [a_name(world, i) for i in range(len(world.things))]
    unique = lambda i: world.cells or names.count(names[i]) == 1  # noqa: E731
    if world.only is not None:
        template = KNOWN[world.only].templates[0]
        yield from (template.replace("{object}", names[i]) for i in _objects(world) if unique(i))
        return
    if world.held is not None:
        for i in on_table:
            if world.things[i].kind in FLAT and i != world.held and unique(i) and world.is_on_ground(i):
                yield f"put it on {names[i]}"
        yield "put it down"
    for i in on_table:
        if unique(i) and i != world.held and world.held is None:
            yield f"pick up {names[i]}"
    for i in world.containers:
        yield f"{doing(Act.SHUT if i in world.open else Act.OPEN)} {names[i]}"
        if i in world.open and not world.contents(i):
            yield from (f"put {names[j]} in {names[i]}" for j in on_table if unique(j))
        if i in world.open:
            yield from (f"take {names[j]} out of {names[i]}" for j in world.contents(i))
    for verb, noun in DEVICE_VERBS.items():
        for i in world.devices:
            if world.things[i].kind == noun and (
                noun != next(iter(DEVICE_VERBS.values())) or not is_operated(world, i)
            ):
                yield f"{verb} {names[i]}"
    bases = [i for i in on_table if world.things[i].kind in FLAT and world.below[i] is None]
    yield from (
        f"put {names[i]} on {names[j]}"
        for i in on_table
        for j in bases
        if i != j and unique(i) and unique(j) and i != world.held
    )
    if world.hand is not None and not world.contents(world.hand):
        yield from (f"give me {names[i]}" for i in on_table if unique(i))
    yield from (f"move {names[i]} to the left" for i in on_table if unique(i))
    yield "stop"


def _objects(world: WorldModel) -> list[int]:
    """Return what the verb of a world with one verb alone can be done with."""
    assert world.only is not None
    noun = KNOWN[world.only].noun
    boxes = world.containers if KNOWN[world.only].act in (Act.OPEN, Act.SHUT) else range(len(world.things))
    return [i for i in boxes if not world.things[i].target and noun in ("", world.things[i].kind)]


def abilities(world: WorldModel) -> str:
    """Return what can be done in this world, in a sentence."""
    shown = " or ".join(repr(each) for each in offers(world))
    if world.only is not None:
        things = listed([a_name(world, i) for i in _objects(world)])
        verb = "reach for" if KNOWN[world.only].act is Act.TOUCH else world.only
        return f"In this scene I can {verb} {things}, and do nothing else. Say, for example: {shown}"
    can = ["pick things up", "put them somewhere", "stack them"]
    can += ["open and close " + listed([a_name(world, i) for i in world.containers])] if world.containers else []
    can += ["put things in and take them out"] if world.containers else []
    verbs = ((verb, i) for verb, noun in DEVICE_VERBS.items() for i in world.devices if world.things[i].kind == noun)
    can += [f"{verb} {a_name(world, i)}" for verb, i in verbs]
    can += ["hand you things"] if world.hand is not None else []
    return f"I can reach for things, {listed(can)}. Say, for example: {shown}"


# ---- What questions are about


def phrase(world: WorldModel, planner, tokens: list[Token]) -> tuple[Entity | None, list[Ref]]:
    """Return the longest phrase for things in some words, and its referents."""
    lattice = Lattice(tokens, table=not world.cells)
    chart = Chart(lattice, planner.judge)
    best: tuple[float, Entity | None] = (0.0, None)
    for at in range(len(lattice)):
        for item in chart.entities(at):
            if item.value.kind in ("thing", "stack", "it", "spot") and not item.skipped:
                odd = item.cost - costs.EMPTY if item.cost >= costs.EMPTY else item.cost
                score = (item.end - at) - 0.6 * min(odd, 4.0) - 0.05 * at
                if best[1] is None or score > best[0]:
                    best = score, item.value
    entity = best[1]
    if entity is None:
        return None, []
    resolver = planner.resolver(world, planner.it, None, (), planner.box)
    return entity, resolver.resolve(entity)


def real(world: WorldModel, refs: Sequence[Ref]) -> list[int]:
    """Return the things of referents, without see-through ones if there are others."""
    alone = [ref for ref in refs if ref.kind == "thing"] or refs  # rather than stacks that they are in
    things = list(dict.fromkeys(ref.things[-1] for ref in alone if ref.things and ref.cost < costs.EMPTY))
    return [i for i in things if not world.things[i].target] or things


def state(world: WorldModel, index: int) -> str:
    """Return the state of a container or device, in a sentence."""
    thing = a_name(world, index)
    if index in world.containers:
        inside = world.contents(index)
        full = f", with {listed([a_name(world, i) for i in inside])} in it" if inside and index in world.open else ""
        return f"{thing} is {'open' if index in world.open else 'closed, not open'}{full}"
    if world.things[index].kind == HAND:
        return holds(world)
    if index in world.devices:
        down = is_operated(world, index)
        return f"{thing} is {'down: it has been moved' if down else 'up, at its start: it has not been moved'}"
    return f"{thing} is {where(world, index)}"


def holds(world: WorldModel) -> str:
    """Return what the gripper holds, in a sentence."""
    return "My gripper is empty: I hold nothing" if world.held is None else f"I hold {a_name(world, world.held)}"


def seen(world: WorldModel, on_table: bool = False) -> str:
    """Return everything that there is, in a sentence; on_table: what is held or in something is told apart alone."""
    loose = [i for i in range(len(world.things)) if world.is_loose(i)]
    shown = [i for i in loose if not on_table or not (i in world.inside or i == world.held)]
    marks = [a_name(world, i).replace("the ", "a ", 1) for i, thing in enumerate(world.things) if thing.target]
    fixed = [a_name(world, i) for i in (*world.devices, *world.containers)]
    text = f"I see {listed([*(a_name(world, i) for i in shown), *fixed, *marks])}"
    apart = [
        (f"{a_name(world, i)} is {where(world, i)}")
        for i in loose
        if i in world.inside or i == world.held or world.below[i] is not None
    ]
    return ". ".join([text, *(each[0].upper() + each[1:] for each in apart)])
