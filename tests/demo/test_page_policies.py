"""The judge of policies on the page counts what was meant, whatever was understood or said."""

from dataclasses import replace

import pytest

from core.errors import ConfigError
from demo import session as session_module
from demo.session import Session
from demo.session_config import build, make_config
from tests.helpers.sessions import session_fixture
from tools.page_judge import figures, judge, section
from tools.page_people import Script
from trainers.export.publish import write_section

CIRCUMSTANCES = 7  # of a task that reaches


reaching = session_fixture(driver="expert", objects=3)


def judged(session, count=CIRCUMSTANCES, seed=5):
    return figures(list(judge(session, count, seed)))


def test_the_expert_succeeds_in_every_circumstance_and_the_same_seed_gives_the_same(reaching):
    first, again = judged(reaching), judged(reaching)
    assert first == again
    assert first["success"] == 1.0
    assert first["disagreements"] == 0
    assert len(first["by_circumstance"]) == CIRCUMSTANCES


def test_a_robot_that_does_something_else_and_says_done_fails(reaching, monkeypatch):
    say = reaching.say

    def mishear(sentence):
        return say(f"reach {next(name for name in reaching.object_names() if name not in sentence)}")

    monkeypatch.setattr(reaching, "say", mishear)
    monkeypatch.setattr(Script, "circumstances", lambda self: {"full names": self._full_names})
    result = judged(reaching, count=2)
    assert result["success"] == 0.0
    assert result["disagreements"] == 2
    assert all(page.startswith("Done") for page in result["page_of_failures"])


def test_a_policy_that_does_nothing_never_succeeds(monkeypatch):
    def build_idle(*args):
        setup = build(*args)
        return replace(setup, policy=lambda state: state.set("action", setup.env.hold_action()))

    monkeypatch.setattr(session_module, "build", build_idle)
    session = Session(make_config(objects=3, second_try=False), seed=3)
    result = judged(session, count=2)
    session.close()
    assert result["success"] == 0.0
    assert result["disagreements"] == 0


def test_a_card_gets_both_figures_once(tmp_path):
    card = tmp_path / "README.md"
    card.write_text("# tiny\n\nWhat it does.\n\n## Config that differs from the default\n\nNothing.\n")
    part = {"instructions": 200, "success": 0.99, "ci95": [0.96, 1.0]}
    page = {"seeds": [11], **part, "disagreements": 0, "by_circumstance": {"fresh scene": part}}
    whole = {"seed": 0, "episodes": 1000, "success_at_end": 0.998, "ci95": [0.993, 0.999]}
    text = section("tiny", {"date": "2026-11-27", "commit": "abc", "page": page, "evaluation": whole})
    for _ in range(2):
        write_section(tmp_path, "Through the page", text)
    assert card.read_text().count("## Through the page\n") == 1
    assert card.read_text().index("## Through the page") < card.read_text().index("## Config")
    assert "| instructions to the page | 0.990 (0.960-1.000) | 200 |" in card.read_text()
    assert "| `evaluate.py` | 0.998 (0.993-0.999) | 1000 |" in card.read_text()


def test_a_card_needs_both_figures():
    with pytest.raises(ConfigError, match="tiny has no figures of its page yet: run python"):
        section("tiny", {})
