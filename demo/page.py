"""The page: what people see and press. It shows what the loop's session does, and asks the loop for all else."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray
from PIL import Image

from conf.overrides import groups
from demo import html as words
from demo.drawing import Drawing
from demo.loop import Loop
from demo.session import Session
from demo.session_config import DRIVERS, Choice, pretrained
from demo.video_recorder import Tape

Array = NDArray[np.float64]
AUTO = "the one that fits"
ARROWS = {"arrowup": (-1, 0, 0), "arrowdown": (1, 0, 0), "arrowleft": (0, -1, 0), "arrowright": (0, 1, 0)}
HEIGHTS = {"pageup": (0, 0, 1), "pagedown": (0, 0, -1)}  # as the person sees it, who stands opposite the robot
SPEEDS = (0.1, 1.0)


class Page:
    """One scene for all who look: what one of them does, the others see.

    shown: called in the loop's thread. All callbacks of the browser only ask the loop.
    """

    def __init__(self, server: viser.ViserServer, session: Session) -> None:
        self.loop = Loop(session, self._show, self._tell)
        self._server = server
        self._gui: Any = server.gui
        self._written: dict[str, str] = {}
        self._tape: Tape | None = None
        self._finger: Any = None
        self._drawing = Drawing(server, self._clicked, self._dragged)
        self._gui.reset()
        self._build(session)
        self._stand(session)

    # ---- what it is made of

    def _build(self, session: Session) -> None:
        gui, choice = self._gui, session.choice
        self._heard, self._message, self._status = gui.add_html(words.message("")), gui.add_html(""), gui.add_html("")
        with gui.add_form(None) as form:
            self._typed = gui.add_text("Say", "", hint="an instruction, a correction, or an answer; Enter does it")
            do = gui.add_button("Do it")
        self._typed.on_update(lambda _: self._listen())
        form.on_submit(self._say)
        do.on_click(self._say)
        buttons = gui.add_button_group("", ("Stop", "Shuffle", "Go where I point"))
        buttons.on_click(lambda event: self._press(event.target.value))
        with gui.add_folder("What it sees and gets"):
            self._looks, self._numbers = gui.add_html(""), gui.add_html("")
        self._build_time()
        self._build_choice(choice, session.stage.config.task.num_objects)
        self._build_hand(session.stage.config.workspace.gripper_box)
        self._build_recording()
        for key, way in (ARROWS | HEIGHTS).items():
            command = gui.add_command(f"Move the finger, or the gripper: {key}", hotkey=key)  # type: ignore[arg-type]
            command.on_trigger(lambda _, way=way: self.loop.ask(lambda session: self._nudge(session, way)))

    def _build_time(self) -> None:
        gui = self._gui
        with gui.add_folder("Time", expand_by_default=False):
            self._paused = gui.add_checkbox("Pause", False)
            self._speed = gui.add_slider("Speed", *SPEEDS, 0.1, 1.0)
            single = gui.add_button("One step")
        self._paused.on_update(lambda _: setattr(self.loop, "paused", self._paused.value))
        self._speed.on_update(lambda _: setattr(self.loop, "speed", min(max(self._speed.value, SPEEDS[0]), SPEEDS[1])))
        single.on_click(lambda _: self.loop.single())

    def _build_choice(self, choice: Choice, objects: int) -> None:
        gui, known = self._gui, groups()
        with gui.add_folder("Who does it, and where"):
            self._driver = gui.add_dropdown("Driven by", DRIVERS, initial_value=choice.driver)
            self._choices = {
                name: gui.add_dropdown(name.capitalize(), known[name], initial_value=getattr(choice, name))
                for name in ("robot", "control", "task", "workspace")
            }
            self._objects = gui.add_slider("Objects", 1, 6, 1, objects)
            policies = [AUTO, *(each.name for each in pretrained())]
            self._policies = gui.add_dropdown("Policy", policies, initial_value=AUTO)
            self._folder = gui.add_text("or a run's folder", choice.checkpoint or "")
            change = gui.add_button("Change")
        change.on_click(lambda _: self._change())
        self._driver.on_update(lambda _: self.loop.ask(self._drive, "driver"))

    def _build_hand(self, box: Sequence[float]) -> None:
        gui = self._gui
        with gui.add_folder("By hand", expand_by_default=False):
            gui.add_html(words.message("Choose 'Driven by: hand'. Arrows and page keys move the gripper too."))
            limits = zip("xyz", box[::2], box[1::2], strict=True)
            self._place = [gui.add_slider(axis, low, high, 0.01, low) for axis, low, high in limits]
            self._grip = gui.add_checkbox("Gripper shut", False)
        for slider in self._place:
            slider.on_update(self._slid)
        self._grip.on_update(lambda _: self.loop.ask(self._shut, "shut"))

    def _build_recording(self) -> None:
        gui = self._gui
        with gui.add_folder("Record", expand_by_default=False):
            still = gui.add_button("Still")
            self._record = gui.add_button("Start filming")
        still.on_click(lambda event: self.loop.ask(lambda session: self._still(session, event.client)))
        self._record.on_click(lambda event: self.loop.ask(lambda session: self._film(session, event.client)))

    # ---- what is asked

    def _listen(self) -> None:
        sentence = self._typed.value
        self.loop.ask(lambda session: self._write_heard(session, sentence, session.listen), "listen")

    async def _say(self, _: Any) -> None:
        """Not in viser's threads but its event loop: a next sentence cannot come between reading and emptying."""
        sentence = self._typed.value.strip()
        if sentence:
            self.loop.ask(lambda session: self._write_heard(session, sentence, session.say))
            self._typed.value = ""

    def _write_heard(self, session: Session, sentence: str, listener: Callable) -> None:
        self._message_of("")
        if not sentence.strip():
            return
        heard = listener(sentence)
        self._put("heard", self._heard, words.heard(heard, session.names()))

    def _press(self, button: str) -> None:
        requests = {"Stop": Session.stop, "Shuffle": self._shuffle, "Go where I point": Session.go}
        self.loop.ask(requests[button])

    def _shuffle(self, session: Session) -> None:
        session.shuffle()
        self._drawing.laid()
        self._message_of("")

    def _clicked(self, body: int) -> None:
        self.loop.ask(lambda session: self._point_at(session, body), "click")

    def _point_at(self, session: Session, body: int) -> None:
        bodies = session.stage.bodies()
        if body in bodies:
            self._point(session, session.scene().positions[bodies.index(body)])

    def _point(self, session: Session, place: Array) -> None:
        session.point(place)
        self._pointed(session)

    def _pointed(self, session: Session) -> None:
        self._message_of("")
        if self._finger is not None:
            self._finger.position = tuple(session.aim)

    def _dragged(self, body: int, place: Array) -> None:
        self.loop.ask(lambda session: self._drag(session, body, place), "drag")

    def _drag(self, session: Session, body: int, place: Array) -> None:
        bodies = session.stage.bodies()
        if body in bodies:
            session.put(bodies.index(body), place[:2])

    def _nudge(self, session: Session, way: tuple[int, int, int]) -> None:
        session.nudge(way)
        self._pointed(session)
        self._follow(session)

    def _slid(self, event: Any) -> None:
        if event.client is not None:  # a person, and not `_follow`
            self.loop.ask(self._reach_out, "hand")

    def _shut(self, session: Session) -> None:
        session.shut = self._grip.value

    def _reach_out(self, session: Session) -> None:
        if session.hand is not None:
            session.reach_out(np.array([slider.value for slider in self._place]))

    def _drive(self, session: Session) -> None:
        session.drive(self._driver.value)
        self._driver.value = session.choice.driver
        self._follow(session)

    def _follow(self, session: Session) -> None:
        """The sliders show where the hand is."""
        if session.hand is not None:
            for slider, number in zip(self._place, session.hand.tolist(), strict=True):
                slider.value = number

    def _change(self) -> None:
        folder, policy = self._folder.value.strip(), self._policies.value
        paths = {each.name: str(each.path) for each in pretrained()}
        values = {name: dropdown.value for name, dropdown in self._choices.items()}
        values["driver"] = self._driver.value
        values["checkpoint"] = folder or paths.get(policy)

        def change(session: Session) -> None:
            self._message_of("One moment.")
            objects = int(self._objects.value)
            left = objects == session.stage.config.task.num_objects  # another task may have another number
            values["objects"] = session.choice.objects if left else objects
            session.change(replace(session.choice, **values))
            self._message_of("")
            self._stand(session)

        self.loop.ask(change, "change")

    def _stand(self, session: Session) -> None:
        """Another world, or the first."""
        choice = session.choice
        self._drawing.stand(session.stage)
        self._finger = None
        if session.stage.shows:
            self._finger = self._server.scene.add_transform_controls(
                "/finger", scale=0.12, disable_rotations=True, position=tuple(session.aim), depth_test=False
            )
            self._finger.on_update(lambda _: self.loop.ask(self._follow_finger, "finger"))
        for name, dropdown in self._choices.items():
            dropdown.value = getattr(choice, name)
        self._driver.value, self._objects.value = choice.driver, session.stage.config.task.num_objects
        self._put("heard", self._heard, words.message(f"Try: {session.example()}"))

    def _follow_finger(self, session: Session) -> None:
        if self._finger is not None:
            self._point(session, np.array(self._finger.position))

    # ---- pictures

    def _still(self, session: Session, client: Any) -> None:
        file = io.BytesIO()
        Image.fromarray(session.stage.render()).save(file, "png")
        client.send_file_download("deixis.png", file.getvalue())

    def _film(self, session: Session, client: Any) -> None:
        if self._tape is None:
            self._tape, self._record.label = Tape(), "Stop filming"
            return
        tape, self._tape, self._record.label = self._tape, None, "Start filming"
        client.send_file_download("deixis.mp4", tape.close())

    # ---- what is shown

    def _show(self, session: Session) -> None:
        show, places = session.show, session.scene().positions
        with self._server.atomic():
            self._drawing.move()
            self._drawing.glow(show.meant, places)
            self._drawing.shine(show.ray, show.pointing, places)
        names = session.names()
        self._put("status", self._status, words.status(show, session.note, self.loop.rate))
        self._put("looks", self._looks, words.looks(show, names))
        self._put("numbers", self._numbers, words.numbers(show))
        if self._tape is not None:
            self._tape.add(session)

    def _tell(self, text: str) -> None:
        self._message_of(text)

    def _message_of(self, text: str) -> None:
        self._put("message", self._message, words.message(text))

    def _put(self, name: str, element: Any, content: str) -> None:
        if self._written.get(name) != content:
            self._written[name] = element.content = content

    def close(self) -> None:
        """Leave nothing half written."""
        if self._tape is not None:
            self._tape.close()
