"""Random scenes and meanings for the tests of the language, two fixed scenes, and answers of the command line."""

import json

import numpy as np
from hypothesis import strategies as st

from language import (
    COLORS,
    NOUNS,
    RELATIONS,
    SIZES,
    SUPERLATIVES,
    VERBS,
    Chain,
    Correction,
    Instruction,
    LanguageError,
    Object,
    ObjectPhrase,
    Scene,
    parse,
    say,
)
from language.cli import main
from language.objects import ROLE_WORDS
from tools.random_scenes import random_scene

# From the robot's viewpoint the red cube is on the right, the green one far left, and the cylinder on the sphere.
TABLE = Scene(
    [
        Object("cube", "red", (0.4, -0.2, 0.0)),
        Object("cube", "blue", (0.4, -0.02, 0.02), size=0.03),
        Object("sphere", "blue", (0.4, 0.1, 0.02)),
        Object("cube", "green", (0.6, 0.2, 0.02), size=0.07),
        Object("cylinder", "yellow", (0.4, 0.1, 0.12)),
    ]
)
# Two cubes and a ball, and two targets.
PLACES = Scene(
    [
        Object("cube", "red", (0.4, -0.2, 0.02)),
        Object("cube", "green", (0.4, 0.0, 0.02)),
        Object("sphere", "blue", (0.4, 0.2, 0.02)),
        Object("cube", "red", (0.6, -0.1, 0.02), role="target"),
        Object("sphere", "yellow", (0.6, 0.1, 0.02), role="target"),
    ]
)


def random_scenes(number, counts=range(2, 9), seed=0):
    rng = np.random.default_rng(seed)
    return [random_scene(int(count), rng) for count in rng.choice(list(counts), size=number)]


def scene(*things):
    """Returns a scene from ("red cube", y in metres) pairs."""
    return Scene(Object(words.split()[1], words.split()[0], (0.4, y, 0.0)) for words, y in things)


def answer(sentence, *scene_and_more, **more):
    """Returns the result of `parse`, or the LanguageError that it raises."""
    try:
        return parse(sentence, *scene_and_more, **more)
    except LanguageError as error:
        return error


def steps(sentence, *scene_and_more, **more):
    """Returns (task, init, goal) of each step."""
    return [(step.task, step.init, step.goal) for step in parse(sentence, *scene_and_more, **more).steps]


def _one_of(table):
    return st.sampled_from(list(table))


def _maybe(table):
    return st.none() | _one_of(table)


spots = st.builds(ObjectPhrase, determiner=st.sampled_from(["here", "there"]))
_excluded = st.builds(ObjectPhrase, _maybe(NOUNS), _maybe(COLORS), size=_maybe(SIZES), role=_maybe(ROLE_WORDS)).filter(
    lambda phrase: phrase != ObjectPhrase()
)


@st.composite
def _described(draw, depth, determiners=("the", "the", "this", "that")):
    """Any phrase with at most `depth` nested relations."""
    where = {}
    if depth and draw(st.booleans()):
        known = draw(_one_of(RELATIONS.values()))
        anchors = [draw(phrases_to(depth - 1)) for _ in range(known.anchors)]
        where = {"relation": known.phrase, "anchors": tuple(anchors)}
    return ObjectPhrase(
        noun=draw(_maybe(NOUNS)),
        color=draw(_maybe(COLORS)),
        size=draw(_maybe(SIZES)),
        role=draw(_maybe(ROLE_WORDS)),
        superlative=draw(_maybe(SUPERLATIVES)),
        excluded=draw(st.none() | _excluded),
        determiner=draw(st.sampled_from(determiners)),
        **where,
    )


def phrases_to(depth):
    alone = st.builds(ObjectPhrase, determiner=st.sampled_from(["it", "this", "that"]))
    return st.one_of(_described(depth), _described(depth), _described(depth), alone)


phrases = phrases_to(3)


@st.composite
def _instructions(draw):
    task = draw(_one_of(VERBS))
    goals = phrases | spots
    if not VERBS[task].takes_goal:
        goals = st.none()
    elif not VERBS[task].needs_goal:
        goals = st.none() | goals
    objects = phrases | spots
    if VERBS[task].takes_every:
        objects |= _described(3, ("every",))
    return Instruction(task, draw(objects), draw(goals))


instructions = _instructions()
chains = st.builds(Chain, st.lists(instructions, min_size=2, max_size=3).map(tuple))
corrections = st.one_of(
    st.builds(Correction, phrase=phrases),
    st.builds(Correction, goal=phrases | spots),
    st.builds(Correction, phrase=phrases, rejected=phrases),
)
meanings = st.one_of(instructions, chains, corrections).filter(lambda meaning: len(say(meaning)) <= 1000)


def answered(capsys, *arguments):
    """The JSON that `python -m language parse` prints for a sentence, and the exit code."""
    status = main(["parse", *arguments, "--json"])
    return json.loads(capsys.readouterr().out), status
