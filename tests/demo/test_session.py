"""Sessions with real environments, driven by scripted experts."""

from contextlib import closing

import numpy as np
import pytest

from core.errors import ConfigError
from demo.returning import LOW
from demo.session import Session
from demo.session_config import make_config
from human import Unreachable
from language import LanguageError, Plan
from tests.helpers.sessions import run_to_end, session_fixture

reaching = session_fixture(driver="expert", objects=3)


placing = session_fixture(seed=1, task="nl_pick_and_place", driver="expert", objects=2)


@pytest.fixture(autouse=True)
def _new_scene(request):
    for name in {"reaching", "placing"} & set(request.fixturenames):
        request.getfixturevalue(name).shuffle()


def is_at(session, index):
    distance = np.linalg.norm(session.env.gripper[0] - session.scene().positions[index])
    return distance < session.env.config.task.radius


@pytest.mark.slow
def test_the_robot_reaches_the_named_object(reaching):
    for index, name in enumerate(reaching.object_names()):  # each starts where the one before has ended
        assert isinstance(reaching.say(f"reach {name}"), Plan)
        assert run_to_end(reaching).startswith("Done")
        assert is_at(reaching, index)


def test_the_steps_of_a_chain_are_done_in_order(reaching):
    names, before = reaching.object_names(), reaching.view.outcome_counts["success"]
    reaching.say(f"reach {names[0]} then reach {names[1]}")
    run_to_end(reaching)
    assert reaching.view.outcome_counts["success"] == before + 2
    assert is_at(reaching, 1)


def test_a_correction_takes_effect_at_the_next_step(reaching):
    names = reaching.object_names()
    reaching.say(f"reach {names[0]}")
    while reaching.view.highlighted != (0,):
        reaching.step()
    reaching.step()
    assert reaching.env.gripper[0, 2] > LOW
    reaching.say(f"no, {names[1]}")
    assert reaching.view.highlighted == (1,)
    run_to_end(reaching)
    assert is_at(reaching, 1)


def test_the_policy_hears_the_plain_name_of_what_answers_and_corrections_name(reaching):
    names = reaching.object_names()
    for sentence in (f"reach {names[0]}", f"no, {names[1]}", "reach the object", names[2]):
        reaching.say(sentence)
    assert reaching.view.policy_sentence == f"reach {names[2]}"
    reaching.say(f"no, {names[1]}")
    assert reaching.view.policy_sentence == f"reach {names[1]}"


def test_a_sentence_that_is_not_understood_stops_nothing(reaching):
    reaching.say(f"reach {reaching.object_names()[0]}")
    assert not isinstance(reaching.say("reach the elephant"), Plan)
    assert reaching.busy
    assert run_to_end(reaching).startswith("Done")


def test_a_verb_of_another_task_is_refused(reaching):
    names = reaching.object_names()
    result = reaching.say(f"grasp {names[0]}")
    assert not isinstance(result, Plan)
    assert "I only reach, and do not grasp" in result.message
    assert not reaching.busy


def test_a_gesture_tells_the_referent_of_this(reaching):
    for index, place in enumerate(reaching.scene().positions):
        assert reaching.point_at(place) == index
        assert reaching.view.pointing.argmax() == index
        reaching.say("reach this")
        assert reaching.view.highlighted == (index,)
        run_to_end(reaching)
        assert is_at(reaching, index)


def test_go_where_pointed_requires_a_gesture_and_no_words(reaching):
    with pytest.raises(LanguageError, match="point at something"):
        reaching.go_where_pointed()
    reaching.point_at(reaching.scene().positions[1])
    reaching.go_where_pointed()
    run_to_end(reaching)
    assert is_at(reaching, 1)


@pytest.mark.slow
@pytest.mark.parametrize("task", ["reach_gesture", "nl_reach_gesture"])
def test_a_gesture_policy_reaches_the_object_that_is_pointed_at(task):
    session = Session(make_config(task=task, objects=3), seed=5)
    for index in range(3):
        session.point_at(session.scene().positions[index])
        session.go_where_pointed()
        assert run_to_end(session).startswith("Done")
        assert session.view.highlighted == (index,)
        session.shuffle()
    session.say(f"reach {session.object_names()[0]}")  # without a gesture: the person points at the named object
    assert session.view.ray is not None
    assert run_to_end(session).startswith("Done")
    session.close()


def test_a_gesture_policy_hears_words_of_its_training_for_what_the_finger_and_people_s_words_single_out():
    session = Session(make_config(task="nl_reach_gesture"), seed=5)
    thing = session.scene()[0]
    heard = f"reach that {thing.color} {thing.noun}"
    session.point_at(thing.position)
    session.say("reach this")
    assert session.view.policy_sentence == heard
    session.point_at(thing.position)
    session.go_where_pointed()
    assert session.view.policy_sentence == heard
    session.say(f"no, {session.object_names()[1]}")
    session.say(f"no, {session.object_names()[0]}")
    assert session.view.policy_sentence == heard
    session.close()


def carry(session, names):
    """Says to bring the first object to the first target; returns the control steps until the gripper holds it."""
    session.say(f"pick {names[0]} and place it to the same position as {names[2]}")
    for step in range(60):
        if session.env.held is not None:
            return step
        session.step()
    raise AssertionError(session.view.status)


def test_a_correction_lays_aside_what_is_held_and_leaves_the_targets_where_they_are(placing):
    placing.shuffle(7)
    order = np.argsort(placing.scene().targets, kind="stable").tolist()  # two objects, then two targets
    names, places = [placing.object_names()[index] for index in order], placing.scene().positions[order]
    carry(placing, names)
    placing.say(f"no, {names[1]}")
    assert run_to_end(placing).startswith("Done")
    after = placing.scene().positions[order]
    assert np.allclose(after[2:], places[2:], atol=1e-6)
    assert np.linalg.norm(after[1] - places[2]) < placing.env.config.task.radius
    assert after[0, 2] < 0.03


def test_on_its_way_back_the_gripper_takes_nothing(placing):
    placing.shuffle(7)
    order = np.argsort(placing.scene().targets, kind="stable").tolist()
    names = [placing.object_names()[index] for index in order]
    steps = carry(placing, names)
    placing.shuffle(7)
    placing.say(f"pick {names[0]} and place it to the same position as {names[2]}")
    for _ in range(steps - 1):
        placing.step()
    placing.say(f"no, {names[1]}")
    for _ in range(15):  # the gripper had begun to close
        placing.step()
        assert placing.env.held is None


@pytest.mark.slow
def test_an_unreachable_pointing_target_changes_nothing(reaching):
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


def test_a_moved_object_is_reached_at_its_new_place(reaching):
    reaching.put_object(0, np.array([0.4, -0.25]))
    for _ in range(5):
        reaching.step()
    assert np.allclose(reaching.scene().positions[0, :2], (0.4, -0.25), atol=0.01)
    assert isinstance(reaching.say(f"reach {reaching.object_names()[0]}"), Plan)
    run_to_end(reaching)
    assert is_at(reaching, 0)


def test_objects_stay_in_the_object_area(reaching):
    reaching.put_object(0, np.array([9.0, 9.0]))
    x0, x1, y0, y1 = reaching.env.config.workspace.object_area
    x, y, _ = reaching.scene().positions[0]
    assert x0 <= x <= x1
    assert y0 <= y <= y1


def test_by_hand_the_gripper_reaches_its_target(reaching):
    reaching.set_driver("hand")
    reaching.move_hand(np.array([0.5, 0.2, 0.2]))
    for _ in range(40):
        reaching.step()
    assert np.allclose(reaching.env.gripper[0], (0.5, 0.2, 0.2), atol=0.02)
    reaching.set_driver("expert")


@pytest.mark.slow
def test_pick_and_place_instructions_succeed(placing):
    done = 0
    for _ in range(3):
        placing.shuffle()
        assert isinstance(placing.say(placing.example()), Plan), placing.example()
        done += run_to_end(placing).startswith("Done")
    assert done >= 2


def test_a_goal_that_is_not_a_target_is_refused(placing):
    names, targets = placing.object_names(), placing.scene().targets
    first, second = (names[index] for index in np.flatnonzero(~targets))
    result = placing.say(f"pick {first} and place it to the same position as {second}")
    assert not isinstance(result, Plan)
    assert "stands there" in result.message


@pytest.mark.slow
def test_the_robot_can_be_changed_and_a_bad_change_changes_nothing():
    session = Session(make_config(driver="expert"), seed=0)
    session.change(make_config(driver="expert", robot="panda"))
    assert session.env.config.robot.name == "panda"
    session.say(session.example())
    assert run_to_end(session).startswith("Done")
    with pytest.raises(ConfigError):
        session.change(make_config(driver="expert", overrides=["task.radius=-1"]))
    session.step()  # the environment still works
    session.close()


def test_without_a_policy_the_expert_drives():
    session = Session(make_config(task="press"), seed=0)
    assert session.config.driver == "expert"
    assert "press" in session.note
    with pytest.raises(ConfigError, match="no trained policy"):
        session.set_driver("policy")
    assert session.config.driver == "expert"
    session.close()


@pytest.mark.slow
@pytest.mark.parametrize(("task", "objects"), [("nl_push", 4), ("swipe", 4), ("nl_reach_gesture", 6)])
def test_the_default_number_of_objects_is_the_one_of_the_task(task, objects):
    session = Session(make_config(task=task, driver="expert"), seed=5)
    assert len(session.scene()) == objects
    session.say(session.example())
    assert run_to_end(session).startswith("Done")
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
def test_a_bad_choice_raises_an_error_of_one_line(given, message):
    with pytest.raises(ConfigError, match=message) as error:
        Session(make_config(**given))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("sentence", ["the {} pls", "now touch teh {}", "{}"])
def test_people_s_sentences_move_the_robot(reaching, sentence):
    reaching.say(sentence.format(reaching.object_names()[1].removeprefix("the ")))
    assert run_to_end(reaching).startswith("Done")
    assert is_at(reaching, 1)


def test_stop_stops_the_robot(reaching):
    reaching.say(f"reach {reaching.object_names()[0]}")
    reaching.step()
    assert reaching.busy
    reaching.say("stop!")
    assert not reaching.busy


def test_a_task_whose_gripper_holds_nothing_refuses_to_take(reaching):
    result = reaching.say(f"pls pick up {reaching.object_names()[0]}")
    assert not reaching.busy
    assert "choose another scene" in result.message


@pytest.mark.slow
def test_the_session_says_whose_left_is_meant(reaching):
    assert reaching.config.workspace == "collabtable"
    assert "robot's" in reaching.whose_left
    session = Session(make_config(task="reach_gesture", objects=3), seed=5)
    assert "yours" in session.whose_left
    session.close()


def test_an_object_is_moved_by_steps_to_where_the_table_ends(reaching):
    start = reaching.scene().positions[1]
    reaching.nudge_object(1, (0.0, -1.0, 0.0))
    assert np.allclose(reaching.scene().positions[1, :2], start[:2] - [0.0, 0.02], atol=1e-6)
    for _ in range(60):
        reaching.nudge_object(1, (0.0, -1.0, 0.0))
    assert reaching.scene().positions[1, 1] == pytest.approx(reaching.env.config.workspace.object_area[2], abs=1e-6)


def test_policy_and_expert_are_both_asked_and_the_driver_alone_drives(reaching):
    reaching.say(f"reach {reaching.object_names()[0]}")
    run_to_end(reaching)
    assert reaching.view.intents == {}
    reaching.compares = True
    try:
        reaching.say(f"reach {reaching.object_names()[1]}")
        while not reaching.view.intents:
            reaching.step()
        before = reaching.env.commanded_gripper[0]
        reaching.step()
        assert list(reaching.view.intents) == ["policy", "expert"]
        moves = {name: intent.move for name, intent in reaching.view.intents.items()}
        assert np.allclose(reaching.env.commanded_gripper[0] - before, moves["expert"], atol=1e-6)  # it drives
        assert not np.allclose(moves["policy"], moves["expert"], atol=1e-4)
        run_to_end(reaching)
        assert reaching.view.intents == {}
    finally:
        reaching.compares = False


@pytest.fixture(scope="module")
def trained():
    session = Session(make_config(task="nl_pick_and_place"), seed=3)
    assert session.has_policy
    yield session
    session.close()


def test_what_the_policy_has_not_learned_the_expert_does_and_undoes(trained):
    """Stacking is no instruction of this task, and no policy has seen a cube that stands on another one."""
    loose = [i for i, target in enumerate(trained.scene().targets) if not target]
    low, top = loose[:2]
    names, starts = trained.object_names(), trained.scene().positions
    for sentence, upper, lower in ((f"put {names[top]} on {names[low]}", top, low), ("the other way round", low, top)):
        trained.say(sentence)
        assert run_to_end(trained).startswith("Done")
        upper_place, lower_place = trained.scene().positions[[upper, lower]]
        assert np.allclose(upper_place - lower_place, (0, 0, trained.env.config.task.object_size), atol=0.01)
    for _ in range(2):
        trained.say("undo")
        assert run_to_end(trained).startswith("Done")
    assert np.allclose(trained.scene().positions[loose[:2]], starts[loose[:2]], atol=0.03)


@pytest.mark.parametrize("second_try", [True, False])
def test_the_expert_tries_once_what_the_policy_did_not_manage(second_try):
    with closing(Session(make_config(second_try=second_try), seed=0)) as session:
        session._policy = lambda state: state.set("action", session.env.hold_action())
        sentence = session.sayable()[0]
        session.say(sentence)
        assert session.acting == "policy"
        ended = run_to_end(session)
        assert ended.startswith("Done") == second_try
        assert session.view.outcome_counts["out of time"] == 1
        assert session.view.outcome_counts["success"] == second_try
        (step,) = session.view.steps
        assert step.words.endswith("in a second try, by the expert") == second_try
        session.say(sentence)
        assert session.acting == "policy"
