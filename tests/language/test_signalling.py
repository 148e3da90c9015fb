"""Signals about the motion, said as wishes, with adverbs and with what they are about."""

import pytest

from language.acts import act_of
from language.scanning import scan


@pytest.mark.parametrize(
    ("act", "sentences"),
    [
        ("stop", ["I'd like you to freeze right now", "you need to stop", "would you mind stopping", "can we stop"]),
        ("wait", ["I want you to pause for a second", "could we wait a moment", "you should wait a bit"]),
        ("continue", ["I want you to carry on", "feel free to continue", "you should keep going now"]),
        (
            "home",
            ["bring your gripper back to its resting position", "I'd like you to return home", "let the arm go home"],
        ),
        ("undo", ["reverse the previous step", "cancel whatever you just did", "we need you to undo your last change"]),
        ("undo", ["it looked better before please", "no the first place was better", "it was nicer before, at once"]),
        ("again", ["repeat the last move", "do what you did once more", "I'd love you to do that again please"]),
        ("faster", ["work a bit faster", "come on, a lot quicker please", "you could go faster"]),
        ("slower", ["go a little less quickly", "please take it slower", "would you mind slowing down"]),
    ],
)
def test_a_signal_may_be_a_wish(act: str, sentences: list[str]) -> None:
    assert [act_of([t.text for t in scan(said) if t.text.isalnum()]) for said in sentences] == [act] * len(sentences)


@pytest.mark.parametrize(
    "sentence",
    [
        "I want the red one",
        "I want you to hold it",
        "can you undo the red one",
        "could you take the last one back",
        "put it back in its original place",
        "move the red cube slowly to the left",
        "you could take it",
    ],
)
def test_what_is_to_be_done_with_a_thing_is_no_signal(sentence: str) -> None:
    assert act_of([t.text for t in scan(sentence) if t.text.isalnum()]) is None


@pytest.mark.parametrize("sentence", ["don't stop", "no need to stop", "you don't have to wait"])
def test_a_stop_that_is_not_to_be_made_goes_on(sentence: str) -> None:
    assert act_of([t.text for t in scan(sentence) if t.text.isalnum()]) == "continue"


@pytest.mark.parametrize("sentence", ["don't go home", "do not undo that", "never do that again", "don't go faster"])
def test_a_signal_that_is_denied_asks_for_nothing(sentence: str) -> None:
    assert act_of([t.text for t in scan(sentence) if t.text.isalnum()]) == "social"
