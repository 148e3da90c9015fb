"""The words that are only understood, from `words.yaml`."""

from __future__ import annotations

from pathlib import Path

from core.safe_files import read_yaml
from language.colors import COLORS
from language.objects import DEVICES, FITTINGS, HAND, NOUNS, SIZES

TABLE = read_yaml(Path(__file__).with_name("words.yaml"))
THINGS: dict[str, str] = TABLE["things"]
REGIONS: dict[str, str] = TABLE["regions"]
CONTROLS: dict[str, str] = TABLE["controls"]
FILLERS = frozenset(TABLE["fillers"].split())
GROUPS: dict[str, tuple[str, ...]] = {  # noun -> the kinds that it may mean
    "container": FITTINGS,
    "device": DEVICES,
    "lid": FITTINGS[-1:],
    "round": ("sphere", "cylinder", "wheel"),
}
ENCLOSING = (*FITTINGS, *GROUPS)  # nouns of what a thing can be in


def phrases(text: str) -> list[str]:
    """Return the phrases of a table's entry, which commas separate."""
    return [phrase.strip() for phrase in text.split(", ")]


UNRELATED = frozenset(phrases(TABLE["strangers"]))  # common words that name nothing here
_COUNTED = phrases("zero, one, two, three, four, five, six, seven, eight, nine, ten")
_MORE = {"couple": 2, "couple of": 2, "pair of": 2, "few": 3, "half": 0.5, "dozen": 12, "fifteen": 15, "twenty": 20}
NUMBERS = {word: float(number) for word, number in (*zip(_COUNTED, range(11), strict=True), *_MORE.items())}
_RANKS = ("first 1st", "second 2nd", "third 3rd", "fourth 4th", "fifth 5th")
ORDINALS = {word: rank for rank, words in enumerate(_RANKS, 1) for word in words.split()}


def colors() -> dict[str, tuple[str, ...]]:
    """Return every colour word with the colours that it may mean; those of the registry mean themselves."""
    known = {word: (name,) for name, color in COLORS.items() for word in (name, *color.synonyms)}
    near = TABLE["near_colors"].items()
    return {**known, **{word: tuple(phrases(names)) for text, names in near for word in phrases(text)}}


def nouns() -> dict[str, tuple[str, ...]]:
    """Return each kind of thing with its nouns, those of the registry included."""
    found = {kind: (kind, *synonyms) for kind, synonyms in NOUNS.items() if kind != HAND}
    for kind, text in THINGS.items():
        found[kind] = tuple(dict.fromkeys((*found.get(kind, ()), *phrases(text))))
    return found


def names() -> set[str]:
    """Return every word for a colour or a kind of thing."""
    return {*colors(), *(noun for kinds in nouns().values() for noun in kinds)}


def sizes() -> dict[str, str]:
    """Return the size words, each with its size."""
    return {word: name for name, size in SIZES.items() for word in (name, *size.synonyms)}
