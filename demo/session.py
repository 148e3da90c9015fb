"""A session with one robot: turns what a person says, points at and chooses into control steps."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from tensordict import TensorDictBase
from torchrl.envs.utils import ExplorationType, set_exploration_type

from core.errors import ConfigError
from demo import board, planning, room, worlds
from demo.actors import Actor, actor_of, attention_of, ending_of, intent_of, is_move_of_expert, other_of
from demo.episodes import SessionEpisodes
from demo.finger import Finger
from demo.planning import Subtask, SubtaskPlanner
from demo.returning import Return
from demo.session_config import SessionConfig, Setup, build
from demo.view_state import ViewState, ViewStep
from deployment.connecting import ArmChoice
from deployment.mirror import MirrorEnv
from deployment.safe_arm import PAUSED, Person, SafeArm
from human import Unreachable
from language import (
    Dialogue,
    Instruction,
    LanguageError,
    ObjectPhrase,
    Outcome,
    Plan,
    Question,
    Refusal,
    Scene,
    Signal,
    Step,
    whose_left,
)
from language.talk import offers
from language.talk import said as in_words
from language.verbs import HERE, POINTING

Array = NDArray[np.float64]
MAX_CHARACTERS = 300  # of a sentence; the rest is ignored
STOPS = ("stop", "wait", "home")  # signals that end what is being done
OBJECTION = re.compile(r"\s*(no|nope|not|wait|stop|don't|hold on)\b", re.IGNORECASE)  # stops the arm, whatever follows
THIS_HERE = re.compile(r"\b(this|that)( \w+)? (right |over )?(here|there)\b", re.IGNORECASE)  # may be one gesture
ASKING = re.compile(r"\W*(and |so |hey |ok |okay |but )*(what|which|who|is|are)\b", re.IGNORECASE)
NUDGE = 0.02  # metres by which a key moves the finger, or the gripper if driven by hand
SECOND_TRY = ", in a second try, by the expert"  # of a step, for the person


class Session:
    """One robot and its environment. Not thread-safe: all calls must come from the thread that calls `step`.

    config: the current choice. env: the world; `change` replaces it. view: shown by user interfaces. finger: of the
    person. compares: policy and expert are both asked at each step, whoever drives. note: a warning about the
    choice, or "". hand_target: (3,) metres, where the gripper is driven by hand; None if the policy or the expert
    drives. gripper_closed: by hand. viewpoint: whose left and right the person means, who speaks; policies are
    given words from the task's own. seed: of the scene. steps: control steps since the environment was built.
    episodes: that were carried out. wished_driver: who is to drive, where there is a policy. understood: the steps
    of the last sentence in words, or "".
    """

    def __init__(
        self,
        config: SessionConfig,
        seed: int = 0,
        gui: bool = False,
        arm: ArmChoice | None = None,
        person: Person | None = None,
    ) -> None:
        """
        Args:
            config: the choice.
            seed: of the scenes.
            gui: in PyBullet's window, which `change` would close.
            arm: that is driven; None: a simulated one.
            person: who can stop the arm.

        Raises:
            ConfigError: something cannot be built.
            ArmError: the arm does not answer.
        """
        self._rng, self._choice, self.understood = np.random.default_rng(seed), arm, ""
        self.compares = False
        self._start(build(config, seed, gui, arm, person), seed)
        self.wished_driver = config.driver

    def _start(self, setup: Setup, seed: int) -> None:
        self.config, self.env, self._policy, self.note = setup.config, setup.env, setup.policy, setup.note
        self.own_workspace, self.viewpoint = setup.own_workspace, setup.env.config.task.viewpoint
        self.view = ViewState()
        self.finger = Finger(self.env)
        self._return = Return(self.env)
        self.gripper_closed, self.steps = False, 0
        self.episodes = SessionEpisodes(self.env)
        self.shuffle(seed)
        self._warm_up()

    @torch.no_grad()
    def _warm_up(self) -> None:
        """Runs parser and policy once: the first call is slow."""
        self.preview(self.example())
        self.preview("what can you do?")
        if self._policy is not None:
            self._policy(self._state.exclude("privileged"))

    def change(self, config: SessionConfig, seed: int | None = None) -> None:
        """Replaces robot, task or policy. Raises ConfigError, and then nothing changes. seed: as in `shuffle`."""
        if self._choice is not None:
            raise ConfigError(f"arm={self._choice.name} is driven: start the page again for another robot or task")
        seed = int(self._rng.integers(2**31)) if seed is None else seed
        setup = build(config, seed)
        counts = self.view.outcome_counts if config.task == self.config.task else None
        viewpoint = self.viewpoint
        self.env.close()
        self._start(setup, seed)
        self.set_viewpoint(viewpoint)
        self.wished_driver = config.driver
        self.view.outcome_counts = counts or self.view.outcome_counts

    def shuffle(self, seed: int | None = None) -> None:
        """Draws another scene, with the arm at rest. seed: of the scene; None: another one."""
        self.seed = int(self._rng.integers(2**31)) if seed is None else seed
        self.env.set_seed(self.seed)
        self._state = self.env.reset()
        self.episodes.drop()
        board.mark(self.env, None)
        self._planner = SubtaskPlanner(self.env, np.random.default_rng(self.seed))
        self._planner.viewpoint = self.viewpoint
        real = self._choice is not None and self._choice.name != "sim"
        self._dialogue = Dialogue(body="a robot arm, a real one") if real else Dialogue()
        self._subtasks = deque[Subtask]()
        self._home = worlds.homes(self._planner.scene())
        self._subtask: Subtask | None = None
        self._stopped = deque[Subtask]()  # what was to be done when somebody said stop
        self._goes_home = False  # while no subtask is carried out
        self._actor: Actor | None = None  # None while the gripper returns to its rest position
        self._other: Actor | None = None  # the expert where the policy drives, or the policy
        self.finger.clear()
        self.view = ViewState(outcome_counts=self.view.outcome_counts)
        self.hand_target: Array | None = None

    # ---- Sentences

    def scene(self) -> Scene:
        """The objects as the language sees them, from the person's viewpoint."""
        return worlds.seen_from(self._planner.scene(), self.viewpoint)

    def object_names(self) -> list[str]:
        """The name of each object, from the person's viewpoint."""
        return worlds.names_of(self.env, worlds.seen_from(self.env.scene(), self.viewpoint))

    def set_viewpoint(self, viewpoint: str) -> None:
        """Takes left and right for those from this viewpoint, a key of language.VIEWPOINTS, from now on."""
        self.viewpoint = self._planner.viewpoint = viewpoint

    def example(self) -> str:
        """A sentence that is possible in this scene."""
        return self._planner.example()

    def sayable(self) -> list[str]:
        """Sentences that are possible now: the feasible instructions of a room, or one for each object."""
        task, seen = self.env.task, worlds.seen_from(self.env.scene(), self.viewpoint)
        if task.verbs:
            return room.sayable(self.env, seen)
        if task.traits.stacks or task.traits.places or task.fixtures:
            return [self.example()]
        names = self.object_names()
        return [room.in_words(self._planner.verb, name) for name in names if name.startswith("the ")]

    @property
    def whose_left(self) -> str:
        """Whose left and right are meant in sentences, in words."""
        return whose_left(self.viewpoint)

    def preview(self, sentence: str) -> Outcome:
        """Interprets a sentence without acting on it."""
        return self._interpret(self._dialogue.copy(), sentence)

    def say(self, sentence: str) -> Outcome:
        """Interprets a sentence and, if it asks for steps, replaces the current subtasks by those.

        The indices of the outcome are those of `scene()`.
        """
        outcome = self._interpret(self._dialogue, sentence)
        self.finger.fresh = 0
        objects = OBJECTION.match(sentence) is not None and not isinstance(outcome, Plan)
        contradicts = self._dialogue.control_word(sentence.lower().strip(" .,!?")) == "no"
        if objects or contradicts or (isinstance(outcome, Signal) and outcome.control in STOPS):
            self.stop()
        try:
            if isinstance(outcome, Signal) and outcome.control in ("home", "continue"):
                return self._obey(outcome)
            if not isinstance(outcome, Plan | Signal) or not outcome.steps:
                return outcome
            subtasks = deque(self._planner.plan(outcome.steps, self.config.driver == "policy"))
            first = self._planner.begin_next(subtasks)
        except LanguageError as error:
            world = self._dialogue.turns[-1].world
            suggestions = self._offers(offers(world, sentence.lower().split()))
            reason = "already" if isinstance(error, planning.AlreadySo) else "impossible"
            refusal = Refusal(sentence, 0.0, (), (0, len(sentence)), reason, str(error), suggestions)
            self._dialogue.amend(refusal, world)
            return refusal
        self.view.sentence = sentence
        self._start_plan(first, subtasks)
        self._dialogue.ended(f"I am at it: {self.understood}")
        return outcome

    def _obey(self, signal: Signal) -> Signal:
        """Goes home, or goes on with what was stopped. Returns the signal with what is done. Raises LanguageError."""
        if signal.control == "home":
            self._go_home()
            self.view.status = "Going back to the rest position."
            return replace(signal, text="I go back to my rest position")
        if self.busy:
            return replace(signal, text="I am at it")
        if not self._stopped:
            raise LanguageError("there is nothing to go on with")
        subtasks = self._stopped.copy()
        self._start_plan(self._planner.begin_next(subtasks), subtasks)
        return replace(signal, text="I go on")

    def _interpret(self, dialogue: Dialogue, sentence: str) -> Outcome:
        sentence = sentence[:MAX_CHARACTERS]
        world = worlds.world_of(self.env, self.scene(), self._home)
        needed = worlds.pointed_in(sentence, (*POINTING, *HERE, "pointing"))
        if THIS_HERE.search(sentence) and (self.finger.fresh == 1 or ASKING.match(sentence)):
            needed = 1
        if self.finger.fresh and self.finger.last_referent is not None:  # "pick it up" after a click
            dialogue.it = (self.finger.last_referent,)
        pointed = self.finger.referents(needed, sentence) if needed else ()
        outcome = dialogue.answer(sentence, world, () if self.env.task.traits.stacks else pointed)
        outcome = self._named_alone(outcome)
        self.understood = in_words(world, outcome.steps) if isinstance(outcome, Plan | Signal) and outcome.steps else ""
        return renumbered(outcome, worlds.numbers_of(self.env).tolist())

    def _named_alone(self, outcome: Outcome) -> Outcome:
        """Return the outcome with offers of this task.

        A sentence that only names an object asks for the task's own verb, unless that needs a place.
        """
        task = self.env.task
        if isinstance(outcome, Refusal):
            return replace(outcome, suggestions=self._offers(outcome.suggestions))
        asks = isinstance(outcome, Question) and not outcome.choices and len(outcome.candidates) == 1
        if not asks or task.verbs or task.traits.places or task.traits.stacks or not isinstance(outcome, Question):
            return outcome
        step = Step(self._planner.verb, outcome.candidates[0])
        return Plan(outcome.sentence, 0.5, (), (0, len(outcome.sentence)), (step,))

    def _offers(self, suggestions: Sequence[str]) -> tuple[str, ...]:
        """Return what can be said instead; where the gripper cannot take anything, an example of the task."""
        task = self.env.task
        return (self.example(),) if task.traits.moves and not (task.verbs or task.traits.grips) else tuple(suggestions)

    # ---- Pointing, and moving objects

    def point_at(self, place: ArrayLike) -> int | None:
        """Lets the person point at a place (3,), metres. Returns the likeliest object; None if none is near the ray.

        Raises:
            Unreachable: the person cannot point there; nothing changes.
            ConfigError: the workspace has no person.
        """
        referent = self.finger.point_at(place)
        self.view.ray, self.view.pointing = self.finger.ray, self.finger.probabilities
        return referent

    def nudge(self, direction: ArrayLike) -> None:
        """Moves the finger, or the gripper if driven by hand, a little in direction (3,). Raises as `point_at`."""
        if self.hand_target is not None:
            self.move_hand(self.hand_target + NUDGE * np.asarray(direction))
        else:
            self.point_at(self.finger.aim + NUDGE * np.asarray(direction))

    def go_where_pointed(self) -> None:
        """Does the task with the object that was pointed at last. Raises LanguageError if there is none."""
        referent = self.finger.last_referent
        if referent is None:
            raise LanguageError("point at something first: click an object, or move the finger")
        if self.env.task.traits.places:
            raise LanguageError("this task needs a target too: click an object, then a target, and say what to do")
        instruction = Instruction(self._planner.verb, ObjectPhrase(determiner="this"))
        sentence = self._planner.policy_sentence(instruction, referent, None)
        self._start_plan(Subtask(sentence, referent), deque())

    def nudge_object(self, index: int, direction: ArrayLike) -> None:
        """Puts an object 2 cm farther in direction (3,), or into the next cell of a board. Raises LanguageError."""
        step = self.env.config.task.spacing if self.env.task.traits.stacks else NUDGE
        self.put_object(index, self.scene().positions[index] + step * np.asarray(direction))

    def put_object(self, index: int, place: Array) -> None:
        """Puts an object at (2,) metres on the table, or at the nearest place where objects may stand."""
        planning.put_object(self.env, self._planner, index, place)
        self._home = worlds.homes(self.scene())

    # ---- Who drives

    @property
    def has_policy(self) -> bool:
        """Whether there is a policy for this task, robot and control."""
        return self._policy is not None

    @property
    def acting(self) -> str:
        """Who carries out what is being done: the driver, or the expert in place of a policy that cannot."""
        by_expert = self._subtask is not None and is_move_of_expert(self._subtask, self._driver)
        return "expert" if by_expert else self._driver

    @property
    def _driver(self) -> str:
        """Who drives: the expert where it tries once more what the policy did not manage."""
        return "expert" if self._subtask is not None and self._subtask.second_try else self.config.driver

    def set_driver(self, driver: str) -> None:
        """Lets the policy, the expert or the hand drive. Raises ConfigError if there is no policy."""
        if driver == "policy" and not self.has_policy:
            raise ConfigError(f"there is no trained policy for task={self.config.task} with robot={self.config.robot}")
        self.config, self.wished_driver = replace(self.config, driver=driver), driver
        self.hand_target = self.env.gripper[0] if driver == "hand" else None
        self._end(self.view.status)

    def move_hand(self, place: Array) -> None:
        """Drives the gripper by hand to (3,) metres, or to the nearest place in the gripper's box."""
        low, high = np.reshape(self.env.config.workspace.gripper_box, (3, 2)).T
        self.hand_target = np.clip(place, low, high)

    # ---- Subtasks

    def _go_home(self) -> None:
        """Let the gripper return to its rest position."""
        self._return.start()
        self._goes_home = True

    @property
    def arm(self) -> SafeArm | None:
        """The arm that is driven; None: a simulated one."""
        return self.env.arm if isinstance(self.env, MirrorEnv) else None

    @property
    def arm_note(self) -> str:
        """Why the arm holds still: nothing is seen, or what its rules say of the arm that is driven; or ""."""
        if blind := self.env.blind[0]:
            return f"The arm holds still: {blind}."
        if not isinstance(self.env, MirrorEnv):
            return ""
        arm, decision = self.env.arm, self.env.world.decision
        if arm.paused and not arm.safety.stopped:
            return PAUSED
        return arm.safety.stopped or "; ".join(decision.reasons if decision else ())

    @property
    def busy(self) -> bool:
        """Whether there is a subtask, or the gripper returns before one."""
        return self._subtask is not None

    def stop(self) -> None:
        """Ends the current subtask and drops the following ones, which "go on" takes up again."""
        if self._subtask is not None:
            left = self._subtask, *self._subtasks
            self._stopped = deque(replace(each, number=n, second_try=False) for n, each in enumerate(left))
        self._end("Stopped.")
        self.view.highlighted = ()

    def _end(self, status: str) -> None:
        if self._subtask is not None:
            self._dialogue.ended(self._told_ending(status))
        board.mark(self.env, None)
        self._planner.return_targets()
        self._subtasks.clear()
        self._subtask = self._actor = self._other = None
        self.episodes.drop()
        self.view.intents = {}
        self._goes_home = False
        self._mark("doing", "failed" if status.startswith("Not done") else "dropped")
        self._mark("next", "dropped")
        self.view.status = status

    def _told_ending(self, status: str) -> str:
        """How far the plan came, for the dialogue; "" if it was carried out."""
        if status.startswith("Done"):
            return ""
        done = [step.words for step in self.view.steps if step.state == "done"]
        left = [step.words for step in self.view.steps if step.state in ("doing", "next")]
        why = status.removeprefix("Not done: ").strip(".").lower()
        failed = f"I did not {' and '.join(left) or 'go on'} ({why})"
        return f"I did this: {' and '.join(done)}. {failed}" if done else failed

    def _start_plan(self, first: Subtask, others: deque[Subtask]) -> None:
        """Starts the first subtask of a plan, in place of what is being done."""
        names = self.object_names()
        self._mark("doing", "dropped")
        self._mark("next", "dropped")
        words = {each.number: self._planner.in_words(each, names) for each in (first, *others)}
        self.view.steps = [ViewStep(words[number]) for number in sorted(words)]
        self._subtasks, self._goes_home = others, False
        self._stopped.clear()
        self._start_subtask(first)

    def _mark(self, state: str, new_state: str) -> None:
        """Gives steps of the plan that are in a state another one."""
        for step in self.view.steps:
            if step.state == state:
                step.state = new_state

    def _start_subtask(self, subtask: Subtask) -> None:
        """Policies are trained to start at the rest position, so the gripper returns there first.

        Exceptions: a correction while the gripper is high takes effect at once; the expert of moves starts anywhere,
        and so does a policy that was trained on one instruction after another.
        """
        is_correction = self._actor is not None and self._return.is_high
        self._subtask, self._actor = subtask, None
        self._show_subtask(subtask)
        self.view.steps[subtask.number].state = "doing"
        self._return.start()
        if is_correction or self.env.task.traits.continues or is_move_of_expert(subtask, self._driver):
            self._return.skip()
        if self._return.is_over:
            self._begin(subtask)

    def _start_next(self) -> None:
        """Starts the next step of a chain, or says why it cannot be done."""
        try:
            self._start_subtask(self._planner.begin_next(self._subtasks))
        except LanguageError as error:
            self._end(f"Not done: {error}.")

    def _show_subtask(self, subtask: Subtask) -> None:
        self.view.status = f"Doing: {self._planner.in_words(subtask, self.object_names())}"
        self.view.policy_sentence = subtask.sentence
        self.view.highlighted = subtask.objects

    def _begin(self, subtask: Subtask) -> None:
        if self.env.task.points and not (self.finger.is_new and subtask.referent == self.finger.last_referent):
            self._show_referent(subtask.referent)
        self.finger.is_new = False
        board.mark(self.env, subtask.move.place if subtask.move and subtask.move.release else None)
        self._state = self.env.give_instruction(subtask.sentence, subtask.referent, subtask.target, subtask.verb)
        self.episodes.begin(self._state, self._words_of(subtask), self.seed)
        self._actor = actor_of(subtask, self.env, self._driver, self._policy)
        self._other = other_of(self._actor, self.env, self._policy)
        self.view.rewards = dict.fromkeys(self.env.reward_names, 0.0)

    def _words_of(self, subtask: Subtask) -> str:
        """What was asked for: in the person's words, if it is one thing."""
        alone = len(self.view.steps) == 1 and self.view.sentence
        return self.view.sentence if alone else self._planner.in_words(subtask, self.object_names())

    def _show_referent(self, index: int) -> None:
        """Lets the person point at the referent, for a policy that requires a gesture."""
        try:
            self.point_at(self.scene().positions[index])
        except Unreachable as error:
            raise LanguageError(str(error)) from None

    # ---- Control steps

    @property
    def period(self) -> float:
        """Seconds of a control step."""
        physics = self.env.config.physics
        return physics.time_step * physics.substeps

    @torch.no_grad()
    def step(self) -> None:
        """Takes one control step."""
        self._end_if_stopped()
        with set_exploration_type(ExplorationType.DETERMINISTIC):
            self._state["action"] = self._action()
        action = self._state["action"]
        after = self.env.step(self._state)["next"]
        self.steps += 1
        self._state = after.exclude("reward", "done", "terminated", "truncated")
        if self._actor is not None:
            self.episodes.add(action, after)
            self._update_subtask(after)
        elif self._subtask is not None or self._goes_home:
            self._return.step()
            if self._return.is_over and self._subtask is not None:
                self._begin(self._subtask)
            elif self._return.is_over:
                self._end("At the rest position.")

    def watch(self, paused: bool) -> None:
        """Looks at the arm that is driven, if there is one, between control steps. It holds where paused."""
        if self.arm is None:
            return
        if paused:
            self.arm.pause()
        else:
            self.arm.watch()
        self._end_if_stopped()

    def _end_if_stopped(self) -> None:
        """Ends what is being done if the arm that is driven was stopped."""
        if self.busy and self.arm is not None and self.arm.safety.stopped:
            self._end(f"Stopped: {self.arm.safety.stopped}.")

    def _action(self) -> torch.Tensor:
        if self.hand_target is not None:
            return self.env.towards(self.hand_target[None], np.array([self.gripper_closed]))
        if self._subtask is None and not self._goes_home:
            return self.env.hold_action()
        if self._actor is None:
            return self.env.towards(self._return.next_position()[None], self._return.holds)
        output = self._actor(self._state.exclude("privileged"))
        self.view.attention = attention_of(output)
        self._compare(output["action"])
        return output["action"]

    def _compare(self, action: torch.Tensor) -> None:
        """Show what policy and expert would do now, where there are both. action: (1, A) of who drives."""
        if not self.compares or self._other is None:
            self.view.intents = {}
            return
        other = self._other(self._state.exclude("privileged"))["action"]
        own, shadow = ("policy", "expert") if self._actor is self._policy else ("expert", "policy")
        intents = {own: intent_of(action, self.env), shadow: intent_of(other, self.env)}
        self.view.intents = {name: intents[name] for name in ("policy", "expert")}

    def _update_subtask(self, after: TensorDictBase) -> None:
        """Adds up rewards; at the end of the episode, starts the next subtask or reports the outcome."""
        for name, value in zip(self.env.reward_names, after["reward_terms"][0].tolist(), strict=True):
            self.view.rewards[name] += value
        ending = ending_of(self._actor, after)
        if ending is None:
            return
        self.episodes.end(ending == "success", self.acting)
        self.view.outcome_counts[ending] += 1
        seconds = self.env.elapsed[0] * self.period
        if ending != "success" and self._subtask is not None and self._may_try_again():
            self.view.steps[self._subtask.number].words += SECOND_TRY
            self._start_subtask(replace(self._subtask, second_try=True))
            return
        if ending == "success":
            self._mark("doing", "done")
            if self._subtasks:
                self._start_next()
                return
        self._end(f"Done in {seconds:.1f} s." if ending == "success" else f"Not done: {ending}.")
        if ending == "success" and self._dialogue.homeward:
            self._go_home()

    def _may_try_again(self) -> bool:
        """Whether the expert may try what has just failed."""
        return self.config.second_try and self.acting == "policy" and self.arm is None

    def close(self) -> None:
        """Closes the environment."""
        self.env.close()


def renumbered(outcome: Outcome, numbers: Sequence[int]) -> Outcome:
    """The outcome with the indices of things replaced by their numbers in the scene."""
    if numbers == list(range(len(numbers))):
        return outcome
    if isinstance(outcome, Question):
        return replace(outcome, candidates=tuple(numbers[i] for i in outcome.candidates))
    if isinstance(outcome, Plan | Signal):
        goals = [None if step.goal is None else numbers[step.goal] for step in outcome.steps]
        steps = [replace(s, object=numbers[s.object], goal=goal) for s, goal in zip(outcome.steps, goals, strict=True)]
        return replace(outcome, steps=tuple(steps))
    return outcome
