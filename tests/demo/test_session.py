"""A robot that people direct, in real worlds, driven by scripted experts."""

import numpy as np
import pytest

from conf.schema import ConfigError
from demo.session import LOW, Session
from demo.session_config import make_config
from human import Unreachable
from language import LanguageError

LONGEST = 200  # control steps that one job may take


@pytest.fixture(scope="module")
def reaching():
    session = Session(make_config(driver="expert", objects=3), seed=3)
    yield session
    session.close()


@pytest.fixture(scope="module")
def placing():
    session = Session(make_config(task="nl_pick_and_place", driver="expert", objects=2), seed=1)
    yield session
    session.close()


@pytest.fixture(autouse=True)
def _fresh(request):
    for name in {"reaching", "placing"} & set(request.fixturenames):
        request.getfixturevalue(name).shuffle()


def finish(session):
    for _ in range(LONGEST):
        if not session.busy:
            return session.view.status
        session.step()
    raise AssertionError(session.view.status)


def at(session, index):
    return np.linalg.norm(session.env.gripper[0] - session.scene().positions[index]) < session.env.config.task.radius


def test_it_goes_where_the_words_say(reaching):
    for index, name in enumerate(reaching.object_names()):  # each from where the one before has ended
        assert reaching.say(f"reach {name}").understood
        assert finish(reaching).startswith("Done")
        assert at(reaching, index)


def test_a_chain_is_done_step_by_step(reaching):
    names, before = reaching.object_names(), reaching.view.outcome_counts["success"]
    reaching.say(f"reach {names[0]} then reach {names[1]}")
    finish(reaching)
    assert reaching.view.outcome_counts["success"] == before + 2
    assert at(reaching, 1)


def test_a_correction_takes_effect_at_the_next_step(reaching):
    names = reaching.object_names()
    reaching.say(f"reach {names[0]}")
    while reaching.view.highlighted != (0,):
        reaching.step()
    reaching.step()
    assert reaching.env.gripper[0, 2] > LOW
    reaching.say(f"no, {names[1]}")
    assert reaching.view.highlighted == (1,)
    finish(reaching)
    assert at(reaching, 1)


def test_what_is_not_understood_stops_nothing(reaching):
    reaching.say(f"reach {reaching.object_names()[0]}")
    assert reaching.say("reach the elephant").understood is None
    assert reaching.busy
    assert finish(reaching).startswith("Done")


def test_another_verb_is_told_to_need_another_task(reaching):
    names = reaching.object_names()
    heard = reaching.say(f"grasp {names[0]}")
    assert heard.understood is None
    assert "nl_reach" in heard.message
    assert not reaching.busy


def test_a_finger_tells_which_one(reaching):
    for index, place in enumerate(reaching.scene().positions):
        assert reaching.point_at(place) == index
        assert reaching.view.pointing.argmax() == index
        reaching.say("reach this")
        assert reaching.view.highlighted == (index,)
        finish(reaching)
        assert at(reaching, index)


def test_going_where_one_points_needs_no_words(reaching):
    with pytest.raises(LanguageError, match="point at something"):
        reaching.go_where_pointed()
    reaching.point_at(reaching.scene().positions[1])
    reaching.go_where_pointed()
    finish(reaching)
    assert at(reaching, 1)


@pytest.mark.parametrize("task", ["reach_gesture", "nl_reach_gesture"])
def test_a_policy_that_reads_gestures_goes_where_the_finger_points(task):
    session = Session(make_config(task=task, objects=3), seed=5)
    for index in range(3):
        session.point_at(session.scene().positions[index])
        session.go_where_pointed()
        assert finish(session).startswith("Done")
        assert session.view.highlighted == (index,)
        session.shuffle()
    session.say(f"reach {session.object_names()[0]}")  # nobody pointed: the person shows what is named
    assert session.view.ray is not None
    assert finish(session).startswith("Done")
    session.close()


def test_where_the_person_cannot_point_nothing_changes(reaching):
    rng, person = np.random.default_rng(0), np.array([1.5, -0.15, 0.4])
    refused = 0
    for place in rng.uniform(-0.6, 0.6, (200, 3)) + person:
        before = reaching.view.ray
        try:
            reaching.point_at(place)
        except Unreachable:
            assert reaching.view.ray is before
            refused += 1
    assert refused


def test_dragged_objects_stand_where_they_were_put_and_are_found_there(reaching):
    reaching.put_object(0, np.array([0.4, -0.25]))
    for _ in range(5):
        reaching.step()
    assert np.allclose(reaching.scene().positions[0, :2], (0.4, -0.25), atol=0.01)
    assert reaching.say(f"reach {reaching.object_names()[0]}").understood
    finish(reaching)
    assert at(reaching, 0)


def test_objects_cannot_be_dragged_off_the_table(reaching):
    reaching.put_object(0, np.array([9.0, 9.0]))
    x0, x1, y0, y1 = reaching.env.config.workspace.object_area
    x, y, _ = reaching.scene().positions[0]
    assert x0 <= x <= x1
    assert y0 <= y <= y1


def test_by_hand_the_gripper_goes_where_it_is_told(reaching):
    reaching.set_driver("hand")
    reaching.move_hand(np.array([0.5, 0.2, 0.2]))
    for _ in range(40):
        reaching.step()
    assert np.allclose(reaching.env.gripper[0], (0.5, 0.2, 0.2), atol=0.02)
    reaching.set_driver("expert")


def test_cubes_are_placed_as_told(placing):
    done = 0
    for _ in range(3):
        placing.shuffle()
        assert placing.say(placing.example()).understood, placing.example()
        done += finish(placing).startswith("Done")
    assert done >= 2


def test_a_place_must_be_a_place(placing):
    names, targets = placing.object_names(), placing.scene().targets
    first, second = (names[index] for index in np.flatnonzero(~targets))
    heard = placing.say(f"pick {first} and place it to the same position as {second}")
    assert heard.understood is None
    assert "see-through" in heard.message


def test_another_robot_takes_over():
    session = Session(make_config(driver="expert"), seed=0)
    session.change(make_config(driver="expert", robot="panda"))
    assert session.env.config.robot.name == "panda"
    session.say(session.example())
    assert finish(session).startswith("Done")
    with pytest.raises(ConfigError):
        session.change(make_config(driver="expert", overrides=["task.radius=-1"]))
    session.step()  # what could not be had has taken nothing away
    session.close()


def test_a_task_without_a_policy_is_driven_by_its_expert_alone():
    session = Session(make_config(task="press"), seed=0)
    assert session.config.driver == "expert"
    assert "press" in session.note
    with pytest.raises(ConfigError, match="no trained policy"):
        session.set_driver("policy")
    assert session.config.driver == "expert"
    session.close()


@pytest.mark.parametrize(("task", "objects"), [("nl_push", 4), ("swipe", 4), ("nl_reach_gesture", 6)])
def test_a_task_has_its_own_number_of_objects_where_none_is_chosen(task, objects):
    session = Session(make_config(task=task, driver="expert"), seed=5)
    assert len(session.scene()) == objects
    session.say(session.example())
    assert finish(session).startswith("Done")
    session.close()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"robot": "pandora"}, "robot=pandora.*panda"),
        ({"objects": 9}, "objects=9"),
        ({"driver": "nobody"}, "driver=nobody"),
        ({"task": "fly"}, "task=fly"),
        ({"checkpoint": "nowhere"}, "nowhere.*does not exist"),
    ],
)
def test_bad_choices_are_told_in_one_line(given, message):
    with pytest.raises(ConfigError, match=message) as error:
        Session(make_config(**given))
    assert "\n" not in str(error.value)
