"""Simulated participants of a study: programs in place of browsers, which speak with the study's pages.

A simulated participant knows what a person sees in the pictures: which object the goal is about, and where it is.
"""

from __future__ import annotations

import json
import random
import sqlite3
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from websockets.exceptions import ConnectionClosed, InvalidMessage, InvalidStatus
from websockets.sync.client import connect

from tools.page_client import TAB_PROTOCOL, PageClient, SceneClient

TIMEOUT = 600.0  # seconds: a busy machine loads robots slowly
VAGUE = ("the thing", "go there", "reach that one please", "the one over there")
OBJECTIONS = ("wait", "no", "stop")
UNHURRIED: dict[str, Any] = {
    "ping_interval": None,
    "max_queue": None,
    "open_timeout": TIMEOUT,
}  # who looks elsewhere for a while is not lost
LOST = (OSError, ConnectionClosed, InvalidStatus, InvalidMessage, EOFError)


class StudyClient:
    """The socket of a study's page. shown: what the page shows. notes: what it has said. acknowledged: numbers."""

    def __init__(self, address: str) -> None:
        self.address = address
        protocols: Any = [TAB_PROTOCOL]
        target = f"{address.replace('http', 'ws', 1)}socket"
        self._socket = connect(target, subprotocols=protocols, compression=None, proxy=None, **UNHURRIED)
        self.shown: dict[str, Any] = {}
        self.notes: list[str] = []
        self.acknowledged: set[int] = set()
        self._number = 0

    @property
    def code(self) -> str:
        """The participant's code."""
        return self.address.rstrip("/").rpartition("/")[2]

    def close(self) -> None:
        """Leave."""
        self._socket.close()

    def listen(self, seconds: float = 0.0) -> None:
        """Take in what the page has sent, and what it sends in the next seconds. Raises one of LOST."""
        end = time.monotonic() + seconds
        while True:
            try:
                message = json.loads(self._socket.recv(max(end - time.monotonic(), 0.0)))
            except TimeoutError:
                return
            self.shown = message.get("shown", self.shown)
            if "acknowledged" in message:
                self.acknowledged.add(message["acknowledged"])
                self.notes += [message["note"]] * bool(message["note"])

    def send(self, action: str, **fields: Any) -> int:
        """Send a message, and wait for its acknowledgement. Returns its number. Raises one of LOST, TimeoutError."""
        self._number += 1
        self._socket.send(json.dumps({"do": action, "number": self._number, **fields}))
        self.wait(lambda: self._number in self.acknowledged)
        self.listen()
        return self._number

    def act(self, action: str, **fields: Any) -> int:
        """Send a message of a participant where they are. As `send`."""
        return self.send(action, stage=self.shown["stage"], **fields)

    def wait(self, holds: Any, seconds: float = TIMEOUT) -> None:
        """Listen until something holds. Raises TimeoutError."""
        end = time.monotonic() + seconds
        while not holds():
            if time.monotonic() > end:
                raise TimeoutError(f"the page still shows {self.shown}")
            self.listen(0.02)


@dataclass
class SimulatedParticipant:
    """Goes through a study. Its errors and answers are drawn.

    address: of its page. database: from which it knows what a person sees in the pictures. scene: whether it looks at
    the scene too, as a browser does. rates: of the robot's clock, as it was shown. seen: entries of conversations that
    the page has shown, by trial and entry. confirmed: answers that were acknowledged, by stage and question.
    acts: how often what was acknowledged, by the kind of its event. at_work: whether it has a robot.
    """

    address: str
    database: Path
    seed: int
    scene: bool = True
    pause: float = 1.0
    rates: list[float] = field(default_factory=list)
    seen: dict[tuple[int, str], dict[str, Any]] = field(default_factory=dict)
    confirmed: dict[tuple[int, str], Any] = field(default_factory=dict)
    acts: Counter[str] = field(default_factory=Counter)
    at_work: bool = False
    finished: bool = False

    def __post_init__(self) -> None:
        self._rng = random.Random(self.seed)

    @property
    def code(self) -> str:
        """The participant's code."""
        return self.address.rstrip("/").rpartition("/")[2]

    def run(self, until: float = float("inf")) -> None:
        """Go on until the end, or until a time of the clock that never goes back. Raises one of LOST."""
        page = StudyClient(self.address)
        try:
            page.wait(lambda: page.shown)
            while time.monotonic() < until and not self.finished:
                match page.shown["kind"]:
                    case "consent":
                        page.act("consent")
                        self.acts["consented"] += 1
                    case "trial":
                        self._trial(page, until)
                    case "questions":
                        self._answer(page)
                    case "thanks":
                        self.finished = True
                    case _:
                        page.listen(0.2)
        finally:
            page.close()

    # ---- Questionnaires

    def _answer(self, page: StudyClient) -> None:
        stage = page.shown["stage"]
        for question in page.shown["questions"]:
            value = self._opinion(question)
            if value != "" and question["value"] is None:
                page.act("answer", question=question["name"], value=value)
                self.confirmed[stage, question["name"]] = value
            self._think(0.3)
        page.act("submit")
        self.acts["submitted"] += 1

    def _opinion(self, question: dict[str, Any]) -> Any:
        if question["kind"] == "likert":
            return min(max(round(self._rng.gauss(0.6, 0.2) * question["points"]), 1), question["points"])
        if question["kind"] == "choice":
            return self._rng.choice(question["choices"])
        return self._rng.choice(["", "It should see where I look.", "Nothing, it went well."])

    def _think(self, seconds: float) -> None:
        time.sleep(self.pause * seconds * self._rng.uniform(0.5, 1.5))

    # ---- Trials

    def _trial(self, page: StudyClient, until: float) -> None:
        page.wait(lambda: page.shown["kind"] != "trial" or page.shown["ready"])
        stage = page.shown["stage"]
        if page.shown["kind"] != "trial":
            return
        if not page.shown["begun"]:
            self._think(1.0)
            page.act("begin")
            self.acts["begun"] += 1
        trial, kind = page.shown["trial"], page.shown["input"]
        sentence, place = self._knowledge(page.shown["pictures"].removeprefix("goal/"))
        robot = PageClient(f"{self.address}robot/")
        scene = SceneClient(f"{self.address}robot/") if self.scene else None
        try:
            robot.wait_until_ready(TIMEOUT)
            self.at_work = True
            for attempt in range(4):
                self._instruct(robot, scene, kind, sentence, place, attempt)
                ended = self._watch(page, robot, scene, stage, trial, until)
                if ended or time.monotonic() > until:
                    return
            if page.shown["stage"] == stage:
                page.act("end", gave_up=True)
        finally:
            for client in (robot, scene):
                if client is not None:
                    client.__exit__()

    def _knowledge(self, scene: str) -> tuple[str, list[float]]:
        """The sentence of a goal, and where its object is."""
        from demo.study.goals import SceneGoal  # loads the simulator

        with sqlite3.connect(f"file:{self.database}?mode=ro", uri=True) as base:
            goal = SceneGoal.from_json(base.execute("SELECT data FROM goals WHERE scene=?", (scene,)).fetchone()[0])
            study = json.loads(base.execute("SELECT value FROM study WHERE key='config'").fetchone()[0])
        base.close()
        return study["scenes"][scene]["goal"], goal.gripper or next(iter(goal.places.values()))

    def _instruct(
        self, robot: PageClient, scene: SceneClient | None, kind: str, sentence: str, place: list[float], attempt: int
    ) -> None:
        """Say or show what to do; sometimes badly at first."""
        self._think(1.0)
        if kind == "finger" or (kind == "both" and self._rng.random() < 0.5):
            off = 0.12 if attempt == 0 and self._rng.random() < 0.2 else 0.0
            self._point(robot, scene, [place[0], place[1] + off, 0.03])
            self._think(0.5)
            if kind == "finger":
                robot.press("point")
            else:
                robot.send("say", text="reach this one")
            return
        if attempt == 0 and self._rng.random() < 0.3:
            sentence = self._rng.choice(VAGUE)
        robot.send("preview", text=sentence[: len(sentence) // 2])
        self._think(0.3)
        robot.send("say", text=sentence)
        if self._rng.random() < 0.15:
            self._think(0.3)
            robot.send("say", text=self._rng.choice(OBJECTIONS))

    @staticmethod
    def _point(robot: PageClient, scene: SceneClient | None, place: list[float]) -> None:
        if scene is None:
            robot.send("nudge", to="left")
            return
        finger = {
            "type": "TransformControlsUpdateMessage",
            "name": "/finger",
            "wxyz": [1.0, 0.0, 0.0, 0.0],
            "owner": "",
        }
        for share in (0.5, 1.0):
            scene.send(finger | {"position": [0.45 + share * (place[0] - 0.45), share * place[1], 0.03]})
            time.sleep(0.1)

    def _watch(
        self, page: StudyClient, robot: PageClient, scene: SceneClient | None, stage: int, trial: int, until: float
    ) -> bool:
        """Watch until the robot has done something, or the trial is over. Returns whether it is over."""
        still = time.monotonic() + 2.0
        while time.monotonic() < until:
            robot.listen(0.05)
            if scene is not None:
                scene.listen()
            page.listen()
            for name, entry in robot.sections.items():
                if name.startswith("entry "):
                    self.seen[trial, name] = entry
            self.rates.append(robot.sections["clock"]["rate"])
            if robot.closed is not None or page.shown.get("stage") != stage:
                page.wait(lambda: page.shown.get("stage") != stage or page.shown.get("ready"))
                return page.shown.get("stage") != stage
            if robot.sections["status"]["busy"]:
                still = time.monotonic() + 2.0
            elif time.monotonic() > still:
                return False
        return True
