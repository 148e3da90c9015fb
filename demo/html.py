"""What the page writes, as HTML. Whatever a person typed is escaped: it is shown, never run."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from demo.dialogue import Heard
from demo.view_state import SCORE, Show

FINE, WRONG, OPEN, PALE = "#2b8a3e", "#c92a2a", "#e67700", "#868e96"
BOX = "padding:2px 12px;font-size:14px;line-height:1.45;overflow-wrap:anywhere"


def heard(what: Heard, names: Sequence[str]) -> str:
    """The sentence with what was understood in green, and what is wrong with the rest, or what is asked back."""
    if what.understood is not None:
        steps = what.understood.steps
        jobs = ", then ".join(_job(step.task, step.init, step.goal, names) for step in steps)
        return _box(f"{_colored(what.sentence, FINE)}<br><small>understood: {escape(jobs)}</small>")
    before, after = what.sentence[: what.place], what.sentence[what.place :]
    color = OPEN if what.candidates else WRONG
    rest = f'<u style="color:{color}">{escape(after)}</u>' if after else ""
    return _box(f'{_colored(before, FINE)}{rest}<br><b style="color:{color}">{escape(what.message)}</b>')


def _job(task: str, init: int | None, goal: int | None, names: Sequence[str]) -> str:
    said = [names[index] for index in (init, goal) if index is not None]
    return f"{task.replace('_', ' ')} {' to '.join(said)}"


def status(show: Show, note: str, rate: float) -> str:
    """What the robot does now, and what its policy hears."""
    hears = f'<br><small>the policy hears: "{escape(show.hears)}"</small>' if show.hears else ""
    warning = f'<br><small style="color:{OPEN}">{escape(note)}</small>' if note else ""
    return _box(f"<b>{escape(show.status)}</b>{hears}{warning}<br><small>clock: {rate:.2f} of real time</small>")


def message(text: str) -> str:
    """Something that a person should know."""
    return _box(f'<b style="color:{OPEN}">{escape(text)}</b>') if text else _box("&nbsp;")


def looks(show: Show, names: Sequence[str]) -> str:
    """A bar for each object: where the policy looks, and what the finger shows."""
    rows = []
    for title, shares in (("policy's attention", show.attention), ("pointed at", show.pointing)):
        if shares is not None and len(shares) == len(names):
            rows.append(f"<i>{title}</i>")
            rows += [_bar(name, float(share)) for name, share in zip(names, shares, strict=True)]
    return _box("".join(f"<div>{row}</div>" for row in rows) or "Nothing yet: say something.")


def _bar(name: str, share: float) -> str:
    width = round(100 * share)
    bar = f'<div style="background:#fab005;height:6px;width:{width}%"></div>'
    return f"<small>{escape(name)}: {share:.0%}</small>{bar}"


def numbers(show: Show) -> str:
    """Rewards of this job, and how often jobs ended how."""
    terms = [f"{escape(name)} {value:+.2f}" for name, value in show.rewards.items()]
    ends = [f"{name} {show.score[name]}" for name in SCORE if show.score[name]]
    return _box(f"reward: {', '.join(terms) or '-'}<br>so far: {', '.join(ends) or '-'}")


def _colored(text: str, color: str) -> str:
    return f'<span style="color:{color};font-weight:600">{escape(text)}</span>'


def _box(inner: str) -> str:
    return f'<div style="{BOX}">{inner}</div>'
