"""Instructions, chains and corrections: what they say, and invalid ones."""

import pytest
from hypothesis import given, settings

from language import Chain, Correction, Instruction, LanguageError, ObjectPhrase, parse, say
from tests.helpers.language_cases import phrases

BLUE_SPHERE = ObjectPhrase("sphere", "blue")
CUBE = ObjectPhrase("cube")
HERE = ObjectPhrase(determiner="here")
EVERY = ObjectPhrase("cube", determiner="every")


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(phrases)
def test_depth_counts_nested_relations(phrase):
    assert phrase.depth == (1 + max(anchor.depth for anchor in phrase.anchors) if phrase.anchors else 0)
    assert phrase.depth <= 3


@pytest.mark.parametrize(
    ("phrase", "words", "kind"),
    [
        (ObjectPhrase(), "the object", "object"),
        (ObjectPhrase(color="red"), "the red object", "color"),
        (ObjectPhrase("cube"), "the cube", "shape"),
        (ObjectPhrase("cube", "red"), "the red cube", "color_shape"),
        (ObjectPhrase(role="target"), "the transparent object", "role"),
        (ObjectPhrase("cube", "red", size="small"), "the small red cube", "size"),
        (ObjectPhrase("cube", superlative="leftmost"), "the leftmost cube", "superlative"),
        (ObjectPhrase("cube", excluded=ObjectPhrase(color="red")), "the cube that is not red", "negation"),
        (ObjectPhrase(excluded=ObjectPhrase("cube", "orange")), "the object that is not an orange cube", "negation"),
        (ObjectPhrase(excluded=ObjectPhrase(role="target")), "the object that is not transparent", "negation"),
        (
            ObjectPhrase(excluded=ObjectPhrase(None, "red", size="small")),
            "the object that is not a small red object",
            "negation",
        ),
        (ObjectPhrase(relation="left of", anchors=(BLUE_SPHERE,)), "the object left of the blue sphere", "relation"),
        (
            ObjectPhrase("cube", relation="between", anchors=(BLUE_SPHERE, ObjectPhrase("cylinder"))),
            "the cube between the blue sphere and the cylinder",
            "relation",
        ),
        (
            ObjectPhrase("cube", None, "left of", (ObjectPhrase("sphere", None, "behind", (CUBE,)),)),
            "the cube left of the sphere behind the cube",
            "nested",
        ),
        (ObjectPhrase("cube", determiner="this"), "this cube", "gesture"),
        (ObjectPhrase(determiner="that"), "that", "gesture"),
        (HERE, "here", "gesture"),
        (ObjectPhrase(determiner="it"), "it", "gesture"),
        (ObjectPhrase("cube", "red", determiner="every"), "every red cube", "color_shape"),
        (ObjectPhrase(determiner="every"), "every object", "object"),
    ],
)
def test_each_kind_of_phrase_is_said_as_expected(phrase, words, kind):
    instruction = Instruction("sort", phrase, BLUE_SPHERE)
    assert say(phrase) == words
    assert say(instruction) == f"sort {words} to the blue sphere"
    assert instruction.kind == phrase.kind == kind
    assert parse(say(instruction)) == instruction


def test_chains_and_corrections_are_said_as_expected():
    reach, push = Instruction("reach", BLUE_SPHERE), Instruction("push", CUBE, BLUE_SPHERE)
    assert say(Chain((reach, push))) == (
        "reach the blue sphere, then push the cube to the same position as the blue sphere"
    )
    assert say(Correction(BLUE_SPHERE)) == "no, the blue sphere"
    assert say(Correction(BLUE_SPHERE, rejected=CUBE)) == "not the cube, the blue sphere"
    assert say(Correction(goal=HERE)) == "no, here"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ObjectPhrase("kube"), "did you mean 'cube'"),
        (lambda: ObjectPhrase(color="yelow"), "did you mean 'yellow'"),
        (lambda: ObjectPhrase(size="smal"), "did you mean 'small'"),
        (lambda: ObjectPhrase(role="tarket"), "did you mean 'target'"),
        (lambda: ObjectPhrase(superlative="leftmos"), "did you mean 'leftmost'"),
        (lambda: ObjectPhrase(determiner="thiss"), "did you mean 'this'"),
        (lambda: ObjectPhrase(relation="left off", anchors=(BLUE_SPHERE,)), "did you mean 'left of'"),
        (lambda: ObjectPhrase(relation="left of"), "needs 1 anchors: 0 are given"),
        (lambda: ObjectPhrase(relation="between", anchors=(BLUE_SPHERE,)), "needs 2 anchors: 1 are given"),
        (lambda: ObjectPhrase(anchors=(BLUE_SPHERE,)), "give both or none"),
        (lambda: ObjectPhrase(relation="left of", anchors=(HERE,)), "'here' cannot be an anchor"),
        (lambda: ObjectPhrase(excluded=ObjectPhrase()), "a noun, color, size or role, and no more"),
        (lambda: ObjectPhrase(excluded=ObjectPhrase("cube", superlative="leftmost")), "and no more"),
        (lambda: ObjectPhrase("cube", determiner="it"), "stands alone"),
        (lambda: Instruction("reech", ObjectPhrase()), "did you mean 'reach'"),
        (lambda: Instruction("push", ObjectPhrase()), "needs a goal"),
        (lambda: Instruction("reach", ObjectPhrase(), ObjectPhrase()), "takes no goal"),
        (lambda: Chain((Instruction("reach", ObjectPhrase()),)), "at least 2"),
        (lambda: Correction(), "either a phrase"),
        (lambda: Correction(CUBE, goal=CUBE), "either a phrase"),
        (lambda: Correction(goal=CUBE, rejected=CUBE), "either a phrase"),
        (lambda: Correction(HERE), "give it as a goal"),
        (lambda: Correction(CUBE, rejected=HERE), "'here' cannot be rejected"),
        (
            lambda: Instruction("reach", EVERY),
            "'every cube' cannot be the object of 'reach', only the object of 'sort'",
        ),
        (lambda: Instruction("sort", CUBE, EVERY), "'every cube' cannot be a goal"),
        (lambda: ObjectPhrase(relation="left of", anchors=(EVERY,)), "'every cube' cannot be an anchor"),
        (lambda: Correction(EVERY), "'every cube' cannot be a correction"),
    ],
)
def test_a_meaning_without_a_sentence_is_refused(make, message):
    with pytest.raises(LanguageError, match=message):
        make()
