"""Anything: each episode says one of the instructions that are feasible in a room, and after success another one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from conf.schema import ConfigError
from envs.sim.devices import facing
from envs.sim.workspace import Fitting
from envs.tasks import room_devices
from envs.tasks.base import Task
from envs.tasks.device_motion import moved
from envs.tasks.feasible import CARRY, DEVICE_VERBS, VERBS, Option, Room, options
from envs.tasks.free_places import COLUMNS, FINE_COLUMNS, FreeTable, described_free
from envs.tasks.furnished import Furnished
from envs.tasks.movable_objects import SCENES
from envs.tasks.nl_reach import NLReach
from envs.tasks.object_layout import scatter
from envs.tasks.operate_among import WIDTHS, OperateAmong
from envs.tasks.outcome import Outcome
from envs.tasks.registry import TASKS, register_task
from envs.tasks.training_episodes import NO_CURRICULUM
from envs.tasks.types import NOTHING, Array, Column, EpisodeSpec, GripperStart, Said, State, TaskConfig
from envs.tasks.verb_sampling import VerbSampler
from human import Person
from language import COLORS, DEVICES, FITTINGS, Placed, Scene

STACK_RADIUS = 0.02  # metres from the place on top of the base, as in conf/task/nl_stack.yaml
STORED, STACKED = 0.3, 0.5  # chances that an object lies in each fitting, and that one stands on another
AT_AN_OBJECT = 0.5  # share of the episodes that the curriculum begins elsewhere, in which that is over another object
ABOVE = 0.12  # metres over an object up to which a gripper begins there
HIGH = (0.2, 0.4)  # metres over the table between which a gripper begins anywhere
OVER_DEVICE = 0.04  # metres over a device from which on a gripper begins there
LEAST_ON_TABLE = 2  # loose objects that stand on the table, at least


class ReachNext(NLReach):
    """Reach after another instruction: the object at which the gripper begins is not the wrong one until it left it."""

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._first = np.full(worlds, NOTHING)  # the slot at which it begins, until it leaves it

    def reset(self, worlds: NDArray[np.int64], state: State) -> None:
        super().reset(worlds, state)
        distances = self._distances(state)[worlds]
        nearest = distances.argmin(1)
        self._first[worlds] = np.where(distances.min(1) <= self.config.radius, nearest, NOTHING)

    def step(self, state: State) -> Outcome:
        distances = self._distances(state)
        stays = (distances.argmin(1) == self._first) & (distances.min(1) <= self.config.radius)
        self._first = np.where(stays, self._first, NOTHING)
        self._held_other = np.where(stays, -1, self._held_other)
        return super().step(state)


@register_task("anything", verb="pick_and_place")
class Anything(Furnished):
    """Each episode draws a verb among those that are feasible in its room, and then its referent and target.

    Success and the ends of episodes are those of the task that is said: `members` has one for each verb. Reward terms
    of all members have the same weights. Scenes are drawn so that several verbs are feasible: fittings are open or
    shut, with an object in them or without, and an object may stand on another one. With `task.devices`, so many
    devices stand behind the loose objects.

    kind_names: the verbs. Without devices there are none for them, and fewer columns.
    """

    columns: tuple[Column, ...] = (*Furnished.columns, *COLUMNS)
    ends = ("success", "wrong_object", "wrong_target", "failed", "time")
    terms = ("progress", "approach", "grasp", "lift", "height", "transport", "release", "operate", *ends)
    continues = True
    wide = (0.85, 1.0)
    kind_names = verbs = VERBS

    def __init__(
        self, config: TaskConfig, object_area: Sequence[float], num_worlds: int, person: Person | None = None
    ) -> None:
        self._table = FreeTable(object_area, config.object_size)
        self._device_area: Sequence[float] = ()
        if config.devices:
            self.verbs, self.fixtures = (*VERBS, *DEVICE_VERBS), (*FITTINGS, *DEVICES)
            marks = len(FITTINGS)  # the columns of all marks come first
            fitting_columns = Furnished.columns[:marks], Furnished.columns[marks:]
            self.columns = (*fitting_columns[0], *room_devices.COLUMNS, *fitting_columns[1], *FINE_COLUMNS)
        self._verbs = [verb for verb in self.verbs if verb in config.verbs] or list(self.verbs)  # that are said
        super().__init__(config, object_area, num_worlds, person)
        self.kind_names = self.verbs

    def _allocate(self, worlds: int) -> None:
        self._free = np.zeros((worlds, self.config.slots, 3))  # where the table is free for each object
        self._sampler = VerbSampler(self.verbs, self.config.curriculum.automatic)
        self._steps = np.zeros(worlds, np.int64)  # since each world's instruction was given
        self.members = [self._member(verb, worlds) for verb in self.verbs]

    def _member(self, verb: str, worlds: int) -> Task:
        """The task of a verb, as far as it evaluates steps: it draws nothing."""
        name, config = f"nl_{verb}", self.config
        kind = ReachNext if verb == "reach" else TASKS[name]
        targets = config.num_targets if verb == "pick_and_place" else 0
        return kind(
            replace(
                config,
                name=name,
                instructions=1,
                verbs=[],
                curriculum=NO_CURRICULUM,
                num_objects=config.slots - targets,
                min_objects=config.slots - targets,
                num_targets=targets,
                radius=STACK_RADIUS if verb == "stack" else config.radius,
                reward={term: config.reward[term] for term in kind.terms},
            ),
            self._area,
            worlds,
        )

    def furnish(self, fittings: Mapping[str, Fitting]) -> None:
        super().furnish(fittings)
        for member in self.members:
            member.furnish(fittings)

    def place_devices(self, area: Sequence[float]) -> None:
        if self.config.devices and not area:
            raise ConfigError(
                f"task.devices={self.config.devices} needs a workspace with a device_area: choose workspace=studio, or 0"
            )
        self._device_area = area

    @property
    def bodies(self) -> tuple[int, int, int]:
        free, fixed, targets = super().bodies
        return free - self.config.devices, fixed, targets

    @property
    def devices(self) -> tuple[str, ...]:
        return room_devices.most_devices(self.config.devices)

    @property
    def device_width(self) -> float:
        return WIDTHS * self.config.object_size

    # ---- judging

    def reset(self, worlds: NDArray[np.int64], state: State) -> None:
        """Begins new episodes in these worlds, or continues with another instruction."""
        self._free[worlds] = self._table.nearest(state.objects[worlds], state.shown[worlds])
        self._steps[worlds] = 0
        for member in self.members:
            member.reset(worlds, state)

    def step(self, state: State) -> Outcome:
        """Evaluates one control step of all worlds, each by the member whose verb is said there."""
        outcomes = [member.step(state) for member in self.members]
        never = np.zeros(len(self._rows))

        def said(values: Iterable[Array | NDArray[np.bool_] | None]) -> Array:
            each = np.stack([never if value is None else value for value in values])
            return np.asarray(each[state.kind, self._rows], np.float64)

        flags = {
            name: said(getattr(each, name) for each in outcomes).astype(bool)
            for name in ("success", "wrong_object", "at_goal", "wrong_target", "failed")
        }
        terms = {name: said(each.terms.get(name) for each in outcomes) for name in self.terms}
        outcome = Outcome(terms, **flags)
        self._steps += 1
        ended = outcome.terminated | (self._steps >= self.config.max_steps)
        self._sampler.note(state.kind[ended], outcome.success[ended])
        return outcome

    @property
    def memory(self) -> Array:
        """(N, M) what the members remember."""
        return np.concatenate([member.memory for member in self.members], axis=1)

    def moved(self, state: State) -> Array:
        """(N, K) how far devices are from their start, in shares of their way; 0 for other objects."""
        return moved(state, self.device_width) if self.config.devices else np.zeros(state.shown.shape)

    def seen(self, state: State) -> Array:
        devices = np.zeros((*state.shown.shape, 0))
        if self.config.devices:
            member = self.members[self.verbs.index("press")]
            assert isinstance(member, OperateAmong)  # any of them tells how far all devices have travelled
            parts = facing(state.quaternions), member.travel(state), self.moved(state)
            devices = room_devices.columns_of(state.nouns, *parts)
        return self._joined(super().seen(state), devices, self._free - state.objects)

    def described(self, episode: EpisodeSpec) -> Array:
        nouns, devices = episode.scene.nouns, np.zeros((len(episode.scene), 0))
        if self.config.devices:
            assert episode.yaw is not None and episode.shares is not None
            gone = room_devices.moved_by(nouns, episode.shares)
            ahead = room_devices.directions(nouns, episode.yaw, gone)
            devices = room_devices.columns_of(nouns, ahead, np.zeros(len(nouns)), gone)
        return self._joined(super().described(episode), devices, described_free(self._table, episode))

    def _joined(self, fittings: Array, devices: Array, free: Array) -> Array:
        """(..., C) the values of `columns`, from those of fittings, of devices and the offset to free places (..., 3)."""
        if not self.config.devices:
            return np.concatenate((fittings, free[..., :2]), axis=-1)
        marks = len(FITTINGS)
        return np.concatenate((fittings[..., :marks], devices, fittings[..., marks:], free, free), axis=-1)

    # ---- drawing

    @property
    def draw_state(self) -> dict[str, float]:
        """For each verb, the share of its last instructions that failed; 1 before any has ended."""
        return dict(zip(self.verbs, self._sampler.failures.tolist(), strict=True))

    def load_draw_state(self, state: Mapping[str, float]) -> None:
        self._sampler.failures[:] = [state.get(verb, 1.0) for verb in self.verbs]

    def room(self, scene: Scene, moved: Array | None = None) -> Room:
        """What the scene is like, for what is feasible in it.

        moved: (K,) how far devices are from their start, in shares of their way; None: they are there.
        """
        nouns, places = scene.nouns, scene.positions
        fits = np.isin(nouns, list(self.fittings))
        return Room(scene, self.shares(nouns, places), self._inside(nouns, places), fits, self._area, moved)

    def next_instruction(
        self, scene: Scene, held: int, rng: Generator, moved: Array | None = None
    ) -> Said | None:
        """An instruction that is feasible in the scene as it is: first a verb is drawn, and then what it is done to.

        held: the object that the gripper holds, or NOTHING. moved: as for `room`. None where nothing is feasible that
        words can name.
        """
        feasible = self._sayable(self.room(scene, moved), held)
        if not feasible:
            return None
        verbs = sorted({each.verb for each in feasible})
        verb = verbs[rng.integers(len(verbs))]
        chosen = [each for each in feasible if each.verb == verb]
        return self._said(scene, chosen[rng.integers(len(chosen))], rng)

    def _sayable(self, room: Room, held: int = NOTHING, verb: str | None = None) -> list[Option]:
        """The feasible instructions, of one verb or of all that are said, whose objects words can name."""
        verbs = self._verbs if verb is None else (verb,)
        feasible = [each for each in options(room, held) if each.verb in verbs]
        if not feasible:
            return []
        named = self._describer.nameable(room.scene)
        return [each for each in feasible if named[each.referent] and (each.target is None or named[each.target])]

    def _said(self, scene: Scene, option: Option, rng: Generator) -> Said:
        verb, referent, target = option
        sentence, _ = self._sentence(verb, scene, referent, target, rng)
        return Said(self.verbs.index(verb), referent, target, sentence, self._heard(sentence))

    def _scene(self, rng: Generator) -> Scene:
        """Loose objects, targets and fittings. The first objects may lie in fittings, and the next one on the last."""
        config = self.config
        count = int(rng.integers(config.min_objects, config.num_objects + 1)) - len(FITTINGS) - config.devices
        places = np.array(scatter(rng, count + config.num_targets, self._area, config.spacing, config.object_size / 2))
        fitting_nouns = list(self.fittings)
        shares = zip(self.fittings.values(), self._draw_shares(rng), strict=True)
        handles = np.array([fitting.handle_at(fitting.value(share)) for fitting, share in shares])
        stored = np.flatnonzero(rng.random(len(handles)) < STORED)[: max(count - LEAST_ON_TABLE, 0)]
        places[: len(stored)] = self.middles(np.array(fitting_nouns)[stored], handles[stored])
        if rng.random() < STACKED and count - len(stored) > 1:
            places[len(stored)] = places[count - 1] + [0.0, 0.0, config.object_size]
        nouns = np.concatenate((self._nouns[rng.integers(len(self._nouns), size=len(places))], fitting_nouns))
        targets = (np.arange(len(nouns)) >= count) & (np.arange(len(nouns)) < len(places))
        places = np.concatenate((places, handles))
        colors = rng.integers(len(COLORS), size=len(nouns))
        return Scene.from_arrays(nouns, colors, places, config.object_size, targets, config.viewpoint)

    def _draw(self, rng: Generator) -> EpisodeSpec:
        """Draws a verb, scenes until it is feasible, and where the gripper begins."""
        verb = self._sampler.draw(self._verbs, rng)
        for _ in range(SCENES):
            placed, room = self._furnished(rng)
            chosen = self._sayable(room, verb=verb)
            if chosen:
                return self._episode_of(placed, room, chosen[rng.integers(len(chosen))], rng)
        raise ConfigError(f"task.name={self.config.name}: no scene was found in which '{verb}' can be said")

    def _furnished(self, rng: Generator) -> tuple[Placed, Room]:
        """A scene, with its devices, and what it is like."""
        placed, count = self._placed(rng), self.config.devices
        if not count:
            return placed, self.room(placed.scene)
        placed, gone = room_devices.draw_devices(placed, count, self._device_area, self.device_width, rng)
        return placed, self.room(placed.scene, gone)

    def _each_in_turn(self, rng: Generator) -> list[EpisodeSpec]:
        placed, room = self._furnished(rng)
        said = [self._said(placed.scene, option, rng) for option in self._sayable(room)]
        return [self._pointed(self._spoken(placed, room, each), rng) for each in said]

    def _episode_of(self, placed: Placed, room: Room, option: Option, rng: Generator) -> EpisodeSpec:
        """The episode, which the curriculum may begin with the object held, or with the gripper elsewhere."""
        curriculum, chance, start = self.config.curriculum, rng.random(), None
        if chance < curriculum.near:
            start = GripperStart(self._elsewhere_offset(room, option.referent, rng), held=False)
        elif chance < curriculum.near + curriculum.held and option.verb in CARRY:
            held = self._held_scene(placed.scene, option.referent, None, rng)
            lifted = None if held is None else self.room(held, room.moved)
            if lifted is not None and option in self._sayable(lifted, option.referent, option.verb):
                placed, room = placed._replace(scene=lifted.scene), lifted
                start = GripperStart(np.zeros(3), held=True)
        return replace(self._spoken(placed, room, self._said(placed.scene, option, rng)), start=start)

    def _elsewhere_offset(self, room: Room, referent: int, rng: Generator) -> Array:
        """(3,) metres from where the gripper would hold the referent to where it begins: over another object, as if
        something had been done there, or anywhere in the air."""
        scene, at = room.scene, room.scene.positions[referent]
        if rng.random() < AT_AN_OBJECT:
            anchors = np.flatnonzero(room.ready | room.fits | room.devices)
            anchor = anchors[rng.integers(len(anchors))]
            least = OVER_DEVICE if room.devices[anchor] else 0.0
            place = scene.positions[anchor] + [0.0, 0.0, rng.uniform(least, ABOVE)]
        else:
            low, high = scene.positions[:, :2].min(0), scene.positions[:, :2].max(0)
            place = np.append(rng.uniform(low, high), rng.uniform(*HIGH))
        return place - at

    def _spoken(self, placed: Placed, room: Room, said: Said) -> EpisodeSpec:
        scene, count = placed.scene, len(placed.scene)
        shares = np.where(room.devices, room_devices.shares_of(scene.nouns, room.moved), room.shares)
        return EpisodeSpec(
            scene,
            said.referent,
            said.kind,
            said.sentence,
            said.heard,
            placed.yaw,
            placed.fixed,
            target=said.target,
            goals=np.ones(count, bool),
            resting=np.any(room.upon, axis=1),
            shares=np.clip(shares, 0.0, 1.0),
        )
