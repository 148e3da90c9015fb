"""The environment that a policy sees while it drives an arm: the classes of `envs`, with an arm in place of physics.

A control step sends the targets to the arm, waits for a control period, and places what was measured and perceived in
the PyBullet world, which takes no physics steps then. Observations, controls, the gripper's logic, sentences and the
page read that world as they read a simulated one.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tensordict import TensorDictBase

from core.errors import ConfigError
from deployment.arm import Array
from deployment.safe_arm import SafeArm
from deployment.safety import Decision
from deployment.twin import TwinArm, TwinCameras
from envs.config import EnvConfig
from envs.interactive.interactive_env import InteractiveEnv
from envs.mdp.grip_controller import GripController
from envs.mdp.perceived_worlds import Reader
from envs.mdp.world_state import WorldState
from envs.sim.kinematics import Pose
from envs.sim.world import SimulatedWorld
from envs.tasks import EpisodeSpec, Task
from human import Unreachable

GRIP_RADIUS = 0.03  # metres from the gripper to the nearest side of an object that a gripper without a sensor may hold
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
Placed = tuple[Sequence[float], Sequence[float]]  # position (3,), metres, and quaternion (4,): x, y, z, w


class Percept(NamedTuple):
    """Where things were seen. angles: (J,) of the arm at that time, radians. poses: of each object, in the order of
    the episode. holds: whether the gripper held one of them then; None: nobody knows."""

    angles: Array
    poses: list[Placed]
    holds: bool | None


class Perception(ABC):
    """Tells where objects are."""

    @abstractmethod
    def begin(self, seed: int) -> EpisodeSpec:
        """Return the scene at the beginning of an episode. What it draws follows from the seed."""

    @abstractmethod
    def look(self) -> Percept:
        """Return the newest percept."""

    def placed(self, angles: Array, poses: list[Placed]) -> None:  # noqa: B027
        """Take note of where the objects are thought to be, with the arm at angles (J,), radians."""

    def put(self, number: int, position: Sequence[float]) -> bool:
        """Put a loose object at position (3,), metres. Returns whether it can do so: most cannot move things."""
        return False

    def reader(self, config: EnvConfig) -> Reader:
        """Return what tells what cameras see. Raises ConfigError where there are none."""
        raise ConfigError("perception.name=camera needs cameras, which only arm=sim has yet: give perception=state")


class FixedScene(Perception):
    """Objects that are where a person says, and then where the arm has carried them. Nobody looks."""

    def __init__(self, arm: SafeArm, episode: EpisodeSpec) -> None:
        self._arm, self._episode = arm, episode
        self._angles, self._poses = arm.safety.limits.low, list[Placed]()  # until an episode begins

    def begin(self, seed: int) -> EpisodeSpec:
        return self._episode

    def look(self) -> Percept:
        holds = False if self._arm.measured.holds is False else None  # what it held stays where it was opened
        return Percept(self._angles, self._poses, holds)

    def placed(self, angles: Array, poses: list[Placed]) -> None:
        self._angles, self._poses = angles, poses


class TwinPerception(Perception):
    """The objects that the twin reports, as late as its measurements. scene: how each episode begins; None: drawn.

    With perception=camera, policies observe what is seen in the twin's pictures instead; the reported places are drawn.
    """

    def __init__(self, arm: TwinArm, safe: SafeArm, scene: EpisodeSpec | None = None) -> None:
        self._arm, self._safe, self._scene = arm, safe, scene

    def begin(self, seed: int) -> EpisodeSpec:
        episode = self._arm.begin(seed, self._scene)
        self._safe.relocate()
        return episode

    def put(self, number: int, position: Sequence[float]) -> bool:
        self._arm.put(number, position)
        return True

    def reader(self, config: EnvConfig) -> Reader:
        from envs.perception.detector import load_detector  # slow to import

        return TwinCameras(self._arm, config, load_detector(config.perception.weights))

    def look(self) -> Percept:
        report = self._arm.report
        assert report is not None, "await_seen has waited for it"
        return Percept(report.state.angles, list(report.poses), report.state.holds)


class MirrorWorld(SimulatedWorld):
    """A world that shows what is measured and perceived. Until `bind`, it is an ordinary one at rest.

    decision: what was sent in the last control step, or None.
    """

    decision: Decision | None = None
    _arm: SafeArm | None = None
    _marks: dict[int, Placed]  # see-through objects that were put elsewhere
    _number: int | None = None  # of the object that is held
    _opened_at: Pose | None = None  # where the gripper was when it was last commanded to open

    def bind(self, env: MirrorEnv, arm: SafeArm, perception: Perception) -> None:
        """Show this arm and these objects from now on, in the environment that has this world alone."""
        self._arm, self._perception = arm, perception
        self._arrays, self._controller, self._kinematics = env.arrays, env.grip_controller, env.kinematics
        self._period = env.period
        # The speed at which a joint ends a control step of simulation, as a share of its mean speed in that step.
        gain, self._substeps = env.config.robot.gain, env.config.physics.substeps
        count = self._substeps
        self._late_speed = gain * (1 - gain) ** (count - 1) * count
        self._reach = env.config.task.object_size / 2 + GRIP_RADIUS

    def reset(self, **beginning: Any) -> None:
        """Begin an episode with the objects of the scene where they are perceived."""
        super().reset(**beginning)
        self._number = self._opened_at = None
        self._marks = {}
        if self._arm is not None:
            self._perception.placed(self._arm.angles, [(place, UPRIGHT) for place in beginning["positions"]])
            self.show()
            self._arrays.commanded[0] = self._arm.angles

    def advance(self, targets: Sequence[float]) -> None:
        """Send the arm to these targets as far as its rules allow, and show it a control period later."""
        if self._arm is None:
            super().advance(targets)
            return
        before = self._arm.angles
        wanted, opening = np.array(targets[: len(self.robot.arm)]), float(self._controller.opening[0])
        if opening < 1:
            self._opened_at = None
        elif self._opened_at is None:
            self._opened_at = self._kinematics.forward(before[None])
        self.decision = self._arm.step(wanted, opening, self._period)
        self.step_physics(self._substeps)
        after = self._arm.angles
        # The next command starts from this one, or from where the arm holds.
        sent = self.decision.angles
        self._arrays.commanded[0] = after if sent is None or self._arm.holding else sent
        self.show((after - before) / self._period * self._late_speed)

    def show(self, speeds: Array | None = None) -> None:
        """Place what is measured and perceived in the world. speeds: (J,) rad/s; None: 0."""
        assert self._arm is not None
        speeds = np.zeros(len(self.robot.arm)) if speeds is None else speeds
        angles, percept = self._arm.angles, self._perception.look()
        opening = self._arm.measured.opening * self.robot.config.finger_opening
        self.robot.place(angles.tolist(), opening, speeds.tolist())
        there, here = (self._kinematics.forward(each[None]) for each in (percept.angles, angles))
        self._number = self._held_at(there, percept)
        poses = list(percept.poses)
        if self._number is not None:  # it goes wherever the gripper will go before it opens
            poses[self._number] = _carried(poses[self._number], there, self._opened_at or here)
        self._perception.placed(angles, poses)
        self.pool.put([self._marks.get(number, pose) for number, pose in enumerate(poses)])

    def mark(self, number: int, position: Sequence[float]) -> None:
        """Show a see-through object at position (3,), metres, for the rest of the episode: it exists only in words."""
        self._marks[number] = position, UPRIGHT

    def _held_at(self, gripper: Pose, percept: Percept) -> int | None:
        """Return the number of the object that a gripper at this pose holds, as far as it is perceived."""
        state = self._arrays.state
        movable = state.movable[0, state.shown[0]]  # not the see-through ones
        if not movable.any() or percept.holds is False:
            return None
        places = np.array([position for position, _ in percept.poses])
        distance = np.where(movable, np.linalg.norm(places - gripper.position, axis=1), np.inf)
        nearest = int(distance.argmin())
        known = percept.holds or (self._controller.closed[0] and distance[nearest] < self._reach)
        return nearest if known else None

    def step_physics(self, steps: int = 1) -> None:
        """Let the person move on, who is drawn beside a real arm as well; nothing else is simulated."""
        if self._arm is None:
            super().step_physics(steps)
        while steps and self._arm is not None and self.person is not None and self.person.moving:
            self.person.advance()
            steps -= 1

    def update_grasp(self, near: Sequence[int], centre: Sequence[float]) -> None:
        """The arm's own gripper has taken hold, or not: `held` says what is perceived."""

    def release(self, after: int = 0) -> None:
        """The command of the next control step opens the gripper."""
        if self._arm is None:
            super().release(after)

    @property
    def held(self) -> int | None:
        return self._number


def _carried(placed: Placed, there: Pose, here: Pose) -> Placed:
    """Return where an object is that was seen with the gripper at `there`, once it has carried it to `here`."""
    turn = here.rotation[0] @ there.rotation[0].T
    position = here.position[0] + turn @ (np.array(placed[0]) - there.position[0])
    return position.tolist(), _turned(turn, placed[1])


def _turned(turn: Array, quaternion: Sequence[float]) -> list[float]:
    """Return a quaternion (x, y, z, w) turned by a rotation (3, 3) of less than half a turn."""
    w = np.sqrt(max(0.0, 1 + np.trace(turn))) / 2
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / (4 * max(w, 1e-9))
    before, scalar = np.array(quaternion[:3]), quaternion[3]
    vector = w * before + scalar * axis + np.cross(axis, before)
    return [*vector.tolist(), float(w * scalar - axis @ before)]


def check_perceived(config: EnvConfig, task: Task) -> None:
    """Raise ConfigError for a task that needs things that nothing perceives."""
    if task.devices or config.workspace.fittings or task.fixtures:
        raise ConfigError(
            f"task.name={config.task.name} has devices, furniture that moves, or a hand, which nothing perceives on an "
            "arm yet; take a task with loose objects, such as nl_reach or nl_pick_and_place"
        )


class MirrorEnv(InteractiveEnv):
    """One world that is an arm with what is perceived around it. period: of a control step, seconds.

    Args:
        config: of the environment that the policy was trained in.
        arm: connected.
        perception: of the objects.
        seed: of what the episodes draw here: the slots of objects.
    """

    _world_type = MirrorWorld

    def __init__(self, config: EnvConfig, arm: SafeArm, perception: Perception, seed: int = 0) -> None:
        self.arm, self._perception = arm, perception
        super().__init__(config, seed)
        self.period = config.physics.time_step * config.physics.substeps
        world = self._worlds[0]
        assert isinstance(world, MirrorWorld)
        self.world = world
        world.bind(self, arm, perception)

    def _make_reader(self, config: EnvConfig) -> Reader:
        return self._perception.reader(config)

    def _begin_episodes(self, worlds: NDArray[np.int64]) -> TensorDictBase:
        """Begin with the scene that is perceived, instead of a drawn one."""
        if not len(worlds):
            return self._first_observation()
        seed = int(self._generators[0].integers(2**31))
        return self.start([self._pointed(self._perception.begin(seed), seed)], seed)

    def _pointed(self, episode: EpisodeSpec, seed: int) -> EpisodeSpec:
        """Return the episode with somebody who points from its beginning, as in training. Raises ConfigError."""
        if self._person is None or episode.gesture is not None:
            return episode
        place = episode.scene.positions[episode.referent]
        try:
            return replace(episode, gesture=self._person.show(place, np.random.default_rng(seed)))
        except Unreachable as error:
            raise ConfigError(f"the first object of the scene: {error}") from None

    def put_object(self, index: int, position: Sequence[float]) -> None:
        """Move a mark, which is not there really, or a thing of the twin. Raises ConfigError for a real thing."""
        if self.scene().targets[index]:
            self.world.mark(index, position)
        elif not self._perception.put(index, position):
            raise ConfigError("this arm's objects are real: move them by hand")
        self.world.show()
        self._arrays.read(self._arrays.index)

    def close(self, *, raise_if_closed: bool = True) -> None:
        """Let go of the arm too: it holds, and is disconnected."""
        super().close(raise_if_closed=raise_if_closed)
        self.arm.close()

    @property
    def arrays(self) -> WorldState:
        """The state of the world, which the arm's measurements are written to."""
        return self._arrays

    @property
    def grip_controller(self) -> GripController:
        """What the gripper is commanded to do."""
        return self._grip_controller
