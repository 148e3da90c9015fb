"""Where participants are in a study: what they may do next, what comes of it, and what they are shown."""

from __future__ import annotations

import json
import secrets
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from core.errors import ConfigError
from demo.study.database import StudyDatabase
from demo.study.orders import Stage, questions_of, stages
from demo.study.study_config import ConditionConfig, SceneConfig, StudyConfig

LETTERS = "abcdefghjkmnpqrstuvwxyz23456789"  # that nobody takes for another one
CODE_LENGTH = 10  # 49 bits: a code lets in whoever has it
INVITED, ACTIVE, FINISHED, STOPPED = "invited", "active", "finished", "stopped"
MOST_TEXT = 4000  # characters of a free answer
HOW = {
    "words": "Tell the robot in words what it shall do.",
    "finger": "Point at a thing: click it, or move the finger with the arrow keys. Then press “Go where I point”.",
    "both": "Tell the robot in words what it shall do. You can also point at a thing: click it, and say “this”.",
}


class NotNow(Exception):
    """What was asked for does not fit where the participant is. The text says why."""


@dataclass(frozen=True)
class StudyTrial:
    """A participant in a scene. number: from 1. begun: whether they have begun. clock: seconds of it that are over."""

    code: str
    number: int
    condition_name: str
    scene_name: str
    condition: ConditionConfig
    scene: SceneConfig
    begun: bool
    clock: float


@dataclass(frozen=True)
class TrialJob:
    """What the process of a trial is given. port: to try first; viser takes a later one if it is taken."""

    study: StudyConfig
    trial: StudyTrial
    database: Path
    port: int


class StudyProgress:
    """The participants of a study. Everything is in the database, so another server can go on.

    Args:
        study: the study.
        database: its database, which is filled if it is new.

    Raises:
        ConfigError: the database is of another study, which somebody has begun.
    """

    def __init__(self, study: StudyConfig, database: StudyDatabase) -> None:
        self.study, self.database = study, database
        self._ways: dict[int, list[Stage]] = {}  # by the participant's number
        self._counts: dict[str, dict[str, Any]] = {}  # of events, by code
        self._counted = 0  # the latest event that is counted
        stored, config = database.get("config"), json.loads(json.dumps(asdict(study)))
        begun = database.first("SELECT 1 FROM participants WHERE number IS NOT NULL") is not None
        if stored != config and not begun:  # a new study, or one that nobody has begun
            database.set("config", config)
            database.set("prepared", False)
        elif stored != config:
            key, before, now = _difference(stored, config)
            raise ConfigError(
                f"study: {key}={now} does not go with database={database.path}, which has {key}={before}; "
                "give database=<another file>, or the study as it was"
            )
        for _ in range(study.participants - len(self.codes())):
            code = "".join(secrets.choice(LETTERS) for _ in range(CODE_LENGTH))
            database.rows("INSERT INTO participants VALUES (?, NULL, ?, 0, NULL, NULL)", (code, INVITED))

    def codes(self) -> list[str]:
        """The codes of all participants, in the order of their making."""
        return [row["code"] for row in self.database.rows("SELECT code FROM participants ORDER BY rowid")]

    @property
    def is_open(self) -> bool:
        """Whether the study goes on; the experimenter can stop it."""
        return not self.database.get("closed")

    def stage(self, code: str) -> Stage:
        """Where a participant is. Raises NotNow for an unknown code."""
        row = self._row(code)
        return Stage("consent") if row["number"] is None else self._stages(row["number"])[row["stage"]]

    def _stages(self, number: int) -> list[Stage]:
        if number not in self._ways:
            self._ways[number] = stages(self.study, number)
        return self._ways[number]

    def _row(self, code: str) -> Any:
        row = self.database.first("SELECT * FROM participants WHERE code=?", (code,))
        if row is None:
            raise NotNow("This link is not valid, or no longer.")
        return row

    def _expect(self, code: str, kind: str) -> Stage:
        """The stage of a participant, who must be at one of this kind. Raises NotNow."""
        stage, state = self.stage(code), self._row(code)["state"]
        if state == STOPPED or not self.is_open:
            raise NotNow("The experimenter has stopped this.")
        if stage.kind != kind:
            raise NotNow("This part is over already.")
        return stage

    # ---- What a participant does

    def consent(self, code: str) -> None:
        """Take a participant in, with the order of conditions that the fewest have. Raises NotNow."""
        self._expect(code, "consent")
        with self.database.together():
            taken = {row[0] for row in self.database.rows("SELECT number FROM participants WHERE number IS NOT NULL")}
            number = next(each for each in range(len(taken) + 1) if each not in taken)
            values = (number, ACTIVE, time.time(), code)
            self.database.rows("UPDATE participants SET number=?, state=?, stage=1, consented=? WHERE code=?", values)
            self.database.log(code, 0, "consented", {"number": number})
            self._enter(code, self._stages(number)[1])

    def trial(self, code: str) -> StudyTrial | None:
        """The trial that a participant is in; None if they are elsewhere or stopped."""
        try:
            stage = self._expect(code, "trial")
        except NotNow:
            return None
        row = self._trial_row(code, stage)
        return StudyTrial(
            code=code,
            number=stage.trial,
            condition_name=stage.condition,
            scene_name=stage.scene,
            condition=self.study.conditions[stage.condition],
            scene=self.study.scenes[stage.scene],
            begun=row["begun"] is not None,
            clock=self._clock(code, stage.trial),
        )

    def _trial_row(self, code: str, stage: Stage) -> Any:
        return self.database.first("SELECT * FROM trials WHERE code=? AND trial=?", (code, stage.trial))

    def _clock(self, code: str, trial: int) -> float:
        """Seconds of the world's clock at the latest event of a trial."""
        query = "SELECT clock FROM events WHERE code=? AND trial=? AND clock IS NOT NULL ORDER BY id DESC LIMIT 1"
        row = self.database.first(query, (code, trial))
        return 0.0 if row is None else float(row["clock"])

    def begin(self, code: str) -> None:
        """Begin the trial that a participant is at. Does nothing if it has begun. Raises NotNow."""
        stage = self._expect(code, "trial")
        if self._trial_row(code, stage)["begun"] is not None:
            return
        with self.database.together():
            query = "UPDATE trials SET begun=? WHERE code=? AND trial=?"
            self.database.rows(query, (time.time(), code, stage.trial))
            self.database.log(code, stage.trial, "begun", {"condition": stage.condition, "scene": stage.scene})

    def end_trial(self, code: str, result: str, goal: bool | None, clock: float = 0.0) -> None:
        """End the trial that a participant is at, and go on. Raises NotNow unless it has begun.

        Args:
            code: of the participant.
            result: how it ended: goal reached, done, gave up, or time is over.
            goal: whether the goal is reached; None: the scene has none.
            clock: seconds of the world's clock that are over, if that is known better than by the log.
        """
        stage = self._expect(code, "trial")
        if self._trial_row(code, stage)["begun"] is None:
            raise NotNow("This part has not begun.")
        clock = max(clock, self._clock(code, stage.trial))
        with self.database.together():
            query = "UPDATE trials SET ended=?, clock=?, result=?, goal=? WHERE code=? AND trial=?"
            self.database.rows(query, (time.time(), clock, result, goal, code, stage.trial))
            self.database.log(code, stage.trial, "ended", {"result": result, "goal": goal}, clock=clock)
            self._advance(code)

    def answer(self, code: str, name: str, value: Any) -> None:
        """Keep an answer as it is given or changed. Raises NotNow for one that is none."""
        stage = self._expect(code, "questions")
        question = questions_of(self.study, stage).get(name)
        if question is None:
            raise NotNow(f"There is no question {name!r} here.")
        value = value[:MOST_TEXT] if isinstance(value, str) else value
        if refused := question.refused(value):
            raise NotNow(f"The answer to {name!r} does not fit: {refused}.")
        with self.database.together():
            values = (code, self._row(code)["stage"], stage.after, stage.condition, stage.scene, stage.trial, name)
            row = (*values, json.dumps(value, ensure_ascii=False), time.time())
            self.database.rows("INSERT OR REPLACE INTO answers VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", row)
            self.database.log(code, stage.trial, "answered", {"question": name, "value": value, "after": stage.after})

    def answers(self, code: str) -> dict[str, Any]:
        """The answers of a participant where they are."""
        query = "SELECT question, value FROM answers WHERE code=? AND stage=?"
        rows = self.database.rows(query, (code, self._row(code)["stage"]))
        return {row["question"]: json.loads(row["value"]) for row in rows}

    def submit(self, code: str) -> None:
        """End a questionnaire, and go on. Raises NotNow while an answer is missing."""
        stage, answers = self._expect(code, "questions"), self.answers(code)
        for name, question in questions_of(self.study, stage).items():
            if question.required and answers.get(name) in (None, ""):
                raise NotNow(f"Please answer: {question.text.strip()}")
        with self.database.together():
            self.database.log(code, stage.trial, "submitted", {"after": stage.after})
            self._advance(code)

    def _advance(self, code: str) -> None:
        row = self._row(code)
        following = self._stages(row["number"])[row["stage"] + 1]
        self.database.rows("UPDATE participants SET stage=stage+1 WHERE code=?", (code,))
        self._enter(code, following)

    def _enter(self, code: str, stage: Stage) -> None:
        if stage.kind == "trial":
            columns = "code, trial, condition, scene, clock"
            values = (code, stage.trial, stage.condition, stage.scene)
            self.database.rows(f"INSERT INTO trials ({columns}) VALUES (?, ?, ?, ?, 0)", values)
        if stage.kind == "thanks":
            query = "UPDATE participants SET state=?, finished=? WHERE code=?"
            self.database.rows(query, (FINISHED, time.time(), code))
            self.database.log(code, 0, "finished")

    # ---- What the experimenter does

    def stop(self, code: str, stopped: bool) -> None:
        """Stop a participant, or let them go on. Raises NotNow unless they are in the midst of it."""
        before, after = (ACTIVE, STOPPED) if stopped else (STOPPED, ACTIVE)
        if self._row(code)["state"] != before:
            raise NotNow(f"This participant is {self._row(code)['state']}.")
        with self.database.together():
            self.database.rows("UPDATE participants SET state=? WHERE code=?", (after, code))
            self.database.log(code, 0, "stopped" if stopped else "continued")

    def close(self, closed: bool) -> None:
        """Stop the study for all participants, or open it again."""
        self.database.set("closed", closed)

    def withdraw(self, code: str) -> None:
        """Delete everything about a participant, the code too. Raises NotNow for an unknown code."""
        self._row(code)
        self.database.delete_participant(code)

    # ---- What is shown

    def shown(self, code: str) -> dict[str, Any]:
        """What the page of a participant shows, but for the robot. Raises NotNow for an unknown code."""
        row, stage = self._row(code), self.stage(code)
        of = 1 if row["number"] is None else len(self._stages(row["number"])) - 1
        state = STOPPED if not self.is_open and row["state"] != FINISHED else row["state"]
        shown = {"title": self.study.title, "code": code, "state": state, "stage": row["stage"], "of": of}
        shown |= {"kind": "stopped" if state == STOPPED else stage.kind}
        if shown["kind"] == "consent":
            shown["text"] = self.study.consent
        elif shown["kind"] == "thanks":
            shown["text"] = self.study.thanks
        elif shown["kind"] == "trial":
            shown |= self._shown_trial(code, stage)
        elif shown["kind"] == "questions":
            answers = self.answers(code)
            shown["about"] = stage.after
            shown["questions"] = [
                {"name": name, **asdict(question), "value": answers.get(name)}
                for name, question in questions_of(self.study, stage).items()
            ]
        return shown

    def _shown_trial(self, code: str, stage: Stage) -> dict[str, Any]:
        scene, condition = self.study.scenes[stage.scene], self.study.conditions[stage.condition]
        numbers = [each.trial for each in self._stages(self._row(code)["number"])]
        return {
            "trial": stage.trial,
            "trials": max(numbers),
            "text": scene.text or "Make the robot bring about what the second picture shows.",
            "how": HOW[condition.input],
            "input": condition.input,
            "pictures": f"goal/{stage.scene}" if scene.goal is not None else "",
            "seconds": scene.seconds,
            "begun": self._trial_row(code, stage)["begun"] is not None,
            "clock": self._clock(code, stage.trial),
        }

    def overview(self) -> list[dict[str, Any]]:
        """What the experimenter's page shows of each participant."""
        self._count_events()
        found = []
        for row in self.database.rows("SELECT * FROM participants ORDER BY rowid"):
            code, stage = row["code"], self.stage(row["code"])
            of = len(self._stages(row["number"])) - 1 if row["number"] is not None else 0
            place = {"condition": stage.condition, "scene": stage.scene, "kind": stage.kind, "trial": stage.trial}
            counts = self._counts.get(code, {"events": 0, "latest": None})
            found.append({"code": code, "state": row["state"], "stage": row["stage"], "of": of, **place, **counts})
        return found

    def _count_events(self) -> None:
        """Count the events that were added since the last time."""
        query = "SELECT id, code, time FROM events WHERE id > ? ORDER BY id"
        for row in self.database.rows(query, (self._counted,)):
            count = self._counts.setdefault(row["code"], {"events": 0, "latest": None})
            count["events"], count["latest"], self._counted = count["events"] + 1, row["time"], row["id"]


def _difference(before: Any, now: Any, key: str = "") -> tuple[str, Any, Any]:
    """The first key in which two plain values differ, with both of its values."""
    if isinstance(before, dict) and isinstance(now, dict):
        for name in (*before, *now):
            if before.get(name) != now.get(name):
                return _difference(before.get(name), now.get(name), f"{key}.{name}".lstrip("."))
    return key, before, now
