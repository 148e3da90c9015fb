"""Revised readings: the last reading with the changes of an answer or a correction; and the way back."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

from language.meanings import Clause, Entity, Gesture, Measure, Reading, RelationPhrase
from language.objects import DEVICES
from language.outcomes import Step
from language.spots import BRUSHED, a_name, is_elsewhere, pinned
from language.steps import CARRY
from language.verbs import DEVICE_VERBS, KNOWN, Act, bringing, doing
from language.wishes import ONTO
from language.words import ENCLOSING
from language.world import WorldModel

_ASIDE = re.compile(  # "move to the left"
    r"\W*(?:(?:now|then|please|just) )*(?:go|move|come)(?: a (?:bit|little))?(?: (?:to|towards) (?:the|your|my))? "
    r"(?:left|right|back|forwards?|backwards?|up|down|higher|lower)\b(?: please)?\W*$",
    re.IGNORECASE,
)
_ON_ITSELF = re.compile(r"\b(?:on|onto|on top of|in|into|inside|next to|beside|under|behind) itself\b", re.IGNORECASE)
_GOING = (*ONTO, "near")  # relations to what the gripper goes to
MOVED = 0.06  # of the distance between neighbours: a thing that was to move and moved less is where it was


def tells(phrase: Entity) -> bool:
    """Return whether a phrase for things says which are meant: "one" and "the thing there" do not."""
    related = [each for each in phrase.relations if each.name != "here"]
    said = phrase.colors, phrase.sides, phrase.superlative, phrase.ordinal, phrase.role, phrase.number
    chosen = phrase.any or phrase.every or phrase.other or isinstance(phrase.pointed, Gesture)
    return chosen or phrase.noun not in (None, "thing") or any(each not in (None, ()) for each in (*said, *related))


def is_unshown(entity: Entity | None) -> bool:
    """Return whether a phrase is like "it" or "this one", with nothing shown to which that could refer."""
    if entity is None or entity.kind == "list":
        return entity is not None and any(is_unshown(part) for part in entity.parts)
    if entity.plural or isinstance(entity.pointed, Gesture):
        return False
    return entity.kind == "it" or (entity.kind == "thing" and not tells(entity))


def filled(last: Reading, entity: Entity, slot: str, relation: str = "on") -> Reading:
    """Return the last reading with a thing as its object, or as the anchor of its place. relation: if it had none."""
    clause = last.steps[-1]
    if slot == "object":
        clause = replace(clause, entity=entity)
    elif not clause.places or not clause.places[0].anchors:
        clause = replace(clause, places=(RelationPhrase(relation, (entity,)),))
    else:
        place = clause.places[0]
        if place.name in ("on", "in") and entity.noun is not None:  # "on the red cube", "no, the fridge"
            place = replace(place, name="in" if entity.noun in ENCLOSING else "on")
        place = replace(place, anchors=(entity, *place.anchors[1:]))
        clause = replace(clause, places=(place, *clause.places[1:]))
    return replace(last, steps=(*last.steps[:-1], clause), cost=0.0)


def revised(last: Reading, reply: Reading) -> list[Reading]:
    """Return the readings that a reply may mean, the likeliest first.

    A phrase replaces the object of the last clause that names one; it keeps the noun and colour that it does not say.
    A place replaces the place; "it" and "that" in it mean the former anchor.
    """
    clause = reply.steps[0]
    anchors = [anchor for place in last.steps[-1].places for anchor in place.anchors]
    goes = any(
        len(place.anchors) == 1 and place.anchors[0].kind == "thing" for step in last.steps for place in step.places
    )
    if clause.entity is not None and clause.entity.kind == "list" and len(clause.entity.parts) == 2 and goes:
        return _with_pair(last, *sorted(clause.entity.parts, key=lambda part: part.noun in ENCLOSING))
    rejected = next((each.anchors[0] for each in getattr(clause.entity, "relations", ()) if each.name == "not"), None)
    if clause.entity is not None and rejected is not None and len(anchors) == 1:  # "I meant X, not Y": Y says which
        new = replace(clause.entity, relations=tuple(r for r in clause.entity.relations if r.name != "not"))
        if rejected.colors and rejected.colors == anchors[0].colors:
            return [filled(last, replace(new, noun=new.noun or anchors[0].noun), "goal")]
    if clause.entity is not None:
        phrases = _completed(last.steps, clause.entity)
        objects = [Reading(each) for phrase in phrases if (each := _replaced(last.steps, phrase))]
        bears = clause.entity.kind == "thing" and (clause.entity.noun in ENCLOSING or clause.entity.role)
        stored = last.steps[-1].act is Act.STORE and not anchors and clause.entity.noun in ENCLOSING  # "no, the drawer"
        meant = [filled(last, clause.entity, "goal", "in")] if stored or (anchors and bears) else []
        return [*meant, *objects] if stored or clause.entity.role == "target" else [*objects, *meant]
    old = last.steps[-1]
    places = tuple(_anchored(place, old.places) for place in clause.places)
    verb = CARRY if old.act is None or old.act not in (Act.CARRY, Act.LOWER) else old.verb
    entity = old.entity if old.entity is not None and old.entity.kind != "list" else Entity("it")
    direct = any(place.name in ("direction", "home", "into") for place in places)
    subject = Entity("it") if direct or old.act not in (Act.CARRY, Act.TAKE, Act.HOLD, None) else entity
    placed = [Clause(verb, each, places, span=old.span) for each in dict.fromkeys((subject, entity))]
    return [
        Reading((*last.steps[:-1], each)) if not direct and len(last.steps) > 1 else Reading((each,)) for each in placed
    ]


def _with_pair(last: Reading, one: Entity, other: Entity) -> list[Reading]:
    """Return the last reading with other things as its object and as its place, whatever else is done with these."""
    at = max(i for i, step in enumerate(last.steps) if any(len(place.anchors) == 1 for place in step.places))
    old = last.steps[at].places[0].anchors[0]
    put = filled(Reading((replace(last.steps[at], entity=one),)), other, "goal")
    noun = old.noun if old.noun in ENCLOSING else None
    shown = old.pointed if isinstance(old.pointed, Gesture) else None

    def same(entity: Entity | None) -> bool:
        return entity is not None and (entity.noun == noun if noun else shown is not None and entity.pointed == shown)

    steps = [replace(each, entity=other) if same(each.entity) else each for each in last.steps]
    return [replace(last, steps=(*steps[:at], *put.steps, *steps[at + 1 :]), cost=0.0)]


def _object_clause(steps: tuple[Clause, ...], new: Entity) -> int | None:
    """Return the index of the last clause that names its object; of a loose thing, if the new phrase can be one."""
    named = [at for at, step in enumerate(steps) if step.entity is not None and step.entity.kind != "it"]
    loose = [at for at in named if steps[at].act not in (Act.OPEN, Act.SHUT, Act.OPERATE, Act.EMPTY)]
    if loose and new.noun not in (*ENCLOSING, *DEVICES):  # "put blue in the drawer and close it - no, the red one"
        return loose[-1]
    return named[-1] if named else (len(steps) - 1 if steps else None)


def _replaced(steps: tuple[Clause, ...], entity: Entity) -> tuple[Clause, ...] | None:
    """Return the clauses with another object in the last that names one, and in those before with the same thing."""
    at = _object_clause(steps, entity)
    if at is None:
        return None
    shown = getattr(steps[at].entity, "pointed", None)
    alike = [shown is not None and getattr(step.entity, "pointed", None) == shown for step in steps]
    return tuple(replace(step, entity=entity) if i == at or alike[i] else step for i, step in enumerate(steps))


def _completed(steps: tuple[Clause, ...], new: Entity) -> list[Entity]:
    """Return the new phrase with the words of the old one that it lacks: noun and colour, noun, or nothing."""
    at = _object_clause(steps, new)
    old = None if at is None else steps[at].entity
    if old is None or new.kind != "thing" or old.kind != "thing":
        return [new]
    if new.noun is not None:  # "touch something blue", "the cube"
        vague = old.noun in (None, "thing") and old.colors and not new.colors and not isinstance(old.pointed, Gesture)
        return [replace(new, colors=old.colors), new] if vague else [new]
    noun = replace(new, noun=old.noun)
    if new.colors or new.other:
        return [noun, new]
    said = () if isinstance(old.pointed, Gesture) else (replace(noun, colors=old.colors),)  # not only pinned
    return [*said, noun, new]


def _anchored(place: RelationPhrase, old: tuple[RelationPhrase, ...]) -> RelationPhrase:
    """Return a place whose "it" is the anchor of the former place."""
    anchors = old[0].anchors if old else ()
    if anchors and any(anchor.kind == "it" for anchor in place.anchors):
        return replace(place, anchors=tuple(anchors[0] if a.kind == "it" else a for a in place.anchors))
    return place


def opposite(last: Reading, steps: Sequence[Step], world: WorldModel) -> Reading | None:
    """Return the last reading the other way round: object and base change places, left is right, open is closed."""
    clause = last.steps[-1]
    touched = [step for step in steps if step.act is Act.TOUCH]
    if len(steps) > 1 and len(touched) == len(steps):  # in the other order
        return Reading(tuple(Clause(step.verb, pinned(step.object)) for step in reversed(steps)))
    carried = [step for step in steps if step.carries and not step.implied]
    if clause.act is Act.GATHER and len(carried) > 1:  # a row
        row = Entity("list", parts=tuple(pinned(step.object) for step in reversed(carried)))
        return Reading((Clause(clause.verb, row),))
    pair = {step.object: step.goal for step in carried}
    if len(pair) == len(carried) == 2 and len({*pair.values()}) == 2 and None not in pair.values():
        both = Entity("list", parts=tuple(map(pinned, pair)))
        return Reading((Clause(doing(Act.SWAP), both),))
    if carried and carried[-1].goal is not None and world.is_loose(carried[-1].goal):
        on = RelationPhrase("on", (pinned(carried[-1].object),))
        return Reading((Clause(CARRY, pinned(carried[-1].goal), (on,)),))
    if clause.act is Act.OPERATE:
        return replace(last, cost=0.0)
    if clause.act in (Act.OPEN, Act.SHUT):
        verb = doing(Act.SHUT if clause.act is Act.OPEN else Act.OPEN)
        return Reading((*last.steps[:-1], replace(clause, verb=verb)))
    turned = tuple(
        replace(place, name=TURNED.get(place.name, place.name), value=TURNED.get(place.value or "", place.value))
        for place in clause.places
    )
    same = [place.name for place in turned] == [place.name for place in clause.places]
    if not turned or (same and turned[0].value == clause.places[0].value):
        return None
    return Reading((replace(clause, places=turned),))


def partly_back(last: Reading) -> Reading | None:
    """Return the reading that takes a bit of the last move back; None if that was no move to a side."""
    clause = last.steps[-1]
    sides = [TURNED.get(place.value or "") for place in clause.places if place.name == "direction"]
    places = tuple(RelationPhrase("direction", measure=Measure(1.0, "bit"), value=side) for side in sides if side)
    return Reading((Clause(CARRY, Entity("it"), places),)) if places else None


def further(last: Reading) -> Reading:
    """Return the last reading once more: what went to one side of something goes further to that side."""
    clause = last.steps[-1]
    side = {"left": "left", "right": "right", "front": "backward", "behind": "forward"}
    if clause.act is not Act.CARRY or len(clause.places) != 1 or clause.places[0].name not in side:
        return last
    shift = RelationPhrase("direction", value=side[clause.places[0].name])
    return Reading((replace(clause, entity=Entity("it"), places=(shift,)),))


_PAIRS = (("left", "right"), ("front", "behind"), ("forward", "backward"), ("up", "down"), ("on", "under"))
TURNED = {one: other for pair in _PAIRS for one, other in (pair, pair[::-1])}


def selecting(places: tuple[RelationPhrase, ...]) -> Entity | None:
    """Return an answer such as "left" or "next to the ball" as a phrase for a thing."""
    if len(places) != 1:
        return None
    if places[0].name == "direction" and places[0].value:
        return Entity(sides=(places[0].value,))
    anchor = next(iter(places[0].anchors), None)
    if anchor is not None and anchor.kind == "thing" and places[0].name in ("on", "in", "to", "at", "near"):
        return anchor
    return Entity(relations=places)


def region_meant(said: Entity | None, last: Reading | None) -> Entity | None:
    """Return what an answer names: after "put it in the corner", "the far left one" is a corner, too."""
    place = next(iter(last.steps[-1].places), None) if last is not None and last.steps else None
    anchor = next(iter(place.anchors), None) if place is not None else None
    if said is None or anchor is None or anchor.kind not in ("corner", "side", "edge"):
        return said
    anchors = [each for relation in said.relations for each in relation.anchors]
    named = said.kind != "thing" or said.noun or said.colors or said.size or said.plural
    if named or any(each.kind not in ("side", "corner") for each in anchors):
        return said
    sides = (*said.sides, *(side for each in anchors for side in each.sides))  # "the one at the back on the left"
    return replace(anchor, sides=sides, span=said.span) if sides else said


def restoring(
    now: WorldModel, then: WorldModel, moved: Sequence[int] = (), only: Sequence[int] = ()
) -> tuple[Step, ...]:
    """Return the steps that bring everything back to where and how it was.

    Args:
        now: the world as it is.
        then: as it was.
        moved: what was to be moved since.
        only: things that alone go back; (): all, also doors and devices.
    """
    loose = [i for i in range(len(then.things)) if then.is_loose(i) and i != then.held]  # see-through ones mark places
    left = [i for i in loose if i == now.held or is_elsewhere(now, then, i, MOVED if i in moved else BRUSHED)]
    if only:
        left = [i for i in left if i in only or i == now.held] if {*left} & {*only} else []
    left.sort(key=lambda i: (i != now.held, then.things[i].bottom))
    used = {world.inside.get(i) for world in (now, then) for i in left}
    opened = [box for box in now.containers if box not in now.open and (box in then.open or box in used)]
    steps = [Step(doing(Act.OPEN), box) for box in opened]
    world: WorldModel = now
    aside: set[int] = set()
    while left:
        index = next((i for i in left if _may_go_back(world, then, i, left)), None)
        spot = None
        if index is None:  # things that change places: one of them goes aside first
            index = next((i for i in left if world.above[i] is None and i not in aside), left[0])
            spot = None if index in aside else _spot_aside(world, then, index)
            aside |= {index}
        if spot is None:
            left.remove(index)
        for step in _steps_back(world, then, index, spot):
            steps.append(step)
            world = world.after(step)
    if only:
        return (*steps, *(Step(doing(Act.SHUT), box) for box in opened))
    for device in then.devices:
        verb = next(verb for verb, noun in DEVICE_VERBS.items() if noun == then.things[device].kind)
        stays = KNOWN[verb].noun == next(iter(DEVICE_VERBS.values()))  # a button stays down
        if abs(now.moved.get(device, 0.0) - then.moved.get(device, 0.0)) > 0.5 and not stays:
            steps.append(Step(verb, device))
    if then.held is not None and now.held != then.held:
        steps.append(Step(bringing("up"), then.held))
    shut = [box for box in now.containers if box not in then.open and (box in now.open or box in opened)]
    return (*steps, *(Step(doing(Act.SHUT), box) for box in shut))


def without_detours(steps: tuple[Step, ...]) -> tuple[Step, ...]:
    """Return steps without closing what is opened again before anything else is done with it."""
    for at, step in enumerate(steps):
        after = next((i for i in range(at + 1, len(steps)) if step.object in (steps[i].object, steps[i].goal)), None)
        if step.act is Act.SHUT and after is not None and steps[after].act is Act.OPEN:
            return without_detours((*steps[:at], *steps[at + 1 : after], *steps[after + 1 :]))
    return steps


def _may_go_back(world: WorldModel, then: WorldModel, index: int, left: Sequence[int]) -> bool:
    """Return whether nothing stands on a thing, or where it was. left: what is not back yet."""
    old, box = then.things[index], then.inside.get(index)
    if world.above[index] is not None or then.below[index] in left:
        return False
    if box is not None:
        return not world.contents(box)
    others = (j for j in range(len(world.things)) if j != index and world.is_loose(j) and j not in world.inside)
    beside = ((world.things[j], max(abs(world.things[j].x - old.x), abs(world.things[j].y - old.y))) for j in others)
    return all(away > 0.8 * old.width or thing.bottom < old.bottom for thing, away in beside)


def _spot_aside(world: WorldModel, then: WorldModel, index: int) -> tuple[float, float] | None:
    """Return a place near which nothing stands, or stood then; None if there is none."""
    x0, x1, y0, y1 = world.bounds
    spots = [(x0 + (x1 - x0) * i / 7, y0 + (y1 - y0) * j / 7) for i in range(8) for j in range(8)]
    taken = [each.things[j] for each in (world, then) for j in range(len(each.things)) if each.is_loose(j)]
    room = 1.5 * world.things[index].width
    free = (at for at in spots if all(max(abs(t.x - at[0]), abs(t.y - at[1])) > room for t in taken))
    return next(free, None)


def _steps_back(world: WorldModel, then: WorldModel, index: int, spot: tuple[float, float] | None) -> Iterator[Step]:
    """Yield the steps that take a thing and put it where it was then. spot: put it there, on the ground, instead."""
    box, old = world.inside.get(index), then.things[index]
    if index != world.held:
        boxed = box is not None and box in world.containers
        yield Step(bringing("out"), index, box) if boxed else Step(bringing("up"), index)
    if spot is not None:
        yield Step(bringing("goal"), index, None, spot, world.ground)
        return
    goal = then.inside.get(index, then.below[index])
    effect = "goal" if goal is None else "in" if goal in then.containers else "hand" if goal == then.hand else "on"
    yield Step(bringing(effect), index, goal, (old.x, old.y), old.bottom)


def only_verb(clause: Clause, verb: str) -> Clause:
    """Return a clause where one verb alone is possible: what is only named, and where to go, are its object."""
    entity, robot = clause.entity, clause.entity is not None and clause.entity.kind == "robot"
    shown = entity is not None and entity.pointed is not None
    if clause.act not in (None, Act.CARRY) or (clause.act is Act.CARRY and not (entity is None or robot or shown)):
        return clause
    if (entity is None or robot) and clause.places and all(_is_there(place) for place in clause.places):
        return replace(clause, verb=verb, entity=Entity("it", span=clause.span), places=())
    at = [place for place in clause.places if place.name in _GOING and place.anchors]
    if at:  # "go there", "on the red one"
        return replace(clause, verb=verb, entity=at[-1].anchors[-1], places=())
    if entity is not None and not robot and all(place.name in ("here", "order") for place in clause.places):
        return replace(clause, verb=verb, places=tuple(place for place in clause.places if place.name == "order"))
    beside = [place for place in clause.places if place.anchors] if entity is None else []
    return replace(clause, verb=verb, entity=Entity(relations=tuple(beside)), places=()) if beside else clause


def _is_there(place: RelationPhrase) -> bool:
    return place.name == "here" and place.value == "there" and not place.anchors


def no_direction(world: WorldModel) -> str:
    """Return why the arm goes in no direction where it only does one verb to things."""
    names = [a_name(world, i) for i, thing in enumerate(world.things) if not thing.target]
    return f"in this scene I only {world.only} things, and go in no direction: name {', '.join(names)}"


def aside(world: WorldModel, text: str) -> str:
    """Return why a sentence asks for what cannot be: an arm that goes to a side, a thing put on itself; or ""."""
    if not world.cells and _ON_ITSELF.search(text):
        return "nothing goes on, in or next to itself"
    return no_direction(world) if world.only and _ASIDE.match(text) else ""


def unfit(world: WorldModel, clause: Clause) -> str:
    """Return why a clause cannot be carried out where one verb alone is possible, or ""."""
    if world.only is None or clause.act in (KNOWN[world.only].act, Act.NEVER, Act.TIDY):
        return ""
    if clause.verb is None or (all(each.name in ("direction", "home") for each in clause.places) and clause.places):
        return no_direction(world)
    doing = f"in this scene I only {world.only}, and do not {clause.verb}".replace("_", " ")
    return f"{doing}; choose another scene, such as 'anything', for that"
