"""Anything: every episode draws an instruction among those that are feasible in its room."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.errors import ConfigError
from envs.sim.workspace import Fitting
from envs.tasks.devices import DevicesAmongObjects
from envs.tasks.reach import ReachNext
from envs.tasks.shared.base import TASKS, Task, register_task
from envs.tasks.shared.feasible import Option, Room, options
from envs.tasks.shared.geometry import lifted
from envs.tasks.shared.manipulation import SCENES
from envs.tasks.shared.room_scenes import RoomScenes, shares_of
from envs.tasks.shared.task_config import NO_CURRICULUM, TaskConfig
from envs.tasks.shared.types import NOTHING, Array, EpisodeSpec, GivenInstruction, GripperStart, State, StepOutcome
from human import Person
from language import Placed, Scene
from language.verbs import CARRIES, HANDING

RATE = 0.03  # weight of the last outcome in the running mean
STACK_RADIUS = 0.02  # metres from the place on top of the base, as in conf/task/nl_stack.yaml
LEAST = 0.1  # weight of a verb that always succeeds, as a share of that of one that always fails


@register_task("anything", verb="pick_and_place")
class Anything(RoomScenes):
    """Follow an instruction of any verb that is feasible in the room as it is.

    Each episode draws a verb, and then its referent and target. Scenes are drawn so that several verbs are feasible.
    The task of the episode's verb decides about success and failure: `members` has one for each verb.

    Instruction: those of all members, such as "open the drawer".
    Success: as of the verb's task.
    Failure: as of the verb's task.
    Reward terms: progress, approach, grasp, lift, height, transport, release and operate, as of the verb's task;
        success, wrong_object, wrong_target, failed and time. Terms that several members share have the same weight.
    Config keys: devices, hand, num_objects counts all fixtures; instructions (one after another), verbs ([]: all),
        curriculum.automatic; needs workspace=studio, without devices workspace=room.
    """

    ends = ("success", "wrong_object", "wrong_target", "failed", "time")
    terms = ("progress", "approach", "grasp", "lift", "height", "transport", "release", "operate", *ends)
    traits = replace(RoomScenes.traits, continues=True)

    def _configure(self, config: TaskConfig, person: Person | None) -> None:
        super()._configure(config, person)
        self._verbs = [verb for verb in self.verbs if verb in config.verbs] or list(self.verbs)  # that instructions use

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._sampler = VerbSampler(self.verbs, self.config.curriculum.automatic)
        self._steps = np.zeros(worlds, np.int64)  # since each world's instruction was given
        self.members = [self._member(verb, worlds) for verb in self.verbs]

    def _member(self, verb: str, worlds: int) -> Task:
        """Make the task of a verb. It only evaluates steps, and draws nothing."""
        name, config = f"nl_{verb}", self.config
        task = ReachNext if verb == "reach" else TASKS[name]
        targets = config.num_targets if verb == "pick_and_place" else 0
        own = replace(
            config,
            name=name,
            instructions=1,
            verbs=[],
            curriculum=NO_CURRICULUM,
            num_objects=config.slots - targets,
            min_objects=config.slots - targets,
            num_targets=targets,
            radius=STACK_RADIUS if verb == "stack" else config.success_radius,
            hold_steps=config.success_steps,
            reward={term: config.reward.get(term, 0.0) for term in task.terms},  # a term of that task alone counts as 0
        )
        return task(own, self._area, worlds)

    def furnish(self, fittings: Mapping[str, Fitting]) -> None:
        super().furnish(fittings)
        for member in self.members:
            member.furnish(fittings)

    # ---- evaluating

    def reset(self, worlds: NDArray[np.int64], state: State) -> None:
        super().reset(worlds, state)
        self._steps[worlds] = 0
        for member in self.members:
            member.reset(worlds, state)

    def notice(self, world: int, slots: NDArray[np.int64], state: State) -> None:
        for member in self.members:
            member.notice(world, slots, state)

    def step(self, state: State) -> StepOutcome:
        """Evaluate one control step of all worlds, each by the member of its verb."""
        outcomes = [member.step(state) for member in self.members]
        never = np.zeros(len(self._rows))

        def chosen(values: Iterable[Array | NDArray[np.bool_] | None]) -> Array:
            each = np.stack([never if value is None else value for value in values])
            return np.asarray(each[state.kind, self._rows], np.float64)

        flags = {
            name: chosen(getattr(each, name) for each in outcomes).astype(bool)
            for name in ("success", "wrong_object", "at_goal", "wrong_target", "failed")
        }
        terms = {name: chosen(each.terms.get(name) for each in outcomes) for name in self.terms}
        outcome = StepOutcome(terms=terms, **flags)
        self._steps += 1
        ended = outcome.terminated | (self._steps >= self.config.most_steps)
        self._sampler.note(state.kind[ended], outcome.success[ended])
        return outcome

    @property
    def memory(self) -> Array:
        """(N, M) the memory of the members, for privileged critics."""
        return np.concatenate([member.memory for member in self.members], axis=1)

    def travel(self, state: State) -> Array:
        member = self.members[self.verbs.index("press")]
        assert isinstance(member, DevicesAmongObjects)  # any of these members gives the travel of all devices
        return member.travel(state)

    def possible_goals(self, placed: Placed) -> NDArray[np.bool_]:
        return np.ones(len(placed.scene), bool)

    # ---- drawing

    @property
    def draw_state(self) -> dict[str, float]:
        """For each verb, the share of its last instructions that failed; 1 before any has ended."""
        return dict(zip(self.verbs, self._sampler.failures.tolist(), strict=True))

    def load_draw_state(self, state: Mapping[str, float]) -> None:
        self._sampler.failures[:] = [state.get(verb, 1.0) for verb in self.verbs]

    def next_instruction(
        self,
        scene: Scene,
        held: int,
        rng: Generator,
        *,
        moved: Array | None = None,
        last: GivenInstruction | None = None,
    ) -> GivenInstruction | None:
        """Draw an instruction that is feasible in the scene as it is: first its verb, then its referent and target.

        Args:
            scene: the objects.
            held: the object that the gripper holds, or NOTHING.
            rng: of the draws.
            moved: as for `room`.
            last: the instruction that succeeded, which has no influence.

        Returns:
            The instruction; None if words can name no feasible one.
        """
        feasible = self._sayable(self.room(scene, moved), held)
        if not feasible:
            return None
        verbs = sorted({each.verb for each in feasible})
        verb = verbs[rng.integers(len(verbs))]
        chosen = [each for each in feasible if each.verb == verb]
        return self._instruction(scene, chosen[rng.integers(len(chosen))], rng)

    def _sayable(self, room: Room, held: int = NOTHING, verb: str | None = None) -> list[Option]:
        """Return the feasible instructions of one verb, or of all verbs in use, whose objects words can name."""
        verbs = self._verbs if verb is None else (verb,)
        feasible = [each for each in options(room, held) if each.verb in verbs]
        if not feasible:
            return []
        named = self._sentences.nameable(room.scene)
        return [each for each in feasible if named[each.referent] and (_needs_no_name(each) or named[each.target])]

    def _instruction(self, scene: Scene, option: Option, rng: Generator) -> GivenInstruction:
        """Say a feasible instruction in words."""
        verb, referent, target = option
        named = None if verb == HANDING else target
        sentence, _ = self._sentences.instruct(verb, scene, referent=referent, target=named, rng=rng)
        return GivenInstruction(
            kind=self.verbs.index(verb),
            referent=referent,
            target=target,
            sentence=sentence,
            heard=self._sentences.heard(sentence),
        )

    def _draw(self, rng: Generator) -> EpisodeSpec:
        """Draw a verb, scenes until it is feasible, and where the gripper begins."""
        verb = self._sampler.draw(self._verbs, rng)
        for _ in range(SCENES):
            placed, room = self._draw_room(rng)
            chosen = self._sayable(room, verb=verb)
            if chosen:
                return self._episode_of(placed, room, chosen[rng.integers(len(chosen))], rng)
        raise ConfigError(f"task.name={self.config.name}: no scene was found in which '{verb}' can be said")

    def _each_in_turn(self, rng: Generator) -> list[EpisodeSpec]:
        placed, room = self._draw_room(rng)
        said = [self._instruction(placed.scene, option, rng) for option in self._sayable(room)]
        return [self._pointed(self._spoken(placed, room, each), rng) for each in said]

    def _episode_of(self, placed: Placed, room: Room, option: Option, rng: Generator) -> EpisodeSpec:
        """Return the episode, which the curriculum may begin with the object held, or with the gripper elsewhere."""
        curriculum, chance, start = self.config.curriculum, rng.random(), None
        if chance < curriculum.near:
            start = GripperStart(self._elsewhere_offset(room, option.referent, rng), held=False)
        elif chance < curriculum.near + curriculum.held and option.verb in CARRIES:
            config = self.config
            size, spacing = config.object_size, config.spacing
            held = lifted(placed.scene, option.referent, None, area=self._area, size=size, spacing=spacing, rng=rng)
            after = None if held is None else self.room(held, room.moved)
            if after is not None and option in self._sayable(after, option.referent, option.verb):
                placed, room = placed._replace(scene=after.scene), after
                start = GripperStart(np.zeros(3), held=True)
        return replace(self._spoken(placed, room, self._instruction(placed.scene, option, rng)), start=start)

    def _spoken(self, placed: Placed, room: Room, given: GivenInstruction) -> EpisodeSpec:
        """Return the episode with this instruction."""
        scene = placed.scene
        shares = np.where(room.devices, shares_of(scene.nouns, room.moved), room.shares)
        return EpisodeSpec(
            scene=scene,
            referent=given.referent,
            kind=given.kind,
            sentence=given.sentence,
            heard=given.heard,
            yaw=placed.yaw,
            fixed=placed.fixed,
            target=given.target,
            goals=self.possible_goals(placed),
            resting=np.any(room.upon, axis=1),
            shares=np.clip(shares, 0.0, 1.0),
        )


def _needs_no_name(option: Option) -> bool:
    """Return whether words need not name the target: there is none, or it is the only hand."""
    return option.target is None or option.verb == HANDING


class VerbSampler:
    """Draws verbs.

    failures: (V,) running mean of the failures of each verb, over all worlds of the process; 1 before any has ended.

    Args:
        verbs: all of them.
        automatic: draw each verb in proportion to its failures.
    """

    def __init__(self, verbs: Sequence[str], automatic: bool) -> None:
        self._verbs, self._automatic = tuple(verbs), automatic
        self.failures = np.ones(len(verbs))

    def draw(self, feasible: Sequence[str], rng: Generator) -> str:
        """Draw one of these verbs."""
        if not self._automatic:
            return feasible[int(rng.integers(len(feasible)))]
        weights = LEAST + self.failures[[self._verbs.index(verb) for verb in feasible]]
        return feasible[int(rng.choice(len(feasible), p=weights / weights.sum()))]

    def note(self, verbs: NDArray[np.int64], succeeded: NDArray[np.bool_]) -> None:
        """Take the outcomes (n,) of instructions with these verbs (n,)."""
        for verb, success in zip(verbs.tolist(), succeeded.tolist(), strict=True):
            self.failures[verb] += RATE * ((not success) - self.failures[verb])
