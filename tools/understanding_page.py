"""The page "What it understands": `python -m tools.understanding_page` writes docs/understanding.md.

Words come from the table of verbs and from `language/words.yaml`; figures from docs/treebank.json and
docs/instructions.json.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from language import words
from language.verbs import KNOWN

DOCS = Path(__file__).parent.parent / "docs"
PAGE, FIGURES, SETS = DOCS / "understanding.md", DOCS / "treebank.json", DOCS / "instructions.json"
NOTE = "<!-- Written by `python -m tools.understanding_page`; do not edit. -->"
SHOWN = 6  # phrases of a meaning
MANY, WEAK = 10, 0.75  # a kind of sentences is named with at least MANY of them, and below this share as expected
TITLES = {
    "relations": "Relations and places",
    "directions": "Directions",
    "superlatives": "Superlatives",
    "roles": "Solid and see-through things",
    "regions": "Regions and participants",
    "units": "Lengths (in cells or in metres)",
    "orders": "Orders of several things",
    "controls": "Sentences about the motion",
}
INTRODUCTION = """\
# What it understands

Everything that a person types goes one way, on a table, on a board and in a room:

```
text -> plain words -> readings -> things and places of one world -> plan, question, answer, refusal or signal
```

A sentence of the [instruction language](language.md) is read first. Other sentences are read by a chart that keeps
every reading; the cheapest plan that can be carried out is chosen. Trained policies never read these sentences: each
step of a plan is said to them in the instruction language.

```python
from language import Dialogue, Object, Plan, Scene

scene = Scene([Object("cube", "red", (0.5, 0.15, 0.025)), Object("cube", "blue", (0.6, 0.0, 0.025))])
dialogue = Dialogue()
outcome = dialogue.answer("pls put teh red cube ontop of the blue one", scene)
assert isinstance(outcome, Plan)
assert [(step.verb, step.object, step.goal) for step in outcome.steps] == [("lift", 0, None), ("stack", 0, 1)]
assert dialogue.answer("where is the red cube?").text == "The red cube is on top of the blue cube."
assert dialogue.answer("undo").steps[1].place == (0.5, 0.15)
```

`interpret(sentence, scene)` does the same without a dialogue. `scene` is a table's `Scene` in metres or a `WorldModel`:
`board(...)` has 8 x 8 cells and stacks up to eight high; `table(scene, held=..., inside=..., open=...)` is a table or
room with something in the gripper, things in a drawer, and a drawer that is open.

| outcome | when | fields |
|---|---|---|
| `Plan` | one plan is clearly likeliest, and every step can be carried out after those before it | `steps`, \
`result`, `notes`, `confidence`, `unused` |
| `Question` | several things are as likely, or something is left open | `text`, `candidates`, `choices`, `span` |
| `Answer` | the sentence asks about the world or what was said and done | `text` |
| `Refusal` | nothing fits, a step is impossible, or a word that matters is not known | `reason`, `text`, \
`suggestions` |
| `Signal` | the sentence is about the motion: "stop", "wait", "go on", "home", "undo", "faster" | `control`, \
`steps` |

A plan has the steps that are needed but were not said, and its notes name them: "I open the blue drawer first". A
sentence with words that may change its meaning is never carried out in part.

```python
from language import table
from language.verbs import ROOM

room = Scene([*scene, Object("drawer", "blue", (0.46, -0.46, 0.08))])
world = table(room, bounds=(0.3, 0.7, -0.2, 0.2), flat_only=True, verbs=ROOM)
plan = Dialogue().answer("could you put the red cube in the drawer and close it?", world)
assert [step.verb for step in plan.steps] == ["open", "lift", "put_in", "close"]
```

A gesture goes with "this", "that", "here" and "there": `interpret("take this", scene, pointed=[0])`.
`language.scene_file.read_world` reads boards and tables from files such as [board.yaml](examples/board.yaml).
"""
FRESH = """\
What a stranger may expect: sentences for the room by people who did not know the grammar, measured before a developer
read them, at the commit that is named. "As expected" includes right questions and refusals. Those of the first two rows
are in `benchmarks/unread/`; [older ones](experiments/understanding.md). Writers differ more than commits.
"""
DEVELOPED = """\
Of {number} sentences that the grammar was developed on, {met:.0%} are as expected, {wrong} wrong and {refused}
refused without help (`{command}`).
The weakest of {kinds} kinds ([all](instructions.json)): {weakest}.
"""
WAYS = """\
Of {ways} other ways of saying {groups} things, {same:.0%} do what the plain sentence does, and {other} something else
(`{command}`; the rest is asked about or refused). A third of the ways of three files, {unread}, was kept unread while
the others were mended: {before:.0%} of it did the same before, {after:.0%} afterwards.
"""
TREEBANK = """\
### Commands of strangers for a board

The Robot Commands Treebank (Dukes 2014, SemEval-2014 task 6) has commands that people wrote for a block-stacking arm,
each with the board before and after. The grammar was developed on four fifths of the boards; nobody looked at the
sentences of the other fifth. A command is right if its block goes where it went in the data.
`python -m benchmarks.treebank --data FOLDER --part held_out` measures it; with `--no-scene`, the reading is chosen
before it is compared with the scene.
"""
LEFT = """\
### Whose left

Left and right are those of the scene's `viewpoint`: "robot" (the default) or "human", who sits across the table.
"Forward" is away from the viewer. "Front" is the viewer's side of the table (`WorldModel.front`); on a board of the
Treebank it is the far side, which is also the "top". A thing that is brought to a person goes into the open hand, if
the scene has one, and otherwise to the far edge.
"""
FILM = """\
## Commands carried out

![Twelve commands, one after another: an arm moves blocks of a board as the subtitle says](commands.gif)

Twelve commands of the Treebank, carried out by the scripted expert on real physics, in real time
(`python -m benchmarks.films commands --data FOLDER --out docs/commands.gif`).
[Manipulation](manipulation.md#the-board) has the figures; the page of `play.py task=rearrange`
[takes such commands](play.md#on-a-board).
"""
TEACHING = """\
## How to teach it

A word or a phrase is one entry of `language/words.yaml`, or is taught as the program runs:

```python
from language import Dialogue, Object, Plan, Scene
from language.lattice import teach

teach("relation", "near", "hard by")
teach("verb", "lift", "snatch up")
scene = Scene([Object("cube", "red", (0.5, 0.15, 0.025)), Object("cube", "blue", (0.6, 0.0, 0.025))])
assert isinstance(Dialogue().answer("put the red cube hard by the blue cube", scene), Plan)
assert isinstance(Dialogue().answer("snatch up the blue cube", scene), Plan)
```

| to teach | one entry of |
|---|---|
| another order of words | `language/wordings.yaml`: a pattern and a plainer wording of the same meaning |
| a verb | `language/verbs.py`: its templates, further words, what it acts on, what holds before and after it |
| a spatial relation of the instruction language | `language/relations.py`: a function |

After a change: `python -m tools.understanding_page`.
"""


WORDS = f"""\
## Words

Up to {SHOWN} phrases of each meaning; "..." stands for more. A phrase is left out if it is the plural of one that is
shown, or adds words to it. `language/verbs.py` and `language/words.yaml` have all, with quantities ("every", "a bit"),
pronouns, negation, corrections ("no, not that one"), conditions and words that join steps.
"""


def page() -> str:
    """The whole page."""
    parts = [NOTE, INTRODUCTION, LEFT, *_figures(), FILM, TEACHING, *_words()]
    return "\n".join(part.rstrip() + "\n" for part in parts)


def _figures() -> Iterator[str]:
    yield "## How well\n"
    if SETS.exists():
        measured = json.loads(SETS.read_text("utf-8"))
        yield FRESH
        rows = [(each["set"], str(each["n"]), *_shares(each)) for each in measured["fresh"]]
        yield _table(("sentences", "number", "as expected", "wrong", "refused without help"), rows)
        yield _developed(measured)
        yield _ways(measured["ways"])
    yield TREEBANK
    rows = []
    for name, figures in json.loads(FIGURES.read_text("utf-8")).items():
        counts = figures["counts"]
        share = [f"{100 * counts[key] / counts['total']:.1f} %" for key in ("right", "wrong", "asked", "refused")]
        rows.append((name.replace("_", " "), str(counts["total"]), *share))
    yield _table(("part", "commands", "right", "wrong", "asked back", "refused"), rows)


def _shares(counts: dict[str, int]) -> list[str]:
    return [f"{counts[key] / counts['n']:.0%}" for key in ("met", "wrong", "refused unhelpfully")]


def _developed(measured: dict[str, Any]) -> str:
    """The figures of the sentences that the grammar was developed on, with the kinds that are understood least."""
    total, kinds = measured["total"], measured["kinds"]
    met = {name: each["met"] / each["n"] for name, each in kinds.items() if each["n"] >= MANY}
    weakest = sorted((share, name) for name, share in met.items() if share < WEAK)
    return DEVELOPED.format(
        number=total["n"],
        met=total["met"] / total["n"],
        wrong=total["wrong"],
        refused=total["refused unhelpfully"],
        command=measured["command"],
        kinds=len(kinds),
        weakest=", ".join(f"{name} {share:.0%}" for share, name in weakest),
    )


def _ways(counts: dict[str, Any]) -> str:
    """How many other ways of saying a thing do what the plain sentence does."""
    unread = counts["unread"]
    return WAYS.format(
        ways=counts["ways"],
        groups=counts["groups"],
        same=counts["same"] / counts["ways"],
        other=counts["other plan"],
        command=counts["command"],
        unread=unread["ways"],
        before=unread["before"] / unread["ways"],
        after=unread["after"] / unread["ways"],
    )


def _words() -> Iterator[str]:
    """Yields a section for each kind of words."""
    yield WORDS
    yield "### Verbs\n"
    verbs = [(name, verb) for name, verb in KNOWN.items() if verb.words]
    yield _entries((f"{name} ({verb.act.value})", words.phrases(verb.words)) for name, verb in verbs)
    yield "### Things\n"
    yield _entries(words.nouns().items())
    yield "### Colours\n\nThe first of the bold colours that the scene holds is meant.\n"
    near: dict[str, list[str]] = {}
    for word, names in words.colors().items():
        near.setdefault(", ".join(names), []).append(word)
    yield _entries(near.items())
    for key, title in TITLES.items():
        yield f"### {title}\n"
        yield _entries((name, words.phrases(text)) for name, text in words.TABLE[key].items())


def _entries(entries: Iterable[tuple[object, Iterable[str]]]) -> str:
    """A list: each meaning with up to SHOWN of its phrases."""
    lines = []
    for meaning, phrases in entries:
        shown: list[str] = []
        for phrase in phrases:
            if not any(_adds(phrase, other) for other in shown):
                shown.append(phrase)
        more = ", ..." if len(shown) > SHOWN else ""
        lines.append(f"- {_bold(meaning)}: {', '.join(shown[:SHOWN])}{more}\n")
    return "".join(lines)


def _adds(phrase: str, other: str) -> bool:
    """Whether a phrase is the plural of another one, or has all its words in their order."""
    rest = iter(phrase.split())
    return phrase == f"{other}s" or all(word in rest for word in other.split())


def _bold(meaning: object) -> str:
    name, _, note = str(meaning).replace("_", " ").partition(" (")
    return f"**{name}**" + (f" ({note}" if note else "")


def _table(header: Iterable[object], rows: Iterable[Iterable[object]]) -> str:
    named = [str(each) for each in header]
    lines: list[Iterable[object]] = [named, ["---"] * len(named), *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), "utf-8")
