"""Sessions in a room with devices, driven by the scripted expert."""

import re

import pytest

from demo.session import Session
from demo.session_config import make_config
from language.verbs import DEVICE_VERBS
from tests.helpers.sessions import run_to_end
from trainers.export import policy_file

SHUFFLES = 40


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(policy_file, "FOLDER", tmp_path_factory.mktemp("none"))  # else a policy's own config is used
        patch.setattr("demo.session_config.pretrained_policies", tuple)
        session = Session(make_config(task="anything", driver="expert"), seed=3)
    yield session
    session.close()


def name_of(session, verb):
    """The name of a device that a listed sentence says the verb of."""
    for _ in range(SHUFFLES):
        session.shuffle()
        for sentence in session.sayable():
            if found := re.fullmatch(f"{verb} (the .*)", sentence):
                return found[1]
    raise AssertionError(verb)


@pytest.mark.slow
@pytest.mark.parametrize("verb", DEVICE_VERBS)
def test_what_is_listed_of_devices_is_done_and_they_stay_as_they_are(session, verb):
    assert session.config.workspace == "studio"
    name = name_of(session, verb)
    index = session.object_names().index(name)
    before = session.env.moved()[index]
    assert session.say(f"{verb} {name}").message is not None
    assert run_to_end(session).startswith("Done")
    assert verb == "press" or abs(session.env.moved()[index] - before) > 0.7


@pytest.mark.slow
@pytest.mark.parametrize("sentence", ["hand me {}", "plz give {} to me", "put {} into my hand"])
def test_what_is_asked_for_is_put_into_the_hand_and_a_full_hand_takes_nothing_more(session, sentence):
    names = [each.removeprefix("hand me ") for each in _listed(session, "hand me the .*")]
    assert session.say(sentence.format(names[0])).message is not None
    assert run_to_end(session).startswith("Done")
    assert "hand me" not in " ".join(session.sayable())
    others = [each.removeprefix("grasp ") for each in session.sayable() if each.startswith("grasp the ")]
    assert "Your hand is full" in session.say(f"hand me {others[0]}").message


def _listed(session, pattern):
    """Sentences that are listed, in the first scene that has some."""
    for _ in range(SHUFFLES):
        session.shuffle()
        if found := [sentence for sentence in session.sayable() if re.fullmatch(pattern, sentence)]:
            return found
    raise AssertionError(pattern)


def test_what_cannot_be_done_to_a_device_is_refused_with_the_reason(session):
    name = name_of(session, "turn")
    for sentence, reason in (
        (f"open {name}", "only a drawer or a fridge"),
        (f"lift {name}", "stays where it is"),
    ):
        assert reason in session.say(sentence).message
        assert not session.busy


def test_pressing_a_wheel_turns_it(session):
    outcome = session.preview(f"press {name_of(session, 'turn')}")
    assert [step.verb for step in outcome.steps] == ["turn"]
