"""Instruction sets: sentences with what a person would expect to happen, and how many expectations are met.

    python -m benchmarks.instructions --data FILE|FOLDER [--errors] [--json] [--by kind] [--every N]

A set is a JSONL file beside its scene: a room with named states, or a board or table as `python -m language` reads it.
Each sentence is given to `language.Dialogue.answer`, as the page does; the earlier turns of a conversation are said
before, and what is given to have come of them counts.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter, defaultdict
from functools import cache, reduce
from pathlib import Path
from typing import Any

from benchmarks.instruction_scoring import CLASSES, judge, verb_of
from core.errors import ConfigError, did_you_mean
from core.program import program
from core.safe_files import FileError, read_yaml
from language import Answer, Dialogue, Object, Outcome, Plan, Question, Refusal, Scene, Signal, Step, WorldModel, table
from language.scene_file import read_world
from language.verbs import KNOWN, ROOM, VERBS, bringing

STEPS = {"take": bringing("up"), "place": bringing("goal"), "rotate": next(v for v in VERBS if "rotate" in v)}
NEEDED = ("id", "say", "expect")  # keys of a sentence
MAX_BYTES, MAX_NODES = 256 * 1024, 50_000


def room_world(scene: dict[str, Any], facts: dict[str, Any]) -> WorldModel:
    """Returns the world of a room with these facts; its things are the objects of the scene, in their order."""
    entries, at = scene["objects"], facts.get("positions") or {}
    ids = [each["id"] for each in entries]
    number = ids.index
    objects = [
        Object(e["noun"], e["color"], tuple(at.get(e["id"], e["position"])), e.get("size", 0.05), e.get("role", "real"))
        for e in entries
    ]
    hand = next((i for i, each in enumerate(entries) if each["noun"] == "palm"), None)
    inside = {number(thing): number(box) for thing, box in (facts.get("inside") or {}).items()}
    if facts.get("in_hand") is not None and hand is not None:
        inside[number(facts["in_hand"])] = hand
    moved = dict(scene.get("devices") or {}) | dict(facts.get("devices") or {})
    held = facts.get("held")
    return table(
        Scene(objects, scene.get("viewpoint", "robot")),
        None if held is None else number(held),
        bounds=tuple(scene["area"]),
        inside=inside,
        open=frozenset(number(box) for box in facts.get("open") or ()),
        moved={number(device): float(share) for device, share in moved.items()},
        home={i: tuple(each["position"][:2]) for i, each in enumerate(entries)},
        flat_only=not scene.get("high"),
        verbs=tuple(scene.get("verbs", ROOM)),
    )


class SetRunner:
    """Says the sentences of sets in their scenes."""

    def answer(self, item: dict[str, Any], folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
        """Returns an answer in the sets' format, and the scene."""
        scene = read_scene(folder / item.get("scene", "room.yaml"))
        ids = [each["id"] for each in scene["objects"]] if "objects" in scene else list(scene["ids"])
        dialogue = Dialogue()
        earlier = item.get("dialogue") or []
        world = (
            self._world(scene, self._state(scene, item))
            if not earlier
            else self._world(scene, scene["states"][item["state"]] or {})
            if "states" in scene
            else scene["world"]
        )
        for turn in earlier:
            world = self._said(dialogue, turn, world, ids)
        if "facts" in item and "objects" in scene:
            world = self._world(scene, item["facts"])
        outcome = dialogue.answer(item["say"], world)
        return as_answer(item["id"], outcome, ids), scene

    def _state(self, scene: dict[str, Any], item: dict[str, Any]) -> dict[str, Any]:
        facts = item.get("facts")
        return facts if facts is not None else scene.get("states", {}).get(item.get("state")) or {}

    def _world(self, scene: dict[str, Any], facts: dict[str, Any]) -> WorldModel:
        return room_world(scene, facts) if "objects" in scene else scene["world"]

    def _said(self, dialogue: Dialogue, turn: dict[str, Any], world: WorldModel, ids: list[str]) -> WorldModel:
        """Says an earlier turn, and lets that come of it which is given. Returns the world after it."""
        outcome = dialogue.answer(turn["say"], world)
        if "plan" in turn:
            steps = given_steps(turn["plan"], world, ids)
            after = reduce(WorldModel.after, steps, world)
            same = isinstance(outcome, Plan) and _objects(outcome.steps) == _objects(steps)
            reading = outcome.reading if same and isinstance(outcome, Plan) else reading_of(steps)
            dialogue.amend(Plan(turn["say"], 1.0, steps=steps, result=after, reading=reading), world)
            return after
        if "asked" in turn:
            candidates = tuple(ids.index(name) for name in turn["asked"] if name in ids)
            reading = getattr(outcome, "reading", None)
            choices = outcome.choices if isinstance(outcome, Question) else ()
            dialogue.amend(
                Question(turn["say"], 0.5, text="Which?", candidates=candidates, choices=choices, reading=reading),
                world,
            )
        elif "control" in turn:
            dialogue.amend(Signal(turn["say"], 1.0, control=turn["control"]), world)
        elif turn.get("answered") and not isinstance(outcome, Answer):
            dialogue.amend(Answer(turn["say"], 1.0, text="Yes"), world)
        elif turn.get("refused") and not isinstance(outcome, Refusal):
            dialogue.amend(Refusal(turn["say"], text="I cannot"), world)
            dialogue.last = getattr(outcome, "reading", None) or dialogue.last
        return world


def _objects(steps: tuple[Step, ...]) -> list[int]:
    """Returns the objects that steps move, open or operate, in order, each once in a row."""
    found = [step.object for step in steps if not step.implied]
    return [each for at, each in enumerate(found) if at == 0 or found[at - 1] != each]


def given_steps(plan: list[dict[str, Any]], world: WorldModel, ids: list[str]) -> tuple[Step, ...]:
    """Returns the steps of a plan that a set gives."""
    steps = []
    for each in plan:
        verb, index = verb_of(each), ids.index(each["object"] if isinstance(each["object"], str) else each["object"][0])
        goal = each.get("goal")
        target = ids.index(goal) if isinstance(goal, str) else None
        place = tuple(each["place"][:2]) if each.get("place") else None
        bottom = each["place"][2] - world.things[index].width / 2 if each.get("place") else 0.0
        verb = STEPS.get(verb, verb)
        carries = KNOWN[verb].effect in ("goal", "on", "in", "hand")
        if carries and place is None:
            hand = world.hand if KNOWN[verb].effect == "hand" else None
            onto = target if target is not None else hand
            thing = world.things[onto] if onto is not None else world.things[index]
            place, bottom = (thing.x, thing.y), thing.top if KNOWN[verb].effect == "on" else thing.bottom
            target = onto
        if target is not None and world.things[target].target:
            target = None
        steps.append(Step(verb, index, target, place if carries else None, bottom if carries else None))
    return tuple(steps)


def reading_of(steps: tuple[Step, ...]) -> Any:
    """Returns a reading that has these steps."""
    from language.meanings import Clause, Entity, Gesture, Reading, RelationPhrase

    clauses = []
    for step in steps:
        goal = () if step.goal is None else (Entity(pointed=Gesture((step.goal,))),)
        places = (RelationPhrase("on", goal),) if goal and step.carries and KNOWN[step.verb].effect != "hand" else ()
        if step.carries and not goal and step.place is not None:
            places = (RelationPhrase("here", (Entity("spot", pointed=Gesture((), step.place)),)),)
        clauses.append(Clause(step.verb, Entity(pointed=Gesture((step.object,))), places))
    return Reading(tuple(clauses))


@cache
def read_scene(path: Path) -> dict[str, Any]:
    """Returns a scene file: a room with its states, or a board or table with its world and the ids of its things."""
    loaded = read_yaml(path, MAX_BYTES, MAX_NODES)
    if isinstance(loaded, dict) and "objects" in loaded:
        return loaded
    world, ids = read_world(path)
    return {"world": world, "ids": ids, "states": {}}


def as_answer(name: str, outcome: Outcome, ids: list[str]) -> dict[str, Any]:
    """Returns an outcome as a line of answers."""
    answer: dict[str, Any] = {"id": name, "steps": [], "candidates": [], "text": "", "control": None}
    if isinstance(outcome, Plan):
        return answer | {"outcome": "plan", "steps": _steps(outcome.steps, ids), "text": "; ".join(outcome.notes)}
    if isinstance(outcome, Question):
        return answer | {
            "outcome": "question",
            "candidates": [ids[i] for i in outcome.candidates],
            "text": outcome.text,
        }
    if isinstance(outcome, Signal):
        return answer | {
            "outcome": "control",
            "control": outcome.control,
            "steps": _steps(outcome.steps, ids),
            "text": outcome.text,
        }
    text = outcome.message if isinstance(outcome, Refusal) else getattr(outcome, "text", "")
    return answer | {"outcome": "refusal" if isinstance(outcome, Refusal) else "answer", "text": text}


def _steps(steps: tuple[Step, ...], ids: list[str]) -> list[dict[str, Any]]:
    return [
        {
            "verb": step.verb,
            "object": ids[step.object],
            "goal": None if step.goal is None else ids[step.goal],
            "place": None if step.place is None else [*step.place, (step.bottom or 0.0) + 0.025],
        }
        for step in steps
    ]


def sets_of(path: Path, ending: str = ".jsonl") -> list[Path]:
    """Returns the sets of a file or folder."""
    return [path] if path.is_file() else sorted(path.glob(f"*{ending}"))


def read_set(path: Path) -> list[dict[str, Any]]:
    """Returns the sentences of a set. Raises ConfigError, which names a line that cannot be said in its scene."""
    items = []
    for number, line in enumerate(path.read_text("utf-8").splitlines(), 1):
        where = f"{path}, line {number}"
        if not line.strip():
            continue
        try:
            item = json.loads(line)
        except ValueError as error:
            raise ConfigError(f"{where} is not JSON: {error}") from None
        if missing := [key for key in NEEDED if not isinstance(item, dict) or key not in item]:
            raise ConfigError(f"{where} lacks {', '.join(missing)}")
        scene = path.parent / item.get("scene", "room.yaml")
        try:
            states = read_scene(scene).get("states") or {}
        except FileError as error:
            raise ConfigError(f"{where}: its scene {scene} {error}") from None
        if states and item.get("state", next(iter(states))) not in states:
            raise ConfigError(f"{where}: state={item['state']} is not in {scene}" + did_you_mean(item["state"], states))
        items.append(item)
    return items


def main() -> None:
    """Prints how many expectations each group meets, and how its outcomes are judged. Raises ConfigError."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--data", type=Path, required=True, help="a set, or a folder of sets, beside its scene")
    parser.add_argument("--errors", action="store_true", help="list the sentences that meet no expectation")
    parser.add_argument("--by", default="source", help="field of the sentences by which they are counted (source)")
    parser.add_argument("--json", action="store_true", help="print the counts as JSON on the last line")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="say only each N-th sentence of a set (1)")
    parser.add_argument("--answers", type=Path, metavar="FILE.jsonl", help="file that receives the answers")
    args = parser.parse_args()
    if args.every < 1:
        raise ConfigError(f"--every {args.every}: must be at least 1")
    files = sets_of(args.data)
    if not files:
        raise ConfigError(f"--data {args.data}: no such file, and no folder with *.jsonl")
    items = [(item, path.parent) for path in files for item in read_set(path)[:: args.every]]
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    runner, answers = SetRunner(), []
    for item, folder in items:
        try:
            answer, scene = runner.answer(item, folder)
        except Exception as error:  # a defect in one sentence must not hide the result of the others
            answer = {"id": item["id"], "outcome": "exception", "text": repr(error)}
            scene = read_scene(folder / item.get("scene", "room.yaml"))
        answers.append(answer)
        failed = answer["outcome"] == "exception"
        kind, met, note = ("wrong", False, answer["text"]) if failed else judge(item, answer, scene)
        for key in (str(item.get(args.by)), "total"):
            counts[key].update({"n": 1, "met": int(met), kind: 1})
        if args.errors and not met:
            print(f"{item['id']} [{kind}] {item['say']!r} expected {json.dumps(item['expect'])} got: {note}")
    if args.answers:
        args.answers.write_text("".join(json.dumps(answer) + "\n" for answer in answers))
    _print(counts, args.by, args.json)


def _print(counts: dict[str, Counter[str]], by: str, as_json: bool) -> None:
    total = counts.pop("total", Counter())
    print(f"{by:24}{'n':>5}{'met':>11}" + "".join(f"{name:>21}" for name in CLASSES))
    for key, each in [*counts.items(), ("total", total)]:
        n = each["n"] or 1
        shares = "".join(f"{each[name]:14} {each[name] / n:6.1%}" for name in CLASSES)
        print(f"{key:24}{each['n']:5}{each['met']:5} {each['met'] / n:5.1%}{shares}")
    if as_json:
        print(json.dumps({"total": _json(total), by: {key: _json(each) for key, each in counts.items()}}))


def _json(each: Counter[str]) -> dict[str, int]:
    return {"n": each["n"], "met": each["met"], **{name: each[name] for name in CLASSES}}


if __name__ == "__main__":
    with program(2):
        main()
