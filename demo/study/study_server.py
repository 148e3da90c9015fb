"""The server of a study: pages of participants and of the experimenter, and a robot for each trial."""

from __future__ import annotations

import asyncio
import hmac
import json
import re
import secrets
import signal
import time
from contextlib import closing, suppress
from functools import partial
from http import HTTPStatus
from pathlib import Path
from typing import Any

import websockets.asyncio.server as websocket_server
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from demo.guarded_server import MAX_MESSAGE, TAB_PROTOCOL, GuardedConnection, page_logger, response, text_response
from demo.page_files import POLICY, PageFiles
from demo.page_gate import PageGate
from demo.study.database import StudyDatabase
from demo.study.progress import NotNow, StudyProgress
from demo.study.router import Backend, Moved, Router
from demo.study.study_messages import (
    EXPERIMENTER,
    PARTICIPANT,
    Begin,
    CloseStudy,
    Consent,
    DeleteParticipant,
    EndTrial,
    GiveAnswer,
    StageMessage,
    StopParticipant,
    StudyMessage,
    Submit,
    Withdraw,
)
from demo.study.trial_host import FULL, TrialHost
from demo.tab_messages import KindsCheck

ROBOT = "robot"  # path of the robot's page under a participant's
PICTURE = re.compile(r"goal/([^/]+)/(before|after)\.png")
PERIOD = 1.0  # seconds between two looks at all participants
CHECKPOINT = 10.0  # seconds between two moves of the log into the database's file
NO_LINK = "This link is not valid, or no longer. Ask whoever invited you.\n"
BEHIND = 16 * 1024  # bytes that a browser has not taken, above which it is sent no more
GOAL_PAUSE = 1.0  # seconds that the reached goal is seen
FRAMED = POLICY + "; frame-src 'self'"


class StudyServer:
    """Serves a study until it is stopped.

    Args:
        progress: the participants.
        host: address to listen on.
        gate: knows the names of the server. Its token is the experimenter's.
        trials: starts the robots; its `tell` is `note`.
    """

    def __init__(self, progress: StudyProgress, host: str, gate: PageGate) -> None:
        self._progress, self._host, self._gate = progress, host, gate
        self.trials: TrialHost | None = None
        self._secret = secrets.token_urlsafe(24)  # between the router and the pages
        self._files = PageFiles()
        self._sockets: dict[str, set[ServerConnection]] = {}  # by code; "" for the experimenter's
        self._page_port = 0
        self._stopped = asyncio.Event()
        self._tasks: set[asyncio.Task[None]] = set()
        self._checks = {True: KindsCheck(EXPERIMENTER), False: KindsCheck(PARTICIPANT)}

    # ---- Serving

    async def serve(self, port: int, on_ready: Any) -> None:
        """Serve until a signal or `stop`. on_ready: called once browsers can come."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            with suppress(NotImplementedError, RuntimeError):  # Windows, or a thread
                loop.add_signal_handler(number, self.stop)
        async with websocket_server.serve(
            self._serve_socket,
            "127.0.0.1",
            0,
            process_request=self._answer,
            create_connection=partial(GuardedConnection, self._checks[False]),  # type: ignore[arg-type]
            select_subprotocol=lambda _, offered: offered[0],
            max_size=MAX_MESSAGE,
            logger=page_logger(),
            server_header=None,
        ) as pages:
            self._page_port = next(iter(pages.sockets)).getsockname()[1]
            router = Router(self._gate, self._find)
            listener = await asyncio.start_server(router.serve, self._host, port)
            try:
                on_ready()
                watch = asyncio.create_task(self._watch())
                await self._stopped.wait()
                watch.cancel()
            finally:
                listener.close()  # without waiting: browsers keep their sockets open
                if self.trials is not None:
                    self.trials.end_all()

    def stop(self) -> None:
        """End `serve`."""
        self._stopped.set()

    def _find(self, target: str) -> tuple[Backend, str] | Moved | str:
        """The server for a path and query, and what it is asked for; a text where there is none."""
        path, _, query = target.partition("?")
        key, _, rest = path.removeprefix("/").partition("/")
        if not key and query.startswith("token="):
            key = query.removeprefix("token=").partition("&")[0]
            return Moved(f"/{key}/") if self._is_experimenter(key) else NO_LINK
        if "/" not in path.removeprefix("/"):
            return Moved(f"{path}/") if self._known(key) or self._is_experimenter(key) else NO_LINK
        end = f"?{query}" if query else ""
        if self._is_experimenter(key):
            return Backend(self._page_port, "study", f"/{self._secret}/experimenter/"), rest + end
        code = self._known(key)
        if code is None:
            return NO_LINK
        inner = rest.removeprefix(f"{ROBOT}/")
        if inner == rest:
            return Backend(self._page_port, "study", f"/{self._secret}/{code}/"), rest + end
        assert self.trials is not None
        running = self.trials.running.get(code)
        if running is None or not running.port:
            return "One moment: the robot is loading.\n"
        return Backend(running.port, f"127.0.0.1:{running.asked_port}", f"/{running.token}/"), inner + end

    def _is_experimenter(self, key: str) -> bool:
        return hmac.compare_digest(key.encode("latin-1", "replace"), self._gate.token.encode())

    def _known(self, key: str) -> str | None:
        """The participant's code if it is one. All are compared, so that the time tells nothing."""
        given = key.encode("latin-1", "replace")
        found = [code for code in self._progress.codes() if hmac.compare_digest(code.encode(), given)]
        return found[0] if found else None

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """The answer to a request of the router; None for a socket that may be opened."""
        path = request.path.partition("?")[0].removeprefix("/")
        secret, _, rest = path.partition("/")
        if not hmac.compare_digest(secret.encode("latin-1", "replace"), self._secret.encode()):
            return text_response(HTTPStatus.FORBIDDEN, NO_LINK)
        who, _, name = rest.partition("/")
        if "Upgrade" in request.headers:
            protocols = request.headers.get_all("Sec-WebSocket-Protocol")
            if name != "socket" or protocols != [TAB_PROTOCOL]:
                return text_response(HTTPStatus.BAD_REQUEST, "Load the page again.\n")
            request.path = f"/{who}"
            return None
        if not name:
            name = "experimenter.html" if who == "experimenter" else "study.html"
        if picture := PICTURE.fullmatch(name):
            query = f"SELECT {picture[2]} FROM goals WHERE scene=?"
            row = self._progress.database.first(query, (picture[1].replace("%20", " "),))
            found = None if row is None else (row[0], {"Content-Type": "image/png"})
        else:
            found = self._files.get(name)
        if found is None:
            return text_response(HTTPStatus.NOT_FOUND, "There is no such file.\n")
        return response(HTTPStatus.OK, found[0], found[1] | {"Content-Security-Policy": FRAMED})

    # ---- Sockets

    async def _serve_socket(self, connection: ServerConnection) -> None:
        assert connection.request is not None
        assert isinstance(connection, GuardedConnection)
        who = connection.request.path.removeprefix("/")
        is_experimenter = who == "experimenter"
        code = "" if is_experimenter else who
        self._sockets.setdefault(code, set()).add(connection)
        try:
            if not is_experimenter:
                self._progress.database.log(code, 0, "connected")
            await self._show(code)
            while True:
                message = await connection.next_message(self._checks[is_experimenter])
                try:
                    note = self._obey(message) if is_experimenter else self._serve_participant(code, message)
                except NotNow as refused:
                    note = str(refused)
                await connection.send(json.dumps({"acknowledged": message.number, "note": note}))
                await self._show(code)
                if is_experimenter:
                    await self._show_all()
        except ConnectionClosed:
            pass
        finally:
            self._sockets[code].discard(connection)
            if not is_experimenter:
                self._progress.database.log(code, 0, "disconnected")

    def _serve_participant(self, code: str, message: StudyMessage) -> str:
        """Do what a participant asks for; it is in the database when this returns. Raises NotNow."""
        progress = self._progress
        if isinstance(message, Withdraw):
            self._withdraw(code)
            return "Everything about you is deleted."
        assert isinstance(message, StageMessage)
        if message.stage != progress.shown(code)["stage"]:
            return ""  # it is sent again, or by another tab
        match message:
            case Consent():
                progress.consent(code)
            case Begin():
                progress.begin(code)
            case EndTrial(gave_up=gave_up):
                self._end_trial(code, "gave up" if gave_up else "done")
            case GiveAnswer(question=question, value=value):
                progress.answer(code, question, value)
            case Submit():
                progress.submit(code)
        return ""

    def _end_trial(self, code: str, result: str) -> None:
        """End a trial, then its robot."""
        assert self.trials is not None
        running, trial = self.trials.running.get(code), self._progress.trial(code)
        reached = None if trial is None or trial.scene.goal is None else running is not None and running.goal
        self._progress.end_trial(code, result, reached, 0.0 if running is None else running.clock)
        self.trials.end(code)

    def _withdraw(self, code: str) -> None:
        assert self.trials is not None
        self.trials.end(code)  # first: it writes no more
        self._progress.withdraw(code)

    def _obey(self, message: StudyMessage) -> str:
        """Do what the experimenter asks for. Raises NotNow."""
        assert self.trials is not None
        match message:
            case StopParticipant(code=code, stopped=stopped):
                self._progress.stop(code, stopped)
                self.trials.end(code)
            case DeleteParticipant(code=code):
                self._withdraw(code)
            case CloseStudy(closed=closed):
                self._progress.close(closed)
                self.trials.end_all()
        return ""

    # ---- What is shown

    async def _show(self, code: str) -> None:
        """Send a participant's tabs, or the experimenter's, what they show now."""
        if not self._sockets.get(code):
            return
        try:
            shown = self._overview() if not code else self._shown(code)
        except NotNow as gone:
            shown = {"kind": "gone", "text": str(gone), "stage": 0, "of": 1}
        message = json.dumps({"shown": shown})
        for connection in list(self._sockets.get(code, ())):
            if connection.transport.get_write_buffer_size() > BEHIND:  # nobody waits for a browser that does not read
                continue
            with suppress(ConnectionClosed):
                await connection.send(message)

    async def _show_all(self) -> None:
        for code in list(self._sockets):
            await self._show(code)

    def _shown(self, code: str) -> dict[str, Any]:
        assert self.trials is not None
        shown = self._progress.shown(code)
        if shown["kind"] == "trial":
            trial = self._progress.trial(code)
            if trial is not None:
                self.trials.start(trial)
            running = self.trials.running.get(code)
            note = FULL if running is None else running.failed
            ready = running is not None and bool(running.port) and not running.failed
            shown |= {"ready": ready, "run": 0 if running is None else running.run, "note": note}
            shown["clock"] = shown["clock"] if running is None else running.clock
            shown["reached"] = running is not None and running.goal
        return shown

    def _overview(self) -> dict[str, Any]:
        assert self.trials is not None
        people = []
        for each in self._progress.overview():
            running = self.trials.running.get(each["code"])
            robot = None if running is None else {"clock": running.clock, "rate": running.rate, "note": running.failed}
            people.append(each | {"here": bool(self._sockets.get(each["code"])), "robot": robot})
        database = self._progress.database
        return {
            "title": self._progress.study.title,
            "open": self._progress.is_open,
            "participants": people,
            "withdrawn": database.get("withdrawn") or 0,
            "database": str(database.path),
            "time": time.time(),
        }

    def note(self, code: str, what: str) -> None:
        """Take what a trial's process tells. In the thread of the event loop."""
        task = asyncio.get_running_loop().create_task(self._after(code, what))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _after(self, code: str, what: str) -> None:
        if what:
            with suppress(NotNow):  # withdrawn, stopped or ended meanwhile
                stage = self._progress.stage(code)
                await self._show(code)
                await asyncio.sleep(GOAL_PAUSE if what == "goal" else 0)
                if self._progress.stage(code) == stage:
                    self._end_trial(code, "goal reached" if what == "goal" else "time is over")
        await self._show(code)

    async def _watch(self) -> None:
        """Look after all participants: free the robots of those who left, let in who waits, show the experimenter."""
        assert self.trials is not None
        checkpointed = time.monotonic()
        while True:
            await asyncio.sleep(PERIOD)
            now = time.monotonic()
            for code, running in list(self.trials.running.items()):
                if self._sockets.get(code):
                    running.left = now
                elif now - running.left > 60 * self._progress.study.idle_minutes:
                    self.trials.end(code)
            await self._show_all()
            if now - checkpointed > CHECKPOINT:
                checkpointed = now
                await asyncio.to_thread(_checkpoint, self._progress.database.path)


def _checkpoint(path: Path) -> None:
    """Move the log into the database's file, with a connection of its own: nobody waits for the disk."""
    with closing(StudyDatabase(path, worker=True)) as database:
        database.checkpoint()
