"""The environment: N PyBullet worlds with a task, as one batched environment of TorchRL."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import torch
from numpy.random import Generator
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import Binary, Bounded, Composite, Unbounded

from core.errors import ConfigError, UseError
from envs.config import EnvConfig
from envs.episode_replay import EpisodeReplayEnv
from envs.mdp.actions import read_action
from envs.mdp.controls import CONTROLS, Control
from envs.mdp.drawn_scenes import DrawnScenes
from envs.mdp.gestures import Gestures, make_person, make_ray_reader
from envs.mdp.goals import Goal
from envs.mdp.grip_controller import ACTION_UNIT, GripController
from envs.mdp.object_rows import scene_of_rows
from envs.mdp.observation_terms import ObservationTerm, Observer, Sight, Source, SpecSettings
from envs.mdp.observations import OBSERVATIONS, OUTCOMES, PICTURE_OBSERVATIONS, SceneSampler, observation_spec
from envs.mdp.perceived_worlds import PerceivedWorlds, Reader
from envs.mdp.pictures import Photographer
from envs.mdp.randomization import InitialStates, Perturbations
from envs.mdp.relabelling import Relabeller
from envs.mdp.rewards import compute_outcome, reward_weights
from envs.mdp.world_state import WorldState
from envs.perception.camera_reader import CameraReader
from envs.sim.device_bodies import DeviceSpec
from envs.sim.devices import DEVICES
from envs.sim.kinematics import Array, Kinematics
from envs.sim.object_pool import PoolSpec
from envs.sim.robot import read_kinematics
from envs.sim.robot_check import check_reach
from envs.sim.window import Window
from envs.sim.workspace import FILM
from envs.sim.world import SimulatedWorld
from envs.tasks import NOTHING, TASKS, EpisodeSpec, State, Task
from envs.tasks.reach import reaching_height
from human import Person
from language import HAND, Tokenizer

PRESS_DEPTH = 0.005  # metres that a magnet without a gap may go below the top of an object on the table
RELABELLED = 16  # episodes that are relabelled at once
ENDS = ("terminated", "truncated", "done")  # (N, 1) bool each


class WorkspaceEnv(EpisodeReplayEnv):
    """N worlds that step together, and are reset one by one.

    World i draws all randomness from its own generator, seeded with (seed, i): its rollouts are the same, bit for bit,
    whatever N is, unless task.curriculum.automatic makes draws depend on the outcomes in all worlds.

    Args:
        config: of the environment.
        num_worlds: N.
        seed: of the generators.
        render: load visual shapes, for `render`.
        window: where the only world is shown.

    Raises:
        ConfigError: the environment cannot be built.
    """

    batch_locked = True
    _world_type: ClassVar[type[SimulatedWorld]] = SimulatedWorld
    _given = False  # whether a present episode was begun by `start`
    _photographer: Photographer | None = None
    _drawn_scenes: DrawnScenes | None = None  # photographs drawn scenes

    def __init__(
        self, config: EnvConfig, num_worlds: int = 1, seed: int = 0, render: bool = False, window: Window | None = None
    ) -> None:
        for name, value, least in (("num_worlds", num_worlds, 1), ("seed", seed, 0)):
            if not isinstance(value, int | np.integer):
                raise ConfigError(f"{name}={value!r} must be a whole number, not of type {type(value).__name__}")
            if value < least:
                raise ConfigError(f"{name}={value} must be at least {least}")
        super().__init__(batch_size=[num_worlds])
        self._drawn = render, window is not None
        self.is_closed = False  # TorchRL's collectors close an env only if it has this attribute
        self.config, self.tokenizer = config, Tokenizer.default()
        config.task.objects.check(config.workspace.bounds)
        self._person = make_person(config.workspace.human, config.gesture)
        self.task = self._draws = make_task(config, num_worlds, self._person)
        self.task.draw(np.random.default_rng(0))  # raises at once if no episode can be drawn
        self.kinematics = make_kinematics(config, self.task)
        drawn = render or config.perception.sees or config.pictures is not None
        self._worlds = [
            make_world(config, self.task, drawn, window, world_type=self._world_type) for _ in range(num_worlds)
        ]
        self.control = make_control(config, self.task, self.kinematics)
        check_reach(config.robot, self.kinematics, config.workspace.object_area, float(self.control.box[0, 2]))
        self._initial_states = make_initial_states(config, self.task, self.kinematics)
        self._arrays = WorldState(
            worlds=self._worlds,
            robot=config.robot,
            kinematics=self.kinematics,
            slots=config.task.slots,
            tokenizer=self.tokenizer,
        )
        self._state, self._weights = self._arrays.state, reward_weights(self.task)
        self._grip_controller = make_grip_controller(config, self.task, self._worlds, self._state)
        self._gestures = Gestures(config.gesture, self._worlds, make_ray_reader(config.workspace, config.gesture))
        self._make_observer(config)
        self._make_specs()
        self._set_seed(seed)

    def _make_observer(self, config: EnvConfig) -> None:
        setup = SpecSettings(
            workspace=config.workspace,
            robot=config.robot,
            kinematics=self.kinematics,
            task=self.task,
            tokenizer=self.tokenizer,
            action_width=len(self.action_unit),
            pictures=config.pictures,
        )
        drawn = self.task if config.drawn() == config else make_task(config.drawn(), 1, self._person)
        terms: tuple[ObservationTerm, ...] = OBSERVATIONS
        pictures = config.pictures
        if pictures is not None:
            terms = (*OBSERVATIONS, *PICTURE_OBSERVATIONS)
            self._photographer = Photographer(pictures, config.workspace, self._worlds, self._arrays)
        self._observer, self._sample = Observer(terms, setup), SceneSampler(replace(setup, task=drawn))
        self._noise = Perturbations(config.task, self.batch_size[0], self.control.unit)
        self._perceived = self._make_perceived(config) if config.perception.sees else None
        self._source = Source(
            task=self.task,
            state=self._state,
            worlds=self._arrays,
            grip_controller=self._grip_controller,
            gestures=self._gestures,
            control=self.control,
            perturbations=self._noise,
            perceived=self._perceived,
            photographer=self._photographer,
        )
        task, joints = make_task(config, RELABELLED, self._person), len(config.robot.joints)
        self._relabeller = Relabeller(
            task, RELABELLED, tokenizer=self.tokenizer, observer=self._observer, joints=joints
        )

    def _make_perceived(self, config: EnvConfig) -> PerceivedWorlds:
        return PerceivedWorlds(
            config=config.perception,
            workspace=config.workspace,
            task=make_task(config, self.batch_size[0], self._person),
            arrays=self._arrays,
            kinematics=self.kinematics,
            grip=self._grip_controller,
            reader=self._make_reader(config),
        )

    def _make_reader(self, config: EnvConfig) -> Reader:
        """Return what tells what is seen in the worlds."""
        from envs.perception.detector import load_detector  # slow to import

        detector = load_detector(config.perception.weights)
        return CameraReader(self._worlds, config.workspace, config.perception, detector)

    def _make_specs(self) -> None:
        n, flag = self.batch_size[0], Binary(1, shape=(*self.batch_size, 1), dtype=torch.bool)
        self.observation_spec = observation_spec(self._observer, n, self.task)
        self.action_spec = Bounded(-1, 1, shape=(n, len(self.action_unit)), dtype=torch.float32)
        self.reward_spec = Unbounded(shape=(n, 1), dtype=torch.float32)
        self.full_done_spec = Composite({name: flag.clone() for name in ENDS}, shape=(n,))

    @property
    def kind_names(self) -> tuple[str, ...]:
        """The kinds of sentences that privileged/kind indexes."""
        return self.task.kind_names

    @property
    def readers(self) -> dict[str | tuple[str, ...], str]:
        """Which network reads which observation, as `ObservationTerm.reader` declares it, by key."""
        return self._observer.readers

    @property
    def reward_names(self) -> tuple[str, ...]:
        """The columns of reward_terms."""
        return self.task.terms

    @property
    def action_unit(self) -> tuple[float, ...]:
        """(A,) the greatest difference from `hold` that each number of an action may have within one control step."""
        return (*self.control.unit.tolist(), *[ACTION_UNIT] * self._grip_controller.width)

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        if self.is_closed or not self._arrays.begun.all():
            raise UseError("step was called " + ("after close" if self.is_closed else "before reset"))
        action = read_action(tensordict, (self.batch_size[0], len(self.action_unit)))
        self._remember(tensordict["action"])
        action = self._stopped_if_blind(self._noise.action(action, self._arrays.steps, self._source.hold))
        self._switch_gestures()
        arrays, arm = self._arrays, action[:, : len(self.control.unit)]
        arrays.commanded = self.control.targets(arm, arrays.commanded, arrays.angles)
        if self._grip_controller.can_grip:
            self._grip_controller.command(action[:, -1])
        arrays.advance(np.concatenate((arrays.commanded, self._grip_controller.targets), axis=1))
        if self._grip_controller.can_grip:
            self._grip_controller.update_grasps()
        self._gestures.follow()
        if self._perceived is not None:
            self._perceived.follow()
        if self._photographer is not None:
            self._photographer.forget()
        arrays.steps += 1
        outcome = self._outcome()  # before the observation, which shows what the task remembers
        return TensorDict(outcome | self._observer.observe(self._source), self.batch_size)

    def _stopped_if_blind(self, action: Array) -> Array:
        """Return the action (N, A), by which arms that could see nothing hold still, and grippers stay as they are."""
        if self._perceived is None or not (blind := self._perceived.standing).any():
            return action
        still = self._source.hold().astype(action.dtype)
        if self._grip_controller.can_grip:
            still[:, -1] = np.where(self._grip_controller.closed, 1.0, -1.0)
        return np.where(blind[:, None], still, action)

    def _switch_gestures(self) -> None:
        """Move the fingers whose switch is due to another object, which becomes the referent."""
        for i, referent in self._gestures.switch(self._arrays.steps):
            slot = int(self._arrays.slots[i][referent])
            self._set_goal(i, replace(self._arrays.goals[i], referent=slot))

    def _set_goal(self, i: int, goal: Goal) -> None:
        """Set the goal of world i within an episode."""
        self._arrays.set_goal(i, goal)
        self.task.reset(np.array([i]), self._state)
        if self._perceived is not None:
            self._perceived.restart(np.array([i]))

    def _outcome(self) -> dict[str, Tensor]:
        """Return the rewards of a control step, and the ends of episodes."""
        outcome = compute_outcome(self.task, self._state, self._weights)
        for i, goal in self._next_goals(outcome["success"][:, 0]):
            self._set_goal(i, goal)
            outcome["terminated"][i] = False
            outcome["success"][i] &= not self.task.traits.stepwise
        truncated = (self._arrays.steps[:, None] >= self.config.task.most_steps) & ~outcome["terminated"]
        outcome |= {"truncated": truncated, "done": truncated | outcome["terminated"]}
        return {name: torch.from_numpy(values) for name, values in outcome.items()}

    def _next_goals(self, success: NDArray[np.bool_]) -> Iterator[tuple[int, Goal]]:
        """Return the worlds whose episodes go on after a success, each with its next goal. success: (N,)."""
        return next_goals(self._arrays, self.task, success, self._generators)

    def _begin_episodes(self, worlds: NDArray[np.int64]) -> TensorDictBase:
        self._given = self._given and len(worlds) < len(self._worlds)
        if self.is_closed:
            raise UseError("reset was called after close")
        for i in worlds.tolist():
            self._begin(i, self.task.draw(self._generators[i]))
        if len(worlds):
            self._read_beginning(worlds)
        return self._first_observation()

    def _begin(self, i: int, episode: EpisodeSpec) -> None:
        """Set up an episode in world i, its objects in random slots."""
        generator, arrays = self._generators[i], self._arrays
        slots = generator.permutation(arrays.rows.shape[1])[: len(episode.scene)]
        joints = self._initial_states.draw(episode, self._grip_controller.grip_depth, generator)
        held = episode.start is not None and episode.start.held
        arrays.begin(i, episode, slots, joints=joints, opening=self._grip_controller.initial_opening(held))
        if self._grip_controller.can_grip:
            centre = self.kinematics.forward(joints[None]).position[0]
            self._grip_controller.begin(
                i, int(slots[episode.referent]) if held else NOTHING, arrays.state.shown[i], centre
            )
        self._gestures.begin(i, episode)
        self._noise.begin(i, episode)

    def _read_beginning(self, worlds: NDArray[np.int64]) -> None:
        """Read the state of worlds whose episodes have just been set up."""
        self._arrays.read(worlds)
        self.task.reset(worlds, self._state)
        if self._perceived is not None:
            self._perceived.begin(worlds)
        self._gestures.read(worlds.tolist())
        if self._photographer is not None:
            self._photographer.forget(worlds)

    def _first_observation(self) -> TensorDictBase:
        """Return the observation before any action."""
        values = self._observer.observe(self._source)
        values["reward_terms"] = torch.zeros(*self.batch_size, len(self.reward_names))
        values |= {name: torch.zeros(*self.batch_size, 1, dtype=torch.bool) for name in (*OUTCOMES, *ENDS)}
        return TensorDict(values, self.batch_size)

    def start(self, episodes: Sequence[EpisodeSpec], seed: int) -> TensorDictBase:
        """Begin these episodes, one in each world, instead of drawn ones. Worlds beyond them repeat the last.

        All else, slots and joint noise, is drawn from the same seed in every world: two worlds with the same episode
        begin with the same bits. Raises ValueError for no episode, or for more than there are worlds.
        """
        if not 0 < len(episodes) <= len(self._worlds):
            raise ValueError(f"{len(episodes)} episodes for {len(self._worlds)} worlds")
        self._generators = [np.random.default_rng(seed) for _ in self._worlds]
        self._given, self._lengths = True, None
        for i in range(len(self._worlds)):
            self._begin(i, episodes[min(i, len(episodes) - 1)])
        self._read_beginning(self._arrays.index)
        return self._first_observation()

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy and pickle the environment: the copy is built anew, and takes the steps of the present episodes again.

        Raises UseError for an environment that is closed, shown in a window, of a subclass, or begun by `start`.
        """
        render, window = self._drawn
        reasons = {"is closed": self.is_closed, "is shown in a window": window, "was begun by start": self._given}
        reasons[f"is a {type(self).__name__}"] = type(self) is not WorkspaceEnv
        for reason, holds in reasons.items():
            if holds:
                raise UseError(f"this environment cannot be copied or pickled: it {reason}; make another one")
        return _copied, (self.config, self.batch_size[0], render, self.present())

    def draw_scenes(self, count: int, seed: int) -> TensorDictBase:
        """(count,) observed scenes that are never simulated, of up to task.drawn_objects.

        See `SceneSampler`; with pictures, `DrawnScenes`.
        """
        if self.config.pictures is None:
            return self._sample(count, seed)
        if self._drawn_scenes is None:
            self._drawn_scenes = DrawnScenes(WorkspaceEnv(self.config.drawn_anywhere(), 1))
        return self._drawn_scenes(count, seed)

    def hindsight(self, episodes: Sequence[TensorDictBase], seed: int) -> list[TensorDictBase]:
        """Relabel episodes with the goal they achieved (HER).

        episodes: (T,) recorded frames each. Those that achieved no other goal are left out. Targets stand elsewhere, or
        other objects are named in other words; rewards and ends are the task's, and an episode is cut where it would
        have ended. Entries that a policy wrote to the frames are kept.
        """
        return self._relabeller(episodes, seed)

    @property
    def slots(self) -> list[NDArray[np.int64]]:
        """For each world, the slots of its episode's objects, in the order of their scene."""
        return list(self._arrays.slots)

    @property
    def elapsed(self) -> NDArray[np.int64]:
        """(N,) control steps since each episode began."""
        return self._arrays.steps.copy()

    def sentence(self, world: int = 0) -> str:
        """Return the instruction of this world's episode."""
        return self._arrays.goals[world].sentence

    @property
    def gripper(self) -> NDArray[np.float64]:
        """(N, 3) gripper centres, metres."""
        return self._state.gripper.copy()

    @property
    def commanded_gripper(self) -> NDArray[np.float64]:
        """(N, 3) gripper centres at the joint angles last commanded, metres."""
        return self.kinematics.forward(self._arrays.commanded).position

    @property
    def fittings(self) -> dict[str, NDArray[np.float64]]:
        """How far each of the workspace's fittings has moved: name to (N,) joint values, metres or radians."""
        values = np.array([world.fitting_positions() for world in self._worlds]).T
        return dict(zip(self.config.workspace.fittings, values, strict=True))

    @property
    def eyes(self) -> NDArray[np.float64]:
        """(3,) between the eyes of the person who points, metres. Raises ConfigError if gesture.source=none."""
        if self._person is None:
            raise ConfigError(f"gesture.source=none: no person points in workspace={self.config.workspace.name}")
        return self._person.eyes

    @property
    def state(self) -> State:
        """The present state of all worlds, for scripted experts. Read-only."""
        return self._state

    @property
    def sight(self) -> Sight:
        """The task and the state as policies may know them: with perception=camera, as cameras see them. Read-only."""
        return self._source.sight

    @property
    def rows(self) -> NDArray[np.float64]:
        """(N, K, D) the rows of the objects of `sight`, without the task's own columns. Read-only."""
        return self._source.rows

    @property
    def blind(self) -> list[str | None]:
        """For each world, why nothing can be seen in it now, so that its arm holds still; None: it is seen."""
        return [None] * len(self._worlds) if self._perceived is None else list(self._perceived.blind)

    @property
    def yaw(self) -> NDArray[np.float64]:
        """(N,) radians that the grippers are turned about the vertical, from their orientation at rest."""
        return self.control.yaw(self._arrays.pose.rotation)

    @property
    def moves_referent(self) -> bool:
        """Whether the task is to move the referent."""
        return self.task.traits.moves

    def is_reachable(self, place: Tensor) -> bool:
        """Return whether a gripper gets within the task's radius of an object at place (3,), metres."""
        return self.control.outside(place.numpy()) <= self.config.task.radius

    @property
    def grip_depth(self) -> float:
        """Metres from the gripper centre down to the centre of an object that it holds."""
        return self._grip_controller.grip_depth

    @property
    def fingers_apart(self) -> NDArray[np.bool_]:
        """(N,) whether the fingers are fully open; always True for a magnet."""
        return self._grip_controller.are_apart(self._arrays.joints[..., 0])

    def towards(
        self,
        position: NDArray[np.float64],
        close: NDArray[np.bool_] | None = None,
        yaw: NDArray[np.float64] | None = None,
    ) -> Tensor:
        """Return the action (N, A) that brings each gripper nearer to position (N, 3), metres: for scripted experts.

        close: (N,) whether it is to grip. yaw: (N,) radians about the vertical, where the task turns. None: as now.
        """
        arm = self.control.towards(position, self._arrays.commanded, yaw)
        grip = np.where(self._grip_controller.closed if close is None else close, 1.0, -1.0)
        action = np.concatenate((arm, grip[:, None][:, : self._grip_controller.width]), axis=1)
        return torch.from_numpy(action.astype(np.float32))

    def render(self, world: int = 0, camera: str = FILM) -> NDArray[np.uint8]:
        """(height, width, 3) a world from one of `workspace.cameras`, by name.

        The env must have been made with render=True.
        """
        if camera == FILM:
            return self._worlds[world].render()
        pose = self._arrays.pose
        gripper = pose.position[world], pose.rotation[world]
        return self._worlds[world].picture(self.config.workspace.cameras[camera], gripper)

    def film(self, world: int = 0) -> NDArray[np.uint8]:
        """(height, width, 3) a world as videos show it: from the side of those whose left and right are meant."""
        return self._worlds[world].render(self.config.workspace.film_from(self.config.task.viewpoint))

    def close(self, *, raise_if_closed: bool = True) -> None:
        self._gestures.close()
        if self._drawn_scenes is not None:
            self._drawn_scenes.close()
        for world in self._worlds:
            world.close()
        self.is_closed = True


def next_goals(
    arrays: WorldState, task: Task, success: NDArray[np.bool_], generators: Sequence[Generator]
) -> Iterator[tuple[int, Goal]]:
    """Yield the worlds whose episodes go on after this control step, with their next goals. Their steps count from 0.

    success: (N,). generators: of each world.
    """
    for i in np.flatnonzero(success & (arrays.instructions_given < task.most_instructions)).tolist():
        slots, held = np.sort(arrays.slots[i]), arrays.state.held[i]
        scene = scene_of_rows(arrays.rows[i, slots], task.config.viewpoint, arrays.state.nouns[i, slots])
        number = NOTHING if held == NOTHING else int(np.searchsorted(slots, held))
        last = arrays.goals[i].instruction(slots)
        moved = task.moved(arrays.state)[i, slots]
        given = task.next_instruction(scene, number, generators[i], moved=moved, last=last)
        if given is not None:
            arrays.instructions_given[i] += 1
            arrays.steps[i] = 0
            yield i, Goal.of_instruction(given, slots)


# ---- its parts, by the config


def make_task(config: EnvConfig, num_worlds: int, person: Person | None) -> Task:
    """Make the task of N worlds. person: the person who points, or None."""
    task = TASKS[config.task.name](config.task, config.workspace.object_area, num_worlds, person)
    task.perceived = config.perception.sees
    task.furnish(config.workspace.fittings)
    task.prepare(config.workspace)
    return task


def make_kinematics(config: EnvConfig, task: Task) -> Kinematics:
    """Return the kinematics of the arm. Its rest pose depends on whether the task moves objects.

    With a rod, the gripper rests over the middle of the object area, at the greatest allowed height.
    """
    kinematics = read_kinematics(config.robot if task.traits.moves else config.robot.reaching())
    if not (config.gripper.rod and task.traits.moves):
        return kinematics
    x0, x1, y0, y1 = config.workspace.object_area
    return kinematics.resting_at(np.array([(x0 + x1) / 2, (y0 + y1) / 2, config.workspace.gripper_box[-1]]))


def _copied(config: EnvConfig, num_worlds: int, render: bool, present: Mapping[str, Any]) -> WorkspaceEnv:
    """Build a copy of an environment. present: what its `present` returned."""
    env = WorkspaceEnv(config, num_worlds, render=render)
    env.restore_present(present)
    return env


def make_world(
    config: EnvConfig,
    task: Task,
    render: bool = False,
    window: Window | None = None,
    *,
    world_type: type[SimulatedWorld] = SimulatedWorld,
) -> SimulatedWorld:
    """One world with all bodies that the task needs."""
    return world_type(
        robot=config.robot,
        workspace=config.workspace,
        physics=config.physics,
        objects=PoolSpec(task.shapes, task.bodies, config.task.object_size),
        visuals=render,
        window=window,
        gripper=config.gripper if task.traits.moves else None,
        devices=DeviceSpec(task.devices, task.device_width),
        holds=task.traits.grips or not task.devices,
        offers=HAND in task.fixtures,
    )


def gripper_name(config: EnvConfig, task: Task) -> str | None:
    """Return the gripper on the robot: "magnet", "fingers" or "hinge"; None if the task moves no objects."""
    return config.gripper.of(config.robot) if task.traits.moves else None


def gripper_box(config: EnvConfig, task: Task) -> Array:
    """(2, 3) lowest and highest corner of where the gripper may be, metres.

    Raises:
        ConfigError: the workspace's box ends below the least height that the task allows.
    """
    box = np.reshape(config.workspace.gripper_box, (3, 2)).T.copy()
    if not task.traits.moves:  # the gripper reaches objects from above, and pushes none
        box[0, 2] = max(box[0, 2], config.task.object_size / 2 + reaching_height(config.task, config.robot.clearance))
    elif gripper_name(config, task) == "magnet" and task.traits.grips:  # it grips and presses from above
        handles = [task.device_width * DEVICES[noun].lowest for noun in task.devices]
        above = config.gripper.gap or -PRESS_DEPTH
        box[0, 2] = max(box[0, 2], min([config.task.object_size + above, *handles]))
    if box[0, 2] >= box[1, 2]:
        raise ConfigError(
            f"workspace.gripper_box={list(config.workspace.gripper_box)} must end above z={box[0, 2]:g}: the gripper "
            f"comes from above to objects of task.object_size={config.task.object_size}"
        )
    return box


def make_control(config: EnvConfig, task: Task, kinematics: Kinematics) -> Control:
    """Make the control that the config names."""
    speed = np.array(config.robot.max_speed) * (config.physics.time_step * config.physics.substeps)
    return CONTROLS[config.control.name](
        config.control,
        kinematics=kinematics,
        speed=speed,
        box=gripper_box(config, task),
        guarded=not task.traits.moves or gripper_name(config, task) == "magnet",
        turns=task.traits.turns,
        gentle=gripper_name(config, task) == "hinge",
    )


def make_initial_states(config: EnvConfig, task: Task, kinematics: Kinematics) -> InitialStates:
    """Return where the arm begins episodes."""
    curriculum = config.task.curriculum.share > 0
    noise = max(config.task.reset_noise, config.task.randomize.start)
    return InitialStates(kinematics, noise, gripper_box(config, task) if curriculum else None)


def make_grip_controller(
    config: EnvConfig, task: Task, worlds: Sequence[SimulatedWorld], state: State
) -> GripController:
    """Make the controller of all worlds' grippers. state: the arrays to which it writes the held slots."""
    return GripController(
        gripper=gripper_name(config, task) if task.traits.grips else None,
        robot=config.robot,
        object_size=config.task.object_size,
        worlds=worlds,
        state=state,
        release_lag=task.release_lag,
        apart=not task.traits.moves,
    )
