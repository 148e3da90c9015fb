"""WorkspaceEnv: N PyBullet worlds behind one TorchRL environment with batch_size [N].

What it observes is told in `envs/observation.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import itemgetter
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
from envs.controls import CONTROLS
from envs.described import described, encoded
from envs.gestures import Gestures, meet, watch
from envs.observation import (
    ATTRIBUTES,
    OBJECT_WIDTH,
    SENTENCE_BYTES,
    Bounds,
    attributes,
    clipped,
    in_bytes,
    observation_spec,
)
from envs.robot import read_chain
from envs.tasks import TASKS, Episode, State
from envs.window import Window
from envs.world import PARKED, Hold, World
from language import NOUNS, Tokenizer

_angle_and_speed = itemgetter(0, 1)
FLAGS = ("success", "wrong_object", "at_goal", "terminated", "truncated", "done")  # (N, 1) bool each


class WorkspaceEnv(EnvBase):
    """N worlds that step together and reset each by itself.

    World i draws all chance from its own generator, seeded with (seed, i): its rollouts are the same, bit for bit,
    whatever N. Raises ConfigError for what cannot be built.

    config: what to build. num_worlds: N. seed: of the generators. render: load visuals, for `render`.
    """

    batch_locked = True

    def __init__(self, config: EnvConfig, num_worlds: int = 1, seed: int = 0, render: bool = False) -> None:
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
        self.chain = read_chain(config.robot)
        self._worlds = [self._world(render) for _ in range(num_worlds)]
        period = config.physics.time_step * config.physics.substeps
        box = np.reshape(config.workspace.gripper_box, (3, 2)).T
        self.control = CONTROLS[config.control.name](
            config.control, self.chain, np.array(config.robot.max_speed) * period, box
        )
        self._weights = np.array([task.reward.get(name, 0.0) for name in self.reward_names])
        self._allocate(num_worlds, len(config.robot.joints), task.num_objects)
        self._gestures = Gestures(config.gesture, self._worlds, watch(config.workspace, config.gesture))
        self._bounds = Bounds(config.workspace, config.robot, self.chain)
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
        return tuple(self.control.unit.tolist())

    def _world(self, render: bool, window: Window | None = None) -> World:
        config, pool = self.config, (tuple(NOUNS), self.task.bodies, self.config.task.object_size)
        return World(config.robot, config.workspace, config.physics, *pool, render, window)

    def _make_specs(self) -> None:
        n, flag = self.batch_size[0], Binary(1, shape=(*self.batch_size, 1), dtype=torch.bool)
        actions = len(self.control.unit)
        self.observation_spec = observation_spec(self._bounds, n, self.task, self.tokenizer, actions)
        self.action_spec = Bounded(-1, 1, shape=(n, actions), dtype=torch.float32)
        self.reward_spec = Unbounded(shape=(n, 1), dtype=torch.float32)
        self.full_done_spec = Composite(
            {name: flag.clone() for name in ("done", "terminated", "truncated")}, shape=(n,)
        )

    def _allocate(self, worlds: int, joints: int, slots: int) -> None:
        fingers = len(self.config.robot.fingers)
        self._joints = np.zeros((worlds, joints + fingers, 2))  # angle and speed, fingers last
        self._commanded = np.zeros((worlds, joints))
        self._fingers = np.full((worlds, fingers), 0.0)  # closed: reaching needs no grip
        self._rows = np.zeros((worlds, slots, OBJECT_WIDTH))
        self._rows[..., :3] = PARKED
        shown, referent = np.zeros((worlds, slots), bool), np.zeros(worlds, np.int64)
        self._state = State(np.zeros((worlds, 3)), self._rows[..., :3], shown, referent)
        self._index = np.arange(worlds)
        self._slots = [np.arange(slots) for _ in range(worlds)]  # of each world's objects
        self._instruction = np.zeros((worlds, self.tokenizer.length), np.int64)
        self._kind = np.zeros(worlds, np.int64)
        self._sentence = np.zeros((worlds, SENTENCE_BYTES), np.uint8)
        self._steps = np.zeros(worlds, np.int64)

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        action = tensordict["action"].detach().numpy().astype(np.float64)
        if not np.isfinite(action).all():
            raise ValueError("an action is not a finite number")
        np.clip(action, -1.0, 1.0, out=action)
        self._turn()
        self._commanded = self.control.targets(action, self._commanded, self._angles)
        targets = np.concatenate((self._commanded, self._fingers), axis=1).tolist()
        for world, target in zip(self._worlds, targets, strict=True):
            world.advance(target)
        self._read(self._index)
        self._gestures.follow()
        self._steps += 1
        return TensorDict(self._observation() | self._judge(), self.batch_size)

    def _turn(self) -> None:
        """Fingers move on to another object where it is time, and what is meant with them."""
        for i, referent in self._gestures.turn(self._steps):
            self._mean(i, self._slots[i][referent])

    def _mean(self, i: int, slot: int) -> None:
        self._state.referent[i] = slot
        self.task.reset(np.array([i]), self._state)

    def _judge(self) -> dict[str, Tensor]:
        """What the step came to: weighted reward terms, their sum, and the ends of episodes."""
        outcome = self.task.step(self._state)
        terms = np.stack([outcome.terms[name] for name in self.reward_names], axis=1) * self._weights
        terminated = outcome.success | outcome.wrong_object
        truncated = (self._steps >= self.config.task.max_steps) & ~terminated
        flags = (
            outcome.success,
            outcome.wrong_object,
            outcome.at_goal,
            terminated,
            truncated,
            terminated | truncated,
        )
        return {
            "reward_terms": torch.from_numpy(terms.astype(np.float32)),
            "reward": torch.from_numpy(terms.sum(1, keepdims=True).astype(np.float32)),
            **{name: torch.from_numpy(flag[:, None]) for name, flag in zip(FLAGS, flags, strict=True)},
        }

    def _reset(self, tensordict: TensorDictBase | None, **_: Any) -> TensorDictBase:
        worlds = self._index
        if tensordict is not None and "_reset" in tensordict.keys():
            worlds = np.flatnonzero(tensordict["_reset"].numpy().reshape(len(self._index), -1).any(1))
        for i in worlds.tolist():
            self._begin(i, self.task.draw(self._generators[i]))
        if len(worlds):
            self._see(worlds)
        return self._begun()

    def _see(self, worlds: NDArray[np.int64]) -> None:
        """Read worlds whose episodes have just been laid out."""
        self._read(worlds)
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
        self._see(self._index)
        return self._begun()

    def draw_scenes(self, count: int, seed: int) -> TensorDictBase:
        """(count,) what could be asked: objects, objects_mask, instruction, gesture and privileged/referent.

        Such episodes are drawn and described like any other, but never simulated: about a millisecond each.
        """
        return described(self.task, self.tokenizer, self._bounds, self._rows.shape[1], count, seed)

    def _begun(self) -> TensorDictBase:
        """What is observed where nothing has been done yet."""
        values = self._observation()
        values["reward_terms"] = torch.zeros(*self.batch_size, len(self.reward_names))
        values |= {name: torch.zeros(*self.batch_size, 1, dtype=torch.bool) for name in FLAGS}
        return TensorDict(values, self.batch_size)

    def _begin(self, i: int, episode: Episode) -> None:
        """Lay out one episode in world i, its objects in slots drawn anew."""
        generator, scene, slots = self._generators[i], episode.scene, self._rows.shape[1]
        order = generator.permutation(slots)[: len(scene)]  # object -> slot
        by_slot = np.argsort(order, kind="stable")
        self._slots[i] = order
        noise = self.config.task.reset_noise
        joints = self.chain.rest + generator.uniform(-noise, noise, len(self.chain.rest))
        self._commanded[i] = joints
        self._rows[i] = 0.0
        self._rows[i, :, :3] = PARKED
        self._rows[i, order, ATTRIBUTES] = attributes(scene)
        self._state.shown[i] = False
        self._state.shown[i, order] = True
        self._state.referent[i] = order[episode.referent]
        self._instruction[i] = encoded(self.tokenizer, episode)
        self._kind[i], self._steps[i] = episode.kind, 0
        self._sentence[i] = in_bytes(episode.sentence)
        yaw = np.zeros(len(scene)) if episode.yaw is None else episode.yaw
        self._worlds[i].reset(
            joints.tolist(),
            0.0,
            scene.nouns[by_slot].tolist(),
            Hold.of(scene.targets, episode.fixed)[by_slot].tolist(),
            scene.positions[by_slot].tolist(),
            yaw[by_slot].tolist(),
            self._rows[i, np.sort(order), 7:11],
        )
        self._gestures.begin(i, episode)

    def _read(self, worlds: NDArray[np.int64]) -> None:
        """Take the measured state of these worlds from PyBullet into the arrays."""
        joints: list[list[tuple]] = []
        poses: list[float] = []
        for i in worlds.tolist():
            world = self._worlds[i]
            joints.append(list(map(_angle_and_speed, world.robot.states())))
            for position, quaternion in world.objects():
                poses += position
                poses += quaternion
        self._joints[worlds] = joints
        shown = np.zeros_like(self._state.shown)
        shown[worlds] = self._state.shown[worlds]
        self._rows[shown, :7] = np.reshape(poses, (-1, 7))
        self._angles = np.ascontiguousarray(self._joints[:, : self._commanded.shape[1], 0])
        self._pose = self.chain.forward(self._angles)
        self._state.gripper = self._pose.position

    def _observation(self) -> dict[str, Any]:
        """Fresh tensors, never views of what the next step overwrites."""
        count = self._commanded.shape[1]
        robot = np.concatenate(
            (
                self._angles,
                self._joints[:, :count, 1],
                self._pose.position,
                self._pose.rotation[:, :, 0],
                self._pose.rotation[:, :, 1],
                self._gripper_state(),
            ),
            axis=1,
        )
        rows = np.where(self._state.shown[..., None], self._rows, 0.0)
        goal = self._rows[self._index, self._state.referent, :3]
        privileged = {
            "referent": torch.from_numpy(self._state.referent.copy()),
            "goal": clipped(goal, self._bounds.position),
            "kind": torch.from_numpy(self._kind.copy()),
            "sentence": torch.from_numpy(self._sentence.copy()),
        }
        seen = {}
        if self._gestures.points:
            seen["gesture"] = clipped(self._gestures.rays, self._bounds.gesture)
            measures = self._gestures.measures(self._rows[..., :3], self._state.shown, self._state.referent)
            privileged["pointing"] = clipped(measures, self._bounds.pointing)
        return seen | {
            "robot": clipped(robot, self._bounds.robot),
            "objects": clipped(rows, self._bounds.objects),
            "objects_mask": torch.from_numpy(self._state.shown.copy()),
            "hold": torch.from_numpy(self.control.hold(self._angles, self._pose.position).astype(np.float32)),
            "instruction": torch.from_numpy(self._instruction.copy()),
            "privileged": TensorDict(privileged, self.batch_size),
        }

    def _gripper_state(self) -> NDArray[np.float64]:
        """(N, 1) in [0, 1]: how far the fingers are open; 0 for a magnet that holds nothing."""
        opening = self.config.robot.finger_opening
        if opening == 0:
            return np.zeros((len(self._index), 1))
        return self._joints[:, -len(self.config.robot.fingers) :, 0].mean(1, keepdims=True) / opening

    def _set_seed(self, seed: int | None) -> None:
        seeds = [np.random.SeedSequence(seed, spawn_key=(i,)) for i in range(len(self._worlds))]
        self._generators = [np.random.default_rng(sequence) for sequence in seeds]

    @property
    def elapsed(self) -> NDArray[np.int64]:
        """(N,) control steps since each episode began."""
        return self._steps.copy()

    def sentence(self, world: int = 0) -> str:
        """The instruction that world `world` is under."""
        return bytes(self._sentence[world]).rstrip(b"\0").decode()

    @property
    def gripper(self) -> NDArray[np.float64]:
        """(N, 3) gripper centres, metres."""
        return self._state.gripper.copy()

    @property
    def fittings(self) -> dict[str, NDArray[np.float64]]:
        """How far each of the workspace's fittings has moved: name to (N,) joint values, metres or radians."""
        values = np.array([world.fittings() for world in self._worlds]).T
        return dict(zip(self.config.workspace.fittings, values, strict=True))

    @property
    def eyes(self) -> NDArray[np.float64]:
        """(3,) between the eyes of the person who points, metres. Raises ConfigError where nobody does."""
        if self._person is None:
            raise ConfigError(f"gesture.source=none: nobody points in workspace={self.config.workspace.name}")
        return self._person.eyes

    def towards(self, position: NDArray[np.float64]) -> Tensor:
        """The action (N, A) that brings each gripper nearer to position (N, 3): for scripted experts."""
        return torch.from_numpy(self.control.towards(position, self._commanded).astype(np.float32))

    def render(self) -> NDArray[np.uint8]:
        """World 0 from the workspace's camera, (height, width, 3). The env must have been made with render=True."""
        return self._worlds[0].render()

    def close(self, *, raise_if_closed: bool = True) -> None:
        self._gestures.close()
        for world in self._worlds:
            world.close()
        self.is_closed = True
