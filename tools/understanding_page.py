"""The page "What it understands": `python -m tools.understanding_page` writes docs/understanding.md.

Words come from the table of verbs, `language/words.yaml` and `language/wordings.yaml`; figures from docs/treebank.json
and docs/instructions.json.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path

from language import words
from language.verbs import KNOWN, Act

DOCS = Path(__file__).parent.parent / "docs"
PAGE, FIGURES, SETS = DOCS / "understanding.md", DOCS / "treebank.json", DOCS / "instructions.json"
NOTE = "<!-- Written by `python -m tools.understanding_page`; do not edit. -->"
TITLES = {
    "relations": "Relations and places",
    "directions": "Directions",
    "sides": "Sides",
    "superlatives": "Superlatives",
    "roles": "Solid and see-through things",
    "regions": "Regions and participants",
    "units": "Lengths (in cells or in metres)",
    "controls": "Sentences about the motion",
    "singles": "Other words",
}
INTRODUCTION = """\
# What it understands

Everything that a person types goes one way, on a table, on a board and in a room:

```
text -> plain words -> readings -> things and places of one world -> plan, question, answer, refusal or signal
```

A sentence of the [instruction language](language.md) names each object exactly and is read first. Other sentences are
read by a chart that keeps every reading; the cheapest plan that can be carried out is chosen. Trained policies never
read these sentences: each step of a plan is said to them in the instruction language.

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

A plan has steps that nobody said where they are needed, and its notes say so: "I open the blue drawer first". A
question is never carried out, and a sentence with words that may change its meaning is never carried out in part.

```python
from language import table
from language.verbs import ROOM

room = Scene([*scene, Object("drawer", "blue", (0.46, -0.46, 0.08))])
world = table(room, bounds=(0.3, 0.7, -0.2, 0.2), flat_only=True, verbs=ROOM)
plan = Dialogue().answer("could you put the red cube in the drawer and close it?", world)
assert [step.verb for step in plan.steps] == ["open", "lift", "put_in", "close"]
```

Gestures go with "this", "that", "here" and "there": `interpret("take this", scene, pointed=[0])`. Boards and tables
are files, too: `language.scene_file.read_world` reads them; [board.yaml](examples/board.yaml) is an example.
"""
FRESH = """\
What a stranger may expect: sentences for the room by people who did not know the grammar, measured before anybody who
develops it read them. The expectations allow several outcomes; "as expected" includes right questions and refusals.
"""
TREEBANK = """\
### Commands of strangers for a board

The Robot Commands Treebank (Dukes 2014, SemEval-2014 task 6) has commands that people wrote for a block-stacking arm,
each with the board before and after. The grammar was developed on four fifths of the boards (groups of scenes that
share a board are never divided); nobody looked at the sentences of the other fifth, which is only measured. A command
is right if its block goes where it went in the data. `python -m benchmarks.treebank --data FOLDER --part held_out`
measures it; with `--no-scene`, the reading is chosen before it is compared with the scene. The data show each pair of
worlds in both directions; the even scene of a pair leads back.
"""
LEFT = """\
### Whose left

Left and right are those of the scene's `viewpoint`: "robot" (the default) or "human", who sits across the table.
"Forward" is away from the viewer. "Front" is the viewer's side of the table (`WorldModel.front`); on a board whose
front is where the arm faces, as in the Treebank, it is the far side, which is also the "top". A thing that is brought
to a person goes into the open hand that they hold out, if the scene has one, and otherwise to the far edge.
"""
FILM = """\
## Commands carried out

![Twelve commands, one after another: an arm moves blocks of a board as the subtitle says](commands.gif)

Twelve commands that people wrote, each understood in its own scene and carried out by the scripted expert on real
physics, in real time. The sentences are quoted from the Robot Commands Treebank.
`python -m benchmarks.films commands --data FOLDER --out docs/commands.gif` makes the film;
[manipulation](manipulation.md#the-board) has the figures. On the page of `play.py task=rearrange`, you
[say such commands yourself](play.md#on-a-board).
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

A wording with another order of words is one line of `language/wordings.yaml`: a pattern and a plainer wording of the
same meaning. A verb is one entry of `language/verbs.py`: its templates, further words, what it acts on, what must hold
before it and what holds after it. No other module names a verb, which a test holds. A spatial relation of the
instruction language is one function in `language/relations.py`; phrases that are only understood stand in `words.yaml`.

After a change of the tables: `python -m tools.understanding_page`.
"""


def page() -> str:
    """The whole page."""
    parts = [NOTE, INTRODUCTION, LEFT, *_figures(), FILM, TEACHING, "## Words\n", *_words()]
    return "\n".join(part.rstrip() + "\n" for part in parts)


def _figures() -> Iterator[str]:
    yield "## How well\n"
    if SETS.exists():
        measured = json.loads(SETS.read_text("utf-8"))
        yield FRESH
        rows = [(each["set"], str(each["n"]), *_shares(each)) for each in measured["fresh"]]
        yield _table(("sentences", "number", "as expected", "wrong", "refused without help"), rows)
        yield f"Sentences that the grammar was developed on (`{measured['command']}`):\n"
        kinds = measured["kinds"]
        header = ("kind of sentence", "sentences", "as expected", "wrong", "refused without help")
        rows = [(k, c["n"], f"{c['met'] / c['n']:.0%}", c["wrong"], c["refused unhelpfully"]) for k, c in kinds.items()]
        yield _table(header, rows)
    yield TREEBANK
    rows = []
    for name, figures in json.loads(FIGURES.read_text("utf-8")).items():
        counts = figures["counts"]
        share = [f"{100 * counts[key] / counts['total']:.1f} %" for key in ("right", "wrong", "asked", "refused")]
        rows.append((name.replace("_", " "), str(counts["total"]), *share))
    yield _table(("part", "commands", "right", "wrong", "asked back", "refused"), rows)


def _shares(counts: dict[str, int]) -> list[str]:
    return [f"{counts[key] / counts['n']:.0%}" for key in ("met", "wrong", "refused unhelpfully")]


def _words() -> Iterator[str]:
    """Yields a section for each kind of words."""
    yield "### Verbs\n"
    rows = [(name.replace("_", " "), verb.act.value, _shown(verb.words)) for name, verb in KNOWN.items() if verb.words]
    yield _table(("verb", "what is done", "understood beside its templates"), rows)
    yield "These are only refused: " + KNOWN[next(n for n, v in KNOWN.items() if v.act is Act.NEVER)].words + ".\n"
    yield "### Things\n"
    yield _table(("meaning", "understood"), ((kind, ", ".join(nouns)) for kind, nouns in words.nouns().items()))
    yield "### Colours\n\nThe first of these colours that the scene holds is meant.\n"
    yield _table(("word", "colours"), ((word, ", ".join(names)) for word, names in words.colors().items()))
    for key, title in TITLES.items():
        yield f"### {title}\n"
        yield _table(("meaning", "understood"), words.TABLE[key].items())


def _shown(text: str) -> str:
    return ", ".join(words.phrases(text))


def _table(header: Iterable[object], rows: Iterable[Iterable[object]]) -> str:
    named = [str(each) for each in header]
    lines: list[Iterable[object]] = [named, ["---"] * len(named), *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), "utf-8")
