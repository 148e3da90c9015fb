"""The templates of each verb, and the phrasings of the original system."""

import pytest

from language import (
    VERBS,
    GroundedStep,
    Instruction,
    LanguageError,
    ObjectPhrase,
    Tokenizer,
    Verb,
    parse,
    say,
)
from language.verbs import BASE, GOAL, OBJECT, has_goal
from language.verbs import PLACES as WORDS_FOR_PLACES
from tests.helpers.language_cases import PLACES, TABLE, steps

CUBE = ObjectPhrase("cube", "green")
MARK = ObjectPhrase("cube", "red", role="target")
TEMPLATES = [(task, template) for task, known in VERBS.items() for template in known.templates]


@pytest.mark.parametrize(("task", "template"), TEMPLATES)
def test_every_template_of_a_task_is_understood(task, template):
    sentence = template.replace(OBJECT, str(CUBE)).replace(GOAL, f"to {MARK}").replace(BASE, str(MARK))
    assert parse(sentence) == Instruction(task, CUBE, MARK if has_goal(template) else None)


@pytest.mark.parametrize("place", WORDS_FOR_PLACES)
def test_every_phrase_for_a_place_is_understood(place):
    assert steps(f"push the green cube {place} the transparent red cube", PLACES) == [("push", 1, 3)]


@pytest.mark.parametrize(
    ("sentence", "step"),
    [
        ("reach the green cube", GroundedStep("reach", None, 1, "distance", 1)),
        ("reach the red object left to the solid red cube", GroundedStep("reach", None, 3, "distance", 1)),
        ("reach the blue object left to the green cube", GroundedStep("reach", None, 2, "distance", 1)),
        (
            "pick the green cube and place it to the same position as the transparent red cube",
            GroundedStep("pick_and_place", 1, 3, "pnp", 3),
        ),
        (
            "push the green cube to the same position as the transparent red cube",
            GroundedStep("push", 1, 3, "distance", 1),
        ),
        (
            "swipe the green cube along the line to the position of the transparent red cube",
            GroundedStep("swipe", 1, 3, "pnpswipe", 3),
        ),
        ("reach there", GroundedStep("reach", None, 4, "distance", 1)),
        ("reach here", GroundedStep("reach", None, 4, "distance", 1)),
    ],
)
def test_phrasings_of_the_original_are_understood(sentence, step):
    assert parse(sentence, PLACES, pointed=[4]).steps == (step,)


@pytest.mark.parametrize(
    ("sentence", "init", "goal", "reward", "networks"),
    [
        ("throw the ball to the transparent sphere", 2, 4, "throw", 3),
        ("pick the ball and rotate it", 2, None, "pnprot", 3),
        ("poke the ball", 2, None, "poke", 3),
        ("poke the ball to the transparent sphere", 2, 4, "poke", 3),
        ("stack the ball on the red cube", 2, 0, "stack", 3),
        ("put the ball on top of the green one", 2, 1, "stack", 3),
        ("press the green cube", None, 1, "press", 3),
        ("turn the green cube", None, 1, "turn", 3),
        ("switch the green cube", None, 1, "switch", 3),
        ("grab the green cube", None, 1, "grasp", 1),
        ("pick up the green cube", 1, None, "lift", 3),
    ],
)
def test_every_task_has_the_originals_init_goal_reward_and_networks(sentence, init, goal, reward, networks):
    sentence = sentence.replace("the ball", "the blue ball")
    (step,) = parse(sentence, PLACES).steps
    assert (step.init, step.goal, step.reward, step.networks) == (init, goal, reward, networks)


@pytest.mark.slow
def test_a_new_verb_needs_one_entry(monkeypatch):
    monkeypatch.setitem(VERBS, "wave", Verb(("wave at {object}", "greet {object} from afar")))
    instruction = Instruction("wave", ObjectPhrase("sphere"))
    assert parse("greet the ball from afar") == instruction
    assert parse(say(instruction)) == instruction
    assert steps("wave at the ball", TABLE) == [("wave", None, 2)]
    assert Tokenizer.default().unknown_words("wave at greet from afar") == ()


@pytest.mark.slow
def test_a_new_template_needs_one_string(monkeypatch):
    push = VERBS["push"]
    monkeypatch.setitem(
        VERBS, "push", Verb((*push.templates, "slide {object} across {goal}"), moves=True, effect="goal")
    )
    assert steps("slide the green cube across to the transparent red cube", PLACES) == [("push", 1, 3)]
    assert say(parse("slide the green cube across there")) == "push the green cube there"


@pytest.mark.parametrize(
    "template", ["wave", "to {goal} bring {object}", "put {object} on {object}", "put {object} {goal} {goal}"]
)
def test_a_template_without_its_slots_in_order_is_refused(template):
    with pytest.raises(LanguageError, match="a template has one"):
        Verb((template,))
