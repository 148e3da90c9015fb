"""The page drives an arm as it drives a simulated robot: words, and a stop that ends what is being done."""

import pytest

pytest.importorskip("viser", reason="viser is not installed")

import play
from core.errors import ConfigError
from tools.browser import CHROMIUM, PageTab, PlayServer, headless_browser
from tools.page_client import PageClient

HIGH_AND_ON_TOP = """e => {
  const box = e.getBoundingClientRect();
  const top = document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2);
  return [box.height >= 44 && box.width >= 44, e.contains(top)];
}"""


@pytest.mark.slow
def test_words_move_the_arm_and_the_red_button_stops_it_until_it_is_let_go():
    server = PlayServer("--seed", "3", "driver=expert", "task=nl_reach", "arm=sim", "arm.latency=0.06")
    try:
        with PageClient(server.address) as page:
            sentence = page.wait_for_text("reach [a-z ]+")
            page.say(sentence)
            page.wait_for_text("Done in", last=True)
            page.press("stop arm")
            page.wait_for_text("somebody pressed stop on the page")
            page.say(sentence)
            page.wait_for_text("Stopped: somebody pressed stop on the page", last=True)
            page.press("release arm")
            page.say(sentence)
            page.wait_for_text("Done in", last=True)
    finally:
        errors = server.close()
    assert server.process.returncode == 0
    assert "Traceback" not in errors


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_the_stop_button_is_large_and_always_in_view():
    pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    server = PlayServer("--seed", "3", "driver=expert", "task=nl_reach", "arm=sim")
    with headless_browser() as browser:
        tab = PageTab(browser, server.address, blank=True).tab
        stop, release = (tab.get_by_role("button", name=name) for name in ("STOP THE ARM", "Let it move again"))
        for width, height in ((1280, 800), (390, 800), (390, 420)):
            tab.set_viewport_size({"width": width, "height": height})
            assert stop.evaluate(HIGH_AND_ON_TOP) == [True, True]
        assert release.is_hidden()
        stop.click()
        release.click()
        release.wait_for(state="hidden")
    errors = server.close()
    assert "Traceback" not in errors


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--gui", "arm=sim"], "--gui shows a simulated robot: leave it out, or arm=sim"),
        (["arm=sim", "safety.deadman=1"], "safety.deadman=1 needs keys, which a page cannot hold: use deploy.py"),
        (["task=anything", "arm=sim"], "which nothing perceives on an arm yet"),
        (["task=nl_reach", "arm=nosuch"], "arm=nosuch is not an arm"),
    ],
)
def test_an_arm_that_the_page_cannot_drive_is_one_sentence(words, message):
    session = play.parser().parse_args(words)
    with pytest.raises(ConfigError) as refusal:
        play.make_session(session)
    assert message in str(refusal.value)
