"""The number of sentences, compared with enumeration where it is small."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from language import count, parse
from language.lexicon import Lexicon, split_template


def tiny(*templates, **more):
    """A language of two colours and one shape, without superlatives, and what else is given."""
    few = {
        **{name: {} for name in ("superlative", "side", "size", "role", "relation", "between", "excluding", "a")},
        **{"pointing": {}, "it": {}, "spot": {}, "place": {"place": ("to",)}},
        "color": {"red": ("red",), "gray": ("gray", "grey")},
        "noun": {None: ("object",), "cube": ("cube",)},
    }
    return Lexicon(few | more, {str(number): (split_template(words),) for number, words in enumerate(templates)})


def sentences(words, depth):
    """All of them, each once, put together without the grammar."""
    named = set(phrases(words, depth))
    spots = forms(words, "spot")
    objects = [*named, *spots]
    goals = [f"{place} {phrase}" for place, phrase in product(forms(words, "place"), named)] + spots
    for (pieces,) in words.templates.values():
        yield from joined(*({"{object}": objects, "{goal}": goals}.get(piece, [piece]) for piece in pieces))


def phrases(words, depth):
    colors, nouns = ["", *forms(words, "color")], forms(words, "noun")
    nots = [form for category in ("color", "size", "role") for form in forms(words, category)]
    adjectives = (["", *forms(words, category)] for category in ("size", "role"))
    nots += [said for said in joined(forms(words, "a"), *adjectives, colors, nouns) if said.split()[1:] != ["object"]]
    excluded = ["", *joined(forms(words, "excluding"), nots)]
    before = [["", *forms(words, category)] for category in ("size", "role")]
    most, sides = forms(words, "superlative"), forms(words, "side")
    where = [""]
    if depth:
        inner = list(phrases(words, depth - 1))
        where += joined(forms(words, "relation"), inner)
        where += joined(forms(words, "between"), inner, ["and"], inner)
    heads = joined(["", *most], *before, colors, nouns) + joined(*before, colors, nouns, sides)
    yield from joined(["the", *forms(words, "pointing")], heads, excluded, where)
    yield from joined(["the"], most, where)
    yield from [*forms(words, "pointing"), *forms(words, "it")]


def forms(words, category):
    return [form for forms in words.categories[category].values() for form in forms]


def joined(*choices):
    return [" ".join(part for part in parts if part) for parts in product(*choices)]


SHOWN = {"pointing": {"this": ("this",)}, "it": {"it": ("it",)}, "spot": {"here": ("here", "right here")}}
NOT = {"excluding": {"excluding": ("that is not", "that isn't")}, "a": {"a": ("a",), "an": ("an",)}}
BESIDE = {"relation": {"left of": ("left of", "left to")}}
BETWEEN = {"between": {"between": ("between",)}}
MOST = {
    "superlative": {"leftmost": ("leftmost",)},
    "side": {"leftmost": ("on the left",)},
    "size": {"small": ("small", "tiny")},
    "role": {"real": ("solid",)},
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "depth"),
    [
        (tiny("reach {object}"), 0),
        (tiny("reach {object}", "poke {object}", "push {object} {goal}", **SHOWN), 0),
        (tiny("reach {object}", **NOT, **MOST, **SHOWN), 0),
        (tiny("push {object} {goal}", **MOST, place={"place": ("to", "at")}), 0),
        (tiny("reach {object}", **BESIDE, **SHOWN, **MOST), 1),
        (tiny("reach {object}", **BESIDE, **NOT), 1),
        (tiny("lift {object} up", **BESIDE, **BETWEEN, **SHOWN), 1),
        (tiny("push {object} {goal}", **BESIDE), 1),
        (tiny("reach {object}", **BESIDE, **SHOWN), 2),
        (tiny("reach {object}", **BESIDE, **BETWEEN, color={"red": ("red",)}), 2),
    ],
)
def test_the_count_equals_the_number_of_enumerated_sentences(words, depth):
    every = list(sentences(words, depth))
    assert len(every) == len(set(every)) == count(depth, words)
    for index in np.random.default_rng(0).choice(len(every), size=100):
        parse(every[index])


@pytest.mark.parametrize("depth", [0, 1])
def test_every_is_counted_as_what_is_sorted(depth):
    plain, sorting = (
        tiny("reach {object} to {base}", **BESIDE, **MOST),
        tiny(**BESIDE, **MOST, every={"every": ("every",)}),
    )
    sorting = replace(sorting, templates={"sort": plain.templates["0"]})
    named = set(phrases(plain, depth))
    leftmost = {each for each in named if each == "the leftmost" or each.startswith("the leftmost left")}
    assert count(depth, plain) == len(named) ** 2
    assert count(depth, sorting) == (2 * len(named) - len(leftmost)) * len(named)


def test_the_count_grows_with_depth():
    counts = [count(depth) for depth in range(4)]
    assert counts == sorted(counts)
    assert counts[1] > 10**12
