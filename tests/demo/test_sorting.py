"""Sessions in which every object of a colour is sorted to a marked place, by the expert."""

import numpy as np
import pytest

from demo.room import room_of
from envs.tasks.sort import is_sorted
from tests.helpers.sessions import run_to_end, session_fixture

SHUFFLES = 60  # until a scene has what is asked for


sorting = session_fixture(task="nl_sort", driver="expert")
room = session_fixture(task="anything", driver="expert")


def steps_of(session):
    """The policy's words for each step, until the last one has ended."""
    heard = []
    while session.busy:
        heard.append(session.view.policy_sentence)
        session.step()
    assert session.view.status.startswith("Done")
    return list(dict.fromkeys(heard))


def all_sorted(session, members, mark):
    return is_sorted(session.scene().positions[members], mark, 0.05).all()


def mark_of(session):
    scene = session.env.scene()
    return scene.positions[scene.targets.argmax()].copy()


@pytest.mark.slow
@pytest.mark.parametrize("command", [None, "gather every {} cube at {}", "put all {} cubes at the target"])
def test_every_object_of_a_colour_is_sorted_in_the_task_of_its_own(sorting, command):
    sorting.shuffle()
    mark, example, counted = mark_of(sorting), sorting.example(), sorting.view.outcome_counts["success"]
    assert example.startswith("sort every ")
    color, place = example.split()[2], example.split(" to ")[1]
    said = sorting.say(example if command is None else command.format(color, place))
    assert sorting.busy, said.message
    members = [i for i, thing in enumerate(sorting.scene()) if thing.color == color and thing.role == "real"]
    heard = steps_of(sorting)
    assert all_sorted(sorting, members, mark)
    assert sorting.view.outcome_counts["success"] == counted + len(members)
    assert all(each.startswith("sort the ") for each in heard)
    assert "there already" in sorting.say(example).message
    assert not sorting.busy


def test_sorting_with_the_brings_one_object(sorting):
    sorting.shuffle()
    names, mark = sorting.object_names(), mark_of(sorting)
    scene = sorting.scene()
    thing = next(i for i in range(len(scene)) if not scene.targets[i] and names[i].startswith("the "))
    sorting.say(f"bring {names[thing]} to {names[scene.targets.argmax()]}")
    assert run_to_end(sorting).startswith("Done")
    assert all_sorted(sorting, [thing], mark)


@pytest.mark.slow
@pytest.mark.parametrize("command", ["sort every {} cube to the transparent cube", "gather all {} cubes at the target"])
def test_policies_that_place_things_sort_them_step_by_step(room, command):
    color, members = same_colour(room)
    mark = mark_of(room)
    said = room.say(command.format(color))
    assert room.busy, said.message
    heard = steps_of(room)
    assert all(each.startswith("pick the ") for each in heard)
    assert all_sorted(room, members, mark)
    places = room.scene().positions[members]
    apart = np.linalg.norm(places[:, None] - places, axis=-1) + np.eye(len(places))
    assert apart.min() > 0.06
    assert np.allclose(mark_of(room), mark), "the mark stands at its own place again"


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["stop", "gather all {} cubes at the target"])
def test_the_mark_returns_where_sorting_is_stopped_or_asked_for_again(room, ending):
    color, members, mark = sorting_beside_the_mark(room)
    room.say(ending.format(color))
    while room.busy:
        room.step()
    assert np.allclose(mark_of(room), mark)
    assert ending == "stop" or all_sorted(room, members, mark)


def test_a_mark_that_the_person_moves_meanwhile_stays_there(room):
    sorting_beside_the_mark(room)
    index, place = int(room.scene().targets.argmax()), np.array([0.4, 0.1])
    room.put_object(index, place)
    assert np.allclose(room.scene().positions[index, :2], place)
    room.say("stop")
    assert np.allclose(mark_of(room)[:2], place)


@pytest.mark.slow
@pytest.mark.parametrize("command", ["sort every {} cube to the transparent cube", "gather all {} cubes at the target"])
@pytest.mark.parametrize(("away", "stays"), [(0.11, True), (0.145, False)])  # metres of one cube from the mark
def test_a_cube_near_the_mark_stays_if_it_is_sorted_and_else_goes_to_another_spot(room, command, away, stays):
    color, (near, far), mark = open_mark(room)
    place = mark + [0.0, away]
    room.put_object(near, place)
    said = room.say(command.format(color))
    assert room.busy, said.message
    while room.busy:
        room.step()
    assert room.view.status.startswith("Done")
    assert all_sorted(room, [near, far], [*mark, 0.025])
    assert np.allclose(room.scene().positions[near, :2], place, atol=0.005) == stays


@pytest.mark.slow
@pytest.mark.parametrize("command", ["sort every {} cube to the transparent cube", "gather all {} cubes at the target"])
def test_where_no_room_is_left_at_the_mark_the_session_says_so(room, command, monkeypatch):
    monkeypatch.setattr("envs.tasks.sort.SPOTS", np.zeros((1, 2)))
    color, _, _ = open_mark(room)
    room.say(command.format(color))
    while room.busy:
        room.step()
    assert "no more room" in room.view.status


def open_mark(session):
    """Puts everything aside from a mark, two cubes of a colour nearer than the rest. Returns colour, cubes and mark."""
    x0, x1, y0, y1 = session.env.config.workspace.object_area
    mark = np.array([(x0 + x1) / 2, y0 + 0.11])
    aside = [np.array([x, y]) for y in (y1, y1 - 0.085) for x in np.linspace(x0, x1, 3)]
    color, members = two_alike(session)
    found, scene = room_of(session.env), session.scene()
    session.put_object(int(scene.targets.argmax()), mark)
    for index in np.flatnonzero(found.loose).tolist():
        session.put_object(index, aside.pop())
    session.put_object(members[1], np.array([x0, mark[1] + 0.14]))
    return color, members, mark


def sorting_beside_the_mark(session):
    """Sorts until the mark stands at a free spot. Returns the colour, the members, and the mark's own place."""
    for _ in range(SHUFFLES):
        color, members = two_alike(session)
        mark = mark_of(session)
        session.say(f"gather all {color} cubes at the target")
        while session.busy:
            if not np.allclose(mark_of(session), mark):
                return color, members, mark
            session.step()
    raise AssertionError("the mark never moved")


def two_alike(session):
    """As `same_colour`, with two cubes of the colour."""
    while True:
        color, members = same_colour(session)
        if len(members) == 2:
            return color, members


def same_colour(session):
    """Draws a scene in which two cubes or more of a colour can be put at a free mark. Returns colour and indices."""
    for _ in range(SHUFFLES):
        session.shuffle()
        found, scene = room_of(session.env), session.scene()
        ready = found.ready & found.level & (scene.nouns == 0)
        for color in dict.fromkeys(scene[int(i)].color for i in np.flatnonzero(ready)):
            alike = [i for i, thing in enumerate(scene) if thing.color == color and found.loose[i]]
            if len(alike) > 1 and ready[alike].all() and found.free_targets().any():
                return color, alike
    raise AssertionError("no scene has two cubes of a colour")


def test_what_cannot_be_sorted_says_why(room):
    while "green" in {thing.color for thing in room.scene()}:  # a colour for which no other one is taken
        room.shuffle()
    assert "only marks a place" in room.say("sort every transparent cube to the transparent cube").message
    assert "no green cube" in room.say("sort every green cube to the transparent cube").message
    assert not room.busy
