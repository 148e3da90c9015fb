"""The HTML of the page. All text from a person is escaped."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from demo.dialogue import Interpretation
from demo.planning import verb_words
from demo.room import in_words
from demo.view_state import OUTCOMES, ViewState
from language import VERBS
from language.commands import Action

GREEN, RED, ORANGE = "#2b8a3e", "#c92a2a", "#e67700"
STYLE = "padding:2px 12px;font-size:14px;line-height:1.45;overflow-wrap:anywhere"


def interpretation(result: Interpretation, names: Sequence[str]) -> str:
    """The sentence: what was understood in green, the rest in red, or orange for a question; and the message."""
    if result.understood is not None:
        steps = result.understood.steps
        summary = ", then ".join(_step(step.task, step.init, step.goal, names) for step in steps)
        return _box(f"{_colored(result.sentence, GREEN)}<br><small>understood: {escape(summary)}</small>")
    if result.actions:
        summary = ", then ".join(_action(action, names) for action in result.actions)
        note = f"<br><small>{escape(result.message)}</small>" if result.message else ""
        return _box(f"{_colored(result.sentence, GREEN)}<br><small>understood: {escape(summary)}</small>{note}")
    before, after = result.sentence[: result.position], result.sentence[result.position :]
    color = ORANGE if result.candidates else RED
    rest = f'<u style="color:{color}">{escape(after)}</u>' if after else ""
    return _box(f'{_colored(before, GREEN)}{rest}<br><b style="color:{color}">{escape(result.message)}</b>')


def _step(verb: str, init: int | None, goal: int | None, names: Sequence[str]) -> str:
    objects = [names[index] for index in (init, goal) if index is not None]
    if VERBS[verb].goal_is_real:
        return in_words(verb, *objects)
    return f"{verb_words(verb)} {' to '.join(objects)}"


def _action(action: Action, names: Sequence[str]) -> str:
    """A step in words: "place the red cube at x 0.45, y -0.10"."""
    words = [action.kind]
    if action.fixture is not None:
        words.append(f"the {action.fixture}")
    if action.object is not None:
        words.append(names[action.object])
    if action.on is not None:
        words.append(f"on {names[action.on]}")
    elif action.position is not None:
        words.append("at x {:.2f}, y {:.2f}".format(*action.position))
    return " ".join(words)


def status(view: ViewState, note: str, rate: float) -> str:
    """What the robot does, the policy's sentence, the note, and the rate of the clock."""
    sentence = f'<br><small>the policy hears: "{escape(view.policy_sentence)}"</small>' if view.policy_sentence else ""
    warning = f'<br><small style="color:{ORANGE}">{escape(note)}</small>' if note else ""
    clock = f"<br><small>clock: {rate:.2f} of real time</small>"
    return _box(f"<b>{escape(view.status)}</b>{sentence}{warning}{clock}")


def message(text: str) -> str:
    """A message to the person; an empty line for ""."""
    return _box(f'<b style="color:{ORANGE}">{escape(text)}</b>') if text else _box("&nbsp;")


def hint(text: str) -> str:
    """A hint to the person."""
    return _box(f"<small>{escape(text)}</small>")


def object_shares(view: ViewState, names: Sequence[str]) -> str:
    """A bar for each object: the policy's attention, and the probability that the finger points at it."""
    rows = []
    for title, shares in (("policy's attention", view.attention), ("pointed at", view.pointing)):
        if shares is not None and len(shares) == len(names):
            rows.append(f"<i>{title}</i>")
            rows += [_bar(name, float(share)) for name, share in zip(names, shares, strict=True)]
    return _box("".join(f"<div>{row}</div>" for row in rows) or "Nothing yet: say something.")


def _bar(name: str, share: float) -> str:
    bar = f'<div style="background:#fab005;height:6px;width:{round(100 * share)}%"></div>'
    return f"<small>{escape(name)}: {share:.0%}</small>{bar}"


def rewards_and_outcomes(view: ViewState) -> str:
    """The reward terms of the current subtask, and how often subtasks ended with each outcome."""
    terms = [f"{escape(name)} {value:+.2f}" for name, value in view.rewards.items()]
    outcomes = [f"{name} {view.outcome_counts[name]}" for name in OUTCOMES if view.outcome_counts[name]]
    return _box(f"reward: {', '.join(terms) or '-'}<br>so far: {', '.join(outcomes) or '-'}")


def _colored(text: str, color: str) -> str:
    return f'<span style="color:{color};font-weight:600">{escape(text)}</span>'


def _box(inner: str) -> str:
    return f'<div style="{STYLE}">{inner}</div>'
