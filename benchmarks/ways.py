"""Ways of saying one thing: whether other wordings do the same as the plain sentence.

    python -m benchmarks.ways [--data FILE|FOLDER] [--errors] [--json]

A file holds groups, divided by empty lines. The scene is the room of `benchmarks/sets/room.yaml`:

    #A                                      name of the state of the room
    > touch the red cube                    earlier turns of the conversation, if any
    = put the red cube in the drawer        the plain sentence
    the red block goes in the drawer        other ways of saying it, one a line
    stick that red box into the drawer

Several plain sentences (`=`) are alternatives: "pick up any cube but the red one" may take each of the others. A way
counts as the same if it gives the same steps with places within 4 cm, a question about the same things, the same
answer, the same control, or a refusal as the plain sentence does.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.instruction_scoring import merged, shown, verb_of
from benchmarks.instructions import as_answer, read_scene, room_world, sets_of
from language import Dialogue, Outcome, Plan

FOLDER = Path(__file__).parent
ROOM = FOLDER / "sets" / "room.yaml"
NEAR = 0.04  # metres between two places that count as the same
COLUMNS = ("same", "other plan", "question", "refusal", "answer", "control")


@dataclass(frozen=True)
class Group:
    """Ways of saying one thing.

    state: name of the state of the room. earlier: the turns before. plain: the plain sentences. ways: the others.
    """

    state: str
    earlier: tuple[str, ...]
    plain: tuple[str, ...]
    ways: tuple[str, ...]


def read_groups(text: str) -> Iterator[Group]:
    """Yields the groups of a file. Raises ValueError if a group has no state or no plain sentence."""
    for block in text.split("\n\n"):
        lines = [line.strip() for line in block.splitlines() if line.strip()]
        if not lines:
            continue
        marked = {mark: tuple(line[1:].strip() for line in lines if line.startswith(mark)) for mark in "#>="}
        if len(marked["#"]) != 1 or not marked["="]:
            raise ValueError(f"a group needs one line '#STATE' and a line '= plain sentence', but begins {lines[0]!r}")
        ways = tuple(line for line in lines if line[0] not in "#>=")
        yield Group(marked["#"][0], marked[">"], marked["="], ways)


def said(scene: dict[str, Any], group: Group, sentence: str) -> dict[str, Any]:
    """Returns what comes of a sentence after the earlier turns of its group, as an answer in the sets' format."""
    dialogue, world = Dialogue(), room_world(scene, scene["states"][group.state] or {})
    outcome: Outcome | None = None
    for turn in (*group.earlier, sentence):
        world = outcome.result if isinstance(outcome, Plan) and outcome.result is not None else world
        outcome = dialogue.answer(turn, world)
    assert outcome is not None
    return as_answer("", outcome, [each["id"] for each in scene["objects"]])


def same(first: dict[str, Any], second: dict[str, Any]) -> bool:
    """Returns whether two answers come to the same."""
    if first["outcome"] != second["outcome"]:
        return False
    if first["outcome"] == "question":
        return set(first["candidates"]) == set(second["candidates"])
    if first["outcome"] == "answer":
        return bool(first["text"] == second["text"])
    steps, others = merged(first["steps"]), merged(second["steps"])
    alike = len(steps) == len(others) and all(map(_same_step, steps, others))
    return alike and bool(first["control"] == second["control"])


def _same_step(first: dict[str, Any], second: dict[str, Any]) -> bool:
    if (verb_of(first), first["object"]) != (verb_of(second), second["object"]):
        return False
    if first["place"] is None or second["place"] is None:
        return bool(first["place"] == second["place"])
    return all(abs(a - b) <= NEAR for a, b in zip(first["place"], second["place"], strict=True))


def main() -> int:
    """Prints how many ways do the same as their plain sentence."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--data", type=Path, default=FOLDER / "ways", help="a file of groups, or a folder of *.txt")
    parser.add_argument("--errors", action="store_true", help="list the ways that do something else")
    parser.add_argument("--json", action="store_true", help="print the counts as JSON on the last line")
    args = parser.parse_args()
    files = sets_of(args.data, ".txt")
    if not files:
        print(f"error: --data {args.data}: no such file, and no folder with *.txt", file=sys.stderr)
        return 2
    scene, counts = read_scene(ROOM), {}
    for path in files:
        try:
            groups = list(read_groups(path.read_text("utf-8")))
        except ValueError as error:
            print(f"error: --data {path}: {error}", file=sys.stderr)
            return 2
        counts[path.stem] = sum((_count(scene, group, args.errors) for group in groups), Counter[str]())
    counts["total"] = sum(counts.values(), Counter[str]())
    print(f"{'file':16}{'ways':>6}" + "".join(f"{name:>12}" for name in COLUMNS))
    for name, each in counts.items():
        print(f"{name:16}{each.total():6}" + "".join(f"{each[column]:12}" for column in COLUMNS))
    if args.json:
        print(json.dumps({name: {"ways": each.total(), **each} for name, each in counts.items()}))
    return 0


def _count(scene: dict[str, Any], group: Group, errors: bool) -> Counter[str]:
    """Returns how many ways of a group do the same, and what comes of the others."""
    plain = [said(scene, group, sentence) for sentence in group.plain]
    counts: Counter[str] = Counter()
    for way in group.ways:
        answer = said(scene, group, way)
        met = any(same(answer, each) for each in plain)
        counts["same" if met else {"plan": "other plan"}.get(answer["outcome"], answer["outcome"])] += 1
        if errors and not met:
            got = shown(answer["steps"]) or answer["control"] or answer["text"]
            print(f"#{group.state} = {group.plain[0]!r} [{answer['outcome']}] {way!r} got: {got}")
    return counts


if __name__ == "__main__":
    sys.exit(main())
