"""The page of the demo: shows the state of a session, and turns input into requests to the session's loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from core.overrides import groups
from demo import html
from demo.real_time_loop import RealTimeLoop
from demo.recording_panel import RecordingPanel
from demo.room import MOST_SAID
from demo.scene_view import SceneView
from demo.session import Session
from demo.session_config import DRIVERS, MOST_OBJECTS, SessionConfig, check_run, pretrained_policies
from demo.sight_panel import SightPanel, load_network
from demo.splash_page import set_camera
from deployment.safe_arm import SafeArm
from language import LanguageError, Outcome

Array = NDArray[np.float64]
AUTO = "the one that fits"
DIRECTIONS = {  # of keys, as the person sees them, who stands opposite the robot
    "arrowup": (-1, 0, 0),
    "arrowdown": (1, 0, 0),
    "arrowleft": (0, -1, 0),
    "arrowright": (0, 1, 0),
    "pageup": (0, 0, 1),
    "pagedown": (0, 0, -1),
}
ALARM = (200, 30, 30)  # RGB of the button that stops an arm
LISTED = (222, 235, 250)  # RGB of the buttons that list feasible instructions
MAX_SENTENCE = 500  # characters
SPEEDS = (0.1, 1.0)  # range of the clock's speed; 1 is real time
HELP_BY_HAND = "Choose 'Driven by: hand'. Arrow and page keys move the gripper too."


class Page:
    """The page of a server. All browsers show the same scene, with the actions of all others.

    Browser callbacks run in other threads, so they only send requests to the loop.
    """

    def __init__(self, server: viser.ViserServer, session: Session) -> None:
        self.loop = RealTimeLoop(session, self._show, self._show_message)
        self._server = server
        self._gui: Any = server.gui
        self._shown_html: dict[str, str] = {}
        self._listed_for: Array = np.zeros(0)  # positions of the objects, and the held object
        self._finger: Any = None
        self._shown_workspace = ""  # by the camera
        self._release: Any = None  # the button that lets a stopped arm move again
        self._scene_view = SceneView(server, self._on_click, self._on_drag)
        self._gui.reset()
        self._build(session)
        self._show_env(session)

    # ---- Elements

    def _build(self, session: Session) -> None:
        gui = self._gui
        self._arm = gui.add_html("")
        if session.arm is not None:
            self._build_arm(session.arm)
        self._interpretation, self._message = gui.add_html(html.message("")), gui.add_html("")
        self._status = gui.add_html("")
        with gui.add_form(None) as form:
            self._typed = gui.add_text("Say", "", hint="an instruction, a correction or an answer, then Enter")
            do = gui.add_button("Do it")
        self._typed.on_update(self._preview)
        form.on_submit(self._say)
        do.on_click(self._say)
        self._whose_left = gui.add_html("")
        buttons = gui.add_button_group("", ("Stop", "Shuffle", "Go where I point"))
        buttons.on_click(lambda event: self._press(event.target.value))
        with gui.add_folder("You can say now") as self._list:
            self._sayable = [gui.add_button("", visible=False, color=LISTED) for _ in range(MOST_SAID)]
        for each in self._sayable:
            each.on_click(lambda event: self._say_listed(event.target.label))
        with gui.add_folder("Attention and rewards"):
            self._shares, self._rewards = gui.add_html(""), gui.add_html("")
        self._build_clock()
        self._build_choice(session.config, session.env.config.task.num_objects)
        self._build_by_hand(session.env.config.workspace.gripper_box)
        self._recording = RecordingPanel(self._server, self.loop, Path.cwd(), self._show_message)
        self._sight = SightPanel(self._server, load_network)
        for key, direction in DIRECTIONS.items():
            command = gui.add_command(f"Move the finger, or the gripper: {key}", hotkey=key)  # type: ignore[arg-type]
            command.on_trigger(lambda _, to=direction: self.loop.ask(lambda session: self._nudge(session, to)))

    def _build_arm(self, arm: SafeArm) -> None:
        """Buttons of an arm that is driven. The loop heeds the first at its next look at the arm."""
        self._gui.add_html(html.PINNED)
        stop = self._gui.add_button("STOP THE ARM", color=ALARM)
        stop.on_click(lambda _: arm.safety.request_stop("somebody pressed stop on the page"))
        self._release = self._gui.add_button("Let it move again", visible=False)
        self._release.on_click(lambda _: self.loop.ask(lambda _: arm.safety.release()))

    def _build_clock(self) -> None:
        gui = self._gui
        with gui.add_folder("Time", expand_by_default=False):
            self._paused = gui.add_checkbox("Pause", False)
            self._speed = gui.add_slider("Speed", *SPEEDS, 0.1, 1.0)
            single = gui.add_button("One step")
        self._paused.on_update(lambda _: setattr(self.loop, "paused", self._paused.value))
        self._speed.on_update(lambda _: setattr(self.loop, "speed", min(max(self._speed.value, SPEEDS[0]), SPEEDS[1])))
        single.on_click(lambda _: self.loop.step_once())

    def _build_choice(self, config: SessionConfig, objects: int) -> None:
        gui, options = self._gui, groups()
        with gui.add_folder("Robot, task and policy"):
            self._driver = gui.add_dropdown("Driven by", DRIVERS, initial_value=config.driver)
            self._choices = {
                name: gui.add_dropdown(name.capitalize(), options[name], initial_value=getattr(config, name))
                for name in ("robot", "control", "task", "workspace")
            }
            self._objects = gui.add_slider("Objects", 1, MOST_OBJECTS, 1, min(objects, MOST_OBJECTS))
            policies = [AUTO, *(policy.name for policy in pretrained_policies())]
            self._policies = gui.add_dropdown("Policy", policies, initial_value=AUTO)
            self._run_folder = gui.add_text("or a run folder", config.checkpoint or "")
            change = gui.add_button("Change")
        change.on_click(lambda _: self._change())
        self._driver.on_update(lambda _: self.loop.ask(self._set_driver, "driver"))

    def _build_by_hand(self, box: Sequence[float]) -> None:
        gui = self._gui
        with gui.add_folder("By hand", expand_by_default=False):
            gui.add_html(html.hint(HELP_BY_HAND))
            limits = zip("xyz", box[::2], box[1::2], strict=True)
            self._hand_sliders = [gui.add_slider(axis, low, high, 0.01, low) for axis, low, high in limits]
            self._gripper_closed = gui.add_checkbox("Gripper closed", False)
        for slider in self._hand_sliders:
            slider.on_update(self._on_slide)
        self._gripper_closed.on_update(lambda _: self.loop.ask(self._set_gripper, "gripper"))

    # ---- Sentences and buttons

    def _preview(self, event: Any) -> None:
        if event.client is None:  # `_say` has emptied the box: what it shows stays
            return
        sentence = self._typed.value
        self.loop.ask(lambda session: self._show_interpretation(session, sentence, session.preview), "preview")

    async def _say(self, _: Any) -> None:
        """A coroutine, so that it runs in viser's event loop: no other sentence comes between reading and clearing."""
        sentence = self._typed.value.strip()
        if sentence:
            self.loop.ask(lambda session: self._show_interpretation(session, sentence, session.say))
            self._typed.value = ""

    def _say_listed(self, sentence: str) -> None:
        self.loop.ask(lambda session: self._show_interpretation(session, sentence, session.say))

    def _show_interpretation(self, session: Session, sentence: str, interpret: Callable[[str], Outcome]) -> None:
        self._show_message("")
        if not sentence.strip():
            return
        if len(sentence) > MAX_SENTENCE:  # the parser takes longer than a control step for some
            raise LanguageError(f"that is too long: a sentence has at most {MAX_SENTENCE} characters")
        result = interpret(sentence)
        self._put("interpretation", self._interpretation, html.interpretation(result, session.object_names()))

    def _press(self, button: str) -> None:
        requests = {"Stop": Session.stop, "Shuffle": self._shuffle, "Go where I point": Session.go_where_pointed}
        self.loop.ask(requests[button])

    def _shuffle(self, session: Session) -> None:
        session.shuffle()
        self._scene_view.update_colors()
        self._show_message("")

    # ---- Finger, objects and gripper

    def _on_click(self, body: int) -> None:
        self.loop.ask(lambda session: self._point_at_body(session, body), "click")

    def _point_at_body(self, session: Session, body: int) -> None:
        bodies = session.env.bodies()
        if body in bodies:
            self._point_at(session, session.scene().positions[bodies.index(body)])

    def _point_at(self, session: Session, place: Array) -> None:
        session.point_at(place)
        self._show_finger(session)

    def _show_finger(self, session: Session) -> None:
        self._show_message("")
        if self._finger is not None:
            self._finger.position = tuple(session.finger.aim)

    def _follow_finger(self, session: Session) -> None:
        if self._finger is not None:
            self._point_at(session, np.array(self._finger.position))

    def _on_drag(self, body: int, place: Array) -> None:
        self.loop.ask(lambda session: self._put_object(session, body, place), "drag")

    def _put_object(self, session: Session, body: int, place: Array) -> None:
        bodies = session.env.bodies()
        if body in bodies:
            session.put_object(bodies.index(body), place[:2])

    def _nudge(self, session: Session, direction: tuple[int, int, int]) -> None:
        session.nudge(direction)
        self._show_finger(session)
        self._show_hand(session)

    def _on_slide(self, event: Any) -> None:
        if event.client is not None:  # moved in a browser, not by `_show_hand`
            self.loop.ask(self._move_hand, "hand")

    def _move_hand(self, session: Session) -> None:
        if session.hand_target is not None:
            session.move_hand(np.array([slider.value for slider in self._hand_sliders]))

    def _show_hand(self, session: Session) -> None:
        if session.hand_target is not None:
            for slider, number in zip(self._hand_sliders, session.hand_target.tolist(), strict=True):
                slider.value = number

    def _set_gripper(self, session: Session) -> None:
        session.gripper_closed = self._gripper_closed.value

    # ---- Robot, task and policy

    def _set_driver(self, session: Session) -> None:
        session.set_driver(self._driver.value)
        self._driver.value = session.config.driver
        self._show_hand(session)

    def _change(self) -> None:
        folder, policy = self._run_folder.value.strip(), self._policies.value
        paths = {each.name: str(each.path) for each in pretrained_policies()}
        values = {name: dropdown.value for name, dropdown in self._choices.items()}
        values["driver"] = self._driver.value
        values["checkpoint"] = folder or paths.get(policy)

        def change(session: Session) -> None:
            self._show_message("One moment.")
            if folder:
                check_run(folder)
            objects = int(self._objects.value)
            unchanged = objects == self._shown_objects(session)  # then another task keeps its own number
            values["objects"] = session.config.objects if unchanged else objects
            if values["workspace"] == session.config.workspace == session.own_workspace:
                values["workspace"] = None  # another task has its own
            session.change(replace(session.config, **values))
            self._show_message("")
            self._show_env(session)

        self.loop.ask(change, "change")

    @staticmethod
    def _shown_objects(session: Session) -> int:
        return min(session.env.config.task.num_objects, MOST_OBJECTS)

    def _show_env(self, session: Session) -> None:
        """Shows a new environment and its config."""
        config = session.config
        self._scene_view.show_env(session.env)
        self._sight.show_env(session.env)
        if config.workspace != self._shown_workspace:
            self._shown_workspace = str(config.workspace)
            set_camera(self._server, self._shown_workspace)
        self._finger = None
        if session.env.has_person:
            self._finger = self._server.scene.add_transform_controls(
                "/finger", scale=0.12, disable_rotations=True, position=tuple(session.finger.aim), depth_test=False
            )
            self._finger.on_update(lambda _: self.loop.ask(self._follow_finger, "finger"))
        for name, dropdown in self._choices.items():
            dropdown.value = getattr(config, name)
        self._driver.value, self._objects.value = config.driver, self._shown_objects(session)
        self._put("whose left", self._whose_left, html.hint(session.whose_left))
        self._put("interpretation", self._interpretation, html.message(f"Try: {session.example()}"))

    # ---- Output

    def _show(self, session: Session) -> None:
        """Called by the loop after every step."""
        view, positions = session.view, session.scene().positions
        with self._server.atomic():
            self._scene_view.update_poses()
            self._scene_view.highlight(view.highlighted, positions)
            self._scene_view.show_pointing(view.ray, view.pointing, positions)
        names = session.object_names()
        self._list_sayable(session)
        self._put("arm", self._arm, html.message(session.arm_note))
        stopped = bool(session.arm and session.arm.safety.stopped)
        if self._release is not None and self._release.visible != stopped:
            self._release.visible = stopped
        self._put("status", self._status, html.status(view, session.note, self.loop.rate))
        self._put("shares", self._shares, html.object_shares(view, names))
        self._put("rewards", self._rewards, html.rewards_and_outcomes(view))
        self._recording.add(session)
        self._sight.update(session)

    def _list_sayable(self, session: Session) -> None:
        """Lists feasible instructions while none is being carried out. The list is renewed if something has moved."""
        held = session.env.held
        state = np.append(session.scene().positions.round(2), -1 if held is None else held)
        if session.busy or np.array_equal(state, self._listed_for):
            return
        self._listed_for = state
        sentences = session.sayable()
        self._list.visible = bool(sentences)
        for button, sentence in zip_longest(self._sayable, sentences):
            button.visible = sentence is not None
            button.label = button.hint = sentence or ""  # the hint is not cut off

    def _show_message(self, text: str) -> None:
        self._put("message", self._message, html.message(text))

    def _put(self, name: str, element: Any, content: str) -> None:
        """Sends content that has changed."""
        if self._shown_html.get(name) != content:
            self._shown_html[name] = element.content = content

    def close(self) -> None:
        """Ends and saves a video that is being recorded."""
        self._recording.save()
