"""Sessions in a room: several verbs, one after another in the world as it is, driven by the scripted expert."""

import re
from contextlib import closing

import numpy as np
import pytest

from demo.returning import NEAR
from demo.room import narrow, room_of
from demo.session import Session
from demo.session_config import default_task, make_config
from language import LanguageError, Plan
from tests.helpers.sessions import run_to_end, session_fixture
from trainers.export import policy_file

SHUFFLES = 40  # until something can be said


session = session_fixture(task="anything", driver="expert")


def names_in(session, *patterns):
    """Draws a scene in which a sentence of each pattern can be said and nothing is in a fitting.

    Returns the name in the first group of each pattern.
    """
    for _ in range(SHUFFLES):
        session.shuffle()
        found = [[re.fullmatch(pattern, each) for each in session.sayable()] for pattern in patterns]
        if all(map(any, found)) and not room_of(session.env).inside.any():
            return [next(each[1] for each in matches if each) for matches in found]
    raise AssertionError(patterns)


def number_of(session, name):
    return session.object_names().index(name)


def done(session, sentence):
    result = session.say(sentence)
    assert session.busy, result.message
    return run_to_end(session).startswith("Done")


def test_the_workspace_is_a_room_and_all_that_is_listed_can_be_said(session):
    session.shuffle()
    assert session.config.workspace in ("room", "studio")
    sentences = session.sayable()
    assert 5 < len(sentences) <= 12
    assert len({each.split()[0] for each in sentences}) > 3
    assert len(set(sentences)) == len(sentences)
    for sentence in sentences:
        result = session.say(sentence)
        assert session.busy, (sentence, result.message)
        assert session.view.status == f"Doing: {sentence}"
        session.stop()


@pytest.mark.slow
def test_a_drawer_is_opened_and_something_put_in_it_in_one_sentence(session):
    drawer, thing = names_in(session, "open (the .*drawer)", "grasp (the .*)")
    index, counts = number_of(session, thing), dict(session.view.outcome_counts)
    before = session.scene().positions[index]
    assert done(session, f"open {drawer} and put {thing} in it")
    assert session.view.outcome_counts["success"] == counts["success"] + 2
    assert np.linalg.norm(session.scene().positions[index] - before) > 0.1
    closed = session.say(f"open {drawer}")
    assert "open already" in closed.message
    assert not session.busy
    lifted = session.preview(f"lift {session.object_names()[index]}")
    assert lifted.steps[0].goal == number_of(session, drawer)
    assert any(each.startswith("take ") for each in session.sayable())


@pytest.mark.slow
def test_the_gripper_does_not_return_between_instructions(session):
    first, second = names_in(session, "reach (the .*cube)", "lift (the .*)")
    assert done(session, f"reach {first}")
    assert done(session, f"grasp {second}")
    session.say(session.sayable()[0])
    rest, distances = session.env.rest_position, []
    while session.busy:
        distances.append(np.linalg.norm(session.env.gripper[0] - rest))
        session.step()
    assert session.view.status.startswith("Done")
    assert min(distances) > NEAR


@pytest.mark.slow
def test_what_is_held_is_put_down_before_anything_else(session):
    thing, drawer = names_in(session, "lift (the .*)", "open (the .*drawer)")
    index = number_of(session, thing)
    assert done(session, f"pls pick up teh {thing.removeprefix('the ')}")
    assert session.env.held == index
    assert all(each.startswith(("put", "stack", "hand")) for each in session.sayable())
    result = session.say(f"open {drawer}")
    assert isinstance(result, Plan)
    assert "down first" in result.message
    assert run_to_end(session).startswith("Done")
    assert session.env.held != index
    assert session.scene().positions[index, 2] < 0.03


@pytest.mark.slow
def test_a_later_step_that_is_done_already_is_left_out_and_told(session):
    drawer, thing = names_in(session, "open (the .*drawer)", "grasp (the .*)")
    while any(each.startswith("close ") for each in session.sayable()):  # it would be listed in place of the drawer
        drawer, thing = names_in(session, "open (the .*drawer)", "grasp (the .*)")
    result = session.say(f"open {drawer} then open {drawer}")
    assert "open already" in result.message
    assert run_to_end(session).startswith("Done")
    assert f"close {drawer}" in session.sayable()
    assert done(session, f"put {thing} in {drawer} and close it")


def test_verbs_and_fittings_that_fit_nothing_are_refused(session):
    (thing,) = names_in(session, "grasp (the .*)")
    fridge = next(name for name in session.object_names() if name.endswith("fridge"))
    for sentence, message in (
        (f"press {thing}", "only buttons"),
        (f"throw {thing}", "cannot throw"),
        (f"lift {fridge}", "stays where it is"),
        (f"open {thing}", "only a drawer or a fridge"),
        (f"put {thing} in {fridge} and eat it", "eat"),
    ):
        result = session.say(sentence)
        assert message in result.message
        assert not session.busy


def test_objects_are_moved_by_hand_and_fittings_are_not(session):
    (thing,) = names_in(session, "grasp (the .*)")
    index, (x0, _, y0, _) = number_of(session, thing), session.env.config.workspace.object_area
    session.put_object(index, np.array([x0, y0]))
    for _ in range(5):
        session.step()
    assert np.allclose(session.scene().positions[index, :2], (x0, y0), atol=0.02)
    fridge = next(i for i, name in enumerate(session.object_names()) if name.endswith("fridge"))
    with pytest.raises(LanguageError, match="stays where it is"):
        session.put_object(fridge, np.array([x0, y0]))


def test_play_begins_with_everything_where_there_is_a_policy_for_it(tmp_path, monkeypatch):
    monkeypatch.setattr(policy_file, "FOLDER", tmp_path)
    assert default_task("kuka") == "nl_reach"
    (tmp_path / "anything_kuka").mkdir()
    (tmp_path / "anything_kuka" / "policy.safetensors").touch()
    assert default_task("kuka") == "anything"
    assert default_task("jaco") == "nl_reach"


def test_what_is_open_too_little_is_opened_wide_before_something_is_taken_out():
    with closing(Session(make_config(task="anything"), seed=3)) as session:  # whose fridge is open by less than 0.9
        (fridge,) = narrow(session.env)
        (inside,) = np.flatnonzero(room_of(session.env).inside[:, fridge])
        names = session.object_names()
        assert done(session, f"take {names[inside].partition(' in ')[0]} out of {names[fridge]}")
        assert not room_of(session.env).inside[inside, fridge]
