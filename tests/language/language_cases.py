"""Random scenes and instructions for the tests of the language."""

import numpy as np
from hypothesis import strategies as st

from language import COLORS, NOUNS, RELATIONS, TEMPLATES, Instruction, Object, ObjectPhrase, Scene


def random_scene(rng, count):
    return Scene.from_arrays(
        nouns=rng.integers(len(NOUNS), size=count),
        colors=rng.integers(len(COLORS), size=count),
        positions=rng.uniform([0.3, -0.3, 0.0], [0.7, 0.3, 0.1], size=(count, 3)),
    )


def random_scenes(number, counts=range(2, 9), seed=0):
    rng = np.random.default_rng(seed)
    return [random_scene(rng, count) for count in rng.choice(list(counts), size=number)]


def scene(*things):
    """A scene from "red cube" and a y each, in metres."""
    return Scene(Object(words.split()[1], words.split()[0], (0.4, y, 0.0)) for words, y in things)


plain_phrases = st.builds(
    ObjectPhrase,
    noun=st.none() | st.sampled_from(list(NOUNS)),
    color=st.none() | st.sampled_from(list(COLORS)),
)


def related(anchors):
    return st.builds(
        lambda head, relation, anchor: ObjectPhrase(head.noun, head.color, relation, anchor),
        plain_phrases,
        st.sampled_from(list(RELATIONS)),
        anchors,
    )


phrases = st.recursive(plain_phrases, related, max_leaves=6)
instructions = st.builds(Instruction, task=st.sampled_from(list(TEMPLATES)), phrase=phrases)
