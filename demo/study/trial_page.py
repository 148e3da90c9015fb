"""The page of one trial: what the condition allows, nothing else, with each event in the log before it is shown."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from demo.guarded_server import PageParts
from demo.page import WELCOME, Page
from demo.session import Session
from demo.shared_state import SharedState, Tab
from demo.study.goals import SceneGoal
from demo.study.progress import HOW, StudyTrial
from demo.study.trial_log import TrialLog
from demo.tab_messages import Click, Hover, Nudge, Preview, Say, TabMessage
from human import Unreachable
from language import Outcome, Signal

SHOWN_SECTIONS = ("status", "clock", "sayable")  # beside the conversation; others would tell the condition
HEARTBEAT = 5.0  # seconds between two samples of the state while the robot rests
STATUS = {"driver": "policy", "acting": "policy", "policy": True, "hears": "", "note": "", "text": ""}
REPLY = {"understood": "", "steps": [], "text": "", "result": "", "offers": []}  # where answers are off
Teller = Callable[..., None]


class TrialSections(SharedState):
    """The sections of a trial's page: of the conversation, each change is logged before it is sent."""

    def __init__(self, trial: StudyTrial, log: TrialLog) -> None:
        super().__init__()
        self._trial, self._log = trial, log
        self._entries: dict[str, dict[str, Any]] = {}

    def put(self, name: str, value: Any) -> None:
        condition = self._trial.condition
        if name not in SHOWN_SECTIONS and not name.startswith("entry "):
            return
        if name == "status":
            value = value | STATUS
            if not value.get("loading"):
                value = value | {"person": value.get("person") and condition.input != "words"}
        elif name == "sayable":
            value = value if condition.suggestions else []
        elif name.startswith("entry "):
            if value["text"] == WELCOME:
                value = value | {"text": HOW[condition.input]}
            elif not self._logged(name, value):
                return
        super().put(name, value if condition.answers else self._silent(name, value))

    def _logged(self, name: str, entry: dict[str, Any]) -> bool:
        """Log what is new in an entry. Returns False if nothing is."""
        before = self._entries.get(name)
        if before == entry:
            return False
        self._entries[name] = {**entry, "steps": [dict(step) for step in entry["steps"]]}
        if before is None:
            said = "".join(part[0] for part in entry["said"])
            kind = "message" if entry["kind"] == "note" else "reply"
            shown = {each: entry[each] for each in ("kind", "understood", "text", "offers")}
            self._log.write(kind, {"entry": name, "said": said, **shown})
        old_steps = [] if before is None else before["steps"]
        for number, step in enumerate(entry["steps"]):
            if number >= len(old_steps) or old_steps[number] != step:
                self._log.write("step", {"entry": name, "step": number, **step})
        if entry["result"] and (before is None or before["result"] != entry["result"]):
            self._log.write("outcome", {"entry": name, "result": entry["result"]})
        return True

    @staticmethod
    def _silent(name: str, value: Any) -> Any:
        """What is shown of a section where answers are off: what was said, as it was said."""
        if not name.startswith("entry ") or value["text"] in HOW.values():
            return value
        said = "".join(part[0] for part in value["said"])
        return value | REPLY | {"kind": "note", "said": [(said, "")] if said else []}


class LoggingTab:
    """A tab that is sent its preview once it is logged."""

    def __init__(self, tab: Tab, log: TrialLog, text: str, answers: bool) -> None:
        self.number = tab.number
        self._tab, self._log, self._text, self._answers = tab, log, text, answers

    def send(self, name: str, value: Any) -> None:
        """Send a section to the tab."""
        if name == "preview" and value is not None:
            shown = {each: value[each] for each in ("kind", "text")}
            self._log.write("preview", {"typed": self._text, **shown})
        if self._answers:
            self._tab.send(name, value)


class TrialPage(Page):
    """The page of one trial.

    Args:
        server: viser's.
        session: with the scene of the trial.
        parts: whose state is `TrialSections` and whose files are `TrialFiles`.
        trial: the trial.
        goal: of its scene; None: it has none.
        log: its log.
        tell: tells the study's server something: a word and values.
        samples_per_second: of the world's state while the robot moves.
    """

    def __init__(
        self,
        server: Any,
        session: Session,
        parts: PageParts,
        *,
        trial: StudyTrial,
        goal: SceneGoal | None,
        log: TrialLog,
        tell: Teller,
        samples_per_second: float,
    ) -> None:
        self._trial, self._goal, self._log, self._tell = trial, goal, log, tell
        self._words, self._finger_used = trial.condition.input != "finger", trial.condition.input != "words"
        self._sample_period = 1 / samples_per_second if samples_per_second else float("inf")
        self._sampled = self._pulsed = log.clock
        self._told: set[str] = set()
        self._sections = parts.state
        super().__init__(server, session, parts)
        self.loop.paused = True  # until somebody looks

    # ---- Messages of tabs: what the condition allows

    def _handle(self, tab: Tab, message: TabMessage) -> None:
        match message:
            case Say() | Preview():
                allowed = self._words
            case Nudge() | Hover() | Click(button="point"):
                allowed = self._finger_used
            case _:
                allowed = isinstance(message, Click) and message.button == "stop"
        if allowed:
            super()._handle(tab, message)

    def _say(self, session: Session, sentence: str) -> None:
        if sentence:
            self._log.write("correction" if session.busy else "utterance", {"text": sentence})
        super()._say(session, sentence)

    def _with_clock(self, outcome: Outcome) -> Outcome:
        if isinstance(outcome, Signal) and outcome.control in ("faster", "slower"):
            return replace(outcome, text="the clock stays as it is here")
        return outcome

    def _preview(self, session: Session, tab: Any, sentence: str) -> None:
        logging_tab: Any = LoggingTab(tab, self._log, sentence, self._trial.condition.answers)
        super()._preview(session, logging_tab, sentence)

    def _stop(self, session: Session) -> None:
        self._log.write("button", {"button": "stop"})
        super()._stop(session)

    def _go_where_pointed(self, session: Session) -> None:
        self._log.write("button", {"button": "go where I point"})
        super()._go_where_pointed(session)

    def _on_drag(self, body: int, place: Any) -> None:
        """Objects stay where they are: what moves them is the robot."""

    def _hover(self, session: Session, tab: Tab, at: tuple[float, float] | None) -> None:
        client = self._scenes.get(tab.number)
        if client is not None:  # no names: they would suggest words
            self._scene_view.hover(client, at, session.scene(), [""] * len(session.scene()))

    # ---- Gestures

    def _point_at_body(self, session: Session, body: int) -> None:
        self._gesture(session, "click", lambda: super(TrialPage, self)._point_at_body(session, body))

    def _follow_finger(self, session: Session) -> None:
        self._gesture(session, "handle", lambda: super(TrialPage, self)._follow_finger(session))

    def _nudge(self, session: Session, to: str) -> None:
        self._gesture(session, "key", lambda: super(TrialPage, self)._nudge(session, to))

    def _gesture(self, session: Session, by: str, point: Callable[[], None]) -> None:
        if not self._finger_used:
            return
        try:
            point()
        except Unreachable:
            self._log.write("gesture", {"by": by, "unreachable": True})
            raise
        finger = session.finger
        shares = None if finger.probabilities is None else finger.probabilities.round(3).tolist()
        told = {
            "by": by,
            "aim": finger.aim.round(4).tolist(),
            "referent": finger.last_referent,
            "probabilities": shares,
        }
        self._log.write("gesture", told)

    # ---- After each control step

    def _show(self, session: Session) -> None:
        if not self.loop.paused:
            self._log.clock += session.period
        super()._show(session)
        self.loop.paused = not self._sections.is_watched
        clock = self._log.clock
        if clock >= self._sampled + (self._sample_period if session.busy else HEARTBEAT):
            self._sampled = clock
            self._log.write("state")
        if clock >= self._pulsed + 1.0:
            self._pulsed = clock
            self._tell("pulse", round(clock, 2), round(self.loop.rate, 3))
        if self._goal is not None and not session.busy and self._goal.holds(session):
            self._end("goal")
        elif clock >= self._trial.scene.seconds:
            self._end("time")

    def _end(self, why: str) -> None:
        """Tell the server once that the trial is over, or that its time is."""
        if why not in self._told:
            self._told.add(why)
            self._log.write("goal" if why == "goal" else "time is over")
            self._tell(why)
