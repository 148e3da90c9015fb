"""A session driven with keys only, as PyBullet's window reports them."""

import pytest

from demo.window_ui import HELP, WindowUI
from tests.helpers.keys import RecordingDisplay
from tests.helpers.sessions import session_fixture


class Typist:
    """Presses a list of keys per control step, then Escape once `until` holds."""

    def __init__(self, steps, until=lambda: True):
        self._steps, self._until, self._patience = list(steps), until, 400

    def poll(self):
        if self._steps:
            return list(self._steps.pop(0))
        self._patience -= 1
        assert self._patience, "the condition was never met"
        return ["escape"] if self._until() else []

    def escape_pressed(self):
        return False


module_session = session_fixture(driver="expert")


@pytest.fixture
def session(module_session):
    module_session.set_driver("expert")
    module_session.shuffle()
    return module_session


def run_keys(session, *steps, until=lambda: True):
    """Runs the user interface with these keys. Returns the display, with its pages."""
    display = RecordingDisplay()
    WindowUI(session, Typist(steps, until), display, real_time=False).run()
    return display


@pytest.mark.slow
def test_a_sentence_is_typed_edited_and_done(session):
    name = session.object_names()[1]
    display = run_keys(session, f"reach {name}x", ["backspace"], ["enter"], until=lambda: "Done" in session.view.status)
    assert f"> reach {name}x_" in display.pages[0]
    assert f"> reach {name}_" in display.pages[1]
    assert "> _" in display.pages[2]
    assert session.view.highlighted == (1,)
    assert all(page[: len(HELP)] == list(HELP) for page in display.pages)


def test_an_error_message_stays_until_the_next_action(session):
    display = run_keys(session, "jump", ["enter"], [], ["f1"])
    assert any("I cannot jump" in line for line in display.pages[2])
    assert not any("I cannot jump" in line for line in display.pages[3])
    assert not session.busy


def test_keys_move_the_finger_to_an_object_and_the_robot_reaches_it(session):
    x, y = session.scene().positions[0, :2]
    down = [["down" if y < 0 else "up"]] * round(abs(y) / 0.02)
    across = [["left" if x < 0.45 else "right"]] * round(abs(x - 0.45) / 0.02)
    display = run_keys(session, *down, *across, ["f3"], until=lambda: "Done" in session.view.status)
    assert session.view.highlighted == (0,)
    assert display.beam is not None
    assert display.beam[1][2] == pytest.approx(0, abs=1e-9)  # it ends on the table
    assert any(line.startswith(f"pointed at: {session.object_names()[0]}") for line in display.pages[-1])


def test_going_where_pointed_before_pointing_gives_a_message(session):
    display = run_keys(session, ["f3"])
    assert any("point at something first" in line for line in display.pages[0])


def test_by_hand_keys_move_and_close_the_gripper(session):
    before = session.env.gripper[0].copy()
    display = run_keys(
        session, ["f4"], ["f5"], *[["up"]] * 5, until=lambda: session.env.gripper[0, 1] > before[1] + 0.08
    )
    assert session.config.driver == "hand"
    assert session.gripper_closed
    assert any("driven by: hand, gripper closed" in line for line in display.pages[-1])
    run_keys(session, ["f4"])
    assert session.config.driver == "policy"


def test_shuffle_removes_the_ray(session):
    display = run_keys(session, ["pageup"], ["f2"])
    assert display.beam is None
