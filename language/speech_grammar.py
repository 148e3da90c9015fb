"""What can be said aloud in a scene, as a JSGF grammar: the table of verbs with the names of the scene's things.

A recogniser that expects only these sentences hears them far better than one that knows all of English. So colours and
nouns are those of the scene, and of the phrases that can be typed only the common ones can be spoken.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from language.colors import COLORS
from language.generator import size_words
from language.lexicon import lexicon
from language.objects import ANY_NOUN, DEVICES, FITTINGS, NOUNS, Scene
from language.verbs import BASE, GOAL, IT, KNOWN, OBJECT, POINTING, ROOM, Act, Verb

# What is said besides the sentences of the table; "<thing>" is a thing of the scene. `Dialogue` understands all of it.
SHORT = (
    "stop", "wait", "go on", "undo", "go home", "again", "faster", "slower", "yes", "no", "no wait", "never mind",
    "<thing>", "no <thing>", "no i meant <thing>", "not <thing>", "the left one", "the right one",
    "drop it", "drop it <spot>", "put it <spot>", "let go", "give it to me", "close it", "open it",
    "what do you see", "what can you do", "what are you doing", "what do you hold", "where is <thing>",
    "what color is <thing>",
)  # fmt: skip
SPOTS = (
    "here", "there", "over there", "on the table", "to the left", "to the right", "a bit to the left",
    "a bit to the right", "in the middle", "in the back left corner", "in the back right corner",
    "in the front left corner", "in the front right corner",
)  # fmt: skip
OPENED, STORED = (Act.OPEN, Act.SHUT), ("in", "out")  # acts and effects that need a drawer or a fridge
SPELLINGS = ("grey",)  # that sound like another word of the table
WORD = re.compile(r"(?<![<\w])[a-z][a-z']*(?![>\w])")


def speech_grammar(scene: Scene, verbs: Iterable[str] = ROOM, points: bool = True) -> str:
    """Return the grammar of what is said in a scene.

    Args:
        scene: its things have the names that can be said.
        verbs: of the table, those of its task.
        points: whether a person points, who may say "this" and "that".
    """
    rules = "\n".join(f"<{name}> = {body};" for name, body in SceneGrammar(scene, points).rules(verbs))
    return f"#JSGF V1.0;\ngrammar deixis;\npublic <said> = <request> | <short>;\n{rules}\n"


def spoken_words(grammar: str) -> set[str]:
    """Return the words of a grammar."""
    return set(WORD.findall(grammar.split("<short>;", 1)[1]))


class SceneGrammar:
    """The rules of the grammar for one scene."""

    def __init__(self, scene: Scene, points: bool) -> None:
        self._scene, self._words, self._points = scene, lexicon(), points
        self._nouns = [list(NOUNS)[noun] for noun in scene.nouns]

    def rules(self, verbs: Iterable[str]) -> Iterator[tuple[str, str]]:
        """Yield the rules, each a name and JSGF."""
        yield "request", f"[{_any(self._forms('opening'))}] <command> [{_any(self._forms('closing'))}]"
        yield "command", f"<step> | <step> {_any(self._forms('then'))} <command>"
        yield "step", _any(self._steps(verbs))
        yield "short", _any(SHORT)
        yield "spot", _any(SPOTS)
        yield "goal", f"{_any(self._forms('place'))} <thing> | <relation> <thing> | <spot>"
        yield "relation", _any(self._forms("relation"))
        yield "most", _any(self._forms("superlative"))
        yield "which", _any(self._forms("which_is"))
        yield "between", f"{_any(self._forms('between'))} <anchor> and <anchor>"
        yield "where", "[<which>] <relation> <anchor> | [<which>] <between>"
        yield "head", _any(self._heads(range(len(self._scene))))
        yield "anchor", "the [<most>] <head>"
        yield "thing", f"the [<most>] <head> [<where>] | the <most> | {self._other('<head>')}"
        for kind, nouns in {"box": FITTINGS, **{noun: (noun,) for noun in DEVICES}}.items():
            those = [index for index, noun in enumerate(self._nouns) if noun in nouns]
            if those:
                heads = _any(self._heads(those))
                yield kind, f"the [<most>] {heads} [<where>] | {self._other(heads)}"

    def _forms(self, category: str) -> list[str]:
        """Return all phrases of a category."""
        return [form for forms in self._words.categories[category].values() for form in forms]

    def _shades(self, color: int) -> list[str]:
        """Return the words for a colour, by its number."""
        forms = self._words.categories["color"][list(COLORS)[color]]
        return [form for form in forms if form not in SPELLINGS]

    def _has_object(self, verb: Verb) -> bool:
        """Return whether something in the scene may be an object of the verb."""
        if verb.act in OPENED or verb.effect in STORED:
            return not set(FITTINGS).isdisjoint(self._nouns)
        return verb.noun in ("", *self._nouns)

    def _other(self, head: str) -> str:
        """Return what is said of a thing without the article."""
        return f"{_any(POINTING)} [{head}] | {IT}" if self._points else IT

    def _heads(self, indices: Iterable[int]) -> Iterator[str]:
        """Yield the names of things, without article: "cube", "red cube", "small solid red one"."""
        adjectives = ""
        if len(set(size_words(self._scene))) > 1:
            adjectives += f"[{_any(self._forms('size'))}] "
        if self._scene.targets.any():
            adjectives += f"[{_any(self._forms('role'))}] "
        found: dict[tuple[str, ...], dict[str, None]] = {}
        for index in indices:
            nouns = self._words.categories["noun"][self._nouns[index]]
            found.setdefault(nouns, {}).update(dict.fromkeys(self._shades(self._scene.colors[index])))
        colors = dict.fromkeys(color for each in found.values() for color in each)
        for nouns, own in (*found.items(), (ANY_NOUN, colors)):
            yield f"{adjectives}[{_any(own)}] {_any(nouns)}"

    def _steps(self, verbs: Iterable[str]) -> Iterator[str]:
        """Yield the templates of verbs that something in the scene may be an object of.

        Those that differ in what is before the object are one, which keeps the recogniser's graph small.
        """
        begins: dict[str, dict[str, None]] = {}
        for name in dict.fromkeys((*verbs, *(name for name, verb in KNOWN.items() if verb.spoken))):
            verb = KNOWN[name]
            if not self._has_object(verb):
                continue
            slot = verb.noun or ("box" if verb.act in OPENED else "thing")
            base = "<box>" if verb.effect in STORED else "<thing>"
            for template in (*verb.templates, *verb.spoken):
                before, after = template.split(OBJECT)
                rest = f"<{slot}>{after}".replace(BASE, base).replace(GOAL, "<goal>")
                begins.setdefault(rest, {})[before.strip()] = None
        for rest, starts in begins.items():
            yield f"{_any(starts)} {rest}"


def _any(phrases: Iterable[str]) -> str:
    """Return JSGF for one of the phrases."""
    return f"({' | '.join(phrases)})"
