"""WorkspaceEnv: N PyBullet worlds behind one TorchRL environment with batch_size [N].

What it observes is told in `envs/mdp/observation_spec.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import Binary, Bounded, Composite, Unbounded
from torchrl.envs import EnvBase

from conf.schema import ConfigError
from envs.config import EnvConfig
from envs.mdp.controls import CONTROLS
from envs.mdp.gestures import Gestures, meet, watch
from envs.mdp.goals import Goal
from envs.mdp.grip_controller import ACTION_UNIT, GripController
from envs.mdp.initial_states import InitialStates
from envs.mdp.observation_spec import Bounds, observation_spec
from envs.mdp.observations import observe
from envs.mdp.relabelling import Hindsight
from envs.mdp.rewards import judge, weights
from envs.mdp.scene_sampling import described
from envs.mdp.world_state import WorldState
from envs.sim.object_pool import PoolSpec
from envs.sim.robot import read_chain
from envs.sim.window import Window
from envs.sim.world import World
from envs.tasks import NOTHING, TASKS, Episode, State
from language import SHAPES, Tokenizer

PRESS = 0.005  # metres that a magnet may go below the top of an object on the table
TALES = 16  # episodes that are told again at once
FLAGS = ("success", "wrong_object", "wrong_target", "at_goal", "terminated", "truncated", "done")  # (N, 1) bool each


class WorkspaceEnv(EnvBase):
    """N worlds that step together and reset each by itself.

    World i draws all chance from its own generator, seeded with (seed, i): its rollouts are the same, bit for bit,
    whatever N. Raises ConfigError for what cannot be built.

    config: what to build. num_worlds: N. seed: of the generators. render: load visuals, for `render`.
    window: where the one world is shown.
    """

    batch_locked = True

    def __init__(
        self,
        config: EnvConfig,
        num_worlds: int = 1,
        seed: int = 0,
        render: bool = False,
        window: Window | None = None,
    ) -> None:
        for name, value, least in (("num_worlds", num_worlds, 1), ("seed", seed, 0)):
            if value < least:
                raise ConfigError(f"{name}={value} must be at least {least}")
        super().__init__(batch_size=[num_worlds])
        self.config, self.tokenizer = config, Tokenizer.default()
        task = config.task
        task.objects.check(config.workspace.bounds)
        self._person = meet(config.workspace.human, config.gesture)
        self.task = TASKS[task.name](task, config.workspace.object_area, num_worlds, self._person)
        self.task.draw(np.random.default_rng(0))  # raises now where no episode can be drawn
        gripper = config.gripper.of(config.robot) if self.task.moves else None
        self.chain = read_chain(config.robot if self.task.moves else config.robot.reaching())
        self._worlds = [self._world(render, window) for _ in range(num_worlds)]
        period = config.physics.time_step * config.physics.substeps
        box = np.reshape(config.workspace.gripper_box, (3, 2)).T.copy()
        if gripper == "magnet" and self.task.grips:  # what it grips, it grips from above
            box[0, 2] = max(box[0, 2], task.object_size - PRESS)
        speed = np.array(config.robot.max_speed) * period
        guarded, turns = gripper == "magnet", self.task.turns
        self.control = CONTROLS[config.control.name](config.control, self.chain, speed, box, guarded, turns)
        self._starts = InitialStates(self.chain, box) if task.curriculum.share > 0 else None
        self._arrays = WorldState(self._worlds, config.robot, self.chain, task.slots, self.tokenizer)
        self._state = self._arrays.state
        kind, size = gripper if self.task.grips else None, task.object_size
        apart = not self.task.moves
        self._grips = GripController(kind, config.robot, size, self._worlds, self._state, self.task.lag, apart)
        self._weights = weights(self.task)
        self._gestures = Gestures(config.gesture, self._worlds, watch(config.workspace, config.gesture))
        self._bounds = Bounds(config.workspace, config.robot, self.chain, self.task)
        retelling = TASKS[task.name](task, config.workspace.object_area, TALES, self._person)
        self._hindsight = Hindsight(retelling, TALES, self.tokenizer, self._bounds, len(config.robot.joints))
        self._make_specs()
        self._set_seed(seed)

    @property
    def kind_names(self) -> tuple[str, ...]:
        """What the numbers of privileged/kind mean."""
        return self.task.kind_names

    @property
    def reward_names(self) -> tuple[str, ...]:
        """What the columns of reward_terms are."""
        return self.task.terms

    @property
    def action_unit(self) -> tuple[float, ...]:
        """How far each of the A numbers may be from `hold` to be carried out within one control step."""
        return (*self.control.unit.tolist(), *[ACTION_UNIT] * self._grips.width)

    def _world(self, render: bool, window: Window | None) -> World:
        config, objects = self.config, PoolSpec(SHAPES, self.task.bodies, self.config.task.object_size)
        gripper = config.gripper if self.task.moves else None
        return World(
            config.robot, config.workspace, config.physics, objects, render, window, gripper, self.task.devices
        )

    def _make_specs(self) -> None:
        n, flag = self.batch_size[0], Binary(1, shape=(*self.batch_size, 1), dtype=torch.bool)
        actions = len(self.action_unit)
        self.observation_spec = observation_spec(self._bounds, n, self.task, self.tokenizer, actions)
        self.action_spec = Bounded(-1, 1, shape=(n, actions), dtype=torch.float32)
        self.reward_spec = Unbounded(shape=(n, 1), dtype=torch.float32)
        self.full_done_spec = Composite(
            {name: flag.clone() for name in ("done", "terminated", "truncated")}, shape=(n,)
        )

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        action = tensordict["action"].detach().numpy().astype(np.float64)
        if not np.isfinite(action).all():
            raise ValueError("an action is not a finite number")
        np.clip(action, -1.0, 1.0, out=action)
        self._turn()
        arrays, arm = self._arrays, action[:, : len(self.control.unit)]
        arrays.commanded = self.control.targets(arm, arrays.commanded, arrays.angles)
        if self._grips.grips:
            self._grips.command(action[:, -1])
        targets = np.concatenate((arrays.commanded, self._grips.targets), axis=1).tolist()
        for world, target in zip(self._worlds, targets, strict=True):
            world.advance(target)
        arrays.read(arrays.index)
        if self._grips.grips:
            self._grips.update_grasps()
        self._gestures.follow()
        arrays.steps += 1
        # The task judges first: what it remembers of an episode is observed too.
        return TensorDict(self._judge() | self._observation(), self.batch_size)

    def _turn(self) -> None:
        """Fingers move on to another object where it is time, and what is meant with them."""
        for i, referent in self._gestures.turn(self._arrays.steps):
            slot = int(self._arrays.slots[i][referent])
            self._set_goal(i, replace(self._arrays.goals[i], referent=slot))

    def _set_goal(self, i: int, goal: Goal) -> None:
        """What world i is asked for from now on, in mid-episode."""
        self._arrays.set_goal(i, goal)
        self.task.reset(np.array([i]), self._state)

    def _judge(self) -> dict[str, Tensor]:
        """What the step came to: the rewards, and the ends of episodes."""
        came_to = judge(self.task, self._state, self._weights)
        out_of_time = torch.from_numpy(self._arrays.steps[:, None] >= self.config.task.max_steps)
        truncated = out_of_time & ~came_to["terminated"]
        return came_to | {"truncated": truncated, "done": truncated | came_to["terminated"]}

    def _reset(self, tensordict: TensorDictBase | None, **_: Any) -> TensorDictBase:
        worlds = self._arrays.index
        if tensordict is not None and "_reset" in tensordict.keys():
            worlds = np.flatnonzero(tensordict["_reset"].numpy().reshape(len(self._arrays.index), -1).any(1))
        for i in worlds.tolist():
            self._begin(i, self.task.draw(self._generators[i]))
        if len(worlds):
            self._see(worlds)
        return self._begun()

    def _see(self, worlds: NDArray[np.int64]) -> None:
        """Read worlds whose episodes have just been laid out."""
        self._arrays.read(worlds)
        self.task.reset(worlds, self._state)
        self._gestures.read(worlds.tolist())

    def start(self, episodes: Sequence[Episode], seed: int) -> TensorDictBase:
        """Begin these episodes, one a world (worlds beyond them repeat the last), instead of drawn ones.

        All else, slots and joint noise, is drawn from the same seed in every world: two worlds with the same episode
        begin as the same bits. Raises ValueError for none, or more than there are worlds.
        """
        if not 0 < len(episodes) <= len(self._worlds):
            raise ValueError(f"{len(episodes)} episodes for {len(self._worlds)} worlds")
        self._generators = [np.random.default_rng(seed) for _ in self._worlds]
        for i in range(len(self._worlds)):
            self._begin(i, episodes[min(i, len(episodes) - 1)])
        self._see(self._arrays.index)
        return self._begun()

    def draw_scenes(self, count: int, seed: int) -> TensorDictBase:
        """(count,) what could be asked: objects, objects_mask, instruction, gesture and privileged/referent.

        Such episodes are drawn and described like any other, but never simulated: about a millisecond each.
        """
        return described(self.task, self.tokenizer, self._bounds, self._arrays.rows.shape[1], count, seed)

    def hindsight(self, episodes: Sequence[TensorDictBase], seed: int) -> list[TensorDictBase]:
        """Recorded episodes, (T,) each, as they would be had been asked for what they came to; those that can be.

        Targets stand elsewhere or other objects are named, in other words; rewards and ends are the task's. Each ends
        where it would have. What a policy wrote to the frames is as it was.
        """
        return self._hindsight(episodes, seed)

    def _begun(self) -> TensorDictBase:
        """What is observed where nothing has been done yet."""
        values = self._observation()
        values["reward_terms"] = torch.zeros(*self.batch_size, len(self.reward_names))
        values |= {name: torch.zeros(*self.batch_size, 1, dtype=torch.bool) for name in FLAGS}
        return TensorDict(values, self.batch_size)

    def _begin(self, i: int, episode: Episode) -> None:
        """Lay out one episode in world i, its objects in slots drawn anew."""
        generator, arrays = self._generators[i], self._arrays
        order = generator.permutation(arrays.rows.shape[1])[: len(episode.scene)]  # object -> slot
        joints = self._first_joints(episode, generator)
        held = episode.start is not None and episode.start.held
        arrays.begin(i, episode, order, joints, self._grips.initial_opening(held))
        if self._grips.grips:
            centre = self.chain.forward(joints[None]).position[0]
            self._grips.begin(i, int(order[episode.referent]) if held else NOTHING, arrays.state.shown[i], centre)
        self._gestures.begin(i, episode)

    def _first_joints(self, episode: Episode, generator: np.random.Generator) -> NDArray[np.float64]:
        """(J,) where the arm begins: about its rest pose, or where the curriculum has it."""
        noise = self.config.task.reset_noise
        joints = self.chain.rest + generator.uniform(-noise, noise, len(self.chain.rest))
        if episode.start is None or self._starts is None:
            return joints
        place = episode.scene.positions[episode.referent] + episode.start.offset
        return self._starts.joints(place + [0.0, 0.0, self._grips.below])

    def _observation(self) -> dict[str, Any]:
        """What is seen now, in fresh tensors."""
        return observe(self._arrays, self._grips, self._gestures, self.task, self._bounds) | {
            "hold": torch.from_numpy(self._hold())
        }

    def _hold(self) -> NDArray[np.float32]:
        """(N, A) the action that keeps the arm where it is; 0 for the gripper, whose number is told outright."""
        arm = self.control.hold(self._arrays.angles, self._arrays.pose.position)
        return np.concatenate((arm, np.zeros((len(arm), self._grips.width))), axis=1).astype(np.float32)

    def _set_seed(self, seed: int | None) -> None:
        seeds = [np.random.SeedSequence(seed, spawn_key=(i,)) for i in range(len(self._worlds))]
        self._generators = [np.random.default_rng(sequence) for sequence in seeds]

    @property
    def elapsed(self) -> NDArray[np.int64]:
        """(N,) control steps since each episode began."""
        return self._arrays.steps.copy()

    def sentence(self, world: int = 0) -> str:
        """The instruction that world `world` is under."""
        return self._arrays.goals[world].sentence

    @property
    def gripper(self) -> NDArray[np.float64]:
        """(N, 3) gripper centres, metres."""
        return self._state.gripper.copy()

    @property
    def fittings(self) -> dict[str, NDArray[np.float64]]:
        """How far each of the workspace's fittings has moved: name to (N,) joint values, metres or radians."""
        values = np.array([world.fitting_positions() for world in self._worlds]).T
        return dict(zip(self.config.workspace.fittings, values, strict=True))

    @property
    def eyes(self) -> NDArray[np.float64]:
        """(3,) between the eyes of the person who points, metres. Raises ConfigError where nobody does."""
        if self._person is None:
            raise ConfigError(f"gesture.source=none: nobody points in workspace={self.config.workspace.name}")
        return self._person.eyes

    @property
    def state(self) -> State:
        """What stands where, and what is held: for scripted experts. Not to be written to."""
        return self._state

    @property
    def yaw(self) -> NDArray[np.float64]:
        """(N,) radians about the vertical that the grippers are turned from how they point at rest."""
        return self.control.yaw(self._arrays.pose.rotation)

    @property
    def below(self) -> float:
        """Metres from the gripper centre down to the centre of an object that it holds."""
        return self._grips.below

    def towards(
        self,
        position: NDArray[np.float64],
        close: NDArray[np.bool_] | None = None,
        yaw: NDArray[np.float64] | None = None,
    ) -> Tensor:
        """The action (N, A) that brings each gripper nearer to position (N, 3): for scripted experts.

        close: (N,) whether it is to grip; none: it goes on doing what it does. yaw: (N,) radians about the vertical
        that it is to be turned, where the task turns things; none: as it is.
        """
        arm = self.control.towards(position, self._arrays.commanded, yaw)
        grip = np.where(self._grips.closed if close is None else close, 1.0, -1.0)
        action = np.concatenate((arm, grip[:, None][:, : self._grips.width]), axis=1)
        return torch.from_numpy(action.astype(np.float32))

    def render(self) -> NDArray[np.uint8]:
        """World 0 from the workspace's camera, (height, width, 3). The env must have been made with render=True."""
        return self._worlds[0].render()

    def close(self, *, raise_if_closed: bool = True) -> None:
        self._gestures.close()
        for world in self._worlds:
            world.close()
        self.is_closed = True
