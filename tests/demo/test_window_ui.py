"""The session driven with keys alone, as PyBullet's window passes them on."""

import pytest

from demo.session import Session
from demo.session_config import make_config
from demo.window_ui import HELP, WindowUI
from human import RecordingDisplay


class Typist:
    """Presses what it was told, a list of keys a control step, then Escape once `until` holds."""

    def __init__(self, steps, until=lambda: True):
        self._steps, self._until, self._patience = list(steps), until, 400

    def poll(self):
        if self._steps:
            return list(self._steps.pop(0))
        self._patience -= 1
        assert self._patience, "it never came to that"
        return ["escape"] if self._until() else []

    def escape_pressed(self):
        return False


@pytest.fixture(scope="module")
def stood():
    session = Session(make_config(driver="expert"), seed=3)
    yield session
    session.close()


@pytest.fixture
def session(stood):
    stood.set_driver("expert")
    stood.shuffle()
    return stood


def driven(session, *steps, until=lambda: True):
    """The pages that a person saw who pressed this."""
    view = RecordingDisplay()
    WindowUI(session, Typist(steps, until), view, real_time=False).run()
    return view


def test_a_sentence_is_typed_mended_and_done(session):
    name = session.object_names()[1]
    view = driven(session, f"reach {name}x", ["backspace"], ["enter"], until=lambda: "Done" in session.view.status)
    assert f"> reach {name}x_" in view.pages[0]
    assert f"> reach {name}_" in view.pages[1]
    assert "> _" in view.pages[2]
    assert session.view.highlighted == (1,)
    assert all(page[: len(HELP)] == list(HELP) for page in view.pages)


def test_what_is_not_understood_is_told_until_the_next_thing_is_done(session):
    view = driven(session, "jump", ["enter"], [], ["f1"])
    assert any("is not understood" in line for line in view.pages[2])
    assert not any("is not understood" in line for line in view.pages[3])
    assert not session.busy


def test_the_finger_is_moved_to_an_object_which_the_robot_then_reaches(session):
    x, y = session.scene().positions[0, :2]
    down = [["down" if y < 0 else "up"]] * round(abs(y) / 0.02)
    across = [["left" if x < 0.45 else "right"]] * round(abs(x - 0.45) / 0.02)
    view = driven(session, *down, *across, ["f3"], until=lambda: "Done" in session.view.status)
    assert session.view.highlighted == (0,)
    assert view.beam is not None
    assert view.beam[1][2] == pytest.approx(0, abs=1e-9)  # it ends on the table
    assert any(line.startswith(f"pointed at: {session.object_names()[0]}") for line in view.pages[-1])


def test_nothing_is_gone_to_before_something_is_pointed_at(session):
    view = driven(session, ["f3"])
    assert any("point at something first" in line for line in view.pages[0])


def test_the_gripper_is_driven_by_hand_and_shut(session):
    before = session.env.gripper[0].copy()
    view = driven(session, ["f4"], ["f5"], *[["up"]] * 5, until=lambda: session.env.gripper[0, 1] > before[1] + 0.08)
    assert session.config.driver == "hand"
    assert session.gripper_closed
    assert any("driven by: hand, gripper closed" in line for line in view.pages[-1])
    driven(session, ["f4"])
    assert session.config.driver == "policy"


def test_another_scene_takes_the_ray_away(session):
    view = driven(session, ["pageup"], ["f2"])
    assert view.beam is None
