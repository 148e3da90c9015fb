"""One robot that people direct: what they say, show and choose becomes what it does, a control step at a time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from tensordict import TensorDictBase
from torchrl.envs.utils import ExplorationType, set_exploration_type

from conf.schema import ConfigError
from demo.dialogue import Heard, Talk
from demo.planning import Job, Planner, all_called
from demo.session_config import Cast, Choice, cast
from demo.view_state import Show
from envs.experts import expert
from human import NothingPointedAt, Unreachable, fuse, posterior, referring_phrase
from language import Instruction, LanguageError, ObjectPhrase, Scene
from trainers.rollout.video import outcome

Array = NDArray[np.float64]
Actor = Callable[[TensorDictBase], TensorDictBase]
STRAYS = 2.0  # degrees that a finger is taken to stray by, where the config does not say
REMEMBERED = 4  # gestures
LOW, NEAR = 0.15, 0.06  # metres: lower than that a gripper goes straight up; so near to its rest it is there
RISE = 60  # control steps at most
NUDGE = 0.02  # metres that a key moves the finger, or by hand the gripper
START = (0.45, 0.0, 0.02)  # metres, where the finger points before it is moved


class Session:
    """Not to be shared between threads: whoever steps it also asks it.

    choice: what is on. stage: its world; another one after `change`. show: what is to be seen. aim: (3,) metres, where
    the finger points, or would begin to.
    """

    def __init__(self, choice: Choice, seed: int = 0, gui: bool = False) -> None:
        """gui: in PyBullet's own window; `change` would leave it. Raises ConfigError for what cannot be built."""
        self._rng = np.random.default_rng(seed)
        self._take(cast(choice, seed, gui))

    def _take(self, part: Cast) -> None:
        self.choice, self.stage, self._policy, self.note = part.choice, part.stage, part.policy, part.note
        self.show = Show()
        self._planner = Planner(self.stage, self._rng)
        self.hand: Array | None = None  # where the gripper is driven to by hand, metres
        self.shut = False  # the gripper, by hand
        self.aim: Array = np.array(START)
        self.shuffle()
        self._warm_up()

    @torch.no_grad()
    def _warm_up(self) -> None:
        """What is slow the first time happens before anybody waits for it."""
        self.listen(self.example())
        if self._policy is not None:
            self._policy(self._state.exclude("privileged"))

    def change(self, choice: Choice) -> None:
        """Another robot, task or policy. Raises ConfigError, and all stays as it is."""
        part = cast(choice, int(self._rng.integers(2**31)))
        score = self.show.score if choice.task == self.choice.task else None
        self.stage.close()
        self._take(part)
        self.show.score = score or self.show.score

    def shuffle(self) -> None:
        """Another scene, the arm at rest."""
        self._state = self.stage.reset()
        self._forget()

    def _forget(self) -> None:
        self.talk, self._jobs = Talk(), deque[Job]()
        self._job: Job | None = None
        self._actor: Actor | None = None  # None while it goes up
        self._gestures: deque[int] = deque(maxlen=REMEMBERED)
        self._fresh = False  # was a finger shown since the last instruction?
        self.show = Show(score=self.show.score)
        self.hand = None

    # ---- what is said and shown

    def scene(self) -> Scene:
        """The objects, as words see them."""
        return self.stage.scene()

    def names(self) -> list[str]:
        """What each object is called."""
        return all_called(self.scene())

    def example(self) -> str:
        """Something that can be said here."""
        return self._planner.example()

    def listen(self, sentence: str) -> Heard:
        """What the sentence would come to; nothing is done."""
        return self.talk.listen(sentence, self.scene(), self._pointed(sentence))

    def say(self, sentence: str) -> Heard:
        """Do what it asks for, from the next control step on, in place of what was being done."""
        scene = self.scene()
        heard = self.talk.hear(sentence, scene, self._pointed(sentence))
        if heard.understood is None:
            return heard
        try:
            self._jobs = deque(self._planner.plan(heard.understood))
        except LanguageError as error:
            return Heard(sentence, None, str(error))
        self._next()
        return heard

    # ---- pointing

    def point(self, place: ArrayLike) -> int | None:
        """Let the person point at a place (3,), metres: the object that this singles out; None where it does none.

        Raises Unreachable, and nothing changes; ConfigError where nobody stands there.
        """
        if not self.stage.shows:
            raise ConfigError("nobody stands here to point: choose workspace=collabtable")
        self.show.ray = self.stage.point(place)
        self.aim = np.array(place, np.float64)
        self.show.pointing = self._likely()
        self._fresh = True
        if self.show.pointing is None:
            return None
        likeliest = int(self.show.pointing.argmax())
        self._gestures.append(likeliest)
        return likeliest

    def nudge(self, way: ArrayLike) -> None:
        """Move the finger a little along a direction (3,), or by hand the gripper. Raises as `point` does."""
        if self.hand is not None:
            self.reach_out(self.hand + NUDGE * np.asarray(way))
        else:
            self.point(self.aim + NUDGE * np.asarray(way))

    def _likely(self) -> Array | None:
        """(K,) how likely each object is pointed at; None where nothing lies along the ray."""
        if self.show.ray is None:
            return None
        noise = max(self.stage.config.gesture.noise_deg, STRAYS)
        try:
            return posterior(*self.show.ray, self.scene().positions, noise)
        except NothingPointedAt:
            return None

    def _pointed(self, sentence: str) -> Callable[[int], Sequence[int]]:
        def latest(count: int) -> Sequence[int]:
            shown = list(self._gestures)[-count:] if count else []
            if count == 1 and shown and self.show.pointing is not None:
                shown = [self._together(sentence, shown[0], self.show.pointing)]
            return shown

        return latest

    def _together(self, sentence: str, shown: int, likely: Array) -> int:
        """What finger and words single out together ("that red one")."""
        try:
            return int(fuse(referring_phrase(sentence), self.scene(), likely).argmax())
        except (LanguageError, NothingPointedAt):  # a correction names no object by itself
            return shown

    def go(self) -> None:
        """Do this task with what is pointed at. Raises LanguageError where nothing is."""
        if not self._gestures:
            raise LanguageError("point at something first: click it, or move the finger")
        if self.stage.task.places:
            raise LanguageError("this task needs a place as well: click an object, then a place, and say what to do")
        referent = self._gestures[-1]
        said = ObjectPhrase(determiner="this")
        words = self._planner.words(Instruction(self._planner.verb, said), referent, None)
        self._jobs = deque([Job(words, referent)])
        self._next()

    def put(self, index: int, place: Array) -> None:
        """Put an object elsewhere on the table: (2,) metres, as near to that as objects may stand."""
        if self.stage.task.operates:
            raise LanguageError("devices stand where they stand: shuffle for others")
        x0, x1, y0, y1 = self.stage.config.workspace.object_area
        x, y = np.clip(place, (x0, y0), (x1, y1))
        self.stage.put(index, (float(x), float(y), self.stage.config.task.object_size / 2))

    def drive(self, driver: str) -> None:
        """Let the policy, the expert or a hand drive. Raises ConfigError where there is no policy."""
        if driver == "policy" and not self.has_policy:
            raise ConfigError(
                f"there is no trained policy for task={self.choice.task} with robot={self.choice.robot} here"
            )
        self.choice = replace(self.choice, driver=driver)
        self.hand = self.stage.gripper[0] if driver == "hand" else None
        self._end()

    def reach_out(self, place: Array) -> None:
        """By hand: the gripper goes there, (3,) metres, as far as it may."""
        low, high = np.reshape(self.stage.config.workspace.gripper_box, (3, 2)).T
        self.hand = np.clip(place, low, high)

    # ---- what is done

    @property
    def has_policy(self) -> bool:
        """Whether there is one for what was chosen."""
        return self._policy is not None

    @property
    def busy(self) -> bool:
        """Whether it is doing something that was asked."""
        return self._job is not None

    def stop(self) -> None:
        """Leave what is being done."""
        self._end()
        self.show.status, self.show.meant = "Stopped.", ()

    def _end(self) -> None:
        self._jobs.clear()
        self._job = self._actor = None

    def _next(self) -> None:
        """Begin the next job: from where policies learned to begin, but for what is corrected in the air."""
        corrected = self._actor is not None and self.stage.gripper[0, 2] > LOW
        self._job, self._actor = self._jobs.popleft(), None
        self._announce(self._job)
        self._returning = 0 if corrected or self._at_rest() else RISE
        if not self._returning:
            self._begin(self._job)

    def _at_rest(self) -> bool:
        return bool(np.linalg.norm(self.stage.gripper[0] - self.stage.rest) < NEAR)

    def _back(self) -> Array:
        """(3,) where the gripper goes next on its way to its rest: up first, or it would take things along."""
        gripper = self.stage.gripper[0]
        return self.stage.rest if gripper[2] > LOW else gripper + [0.0, 0.0, LOW]

    def _announce(self, job: Job) -> None:
        names = self.names()
        where = "" if job.target is None else f" to {names[job.target]}"
        self.show.status = f"Doing: {self._planner.doing} {names[job.referent]}{where}"
        self.show.hears = job.sentence
        self.show.meant = (job.referent,) if job.target is None else (job.referent, job.target)

    def _begin(self, job: Job) -> None:
        if self.stage.task.points and not (self._fresh and job.referent in list(self._gestures)[-1:]):
            self._show(job.referent)
        self._fresh = False
        self._state = self.stage.tell(job.sentence, job.referent, job.target)
        self._actor = expert(self.stage) if self.choice.driver == "expert" else self._policy
        self.show.rewards = dict.fromkeys(self.stage.reward_names, 0.0)

    def _show(self, index: int) -> None:
        """This policy must be shown what is meant: the person points at it."""
        try:
            self.point(self.scene().positions[index])
        except Unreachable as error:
            raise LanguageError(str(error)) from None

    @torch.no_grad()
    def step(self) -> None:
        """One control step."""
        with set_exploration_type(ExplorationType.DETERMINISTIC):
            self._state["action"] = self._action()
        after = self.stage.step(self._state)["next"]
        self._state = after.exclude("reward", "done", "terminated", "truncated")
        if self._actor is not None:
            self._note(after)
        elif self._job is not None:
            self._returning -= 1
            if self._returning <= 0 or self._at_rest():
                self._begin(self._job)

    def _action(self) -> torch.Tensor:
        if self.hand is not None:
            return self.stage.towards(self.hand[None], np.array([self.shut]))
        if self._actor is None:
            return self.stage.still() if self._job is None else self.stage.towards(self._back()[None])
        frames = self._actor(self._state.exclude("privileged"))
        if "attention_logits" in frames.keys():
            shown = self._state["objects_mask"][0]
            self.show.attention = frames["attention_logits"][0].softmax(-1)[shown].numpy().astype(np.float64)
        return frames["action"]

    def _note(self, after: TensorDictBase) -> None:
        for name, value in zip(self.stage.reward_names, after["reward_terms"][0].tolist(), strict=True):
            self.show.rewards[name] += value
        if not (after["terminated"] | after["truncated"])[0]:
            return
        ending = outcome(after)
        self.show.score[ending] += 1
        seconds = self.stage.elapsed[0] * self.period
        if ending == "success" and self._jobs:
            self._next()
            return
        self._end()
        self.show.status = f"Done in {seconds:.1f} s." if ending == "success" else f"Not done: {ending}."

    @property
    def period(self) -> float:
        """Seconds of a control step."""
        physics = self.stage.config.physics
        return physics.time_step * physics.substeps

    def close(self) -> None:
        self.stage.close()
