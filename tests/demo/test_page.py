"""The page in a real browser: people load it, type, answer, click, correct, change the robot, and leave."""

import time

import numpy as np
import pytest

pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

from benchmarks.visitor import CHROMIUM, SIZE, Served, Visitor, browsing
from demo.session import Session
from demo.session_config import choose
from demo.splash_page import CAMERA, LENS, LOOK_AT

LIKELY = r"(?:[6-9]\d|100)%"
FREE = (0.4, -0.22, 0.025)  # metres: where nothing stands in the first scene

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")


@pytest.fixture(scope="module")
def served():
    """The page, driven by the expert, which takes no time to load."""
    served = Served("--seed", "3", "driver=expert")
    yield served
    errors = served.close()
    assert served.process.returncode == 0
    assert "Traceback" not in errors


@pytest.fixture(scope="module")
def browser():
    with browsing() as browser:
        yield browser


@pytest.fixture(scope="module")
def first_scene():
    """Where the objects stand at first, metres: the same seed, the same scene."""
    session = Session(choose(driver="expert"), seed=3)
    yield session.scene().positions
    session.close()


def seen_at(place):
    """The pixel (x, y) of a place (3,), metres."""
    ahead = np.subtract(LOOK_AT, CAMERA) / np.linalg.norm(np.subtract(LOOK_AT, CAMERA))
    right = np.cross(ahead, [0, 0, 1]) / np.linalg.norm(np.cross(ahead, [0, 0, 1]))
    from_eye = np.subtract(place, CAMERA)
    x, y, depth = (from_eye @ axis for axis in (right, np.cross(ahead, right), ahead))
    focal = SIZE[1] / 2 / np.tan(LENS / 2)
    return SIZE[0] / 2 + focal * x / depth, SIZE[1] / 2 + focal * y / depth


@pytest.fixture(scope="module")
def visitor(served, browser):
    return Visitor(browser, served.address)


def test_an_object_that_is_clicked_is_pointed_at_and_reached(visitor, first_scene):
    name = visitor.objects()[1]
    visitor.tab.mouse.click(*seen_at(first_scene[1]))
    visitor.shows("pointed at")
    visitor.shows(f"^{name}: {LIKELY}")
    visitor.presses("Go where I point")
    visitor.shows("the policy hears")
    visitor.shows("Done in")


def test_an_object_that_is_dragged_lies_under_the_mouse_where_it_is_let_go(visitor, first_scene):
    name, place = visitor.objects()[0], FREE
    (x, y), mouse = seen_at(place), visitor.tab.mouse
    mouse.move(*seen_at(first_scene[0]))
    mouse.down()
    mouse.move(x, y, steps=5)
    mouse.up()
    visitor.presses("Stop")
    visitor.shows("Stopped")
    mouse.click(x, y)
    visitor.shows(f"^{name}: {LIKELY}")


def test_a_still_and_a_film_can_be_taken_home(visitor):
    visitor.presses("Record")
    visitor.presses("Still")
    assert visitor.takes("deixis.png")[:8] == b"\x89PNG\r\n\x1a\n"
    visitor.presses("Start filming")
    time.sleep(1)
    visitor.presses("Stop filming")
    assert visitor.takes("deixis.mp4")[4:8] == b"ftyp"


def test_a_sentence_is_understood_while_it_is_typed_and_done_on_enter(visitor):
    name = visitor.objects()[0]
    visitor.types(f"reach {name}")
    visitor.shows(f"understood: reach {name}")
    assert visitor.gets(f"reach {name}") == "Done in"


def test_nonsense_is_told_where_it_goes_wrong_and_never_run(visitor):
    visitor.says("<img src=x onerror=alert(1)> jump")
    visitor.shows("is not understood")
    assert visitor.tab.locator("img[src=x]").count() == 0


def test_an_open_sentence_is_asked_back_and_the_answer_is_done(visitor):
    names = visitor.objects()
    visitor.says("reach the object")
    visitor.shows("Do you mean")
    assert visitor.gets(names[1]) == "Done in"
    visitor.shows(f'the policy hears: "reach {names[1]}"')


def test_a_correction_in_motion_changes_what_is_meant(visitor):
    names = visitor.objects()
    visitor.says(f"reach {names[0]}")
    visitor.says(f"no, {names[2]}")
    visitor.shows(f'the policy hears: "reach {names[2]}"')
    visitor.shows("Done in")


def test_arrow_keys_move_the_finger_but_not_while_a_sentence_is_typed(visitor):
    visitor.presses("Shuffle")
    visitor.shows("Nothing yet")
    visitor.types("reach")
    visitor.field("Say").press("ArrowLeft")
    time.sleep(0.5)
    assert not visitor.tab.get_by_text("pointed at").count()
    visitor.tab.evaluate("document.activeElement.blur()")
    visitor.tab.keyboard.press("ArrowLeft")
    visitor.shows("pointed at")


def test_another_robot_comes_when_it_is_chosen(visitor):
    visitor.chooses("Robot", "panda")
    visitor.presses("Change")
    visitor.shows("Try: reach")
    assert visitor.gets(f"reach {visitor.objects()[0]}") == "Done in"


def test_two_tabs_see_the_same_and_one_may_go(served, browser, visitor):
    name = visitor.objects()[1]
    other = Visitor(browser, served.address)
    assert other.gets(f"reach {name}") == "Done in"
    other.tab.close()
    visitor.shows(f'the policy hears: "reach {name}"')
    visitor.shows("Done in")


def test_it_is_the_same_after_a_reload(visitor):
    visitor.tab.reload()
    visitor.field("Say").wait_for()
    visitor.shows("Done in")
    visitor.says(f"reach {visitor.objects()[0]}")
    visitor.presses("Stop")
    visitor.shows("Stopped")


def test_the_clock_goes(visitor):
    assert 0.2 < visitor.clock() <= 1.05  # 1.00 where nothing runs beside it: python -m benchmarks.page start
