"""The page and its server in a headless browser: conversation, clicks, corrections, changes and several tabs."""

import re
import time

import numpy as np
import pytest

pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

from demo.session import Session
from demo.session_config import make_config
from demo.splash_page import CAMERA, FIELD_OF_VIEW, LOOK_AT
from tools.browser import CHROMIUM, PageTab, PlayServer, headless_browser

LIKELY = r"(?:[6-9]\d|100)%"  # 60 % or more
FREE_PLACE = (0.4, -0.22, 0.025)  # metres: no object is near it in the first scene
NOTE_OFFERS = """() => {
    window.offered = [];
    new MutationObserver(() => {
        const told = [...document.querySelectorAll(".entry")].at(-1)?.textContent.includes("This is a new scene");
        if (told) window.offered.push([...document.querySelectorAll("#chips .chip")].map(chip => chip.innerText));
    }).observe(document.getElementById("log"), {childList: true});
}"""  # the sentences that the page offers at the moment when it tells of a new scene

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
def page(server):
    with headless_browser() as browser:
        yield PageTab(browser, server.address, blank=True)


@pytest.fixture(scope="module")
def first_scene():
    """(K, 3) positions of the objects in the first scene, metres; the seed is that of the server."""
    session = Session(make_config(driver="expert", task="nl_reach"), seed=3)
    yield session.scene().positions
    session.close()


def pixel_of(page, place):
    """The pixel (x, y) of the tab that shows a place (3,), metres."""
    box = page.tab.locator("#scene").bounding_box()
    ahead = np.subtract(LOOK_AT, CAMERA) / np.linalg.norm(np.subtract(LOOK_AT, CAMERA))
    right = np.cross(ahead, [0, 0, 1]) / np.linalg.norm(np.cross(ahead, [0, 0, 1]))
    from_eye = np.subtract(place, CAMERA)
    x, y, depth = (from_eye @ axis for axis in (right, np.cross(ahead, right), ahead))
    focal = box["height"] / 2 / np.tan(FIELD_OF_VIEW / 2)
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    return middle[0] + focal * x / depth, middle[1] + focal * y / depth


def test_a_clicked_object_is_pointed_at_and_reached(page, first_scene):
    page.open_lab("Attention")
    name = page.object_names()[1]
    page.tab.mouse.click(*pixel_of(page, first_scene[1]))
    page.wait_for_text(f"^{name}: {LIKELY}")
    page.press("Go where I point")
    page.wait_for_turn("Done in")


def test_a_dragged_object_follows_the_mouse(page, first_scene):
    name, place = page.object_names()[0], FREE_PLACE
    (x, y), mouse = pixel_of(page, place), page.tab.mouse
    mouse.move(*pixel_of(page, first_scene[0]))
    mouse.down()
    mouse.move(x, y, steps=5)
    mouse.up()
    time.sleep(0.5)
    mouse.click(x, y)
    page.wait_for_text(f"^{name}: {LIKELY}")


def test_a_picture_and_a_video_can_be_downloaded(page):
    page.open_lab("Record")
    assert page.download("Picture")[:8] == b"\x89PNG\r\n\x1a\n"
    page.press("Start video")
    time.sleep(1)
    assert page.download("Stop video")[4:8] == b"ftyp"


def test_a_sentence_is_interpreted_while_typed_and_done_on_enter(page):
    name = page.object_names()[0]
    page.type_sentence(f"reach {name}")
    page.tab.locator("#preview", has_text=f"reach {name}").wait_for()
    assert page.say_and_wait(f"reach {name}") == "Done"
    assert page.tab.evaluate("document.activeElement.id") == "say"
    page.tab.press("#say", "ArrowUp")
    assert page.tab.input_value("#say") == f"reach {name}"
    page.tab.press("#say", "ArrowDown")
    assert page.tab.input_value("#say") == ""


def test_nonsense_gets_a_refusal_whose_html_is_escaped_and_two_suggestions(page):
    page.say("<img src=x onerror=alert(1)> jump")
    page.wait_for_turn("I do not know the words 'img")
    assert page.tab.locator("img[src=x]").count() == 0
    assert 1 <= page.tab.locator(".entry").last.locator(".chip").count() <= 2
    assert "Done" not in page.tab.locator(".entry").last.inner_text()


def test_an_ambiguous_sentence_gets_a_question_whose_answer_is_a_click(page):
    name = page.object_names()[1]
    page.say("reach the object")
    page.wait_for_turn("Do you mean")
    page.tab.locator(".entry").last.get_by_role("button", name=name).click()
    page.wait_for_turn("Done in")
    page.wait_for_text(f'the policy hears: "reach {name}"')
    assert page.tab.locator(".offers .chip").count() == 0  # an old question cannot be answered


def test_a_correction_during_motion_changes_the_referent(page):
    names = page.object_names()
    page.say(f"reach {names[0]}")
    page.say(f"no, {names[2]}")
    page.wait_for_text(f'the policy hears: "reach {names[2]}"')
    page.wait_for_turn("Done in")
    assert "Stopped" in page.tab.locator(".entry").nth(-2).inner_text()


def test_arrow_keys_in_the_picture_move_the_finger(page):
    page.press("New scene")
    page.wait_for_turn("This is a new scene")
    page.wait_for_text("Nothing yet")
    page.tab.locator("#scene").focus()
    page.tab.frame_locator("#scene").locator("body").press("ArrowLeft")
    page.tab.locator("#lab h3", has_text="Pointed at").wait_for()


def test_the_sentences_of_a_new_scene_are_offered_when_it_is_told(page):
    page.tab.evaluate(NOTE_OFFERS)
    for count in (1, 2, 3):
        page.say("hello")  # without another entry between, the same note is not told twice
        page.wait_for_turn("Hello! I am a robot arm")
        page.press("New scene")
        page.tab.wait_for_function("count => window.offered.length === count", arg=count)
        offered = page.tab.evaluate("window.offered.at(-1)")
        page.tab.wait_for_timeout(500)  # several control steps later
        assert offered == page.tab.locator("#chips .chip").all_inner_texts()


def test_the_robot_can_be_changed_and_the_page_says_who_drives(page):
    page.choose("Robot", "panda")
    assert "The scripted expert drives" in page.wait_for_turn("robot panda, task nl_reach")
    assert page.say_and_wait(f"reach {page.object_names()[0]}") == "Done"


def test_two_tabs_show_the_same_conversation_and_a_reload_keeps_it(server, page):
    name = page.object_names()[1]
    other = PageTab(page.tab.context.browser, server.address, blank=True)
    assert other.say_and_wait(f"reach {name}") == "Done"
    assert name in page.wait_for_turn("Done in")
    other.tab.reload()
    other.wait_until_ready()
    assert name in other.wait_for_turn("Done in")
    other.tab.close()


def test_the_clock_runs(page):
    assert 0.2 < page.clock() <= 1.05  # 1.00 on an idle machine: python -m benchmarks.page start


def test_a_click_says_what_is_listed_in_a_room(page):
    page.choose("Robot", "kuka")
    page.wait_for_turn("robot kuka")
    page.choose("Scene", "anything")
    page.wait_for_turn("task anything")
    chip = page.tab.locator("#chips .chip", has_text=re.compile("^(open|close) the ")).first
    verb, thing = chip.inner_text().split(maxsplit=1)
    chip.click()
    page.wait_for_turn(f"{verb} {thing}")
    page.wait_for_turn("Done in")
    page.tab.locator("#chips .chip", has_text=f"{'open' if verb == 'close' else 'close'} {thing}").wait_for()


def test_commands_on_the_board_are_carried_out_and_the_page_tells_whose_left_is_meant(page):
    page.choose("Scene", "rearrange")
    page.wait_for_turn("task rearrange")
    assert page.tab.get_by_label("my left", exact=True).is_checked()
    example = page.tab.locator("#chips .chip").first.inner_text()
    assert page.say_and_wait(example) == "Done"
    page.tab.get_by_label("the robot's left").check()
    page.wait_for_turn("left and right are the robot's")
    page.say("reach " + re.search(r"the \w+ (?:cube|pyramid|block)", example)[0])
    page.wait_for_turn("moves nothing on a board")
