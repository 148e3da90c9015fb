"""The conversation of the page: what a turn shows, how its steps are ticked off, and what is taken back."""

from __future__ import annotations

import pytest

from demo.conversation import MOST_ENTRIES, Conversation, Entry, entry_of, marked
from demo.view_state import ViewState, ViewStep
from language import Answer, Plan, Question, Refusal
from tests.helpers.sessions import session_fixture


class Shown(dict):
    """The sections of a page."""

    def drop(self, *names):
        for name in names:
            del self[name]

    @property
    def turns(self):
        return [self[name] for name in sorted(self, key=lambda name: int(name.split()[1]))]


@pytest.fixture
def page():
    shown = Shown()
    shown.conversation = Conversation(shown.__setitem__, shown.drop)
    return shown


def plan(*words):
    return ViewState(steps=[ViewStep(each) for each in words])


def test_steps_are_ticked_off_as_they_are_done_and_the_result_stands_below_them(page):
    view = plan("open the drawer", "put the cube in the drawer")
    view.steps[0].state = "doing"
    page.conversation.answer(Entry("plan", [("put it there", "used")]), view)
    page.conversation.update(view, True)
    assert [step["state"] for step in page.turns[0]["steps"]] == ["doing", "next"]
    view.steps[0].state, view.steps[1].state = "done", "doing"
    page.conversation.update(view, True)
    assert [step["state"] for step in page.turns[0]["steps"]] == ["done", "doing"]
    view.steps[1].state, view.status = "done", "Done in 2.0 s."
    page.conversation.update(view, False)
    assert page.turns[0]["result"] == "Done in 2.0 s."


def test_a_turn_that_follows_does_not_get_the_result_of_the_one_before(page):
    view = plan("reach the cube")
    page.conversation.answer(Entry("plan"), view)
    page.conversation.answer(Entry("refusal", text="No."), view)
    view.status = "Done in 1.0 s."
    page.conversation.update(view, False)
    assert [turn["result"] for turn in page.turns] == ["Done in 1.0 s.", ""]


def test_a_new_plan_ends_the_one_before(page):
    first = plan("reach the cube")
    page.conversation.answer(Entry("plan"), first)
    second = plan("reach the ball")
    page.conversation.answer(Entry("plan"), second)
    assert page.turns[0]["result"].startswith("Stopped")
    second.status = "Done in 1.0 s."
    page.conversation.update(second, False)
    assert page.turns[0]["result"].startswith("Stopped")
    assert page.turns[1]["result"] == "Done in 1.0 s."


def test_offers_are_taken_back_when_something_else_is_said_or_the_scene_is_gone(page):
    page.conversation.answer(Entry("question", offers=["the red cube"]), ViewState())
    assert page.turns[0]["offers"]
    page.conversation.answer(Entry("refusal", offers=["stop"]), ViewState())
    assert [turn["offers"] for turn in page.turns] == [[], ["stop"]]
    page.conversation.leave_scene()
    assert [turn["offers"] for turn in page.turns] == [[], []]


def test_notes_are_not_repeated_and_old_turns_leave(page):
    page.conversation.note("the same")
    page.conversation.note("the same")
    assert len(page.turns) == 1
    for number in range(MOST_ENTRIES + 5):
        page.conversation.note(f"note {number}")
    assert len(page.turns) == MOST_ENTRIES


def test_words_that_counted_are_marked():
    sentence = "please reach the red cube"
    parts = marked(sentence, Plan(sentence, 1.0, ("please",)))
    assert parts == [("please", "unused"), (" ", ""), ("reach the red cube", "used")]
    refused = marked("reach the xyzzy now", Refusal("reach the xyzzy now", 0.0, (), (10, 15)))
    assert refused == [("reach the ", "used"), ("xyzzy", "problem"), (" now", "")]


def test_questions_offer_what_may_be_meant_and_refusals_two_sentences():
    names = ["the red cube", "the blue cube"]
    asked = entry_of("reach the cube", Question("reach the cube", text="which one?", candidates=(0, 1)), "", names)
    assert asked.offers == names
    suggestions = ("stop", "go home", "undo")
    refused = entry_of("fly", Refusal("fly", text="I cannot fly", suggestions=suggestions), "", names)
    assert (refused.text, refused.offers) == ("I cannot fly.", ["stop", "go home"])
    assert entry_of("hi", Answer("hi", text="hello"), "", names).text == "Hello."


session = session_fixture(driver="expert", task="nl_reach")


def drive(session, steps=200):
    for _ in range(steps):
        if not session.busy and "Going back" not in session.view.status:
            return
        session.step()


def test_a_session_ticks_off_the_steps_of_a_chain(session):
    first, second = session.object_names()[:2]
    session.say(f"reach {first} then reach {second}")
    assert [step.state for step in session.view.steps] == ["doing", "next"]
    drive(session)
    assert [step.state for step in session.view.steps] == ["done", "done"]


def test_what_was_stopped_goes_on_and_home_is_a_place(session):
    first, second = session.object_names()[:2]
    session.say(f"reach {first} then reach {second}")
    session.step()
    session.say("stop")
    assert [step.state for step in session.view.steps] == ["dropped", "dropped"]
    session.say("go on")
    drive(session)
    assert [step.state for step in session.view.steps] == ["done", "done"]
    assert session.say("go home").text
    drive(session)
    assert session.view.status == "At the rest position."
    assert abs(session.env.gripper[0] - session.env.rest_position).max() < 0.06
    assert isinstance(session.say("go on"), Refusal)


def test_the_arm_goes_home_after_a_step_where_that_is_asked_for(session):
    session.say(f"reach {session.object_names()[0]} and go home")
    drive(session)
    assert [step.state for step in session.view.steps] == ["done"]
    for _ in range(60):
        session.step()
    assert abs(session.env.gripper[0] - session.env.rest_position).max() < 0.06


@pytest.mark.parametrize("words", ["no", "wait", "not that", "no wait", "Wait!", "not the xyzzy"])
def test_an_objection_stops_the_arm_whatever_else_it_says(session, words):
    session.say(f"reach {session.object_names()[0]}")
    assert session.busy
    session.say(words)
    assert not session.busy
    assert session.view.status == "Stopped."


def test_what_is_pointed_at_last_is_this_thing_here_and_it(session):
    session.shuffle(3)
    names, places = session.object_names(), session.scene().positions
    session.point_at(places[0])
    assert names[0] in session.say("what is this?").text.lower()
    session.point_at(places[1])
    assert names[1] in session.say("and what is this thing here?").text.lower()
    session.point_at(places[2])
    assert session.say("go to it").steps[-1].object == 2


def test_after_a_stop_the_dialogue_knows_what_is_not_done_and_it_goes_on(session):
    first, second = session.object_names()[:2]
    session.say(f"reach {first} then reach {second}")
    assert session.say("did you do it?").text.startswith("No: I am at it")
    session.say("stop")
    assert "stopped" in session.say("why did that not work?").text
    session.say("thanks, you are good at this")
    session.say("ok keep going")
    drive(session)
    assert session.say("did you do it?").text.startswith("Yes")


def test_left_is_left_from_where_the_person_looks(session):
    session.shuffle()
    leftmost = {}
    for viewpoint in ("robot", "human"):
        session.set_viewpoint(viewpoint)
        outcome = session.preview("reach the leftmost thing")
        assert isinstance(outcome, Plan)
        leftmost[viewpoint] = outcome.steps[0].object
    y = session.scene().positions[:, 1]
    assert leftmost == {"robot": y.argmax(), "human": y.argmin()}
    session.say("reach the leftmost thing")
    drive(session)
    assert session.view.highlighted == (leftmost["human"],) or session.view.status.startswith("Done")
    session.set_viewpoint("robot")
