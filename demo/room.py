"""A room, where several verbs are possible: which instructions are feasible in it now, and why others are not."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import chain, zip_longest

import numpy as np
from numpy.typing import NDArray

from envs.interactive.interactive_env import InteractiveEnv, object_name
from envs.tasks.anything import Anything
from envs.tasks.shared.feasible import CARRIES, DEVICE_VERBS, THROUGH, Option, Room, options
from envs.tasks.shared.fittings import OPEN, SHUT
from envs.tasks.shared.free_places import BESIDE
from envs.tasks.shared.geometry import length
from envs.tasks.shared.types import NOTHING
from envs.tasks.sort import Spots
from language import HAND, SUPERLATIVES, VERBS, LanguageError, ObjectPhrase, Scene, Split, matches
from language.describing import plain_name
from language.generator import ReferringExpressions
from language.verbs import BASE, GOAL, HANDING, KNOWN, OBJECT, OPERATED, PLACING, Act, has_goal

MOST_SAID = 12  # instructions that are listed
PLACE = {PLACING: "put {object} {goal}"}  # templates in place of the first one, where that is long
YOURS = "your hand"
AT = "at"  # before the object that marks a place


def in_words(verb: str, referent: str, target: str | None = None) -> str:
    """An instruction with these names: "put the red cube in the drawer". No words name the hand of "hand me ..."."""
    target = target if VERBS[verb].takes_goal else None
    fits = (each for each in VERBS[verb].templates if has_goal(each) == (target is not None))
    sentence = PLACE.get(verb, next(fits)).replace(OBJECT, referent)
    return sentence if target is None else sentence.replace(BASE, target).replace(GOAL, f"{AT} {target}")


def names_of(scene: Scene) -> list[str]:
    """The name of each object: "your hand", and "the transparent cube" for the only see-through one."""
    phrases = [plain_phrase(scene, index) for index in range(len(scene))]
    names = [object_name(i, scene) if phrase is None else str(phrase) for i, phrase in enumerate(phrases)]
    names = [YOURS if thing.noun == HAND else name for name, thing in zip(names, scene, strict=True)]
    if scene.targets.sum() == 1:
        target = int(scene.targets.argmax())
        names[target] = f"the transparent {scene[target].noun}"
    return names


def plain_phrase(scene: Scene, index: int) -> ObjectPhrase | None:
    """The simplest phrase that fits this object alone; None if there is none.

    As people do, it calls one of two alike objects the highest or leftmost even where the difference is small.
    """
    with suppress(LanguageError):
        return plain_name(index, ReferringExpressions(scene, Split()))
    thing = scene[index]
    for word in SUPERLATIVES:
        phrase = ObjectPhrase(noun=thing.noun, color=thing.color, superlative=word)
        if np.flatnonzero(matches(phrase, scene)).tolist() == [index]:
            return phrase
    return None


def room_of(env: InteractiveEnv, scene: Scene | None = None) -> Room:
    """The room as it is, or as it would be with this scene."""
    assert isinstance(env.task, Anything)
    return env.task.room(env.scene() if scene is None else scene, env.moved())


def sayable(env: InteractiveEnv, scene: Scene) -> list[str]:
    """The feasible instructions, MOST_SAID sentences at most: first one of each verb, about different objects.

    scene: of the environment, from the viewpoint of who speaks.
    """
    names, held = names_of(scene), NOTHING if env.held is None else env.held
    by_verb: dict[str, list[Option]] = {}
    for option in options(room_of(env, scene), held):
        if all(names[each].startswith(("the ", YOURS)) for each in option[1:] if each is not None):
            by_verb.setdefault(option.verb, []).append(option)
    turned = [each[at % len(each) :] + each[: at % len(each)] for at, each in enumerate(by_verb.values())]
    found = [option for option in chain(*zip_longest(*turned)) if option is not None]
    return [
        in_words(verb, names[referent], None if target is None else names[target])
        for verb, referent, target in found[:MOST_SAID]
    ]


def check(env: InteractiveEnv, option: Option, scene: Scene) -> None:
    """Raises LanguageError, with the reason, unless this can be done in the scene."""
    room, names = room_of(env, scene), names_of(scene)
    held = NOTHING if env.held is None else env.held
    reason = next(_reasons(room, option, held, names), "")
    leaves_here = option.verb == PLACING and held == option.referent
    possible = option.verb in OPERATED or leaves_here or option in options(room, held)  # a fitting may be half open
    if not reason and not possible:
        verb, referent, target = option
        reason = f"'{in_words(verb, names[referent], None if target is None else names[target])}' cannot be done now"
    if reason:
        raise LanguageError(reason)


def narrow(env: InteractiveEnv) -> set[int]:
    """What is open, but not wide enough for something to go in or out."""
    return set(np.flatnonzero(_is_narrow(room_of(env))).tolist())


def _is_narrow(room: Room) -> NDArray[np.bool_]:
    return room.fits & (room.shares >= OPEN) & (room.shares <= THROUGH)


def free_spot(
    env: InteractiveEnv, referent: int, mark: tuple[float, float, float], scene: Scene
) -> tuple[float, float, float]:
    """Where there is room for the object at a marked place, but not where it stands; metres.

    Raises LanguageError if there is none.
    """
    size = env.config.task.object_size
    real = ~scene.targets
    real[referent] = env.held != referent
    objects = np.concatenate((scene.positions, scene.positions[[referent]]))  # `free` lets an object stay where it is
    spots = Spots(env.config.workspace.object_area, size)
    spot = spots.free(objects[None], np.append(real, real[referent])[None], np.array(mark)[None])[0, referent]
    if (length((scene.positions[real] - spot)[:, :2]) < BESIDE * size).any():
        raise LanguageError(f"there is no more room for {names_of(scene)[referent]} at the marked place")
    x, y, z = spot.tolist()
    return x, y, z


def _reasons(room: Room, option: Option, held: int, names: Sequence[str]) -> Iterator[str]:
    """Why this cannot be done, the first reason first."""
    verb, referent, target = option
    name = names[referent]
    if held != NOTHING and room.loose[held]:
        if held != referent:
            yield f"put down {names[held]} first"
        elif verb not in CARRIES:
            yield f"the gripper holds {name} already: say where to put it"
    if verb in OPERATED:
        yield from _of_operating(room, verb, referent, name)
        return
    if verb in DEVICE_VERBS:
        yield from _of_device(room, verb, referent, name)
        return
    if room.scene.targets[referent]:
        yield f"{name} only marks a place: name another object"
    if KNOWN[verb].act is not Act.TOUCH and (room.fits | room.devices)[referent]:
        yield f"{name} stays where it is: name something on the table"
    yield from _of_taking(room, option, names)
    if target is not None:
        yield from _of_target(room, option, held, names)


def _of_operating(room: Room, verb: str, referent: int, name: str) -> Iterator[str]:
    if not room.fits[referent]:
        yield f"'{verb}' needs a drawer or a fridge, which {name} is not"
    elif KNOWN[verb].act is Act.OPEN and room.shares[referent] >= OPEN:
        yield f"{name} is open already"
    elif KNOWN[verb].act is Act.SHUT and room.shares[referent] <= SHUT:
        yield f"{name} is shut already"
    elif room.blocked():
        yield f"{name} cannot move: something lies in its way"


def _of_device(room: Room, verb: str, referent: int, name: str) -> Iterator[str]:
    noun = DEVICE_VERBS[verb]
    if room.scene[referent].noun != noun:
        yield f"'{verb}' needs a {noun}, which {name} is not"
    elif not room.operable(verb)[referent]:
        yield f"{name} is down already" if abs(room.moved[referent]) > 0.5 else f"{name} is at neither of its ends"


def _of_taking(room: Room, option: Option, names: Sequence[str]) -> Iterator[str]:
    verb, referent, target = option
    name, boxes = names[referent], np.flatnonzero(room.inside[referent]).tolist()
    removes = KNOWN[verb].effect == "out"
    if removes and target not in boxes:
        yield f"{name} is not in {names[target or 0]}"
    if not removes and boxes:
        yield f"{name} is in {names[boxes[0]]}: take it out first"
    if room.handed[referent].any():
        yield f"{name} is in your hand"
    if room.covered[referent]:
        upper = int(np.flatnonzero(room.upon[:, referent])[0])
        yield f"{names[upper]} stands on {name}: take that down first"
    if KNOWN[verb].act is Act.UNSTACK and not room.upon[referent].any():
        yield f"{name} stands on no other object"


def _of_target(room: Room, option: Option, held: int, names: Sequence[str]) -> Iterator[str]:
    verb, referent, target = option
    assert target is not None
    there = names[target]
    effect = KNOWN[verb].effect
    if verb == PLACING:
        if not room.scene.targets[target]:
            yield f"{there} marks no place: name the see-through object, or say 'on top of {there}'"
        elif _is_taken(room, option, held):
            yield "something stands there already"
    elif effect == "on":
        if room.upon[referent, target]:
            yield f"{names[referent]} stands on {there} already"
        if not (room.loose & room.ready & room.level)[target]:
            yield f"nothing can be put on {there} now"
    elif verb == HANDING:
        if room.handed[:, target].any():
            inside = int(np.flatnonzero(room.handed[:, target])[0])
            yield f"your hand is full: {names[inside]} is in it"
    elif not room.fits[target]:
        yield f"nothing goes in {there}: name the drawer or the fridge"
    elif _is_narrow(room)[target]:
        yield f"{there} is not open wide enough: close it, then open it again"
    elif room.shares[target] <= THROUGH:
        yield f"{there} is not open: open it first"
    elif effect == "in" and room.inside[:, target].any():
        inside = int(np.flatnonzero(room.inside[:, target])[0])
        yield f"{there} is full: {names[inside]} is in it"


def _is_taken(room: Room, option: Option, held: int) -> bool:
    """Whether an object stands at the target; the referent counts unless it is held."""
    others, (_, referent, target) = room.loose.copy(), option
    others[referent] &= held != referent
    apart = length((room.scene.positions - room.scene.positions[target])[:, :2])
    return bool((others & (apart < BESIDE * room.scene.sizes)).any())
