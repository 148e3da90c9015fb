"""A session in which the person holds out an open hand, and asks for things as people do."""

import numpy as np
import pytest

from language import HAND, NOUNS
from tests.helpers.sessions import run_to_end, session_fixture

session = session_fixture(task="nl_hand_over", driver="expert")


@pytest.mark.parametrize("sentence", ["hand me {}", "pls giv me {} now", "take {} and put it in my hand", None])
def test_what_is_asked_for_lies_in_the_hand_in_the_end(session, sentence):
    session.shuffle()
    assert session.config.workspace == "handover"
    scene = session.env.scene()
    hand = scene.nouns.tolist().index(list(NOUNS).index(HAND))
    thing = next(index for index in range(len(scene)) if index != hand)
    said = session.example() if sentence is None else sentence.format(session.object_names()[thing])
    result = session.say(said)
    assert session.busy, result.message
    assert run_to_end(session).startswith("Done")
    places = session.env.scene().positions
    offsets = np.abs(places - places[hand])
    offsets[hand] = 1.0
    assert (offsets < [0.05, 0.05, 0.04]).all(1).any()


def test_a_hand_is_nothing_that_could_be_taken(session):
    session.shuffle()
    result = session.say("take the palm")
    assert not session.busy
    assert result.message
