"""The sentences of tests/language/commands/people.txt: their scenes, and whether an outcome is the expected one."""

from __future__ import annotations

from pathlib import Path

import yaml

from language import Answer, Dialogue, Object, Outcome, Plan, Question, Refusal, Scene, Signal, WorldModel, board

FOLDER = Path(__file__).parent.parent / "language" / "commands"
SCENES = yaml.safe_load((FOLDER / "people_scenes.yaml").read_text())
LINES = [line for line in (FOLDER / "people.txt").read_text().splitlines() if not line.startswith("#")]
CASES = [tuple(part.strip() for part in line.split(" | ")) for line in LINES]
SIDES = {"left": (0, 1), "right": (0, -1), "front": (-1, 0), "behind": (1, 0), "back": (1, 0)}


def scene_of(name):
    """The scene, and the ids of its objects in order."""
    entries = dict(SCENES[name])
    if entries.pop("board", False):
        held = entries.pop("holding", None)
        ids = list(entries)
        # A column is counted from the left, a row from the front: y points left, x away.
        blocks = [(kind, color, row, 7 - column, z) for kind, color, column, row, z in entries.values()]
        return board(blocks, None if held is None else ids.index(held)), ids
    things = [Object(noun, color, (x, y, 0.05 * sum(z))) for noun, color, x, y, *z in entries.values()]
    return Scene(things), list(entries)


def judged(name, sentences, expected):
    """The result, "right", "wrong" (something else is done), "unhelpful" (no hint) or "other"; and the last outcome."""
    scene, ids = scene_of(name)
    dialogue, outcome = Dialogue(), None
    for number, sentence in enumerate(sentences.split(" / ")):
        outcome = dialogue.answer(sentence, None if number else scene)
    start = Dialogue()
    start.answer("stop", scene)
    fits = any(
        all(_fits(outcome, part.split(), ids, start.world) for part in choice.split(" and "))
        and _others_stay(outcome, choice, ids, start.world)
        for choice in expected.split(" or ")
    )
    if fits:
        return "right", outcome
    if isinstance(outcome, Plan | Signal):
        return "wrong", outcome
    helpful = bool(outcome.text) and bool(getattr(outcome, "suggestions", True))
    return "other" if helpful else "unhelpful", outcome


def _fits(outcome: Outcome, words: list[str], ids: list[str], start: WorldModel) -> bool:
    if words[0] == "refuse":
        return isinstance(outcome, Refusal | Answer)
    if words[0] == "ask":
        wanted = {ids.index(name) for name in words[1:]}
        return isinstance(outcome, Question) and (not wanted or wanted == set(outcome.candidates))
    if isinstance(outcome, Signal) and not outcome.steps:
        return words == [outcome.control]
    if words == ["nothing"]:
        return isinstance(outcome, Answer)
    if not isinstance(outcome, Plan | Signal):
        return False
    kinds = [step.verb for step in outcome.steps]
    if words[0] in ("hold", "reach", "press", "switch", "turn"):
        index = ids.index(words[1])
        if words[0] == "hold":
            return outcome.result.held == index
        return kinds == [words[0]] and outcome.steps[0].object == index
    return outcome.result.held != ids.index(words[0]) and _stands(outcome.result, start, words, ids)


def _stands(world: WorldModel, start: WorldModel, words: list[str], ids: list[str]) -> bool:
    thing, was = world.things[ids.index(words[0])], start.things[ids.index(words[0])]
    others = [world.things[ids.index(word)] for word in words[2:] if word in ids]
    unit, word = world.pitch, words[1]
    if word == "on":
        index = world.below[ids.index(words[0])]
        return index is not None and ids[index] == words[2]
    if word == "at":
        x, y = map(float, words[2:])
        x, y = (y, 7 - x) if world.cells else (x, y)
        return abs(thing.x - x) < 0.01 and abs(thing.y - y) < 0.01
    if word == "moved":
        dx, dy = SIDES[words[2]]
        along = dx * (thing.x - was.x) + dy * (thing.y - was.y)
        return 0 < along < 3 * unit and abs(along - abs(thing.x - was.x) - abs(thing.y - was.y)) < 1e-6
    if word in ("corner", "edge"):
        return all(_at_side(world, thing, side) for side in words[2:])
    if word == "middle":
        return max(abs(thing.x - world.center[0]), abs(thing.y - world.center[1])) < 0.6 * unit
    if world.below[ids.index(words[0])] is not None:
        return False
    if word == "table":
        return True
    if word == "between":
        middle = [(others[0].x + others[1].x) / 2, (others[0].y + others[1].y) / 2]
        return max(abs(thing.x - middle[0]), abs(thing.y - middle[1])) < 0.6 * unit
    away = (thing.x - others[0].x, thing.y - others[0].y)
    if word == "near":
        return 0.5 * unit < max(map(abs, away)) < 2.5 * unit
    dx, dy = SIDES[word]
    return dx * away[0] + dy * away[1] > max(abs(dy * away[0] + dx * away[1]), 0.5 * unit)


def _at_side(world: WorldModel, thing, side: str) -> bool:
    x0, x1, y0, y1 = world.bounds
    edge = {"left": (thing.y, y1), "right": (thing.y, y0), "front": (thing.x, x0), "back": (thing.x, x1)}[side]
    return abs(edge[0] - edge[1]) < 0.6 * world.pitch


def _others_stay(outcome: Outcome, expected: str, ids: list[str], start: WorldModel) -> bool:
    """Whether everything that the expectation does not name is where it was."""
    if not isinstance(outcome, Plan) or len(expected.split()) == 1:
        return True
    named = expected.split()
    same = zip(ids, start.things, outcome.result.things, strict=True)
    return all(name in named or (a.x, a.y, a.bottom) == (b.x, b.y, b.bottom) for name, a, b in same)
