"""The page in a headless browser: typing, answers, clicks, corrections, changes and several tabs."""

import time

import numpy as np
import pytest

pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

from demo.session import Session
from demo.session_config import make_config
from demo.splash_page import CAMERA, FIELD_OF_VIEW, LOOK_AT
from tools.browser import CHROMIUM, SIZE, PageTab, PlayServer, headless_browser

LIKELY = r"(?:[6-9]\d|100)%"  # 60 % or more
FREE_PLACE = (0.4, -0.22, 0.025)  # metres: no object is near it in the first scene

pytestmark = [pytest.mark.slow, pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")]


@pytest.fixture(scope="module")
def server():
    """The page, driven by the expert, which loads faster than a policy."""
    server = PlayServer("--seed", "3", "driver=expert", "task=nl_reach")
    yield server
    errors = server.close()
    assert server.process.returncode == 0
    assert "Traceback" not in errors
    assert "were dropped" not in errors  # the page takes all that a browser sends


@pytest.fixture(scope="module")
def browser():
    with headless_browser() as browser:
        yield browser


@pytest.fixture(scope="module")
def first_scene():
    """(K, 3) positions of the objects in the first scene, metres; the seed is that of the server."""
    session = Session(make_config(driver="expert"), seed=3)
    yield session.scene().positions
    session.close()


def pixel_of(place):
    """The pixel (x, y) of the tab that shows a place (3,), metres."""
    ahead = np.subtract(LOOK_AT, CAMERA) / np.linalg.norm(np.subtract(LOOK_AT, CAMERA))
    right = np.cross(ahead, [0, 0, 1]) / np.linalg.norm(np.cross(ahead, [0, 0, 1]))
    from_eye = np.subtract(place, CAMERA)
    x, y, depth = (from_eye @ axis for axis in (right, np.cross(ahead, right), ahead))
    focal = SIZE[1] / 2 / np.tan(FIELD_OF_VIEW / 2)
    return SIZE[0] / 2 + focal * x / depth, SIZE[1] / 2 + focal * y / depth


@pytest.fixture(scope="class")
def page_of_a_room(browser):
    """The page of a server that begins in a room, and that ends without an error."""
    server = PlayServer("--seed", "3", "driver=expert", "task=anything")
    page = PageTab(browser, server.address, blank=True)
    yield page
    page.tab.close()  # an open one goes on drawing
    errors = server.close()
    assert "Traceback" not in errors
    assert "were dropped" not in errors


class TestRoom:
    """One server for both, which ends with them: an open tab goes on drawing."""

    def test_a_click_says_what_is_listed_in_a_room_and_another_task_leaves_the_room(self, page_of_a_room):
        page = page_of_a_room
        sentence = page.wait_for_text("^(open|close) the ")
        page.press(sentence)
        page.wait_for_text(f"understood: {sentence.split()[0]}")
        page.wait_for_text("Done in")
        other = {"open": "close", "close": "open"}[sentence.split()[0]]
        page.wait_for_text(f"^{other} {sentence.split(maxsplit=1)[1]}$")
        page.choose("Task", "nl_reach")
        page.press("Change")
        page.wait_for_text("Try: reach")
        assert page.field("Workspace").input_value() == "collabtable"

    def test_commands_on_the_board_are_carried_out_and_the_page_tells_whose_left_is_meant(self, page_of_a_room):
        page = page_of_a_room
        page.choose("Task", "rearrange")
        page.press("Change")
        page.wait_for_text("left and right are the robot's")
        example = page.wait_for_text("^Try: (?!reach)").removeprefix("Try: ")
        assert page.say_and_wait(example) == "Done in"
        page.wait_for_text("understood: lift")
        page.say("reach the red cube")
        page.wait_for_text("moves nothing on a board")


@pytest.fixture(scope="module")
def page(server, browser):
    return PageTab(browser, server.address, blank=True)


def test_a_clicked_object_is_pointed_at_and_reached(page, first_scene):
    name = page.object_names()[1]
    page.tab.mouse.click(*pixel_of(first_scene[1]))
    page.wait_for_text("pointed at")
    page.wait_for_text(f"^{name}: {LIKELY}")
    page.press("Go where I point")
    page.wait_for_text("the policy hears")
    page.wait_for_text("Done in")


def test_a_dragged_object_follows_the_mouse(page, first_scene):
    name, place = page.object_names()[0], FREE_PLACE
    (x, y), mouse = pixel_of(place), page.tab.mouse
    mouse.move(*pixel_of(first_scene[0]))
    mouse.down()
    mouse.move(x, y, steps=5)
    mouse.up()
    page.press("Stop")
    page.wait_for_text("Stopped")
    mouse.click(x, y)
    page.wait_for_text(f"^{name}: {LIKELY}")


def test_a_picture_and_a_video_can_be_downloaded(page):
    page.press("Record")
    page.press("Picture")
    assert page.download("deixis.png")[:8] == b"\x89PNG\r\n\x1a\n"
    page.press("Start video")
    time.sleep(1)
    page.press("Stop video")
    assert page.download("deixis.mp4")[4:8] == b"ftyp"


def test_a_sentence_is_interpreted_while_typed_and_done_on_enter(page):
    name = page.object_names()[0]
    page.type_sentence(f"reach {name}")
    page.wait_for_text(f"understood: reach {name}")
    assert page.say_and_wait(f"reach {name}") == "Done in"


def test_nonsense_gets_a_message_and_its_html_is_escaped(page):
    page.say("<img src=x onerror=alert(1)> jump")
    page.wait_for_text("I do not know the words 'img")
    assert page.tab.locator("img[src=x]").count() == 0


def test_an_ambiguous_sentence_gets_a_question_and_the_answer_is_done(page):
    names = page.object_names()
    page.say("reach the object")
    page.wait_for_text("Do you mean")
    assert page.say_and_wait(names[1]) == "Done in"
    page.wait_for_text(f'the policy hears: "reach {names[1]}"')


def test_a_correction_during_motion_changes_the_referent(page):
    names = page.object_names()
    page.say(f"reach {names[0]}")
    page.say(f"no, {names[2]}")
    page.wait_for_text(f'the policy hears: "reach {names[2]}"')
    page.wait_for_text("Done in")


def test_arrow_keys_move_the_finger_but_not_while_typing(page):
    page.press("Shuffle")
    page.wait_for_text("Nothing yet")
    page.type_sentence("reach")
    page.field("Say").press("ArrowLeft")
    time.sleep(0.5)
    assert not page.tab.get_by_text("pointed at").count()
    page.tab.evaluate("document.activeElement.blur()")
    page.tab.keyboard.press("ArrowLeft")
    page.wait_for_text("pointed at")


def test_the_robot_can_be_changed(page):
    page.choose("Robot", "panda")
    page.press("Change")
    page.wait_for_text("Try: reach")
    assert page.say_and_wait(f"reach {page.object_names()[0]}") == "Done in"


def test_two_tabs_show_the_same_scene_and_one_can_be_closed(server, browser, page):
    name = page.object_names()[1]
    other = PageTab(browser, server.address, blank=True)
    assert other.say_and_wait(f"reach {name}") == "Done in"
    other.tab.close()
    page.wait_for_text(f'the policy hears: "reach {name}"')
    page.wait_for_text("Done in")


def test_a_reload_keeps_the_state(page):
    page.say(f"reach {page.object_names()[0]}")
    page.wait_for_text("Done in")
    page.tab.reload()
    page.field("Say").wait_for()
    page.wait_for_text("Done in")
    page.say(f"reach {page.object_names()[0]}")
    page.press("Stop")
    page.wait_for_text("Stopped")


def test_the_clock_runs(page):
    assert 0.2 < page.clock() <= 1.05  # 1.00 on an idle machine: python -m benchmarks.page start
