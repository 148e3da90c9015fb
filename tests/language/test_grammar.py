"""`say` and `parse` are inverse to each other."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from language import Chain, Correction, Instruction, LanguageError, ObjectPhrase, Wording, parse, say
from tests.helpers.language_cases import meanings, phrases

BLUE_SPHERE = ObjectPhrase("sphere", "blue")
CUBE = ObjectPhrase("cube")
HERE = ObjectPhrase(determiner="here")
seeds = st.integers(0, 2**32 - 1)


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(meanings)
def test_parse_inverts_say(meaning):
    assert parse(say(meaning)) == meaning


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(meanings, seeds)
def test_parse_inverts_say_in_any_wording(meaning, seed):
    sentence = Wording().say(meaning, np.random.default_rng(seed))
    assume(len(sentence) <= 1000)  # what is longer is refused
    assert parse(sentence) == meaning


@settings(max_examples=100, deadline=None)
@given(meanings)
def test_parsed_phrases_have_their_positions_in_the_sentence(meaning):
    sentence = say(meaning)
    for instruction in getattr(parse(sentence), "steps", ()):
        for part in (*instruction.phrase.parts(), *(instruction.goal.parts() if instruction.goal else ())):
            assert sentence[part.position :].startswith(str(part))


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
    ],
)
def test_each_kind_of_phrase_is_said_as_expected(phrase, words, kind):
    instruction = Instruction("reach", phrase)
    assert say(phrase) == words
    assert say(instruction) == f"reach {words}"
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
    "sentence",
    [
        "touch the red block left of the blue ball",
        "go to the red box to the left of the blue sphere",
        "Please reach the red cube left to the blue sphere.",
        "please, reach the red cube left of the blue sphere, please!",
        "Could you please touch the red cube that is left of the blue ball?",
        "now reach the red cube which is to the left of the blue sphere, thank you.",
        "I want you to reach for the red cube on the left of the blue sphere",
        "  REACH\tthe   Red cube\nleft of the blue sphere ?!  ",
        "hey robot, move to the red cube left of the blue sphere now",
    ],
)
def test_alternative_sentences_have_the_same_meaning(sentence):
    assert parse(sentence) == parse("reach the red cube left of the blue sphere")


@pytest.mark.parametrize("word", ["object", "one", "thing"])
def test_generic_nouns_are_parsed(word):
    assert parse(f"reach the red {word}").phrase == ObjectPhrase(color="red")


@pytest.mark.parametrize("mark", ["isn't", "isn\u2019t", "ISN'T"])
def test_both_apostrophes_are_accepted(mark):
    assert parse(f"reach the cube that {mark} red") == parse("reach the cube that is not red")


def test_a_relation_attaches_to_the_nearest_object():
    phrase = parse("reach the cube left of the sphere right of the cylinder").phrase
    assert phrase.anchors == (ObjectPhrase("sphere", None, "right of", (ObjectPhrase("cylinder"),)),)


def test_between_takes_the_nearest_and():
    phrase = parse("reach the cube between the ball between this and that and the tin").phrase
    inner = ObjectPhrase("sphere", None, "between", (ObjectPhrase(determiner="this"), ObjectPhrase(determiner="that")))
    assert phrase.anchors == (inner, ObjectPhrase("cylinder"))


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
        (lambda: ObjectPhrase(relation="left of"), "from 1 anchors: 0 are given"),
        (lambda: ObjectPhrase(relation="between", anchors=(BLUE_SPHERE,)), "from 2 anchors: 1 are given"),
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
    ],
)
def test_a_meaning_without_a_sentence_is_refused(make, message):
    with pytest.raises(LanguageError, match=message):
        make()
