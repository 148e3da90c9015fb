"""The HTML of the page. All text from a person is escaped."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from demo.room import in_words
from demo.view_state import OUTCOMES, ViewState
from language import Answer, Outcome, Plan, Question, Signal, Step

GREEN, RED, ORANGE = "#2b8a3e", "#c92a2a", "#e67700"
# The button that stops an arm follows this mark. It is in a corner of the window, wherever the panel is scrolled to.
# The head of the panel takes no clicks then, which fold it up or show settings in its place: the button would go too.
PINNED = """<i id="arm-stop"></i><style>
div:has(> #arm-stop) + div { position: fixed; left: 8px; bottom: 8px; margin: 0 !important; z-index: 1000; }
div:has(> #arm-stop) + div button { height: 56px !important; width: 190px !important; font-size: 17px !important; }
.mantine-ScrollArea-content:has(#arm-stop) { padding-bottom: 72px; }
.mantine-Paper-root:has(#arm-stop) div[style*="cursor: grab"],
.mantine-Paper-root:has(#arm-stop) div[style*="cursor: pointer"][style*="3.5em"] { pointer-events: none; }
</style>"""
STYLE = "padding:2px 12px;font-size:14px;line-height:1.45;overflow-wrap:anywhere"


def interpretation(result: Outcome, names: Sequence[str]) -> str:
    """The sentence: what was understood in green, a question in orange, else red; and the message."""
    if isinstance(result, Plan) or (isinstance(result, Signal) and result.steps):
        summary = ", then ".join(_step(step, names) for step in result.steps)
        notes = "; ".join(getattr(result, "notes", ()))
        note = f"<br><small>{escape(notes)}</small>" if notes else ""
        return _box(f"{_colored(result.sentence, GREEN)}<br><small>understood: {escape(summary)}</small>{note}")
    if isinstance(result, Answer | Signal):
        text = result.text or f"understood: {getattr(result, 'control', '')}"
        return _box(f"{_colored(result.sentence, GREEN)}<br><b>{escape(text)}</b>")
    start = result.span[0] if isinstance(result, Question) else 0
    before, after = result.sentence[:start], result.sentence[start:]
    color = ORANGE if isinstance(result, Question) else RED
    rest = f'<u style="color:{color}">{escape(after)}</u>' if after else ""
    return _box(f'{_colored(before, GREEN)}{rest}<br><b style="color:{color}">{escape(result.message)}</b>')


def _step(step: Step, names: Sequence[str]) -> str:
    """A step in words: "put the red cube in the blue drawer", "move the red cube to x 0.45, y -0.10"."""
    goal = None if step.goal is None else names[step.goal]
    if step.place is None or goal is not None:
        return in_words(step.verb, names[step.object], goal)
    x, y = step.place
    return f"put {names[step.object]} at x {x:.2f}, y {y:.2f}"


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


def seen(lines: Sequence[str], cameras: Sequence[str]) -> str:
    """What cameras see together, a line for each thing."""
    listed = "".join(f"<div>{escape(line)}</div>" for line in lines) or "Nothing."
    return _box(f"<small>{escape(' and '.join(cameras))} see:{listed}</small>")


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
