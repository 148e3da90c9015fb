"""The page of the demo: shows a session's state, and turns what tabs ask for into requests to the session's loop."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from core.overrides import groups
from demo.conversation import Conversation, Entry, entry_of
from demo.guarded_server import PageParts
from demo.hearing_panel import HearingPanel
from demo.real_time_loop import RealTimeLoop
from demo.recording_panel import RecordingPanel
from demo.scene_view import SceneView
from demo.scenery import Scenery
from demo.session import Session
from demo.session_config import MOST_OBJECTS, SessionConfig, check_run, pretrained_policies
from demo.shared_scene import PREPARED, Pointed, PutThere, Said, scene_of
from demo.shared_state import Tab
from demo.sharing_panel import SharingPanel
from demo.sight_panel import SightPanel, load_network
from demo.splash_page import set_camera
from demo.tab_messages import (
    MIN_SPEED,
    Change,
    Click,
    ExportEpisodes,
    Hear,
    Hover,
    MoveHand,
    MoveObject,
    Nudge,
    OpenScene,
    Preview,
    Say,
    SetCamera,
    SetDriver,
    SetFlag,
    SetSpeed,
    SetViewpoint,
    TabMessage,
)
from language import LanguageError, Outcome, Signal

Array = NDArray[np.float64]
DIRECTIONS = {  # as the person sees them, who stands opposite the robot
    "away": (-1, 0, 0),
    "near": (1, 0, 0),
    "left": (0, -1, 0),
    "right": (0, 1, 0),
    "up": (0, 0, 1),
    "down": (0, 0, -1),
}
STOOD = 0.004  # metres: what moved by less stood still
WELCOME = "Say what the robot shall do, or click a thing to point at it. You can ask what it sees, too."
MAX_SENTENCE = 500  # characters
FASTER = {"faster": 2.0, "slower": 0.5}  # factors of the clock's speed
DRIVEN_BY = {
    "policy": "The trained policy drives.",
    "expert": "The scripted expert drives.",
    "hand": "You drive by hand.",
}


class Page:
    """The page of a server. All tabs show the same scene and conversation, with what is done in all others.

    Messages of tabs come in the server's thread, so they only send requests to the loop.
    """

    def __init__(self, server: viser.ViserServer, session: Session, parts: PageParts, scene: str | None = None) -> None:
        """
        Args:
            server: of the scene.
            session: that is shown.
            parts: of the server.
            scene: name or code of the scene that the session shows; None: no shared one.
        """
        self.loop = RealTimeLoop(session, self._show, self._note)
        self._server, self._scenes = server, parts.scenes
        self._state: Any = parts.state
        self._conversation = Conversation(parts.state.put, parts.state.drop)
        self._listed_for: Array = np.zeros(0)  # positions of the objects, and the held object
        self._finger: Any = None
        self._shown_workspace = ""  # by the camera
        self._scene_view = SceneView(server, self._on_click, self._on_drag)
        self._scenery = Scenery(self._scene_view)
        self._recording = RecordingPanel(parts.state, parts.files, Path.cwd(), self._note)
        self._sight = SightPanel(parts.state, load_network)
        self._hearing = HearingPanel(parts.state)
        self._sharing = SharingPanel(parts.state, parts.files, self._note)
        if scene is not None:
            self._begin_scene(session, scene)
        self._show_env(session)
        self._conversation.note(WELCOME)
        parts.state.handle = self._handle

    # ---- Messages of tabs

    def _handle(self, tab: Tab, message: TabMessage) -> None:
        ask = self.loop.ask
        match message:
            case Say(text=text):
                ask(lambda session: self._hear(session, text.strip()))
            case Hear(pcm=pcm, rate=rate):
                ask(lambda session: self._hearing.take(session, tab, pcm, rate), f"sound {tab.number}")
            case Preview(text=text):
                ask(lambda session: self._preview(session, tab, text.strip()), f"preview {tab.number}")
            case Hover(at=at):
                ask(lambda session: self._hover(session, tab, at), f"hover {tab.number}")
            case Nudge(to=to):
                ask(lambda session: self._nudge(session, to))
            case MoveObject(object=index, to=to):
                ask(lambda session: self._move_object(session, tab, index, to))
            case Click(button=button):
                self._press(tab, button)
            case Change():
                ask(lambda session: self._change(session, message), "change")
            case OpenScene(text=text):
                ask(lambda session: self._open_scene(session, text), "change")
            case ExportEpisodes(kind=kind):
                ask(lambda session: self._sharing.export(session, tab, kind))
            case MoveHand(place=place):
                ask(lambda session: self._move_hand(session, np.array(place)), "hand")
            case _:
                self._set(message)

    def _press(self, tab: Tab, button: str) -> None:
        ask = self.loop.ask
        match button:
            case "stop":
                ask(self._stop)
            case "shuffle":
                ask(self._shuffle)
            case "point":
                ask(self._go_where_pointed)
            case "step":
                self.loop.step_once()
            case "picture":
                ask(lambda session: self._recording.send_picture(session, tab))
            case "video":
                ask(lambda session: self._recording.toggle(tab))
            case "link":
                ask(lambda session: self._sharing.send_link(session, tab))
            case "stop arm":  # the loop heeds it at its next look at the arm
                if self.loop.session.arm is not None:
                    self.loop.session.arm.safety.request_stop("somebody pressed stop on the page")
            case "release arm":
                ask(lambda session: session.arm.safety.release() if session.arm is not None else None)

    def _set(self, message: TabMessage) -> None:
        ask = self.loop.ask
        match message:
            case SetDriver(value=driver):
                ask(lambda session: self._set_driver(session, driver), "driver")
            case SetViewpoint(value=viewpoint):
                ask(lambda session: self._set_viewpoint(session, viewpoint), "viewpoint")
            case SetSpeed(value=speed):
                self.loop.speed = speed
            case SetCamera(value=camera):
                ask(lambda session: self._sight.choose(camera), "camera")
            case SetFlag(name=name, value=flag):
                ask(lambda session: self._set_flag(session, name, flag), name)

    def _set_flag(self, session: Session, name: str, value: bool) -> None:
        match name:
            case "paused":
                self.loop.paused = value
            case "gripper closed":
                session.gripper_closed = value
            case "names":
                self._scene_view.shows_names = value
            case "glow":
                self._scene_view.glows = value
            case "compares":
                session.compares = value
            case "looks":
                self._sight.look(value)

    # ---- Sentences and buttons

    def _hear(self, session: Session, sentence: str) -> None:
        """Do what somebody says now. What a link would have said later is not said any more."""
        self._sharing.stop()
        self._say(session, sentence)

    def _say(self, session: Session, sentence: str) -> None:
        if not sentence:
            return
        self._sharing.did(Said(text=sentence), session)
        try:
            outcome = session.say(checked(sentence))
        except LanguageError as error:
            self._conversation.answer(Entry("refusal", [(sentence, "")], text=f"{error}"), session.view)
            return
        outcome = self._with_clock(outcome)
        entry = entry_of(sentence, outcome, session.understood, session.object_names())
        self._conversation.answer(entry, session.view)

    def _with_clock(self, outcome: Outcome) -> Outcome:
        """Let the clock run faster or slower, where a sentence asks for that. Return the outcome with what was done."""
        if not isinstance(outcome, Signal) or outcome.control not in FASTER:
            return outcome
        before, factor = self.loop.speed, FASTER[outcome.control]
        self.loop.speed = min(max(before * factor, MIN_SPEED), 1.0)
        if self.loop.speed == before:
            way = ("in real time", "faster") if factor > 1 else (f"at {before:.0%} of real time", "more slowly")
            return replace(outcome, text=f"the clock runs {way[0]}, and I cannot go {way[1]} than that")
        return replace(outcome, text=f"the clock runs at {self.loop.speed:.0%} of real time now")

    def _preview(self, session: Session, tab: Tab, sentence: str) -> None:
        if not sentence:
            tab.send("preview", None)
            return
        try:
            outcome = session.preview(checked(sentence))
        except LanguageError as error:
            tab.send("preview", {"kind": "refusal", "text": str(error)})
            return
        entry = entry_of(sentence, outcome, session.understood, session.object_names())
        tab.send("preview", {"kind": entry.kind, "text": entry.understood or entry.text, "said": entry.said})

    def _stop(self, session: Session) -> None:
        self._sharing.stop()
        session.stop()
        self._conversation.update(session.view, session.busy)

    def _go_where_pointed(self, session: Session) -> None:
        session.go_where_pointed()
        self._conversation.start("Go where I point", session.view)

    def _shuffle(self, session: Session) -> None:
        session.shuffle()
        self._sharing.begin(session)
        self._show_choice(session)
        self._scene_view.update_colors()
        self._leave_scene(session, "This is a new scene.")

    def _leave_scene(self, session: Session, text: str) -> None:
        """Tell of a new scene. What can be said in it is told first: nobody is offered words of the scene before."""
        self._list_sayable(session)
        self._conversation.leave_scene()
        self._conversation.note(text)

    def _note(self, text: str) -> None:
        """Add a message to the conversation. Can be called in any thread."""
        self.loop.ask(lambda _: self._conversation.note(text), "note")

    # ---- Finger, objects and gripper

    def _hover(self, session: Session, tab: Tab, at: tuple[float, float] | None) -> None:
        client = self._scenes.get(tab.number)
        if client is not None:
            self._scene_view.hover(client, at, session.scene(), session.object_names())

    def _on_click(self, body: int) -> None:
        self.loop.ask(lambda session: self._point_at_body(session, body), "click")

    def _point_at_body(self, session: Session, body: int) -> None:
        bodies = session.env.bodies()
        if body in bodies:
            self._point_at(session, session.scene().positions[bodies.index(body)])

    def _point_at(self, session: Session, place: Array) -> None:
        session.point_at(place)
        self._note_finger(session)
        self._show_finger(session)

    def _note_finger(self, session: Session) -> None:
        x, y, z = session.finger.aim.round(4).tolist()
        self._sharing.did(Pointed(place=(x, y, z)), session)

    def _show_finger(self, session: Session) -> None:
        if self._finger is not None:
            self._finger.position = tuple(session.finger.aim)

    def _follow_finger(self, session: Session) -> None:
        if self._finger is not None:
            session.point_at(np.array(self._finger.position))
            self._note_finger(session)

    def _on_drag(self, body: int, place: Array) -> None:
        self.loop.ask(lambda session: self._put_object(session, body, place), "drag")

    def _put_object(self, session: Session, body: int, place: Array) -> None:
        bodies = session.env.bodies()
        if body in bodies:
            session.put_object(bodies.index(body), place[:2])
            self._note_object(session, bodies.index(body))

    def _note_object(self, session: Session, index: int) -> None:
        x, y, _ = session.scene().positions[index].round(4).tolist()
        self._sharing.did(PutThere(object=index, place=(x, y)), session)

    def _move_object(self, session: Session, tab: Tab, index: int, to: str) -> None:
        """Move an object by a little, and tell the tab where it stands now."""
        if index >= len(session.env.bodies()):
            return
        before = session.scene().positions[index]
        session.nudge_object(index, DIRECTIONS[to])
        self._note_object(session, index)
        place = session.scene().positions[index]
        text = place_in_words(place) + ("" if np.abs(place - before).max() > STOOD else "; it goes no farther that way")
        tab.send("moved", f"{session.object_names()[index]}: {text}")

    def _nudge(self, session: Session, to: str) -> None:
        session.nudge(DIRECTIONS[to])
        if session.hand_target is None:
            self._note_finger(session)
        self._show_finger(session)

    def _move_hand(self, session: Session, place: Array) -> None:
        if session.hand_target is not None:
            session.move_hand(place)

    # ---- Robot, task and policy

    def _set_driver(self, session: Session, driver: str) -> None:
        if driver != session.config.driver:
            session.set_driver(driver)
            self._conversation.note(DRIVEN_BY[driver])

    def _set_viewpoint(self, session: Session, viewpoint: str) -> None:
        if viewpoint != session.viewpoint:
            session.set_viewpoint(viewpoint)
            self._listed_for = np.zeros(0)
            self._leave_scene(session, f"From now on, {session.whose_left}.")

    def _change(self, session: Session, message: Change) -> None:
        if message.run:
            check_run(message.run)
        paths = {each.name: str(each.path) for each in pretrained_policies()}
        objects = session.config.objects  # then another task keeps its own number
        if message.objects not in (None, self._shown_objects(session)):
            objects = message.objects
        workspace = message.workspace
        if workspace == session.config.workspace == session.own_workspace:
            workspace = None  # another task has its own
        values = {name: getattr(message, name) for name in ("robot", "control", "task")}
        values |= {"workspace": workspace, "objects": objects, "driver": session.wished_driver}
        values["checkpoint"] = message.run or paths.get(message.policy or "")
        self._rebuild(session, replace(session.config, **values))
        self._sharing.begin(session)
        self._show_env(session)
        config = session.config
        note = session.note or DRIVEN_BY[config.driver]
        self._leave_scene(session, f"This is another scene: robot {config.robot}, task {config.task}. {note}")

    def _rebuild(self, session: Session, config: SessionConfig, seed: int | None = None) -> None:
        self._state.put("status", {"loading": True})
        try:
            session.change(config, seed)
        finally:
            self._show_status(session)

    # ---- Shared scenes

    def _open_scene(self, session: Session, text: str) -> None:
        """Show a prepared scene, or that of a link. Raises ConfigError, and then nothing changes."""
        shared = scene_of(text)
        self._rebuild(session, replace(session.config, checkpoint=None, **shared.choices), shared.seed)
        self._begin_scene(session, text)
        self._show_env(session)
        note = session.note or DRIVEN_BY[session.config.driver]
        title = PREPARED[text].title if text in PREPARED else "This is the scene of a link"
        self._leave_scene(session, f"{title}. {note}")

    def _begin_scene(self, session: Session, text: str) -> None:
        shared = scene_of(text)
        session.set_viewpoint(shared.viewpoint)
        self._sharing.begin(session, shared.events, text if text in PREPARED else "")

    def _go_on(self, session: Session) -> None:
        """Do what a link says is to happen now, if anything."""
        match self._sharing.due(session):
            case Said(text=text):
                self._say(session, text)
            case Pointed(place=place):
                self._point_at(session, np.array(place))
            case PutThere(object=index, place=at) if index < len(session.env.bodies()):
                session.put_object(index, np.array(at))
                self._note_object(session, index)

    @staticmethod
    def _shown_objects(session: Session) -> int:
        return min(session.env.config.task.num_objects, MOST_OBJECTS)

    def _show_env(self, session: Session) -> None:
        """Shows a new environment and its config."""
        config = session.config
        self._scene_view.show_env(session.env)
        self._scenery.show_env(session.env)
        self._sight.show_env(session.env)
        if config.workspace != self._shown_workspace:
            self._shown_workspace = str(config.workspace)
            set_camera(self._server, self._shown_workspace)
        self._finger = None
        if session.env.has_person:
            self._finger = self._scene_view.add_finger(session.finger.aim)
            self._finger.on_update(lambda _: self.loop.ask(self._follow_finger, "finger"))
        self._show_choice(session)
        self._listed_for = np.zeros(0)

    def _show_choice(self, session: Session) -> None:
        config = session.config
        options = {name: groups()[name] for name in ("robot", "control", "task", "workspace")}
        shown = {name: getattr(config, name) for name in options} | {"objects": self._shown_objects(session)}
        shown |= {"run": config.checkpoint or "", "scene": self._sharing.name}
        scenes = [(name, each.title) for name, each in PREPARED.items()]
        policies = [policy.name for policy in pretrained_policies()]
        choice = {"options": options, "policies": policies, "scenes": scenes, "most": MOST_OBJECTS, "shown": shown}
        self._state.put("choice", choice)

    # ---- Output

    def _show(self, session: Session) -> None:
        """Called by the loop after every step."""
        self._go_on(session)
        view, names, positions = session.view, session.object_names(), session.scene().positions
        with self._server.atomic():
            self._scene_view.update_poses()
            moves = {name: intent.move for name, intent in view.intents.items()}
            self._scene_view.show_moves(session.env.gripper[0], moves)
            self._scene_view.highlight(view.highlighted, positions, session.env.gripper[0], session.busy)
            self._scenery.show_shadows(self._casting(session, positions))
            self._scene_view.show_pointing(view.ray, view.pointing, positions)
            self._scene_view.show_shares(view.attention, names, positions)
        self._show_status(session)
        self._show_lab(session, names)
        self._show_intents(session)
        self._list_sayable(session)
        self._conversation.update(view, session.busy)
        self._recording.update(session)
        self._sight.update(session)

    @staticmethod
    def _casting(session: Session, positions: Array) -> Array:
        """(N, 3) metres: the gripper, and the objects that can be moved."""
        loose = [body is not None for body in session.env.bodies()] & ~session.scene().targets
        return np.concatenate((session.env.gripper[:1], positions[loose]))

    def _show_status(self, session: Session) -> None:
        view, arm = session.view, session.arm
        stopped = arm is not None and bool(arm.safety.stopped)
        status = {"loading": False, "text": view.status, "busy": session.busy, "note": session.note}
        status |= {"driver": session.config.driver, "policy": session.has_policy, "hears": view.policy_sentence}
        status |= {"acting": session.acting}
        status |= {"arm": session.arm_note, "real": arm is not None, "stopped": stopped}
        status |= {"viewpoint": session.viewpoint, "left": session.whose_left, "person": session.env.has_person}
        self._state.put("status", status)
        clock = {"paused": self.loop.paused, "speed": round(self.loop.speed, 2), "rate": round(self.loop.rate, 2)}
        self._state.put("clock", clock)

    def _show_lab(self, session: Session, names: list[str]) -> None:
        view = session.view
        shares = {"attention": view.attention, "pointing": view.pointing}
        lists = {
            name: None if each is None or len(each) != len(names) else [round(float(share), 2) for share in each]
            for name, each in shares.items()
        }
        rewards = {name: round(value, 3) for name, value in view.rewards.items()}
        steps = int(session.env.elapsed[0]) if session.busy else 0
        outcomes = {name: count for name, count in view.outcome_counts.items() if count}
        movable = [index for index, body in enumerate(session.env.bodies()) if body is not None]
        self._state.put(
            "lab",
            {"names": names, "movable": movable, **lists, "rewards": rewards, "step": steps, "outcomes": outcomes},
        )
        low, high = np.reshape(session.env.config.workspace.gripper_box, (3, 2)).T.tolist()
        place = None if session.hand_target is None else [round(each, 3) for each in session.hand_target.tolist()]
        self._state.put("hand", {"low": low, "high": high, "place": place, "closed": session.gripper_closed})

    def _show_intents(self, session: Session) -> None:
        intents = {
            name: {"action": intent.action.round(2).tolist(), "move": (1000 * intent.move).round().tolist()}
            for name, intent in session.view.intents.items()
        }
        self._state.put("intents", {"compares": session.compares, "policy": session.has_policy, "of": intents})

    def _list_sayable(self, session: Session) -> None:
        """Lists feasible instructions while none is being carried out. The list is renewed if something has moved."""
        held = session.env.held
        state = np.append(session.scene().positions.round(2), -1 if held is None else held)
        if session.busy or np.array_equal(state, self._listed_for):
            return
        self._listed_for = state
        self._state.put("sayable", list(dict.fromkeys((*self._sharing.sentences, *session.sayable()))))

    def close(self) -> None:
        """Ends and saves a video that is being recorded, and ends the process that hears."""
        self._recording.save()
        self._hearing.close()


def place_in_words(place: Array) -> str:
    """A place (3,), metres, as the person sees it who stands opposite the robot."""
    side = f"{100 * abs(place[1]):.0f} cm to your {'left' if place[1] < 0 else 'right'}"
    return f"{100 * place[0]:.0f} cm from the robot, " + (side if abs(place[1]) >= 0.005 else "in the middle")


def checked(sentence: str) -> str:
    """The sentence. Raises LanguageError for a long one: the parser takes longer than a control step for some."""
    if len(sentence) > MAX_SENTENCE:
        raise LanguageError(f"That is too long: a sentence has at most {MAX_SENTENCE} characters.")
    return sentence
