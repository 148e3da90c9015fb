"""The page drives an arm as it drives a simulated robot: words, and a stop that ends what is being done."""

import pytest

pytest.importorskip("viser", reason="viser is not installed")

import play
from core.errors import ConfigError
from tools.browser import PlayServer
from tools.page_client import PageClient


@pytest.mark.slow
def test_words_move_the_arm_and_the_red_button_stops_it_until_it_is_let_go():
    server = PlayServer("--seed", "3", "driver=expert", "task=nl_reach", "arm=sim", "arm.latency=0.06")
    try:
        with PageClient(server.address) as page:
            sentence = page.wait_for_text("Try: (reach [a-z ]+)").removeprefix("Try: ").strip()
            page.say(sentence)
            page.wait_for_text("Done in")
            page.press("STOP THE ARM")
            page.wait_for_text("somebody pressed stop on the page")
            page.say(sentence)
            page.wait_for_text("Stopped: somebody pressed stop on the page")
            page.press("Let it move again")
            page.say(sentence)
            page.wait_for_text("Done in")
    finally:
        errors = server.close()
    assert server.process.returncode == 0
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
