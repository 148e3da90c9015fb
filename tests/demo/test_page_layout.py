"""The page's own files in a browser, with made-up sections in place of a server: layout, names and contrast."""

import json
import os
from pathlib import Path

import pytest

pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

from demo.page_files import PageFiles
from tools.browser import CHROMIUM

pytestmark = [pytest.mark.slow, pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")]

AXE = Path(os.environ.get("AXE_CORE", "node_modules/axe-core/axe.min.js"))  # npm install axe-core
SCREENS = {"wide": (1280, 800), "tablet": (768, 1024), "phone": (390, 844), "phone with a keyboard": (390, 420)}
NAMES = ["the red cube", "the blue cube", "the drawer"]
STEPS = [{"words": "open the drawer", "state": "done"}, {"words": "put the red cube in the drawer", "state": "doing"}]
EMPTY = {"said": [], "understood": "", "steps": [], "text": "", "result": "", "offers": []}
SECTIONS = {
    "status": {
        **{"loading": False, "text": "Doing: put the red cube in the drawer", "busy": True, "note": "", "person": True},
        **{"driver": "policy", "policy": True, "acting": "expert", "hears": "put the red cube in the drawer"},
        **{"arm": "", "real": False, "stopped": False, "viewpoint": "human", "left": "left and right are yours"},
    },
    "choice": {
        "options": {name: ["kuka", "anything"] for name in ("robot", "control", "task", "workspace")},
        **{"policies": ["anything_kuka"], "most": 6, "scenes": [["drawer", "The drawer"]]},
        "shown": {
            "robot": "kuka",
            "control": "kuka",
            "task": "anything",
            "workspace": "kuka",
            "objects": 3,
            "run": "",
            "scene": "",
        },
    },
    "sayable": ["reach the red cube", "open the drawer", "put the blue cube on the red cube"],
    "clock": {"paused": False, "speed": 1.0, "rate": 1.0},
    "lab": {
        **{
            "names": NAMES,
            "movable": [0, 1],
            "attention": [0.1, 0.7, 0.2],
            "pointing": None,
            "outcomes": {"success": 2},
        },
        **{"rewards": {"progress": 0.5, "time": -0.1}, "step": 4},
    },
    "intents": {
        **{"compares": True, "policy": True},
        "of": {
            "policy": {"action": [0.5, 0.0, -1.0, 0.2], "move": [20.0, 0.0, -40.0]},
            "expert": {"action": [0.5, 0.1, -1.0, -1.0], "move": [20.0, 4.0, -40.0]},
        },
    },
    "hand": {"low": [0, 0, 0], "high": [1, 1, 1], "place": None, "closed": False},
    "recording": False,
    "sight": {
        **{"looks": False, "camera": "front", "cameras": ["front", "side"]},
        **{"picture": "", "lines": [], "looking": [], "note": ""},
    },
    "entry 0": {**EMPTY, "kind": "note", "text": "Say what the robot shall do."},
    "entry 1": {
        **{
            **EMPTY,
            "kind": "plan",
            "said": [["please", "unused"], [" ", ""], ["put the red cube in the drawer", "used"]],
        },
        **{"understood": "put the red cube in the drawer", "steps": STEPS, "text": "I open the drawer first."},
    },
    "entry 2": {
        **{**EMPTY, "kind": "refusal", "said": [["reach the ", "used"], ["xyzzy", "problem"]]},
        **{"text": "I do not know the word 'xyzzy'.", "offers": ["reach the red cube", "open the drawer"]},
    },
    "entry 3": {
        **{
            **EMPTY,
            "kind": "question",
            "said": [["take the cube", ""]],
            "text": "Do you mean the red cube or the blue one?",
        },
        "offers": NAMES[:2],
    },
}
SOCKET = """window.sent = [];
window.WebSocket = class {
  static OPEN = 1;
  constructor() { this.readyState = 1; window.socket = this; setTimeout(() => {
    this.onopen(); this.onmessage({data: JSON.stringify(SECTIONS)}); }); }
  send(message) { window.sent.push(JSON.parse(message)); }
};""".replace("SECTIONS", json.dumps(SECTIONS))
IN_VIEW = """() => ['#scene', '#say', '#stop', '.entry:last-child'].filter(name => {
  const box = document.querySelector(name).getBoundingClientRect();
  return !(box.width > 0 && box.top >= 0 && box.left >= 0 && box.right <= innerWidth && box.bottom <= innerHeight);
})"""


@pytest.fixture(scope="module")
def tab(browser):
    files, errors = PageFiles(), []

    def answer(route):
        path = route.request.url.removeprefix("http://page.test/").partition("?")[0]
        found = files.get(path) or (b"<!doctype html><title>scene</title>", {"Content-Type": "text/html"})
        route.fulfill(body=found[0], headers=found[1])

    tab = browser.new_page()
    tab.on("pageerror", lambda error: errors.append(str(error)))
    tab.route("http://page.test/**", answer)
    tab.add_init_script(SOCKET)
    tab.goto("http://page.test/")
    tab.locator("body[data-ready]").wait_for()
    tab.locator(".entry").last.wait_for()
    yield tab
    assert errors == []


def show(tab, screen, scheme="light"):
    tab.emulate_media(color_scheme=scheme)
    tab.set_viewport_size(dict(zip(("width", "height"), SCREENS[screen], strict=True)))


def out_of_view(tab):
    """What is not in view, once the layout has settled."""
    for _ in range(100):
        if not (missing := tab.evaluate(IN_VIEW)):
            break
        tab.wait_for_timeout(100)
    return missing


def receive(tab, sections):
    tab.evaluate("sections => socket.onmessage({data: JSON.stringify(sections)})", sections)


@pytest.mark.parametrize("screen", SCREENS)
def test_robot_box_and_last_answer_are_in_view_at_once(tab, screen):
    show(tab, screen)
    assert out_of_view(tab) == []
    assert tab.evaluate("document.documentElement.scrollWidth") <= SCREENS[screen][0]
    tab.locator("#lab-button").evaluate("button => button.click()")
    assert set(tab.evaluate(IN_VIEW)) <= {".entry:last-child"}  # on narrow screens, the Lab is over the conversation
    tab.locator("#lab-button").evaluate("button => button.click()")


def test_the_log_stays_at_its_end_where_a_scroll_is_reported_before_a_new_size(tab):
    show(tab, "phone")
    assert out_of_view(tab) == []
    tab.evaluate("""() => {
      const log = document.querySelector('.log');
      log.style.maxHeight = '60px';
      log.dispatchEvent(new Event('scroll'));
    }""")
    tab.wait_for_function(
        """() => {
      const log = document.querySelector('.log');
      return log.clientHeight <= 60 && log.scrollHeight - log.scrollTop - log.clientHeight < 2;
    }""",
        timeout=5000,
    )
    tab.evaluate("document.querySelector('.log').style.maxHeight = ''")
    assert out_of_view(tab) == []


@pytest.mark.skipif(not AXE.is_file(), reason="axe-core is not installed: npm install axe-core")
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("screen", ["wide", "phone"])
def test_axe_finds_nothing_serious(tab, screen, scheme):
    show(tab, screen, scheme)
    for _ in range(2):  # without the Lab, and with it
        tab.evaluate("document.querySelectorAll('#lab details').forEach(each => { each.open = true; })")
        tab.evaluate(AXE.read_text())
        found = tab.evaluate("axe.run({iframes: false}).then(result => result.violations)")
        serious = [each for each in found if each["impact"] in ("serious", "critical")]
        assert [(each["id"], [node["html"][:150] for node in each["nodes"]]) for each in serious] == []
        tab.locator("#lab-button").click()


def test_the_box_never_moves_and_has_the_focus(tab):
    show(tab, "wide")
    before = tab.locator("#say").bounding_box()
    for kind, text in (("plan", "put it there"), ("refusal", "no " * 200), ("question", "which one?")):
        tab.fill("#say", "put")
        receive(tab, {"preview": {"kind": kind, "text": text, "said": []}})
        assert tab.locator("#say").bounding_box() == before
    receive(tab, {"entry 4": {**EMPTY, "kind": "answer", "text": "I see a lot. " * 60}, "sayable": ["stop"] * 12})
    assert tab.locator("#say").bounding_box() == before
    assert tab.evaluate("document.activeElement.id") == "say"
    receive(tab, {"entry 4": None, "sayable": SECTIONS["sayable"]})


def test_keys_recall_what_was_said_and_choose_suggestions(tab):
    tab.evaluate("window.sent = []")
    tab.fill("#say", "hello there")
    tab.press("#say", "Enter")
    assert {"do": "say", "text": "hello there"} in tab.evaluate("window.sent")
    tab.press("#say", "ArrowUp")
    assert tab.input_value("#say") == "hello there"
    tab.press("#say", "ArrowDown")
    assert tab.input_value("#say") == ""
    tab.fill("#say", "blue on")
    tab.press("#say", "ArrowDown")
    assert tab.get_attribute("#say", "aria-activedescendant") == "suggestion-0"
    tab.press("#say", "Enter")
    assert tab.evaluate("window.sent.at(-1)") == {"do": "say", "text": "put the blue cube on the red cube"}
    assert tab.locator("#suggestions").is_hidden()


def test_an_answer_is_a_click_and_the_keyboard_reaches_everything(tab):
    tab.locator(".entry").last.get_by_role("button", name="the blue cube").click()
    assert tab.evaluate("window.sent.at(-1)") == {"do": "say", "text": "the blue cube"}
    reached = set()
    for _ in range(40):
        tab.keyboard.press("Tab")
        reached.add(tab.evaluate("document.activeElement.id || document.activeElement.name"))
    assert reached >= {
        "say",
        "do",
        "stop",
        "point",
        "shuffle",
        "lab-button",
        "bar-robot",
        "bar-task",
        "viewpoint",
        "scene",
    }


def test_steps_are_ticked_off_in_place(tab):
    item = tab.locator(".entry").nth(1)
    assert "doing" in item.inner_text()
    done = [{**step, "state": "done"} for step in STEPS]
    receive(tab, {"entry 1": {**SECTIONS["entry 1"], "steps": done, "result": "Done in 2.0 s."}})
    assert item.locator(".steps li.done").count() == 2
    assert "Done in 2.0 s." in item.inner_text()


def test_keys_move_a_chosen_object_and_a_live_region_says_where_it_stands(tab):
    tab.evaluate("document.getElementById('lab').hidden = false")
    tab.evaluate("document.querySelectorAll('#lab details').forEach(each => { each.open = true; })")
    tab.get_by_label("Object to move").select_option("the blue cube")
    receive(tab, {"lab": {**SECTIONS["lab"], "names": ["the red cube", "the left cube", "the drawer"]}})
    assert tab.get_by_label("Object to move").input_value() == "1"  # still the same one
    pad = tab.get_by_role("group", name="Move the object")
    pad.get_by_role("button", name="to your left").press("ArrowUp")
    assert tab.evaluate("window.sent.at(-1)") == {"do": "move", "object": 1, "to": "away"}
    tab.keyboard.press("Enter")  # the button of that key has the focus
    assert tab.evaluate("window.sent.at(-1)") == {"do": "move", "object": 1, "to": "away"}
    receive(tab, {"moved": "the left cube: 42 cm from the robot, 10 cm to your left"})
    assert "42 cm from the robot" in tab.locator("#lab [role=status]").first.inner_text()


def test_what_policy_and_expert_would_do_stands_side_by_side(tab):
    rows = tab.locator("#lab .intents tbody tr")
    assert rows.nth(0).inner_text().split("\t") == ["move x, mm", "20", "20"]
    assert rows.nth(3).inner_text().startswith("angle between, degrees\t5")
    assert rows.last.inner_text().split("\t") == ["action 4", "0.20", "-1.00"]
    receive(tab, {"intents": {"compares": True, "policy": False, "of": {}}})
    tab.get_by_text("There is no trained policy here").wait_for()


def test_the_link_of_a_scene_can_be_copied_and_is_opened_once(tab):
    receive(tab, {"link": "abc-123"})
    link = tab.get_by_label("Link to this scene").input_value()
    assert link == "http://page.test/#scene=abc-123"
    tab.evaluate("location.hash = '#scene=abc-123'")
    tab.locator("body").press("Tab")  # by then the event of the hash has come
    assert tab.evaluate("window.sent.at(-1)") == {"do": "scene", "text": "abc-123"}
    assert tab.evaluate("location.hash") == ""


def test_a_prepared_scene_is_chosen_in_the_bar(tab):
    show(tab, "wide")
    tab.locator("#bar-task").select_option("The drawer")
    assert tab.evaluate("window.sent.at(-1)") == {"do": "scene", "text": "drawer"}
    tab.locator("#bar-task").select_option("kuka")
    assert tab.evaluate("window.sent.at(-1).do") == "change"


def test_what_is_said_while_the_connection_is_lost_stays_in_the_box(tab):
    left = tab.evaluate("""() => {
      const input = document.getElementById('say');
      input.value = 'open the drawer';
      window.sent = [];
      socket.onclose();
      document.getElementById('form').requestSubmit();
      return input.value;
    }""")
    assert left == "open the drawer"
    tab.locator("body[data-ready]").wait_for()  # it has connected again
    tab.locator("#say").press("Enter")
    assert {"do": "say", "text": "open the drawer"} in tab.evaluate("window.sent")
