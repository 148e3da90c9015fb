"""The page in a real browser: people load it, type, answer, click, correct, change the robot, and leave."""

import time

import numpy as np
import pytest

pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

from demo.session import Session
from demo.session_config import make_config
from demo.splash_page import CAMERA, FIELD_OF_VIEW, LOOK_AT
from tools.browser import CHROMIUM, SIZE, PageTab, PlayServer, headless_browser

LIKELY = r"(?:[6-9]\d|100)%"
FREE = (0.4, -0.22, 0.025)  # metres: where nothing stands in the first scene

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")


@pytest.fixture(scope="module")
def server():
    """The page, driven by the expert, which takes no time to load."""
    server = PlayServer("--seed", "3", "driver=expert")
    yield server
    errors = server.close()
    assert server.process.returncode == 0
    assert "Traceback" not in errors


@pytest.fixture(scope="module")
def browser():
    with headless_browser() as browser:
        yield browser


@pytest.fixture(scope="module")
def first_scene():
    """Where the objects stand at first, metres: the same seed, the same scene."""
    session = Session(make_config(driver="expert"), seed=3)
    yield session.scene().positions
    session.close()


def seen_at(place):
    """The pixel (x, y) of a place (3,), metres."""
    ahead = np.subtract(LOOK_AT, CAMERA) / np.linalg.norm(np.subtract(LOOK_AT, CAMERA))
    right = np.cross(ahead, [0, 0, 1]) / np.linalg.norm(np.cross(ahead, [0, 0, 1]))
    from_eye = np.subtract(place, CAMERA)
    x, y, depth = (from_eye @ axis for axis in (right, np.cross(ahead, right), ahead))
    focal = SIZE[1] / 2 / np.tan(FIELD_OF_VIEW / 2)
    return SIZE[0] / 2 + focal * x / depth, SIZE[1] / 2 + focal * y / depth


@pytest.fixture(scope="module")
def page(server, browser):
    return PageTab(browser, server.address)


def test_an_object_that_is_clicked_is_pointed_at_and_reached(page, first_scene):
    name = page.object_names()[1]
    page.tab.mouse.click(*seen_at(first_scene[1]))
    page.wait_for_text("pointed at")
    page.wait_for_text(f"^{name}: {LIKELY}")
    page.press("Go where I point")
    page.wait_for_text("the policy hears")
    page.wait_for_text("Done in")


def test_an_object_that_is_dragged_lies_under_the_mouse_where_it_is_let_go(page, first_scene):
    name, place = page.object_names()[0], FREE
    (x, y), mouse = seen_at(place), page.tab.mouse
    mouse.move(*seen_at(first_scene[0]))
    mouse.down()
    mouse.move(x, y, steps=5)
    mouse.up()
    page.press("Stop")
    page.wait_for_text("Stopped")
    mouse.click(x, y)
    page.wait_for_text(f"^{name}: {LIKELY}")


def test_a_still_and_a_film_can_be_taken_home(page):
    page.press("Record")
    page.press("Picture")
    assert page.download("deixis.png")[:8] == b"\x89PNG\r\n\x1a\n"
    page.press("Start video")
    time.sleep(1)
    page.press("Stop video")
    assert page.download("deixis.mp4")[4:8] == b"ftyp"


def test_a_sentence_is_understood_while_it_is_typed_and_done_on_enter(page):
    name = page.object_names()[0]
    page.type_sentence(f"reach {name}")
    page.wait_for_text(f"understood: reach {name}")
    assert page.say_and_wait(f"reach {name}") == "Done in"


def test_nonsense_is_told_where_it_goes_wrong_and_never_run(page):
    page.say("<img src=x onerror=alert(1)> jump")
    page.wait_for_text("is not understood")
    assert page.tab.locator("img[src=x]").count() == 0


def test_an_open_sentence_is_asked_back_and_the_answer_is_done(page):
    names = page.object_names()
    page.say("reach the object")
    page.wait_for_text("Do you mean")
    assert page.say_and_wait(names[1]) == "Done in"
    page.wait_for_text(f'the policy hears: "reach {names[1]}"')


def test_a_correction_in_motion_changes_what_is_meant(page):
    names = page.object_names()
    page.say(f"reach {names[0]}")
    page.say(f"no, {names[2]}")
    page.wait_for_text(f'the policy hears: "reach {names[2]}"')
    page.wait_for_text("Done in")


def test_arrow_keys_move_the_finger_but_not_while_a_sentence_is_typed(page):
    page.press("Shuffle")
    page.wait_for_text("Nothing yet")
    page.type_sentence("reach")
    page.field("Say").press("ArrowLeft")
    time.sleep(0.5)
    assert not page.tab.get_by_text("pointed at").count()
    page.tab.evaluate("document.activeElement.blur()")
    page.tab.keyboard.press("ArrowLeft")
    page.wait_for_text("pointed at")


def test_another_robot_comes_when_it_is_chosen(page):
    page.choose("Robot", "panda")
    page.press("Change")
    page.wait_for_text("Try: reach")
    assert page.say_and_wait(f"reach {page.object_names()[0]}") == "Done in"


def test_two_tabs_see_the_same_and_one_may_go(server, browser, page):
    name = page.object_names()[1]
    other = PageTab(browser, server.address)
    assert other.say_and_wait(f"reach {name}") == "Done in"
    other.tab.close()
    page.wait_for_text(f'the policy hears: "reach {name}"')
    page.wait_for_text("Done in")


def test_it_is_the_same_after_a_reload(page):
    page.tab.reload()
    page.field("Say").wait_for()
    page.wait_for_text("Done in")
    page.say(f"reach {page.object_names()[0]}")
    page.press("Stop")
    page.wait_for_text("Stopped")


def test_the_clock_goes(page):
    assert 0.2 < page.clock() <= 1.05  # 1.00 where nothing runs beside it: python -m benchmarks.page start
