"""The twin: the simulated world in another process, behind the interface of an arm, with the faults that arms have.

Commands and measurements travel as messages that are late, lost or out of order. Encoders have steps, joints have play,
motors are stronger or weaker than those that a policy was trained with, and objects heavier or smoother. The twin alone
knows where things really are, and judges whether an episode succeeded.
"""

from __future__ import annotations

import heapq
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from typing import Any, ClassVar, NamedTuple

import numpy as np

from core.schema import Checked, within
from deployment.arm import Arm, ArmError, ArmState, Array, Clock
from envs.config import EnvConfig
from envs.perception import Detections, Detector, UnusablePicture
from envs.perception.camera_reader import Gripper, NamedCameras, Picture
from envs.perception.config import STATE
from envs.tasks import EpisodeSpec
from envs.tasks.shared.types import Randomized
from envs.workspace_env import WorkspaceEnv
from trainers.collect.worker import ChildProcess, detach

TURN = 2 * np.pi  # radians
PATIENCE = 120.0  # seconds that the process may take to answer
STALE = 1.0  # seconds after which a picture tells nothing of the present


@dataclass(frozen=True, kw_only=True)
class TwinConfig(Checked):
    """Settings of the twin; all faults are off by default, but for the encoders' steps.

    latency: seconds that each message takes, each way. jitter: up to so many seconds more, drawn for each message.
    dropped: share of the messages that are lost, each way. encoder: steps of a turn. backlash: radians of play in each
    joint. gains, masses, friction: each episode draws factors from 1 - x to 1 + x, of each motor's gain, and of the
    objects' mass and friction. rate: measurements in a second. real_time: whether its time is that of this machine;
    otherwise it passes as fast as it is computed. seed: of its draws.
    """

    latency: float = within(0, 1, default=0.0)
    jitter: float = within(0, 1, default=0.0)
    dropped: float = within(0, 0.9, default=0.0)
    encoder: int = within(16, 2**24, default=4096)
    backlash: float = within(0, 0.2, default=0.0)
    gains: float = within(0, 0.9, default=0.0)
    masses: float = within(0, 0.9, default=0.0)
    friction: float = within(0, 0.9, default=0.0)
    rate: float = within(5, 240, default=60.0)
    real_time: bool = False
    seed: int = within(0, 2**31 - 1, default=0)


class TwinCommand(NamedTuple):
    """A message to the arm. time: when it was sent, seconds. angles: (J,) radians; None: hold."""

    time: float
    angles: Array | None
    opening: float


class TwinReport(NamedTuple):
    """A message from the arm. state: measured. poses: position and quaternion of each object at the same time.
    pictures: of the cameras at that time, by name; None: none were taken then."""

    state: ArmState
    poses: list[tuple[tuple[float, ...], tuple[float, ...]]]
    pictures: dict[str, Picture] | None = None


class EpisodeVerdict(NamedTuple):
    """How an episode ended, judged by where things really are. steps: control steps."""

    success: bool
    wrong_object: bool
    steps: int


class Channel:
    """Messages in one direction: each arrives late, or never. `rng` draws jitter and losses."""

    def __init__(self, config: TwinConfig, rng: np.random.Generator) -> None:
        self._config, self._rng, self._count = config, rng, 0
        self._waiting: list[tuple[float, int, Any]] = []  # a heap by arrival, then by number

    def send(self, time: float, message: Any) -> None:
        """Send a message at this time, seconds."""
        self._count += 1
        late = self._config.latency + self._config.jitter * self._rng.random()
        if self._rng.random() >= self._config.dropped:
            heapq.heappush(self._waiting, (time + late, self._count, message))

    def receive(self, time: float) -> list[Any]:
        """Return the messages that have arrived by this time, in the order of their arrival."""
        arrived = []
        while self._waiting and self._waiting[0][0] <= time:
            arrived.append(heapq.heappop(self._waiting)[2])
        return arrived

    def clear(self) -> None:
        """Lose everything that is on its way."""
        self._waiting.clear()


# ---- in the twin's process


class TwinEnv(WorkspaceEnv):
    """One world that obeys messages. time: of its physics, seconds."""

    def __init__(self, setup: EnvConfig, config: TwinConfig) -> None:
        sees = setup.perception.sees
        super().__init__(replace(setup, perception=STATE), 1, config.seed, render=sees)
        self._cameras = NamedCameras(setup.workspace, setup.perception) if sees else None
        self._pictured = 0  # physics steps at the last pictures
        self._twin, self._rng = config, np.random.default_rng(config.seed)
        self._commands, self._reports = Channel(config, self._rng), Channel(config, self._rng)
        self._only, physics = self._worlds[0], setup.physics
        self._tick, self._substeps = physics.time_step, physics.substeps
        self._every = max(1, round(1 / (config.rate * physics.time_step)))  # physics steps from one report to the next
        self.time, self._count = 0.0, 0
        self.verdict: EpisodeVerdict | None = None

    def begin(self, seed: int, episode: EpisodeSpec | None = None) -> EpisodeSpec:
        """Begin an episode, by default one that is drawn. Its draws follow from the seed alone."""
        rng = np.random.default_rng([self._twin.seed, seed])
        episode = self.task.draw(rng) if episode is None else episode
        drawn = [1 + rng.uniform(-share, share) for share in (self._twin.masses, self._twin.friction)]
        really = replace(episode, randomized=Randomized(mass=drawn[0], friction=drawn[1], delay=0, noise=0))
        self._rng.bit_generator.state = rng.bit_generator.state
        robot = self._only.robot
        factors = 1 + rng.uniform(-self._twin.gains, self._twin.gains, len(robot.arm) + len(robot.fingers))
        robot.scale_gains(factors.tolist())
        self.start([really], seed)
        self._commands.clear()
        self._reports.clear()
        self._count, self.verdict, self._latest, self._holds = 0, None, -np.inf, False
        self._target = self._arrays.angles[0].copy()
        self._joints = self._target.copy()  # the targets after the play
        self._drive()
        self._report()
        return episode

    def put(self, number: int, position: Sequence[float]) -> None:
        """Put a loose object at position (3,), metres, as a person would."""
        self._only.pool.move(number, position)

    def run(self, until: float, commands: Sequence[TwinCommand]) -> tuple[list[TwinReport], EpisodeVerdict | None]:
        """Let time pass until `until`, seconds.

        commands: that were sent since the last call. Returns the reports that have arrived at the other end by then,
        and how the episode ended, if it has.
        """
        for command in commands:
            self._commands.send(command.time, command)
        while self.time + self._tick / 2 < until:
            for command in self._commands.receive(self.time + self._tick / 2):
                self._carry_out(command)
            self._only.step_physics()
            self._count += 1
            self.time += self._tick
            if self._count % self._every == 0:
                self._look()
                self._report()
            if self._count % self._substeps == 0:
                self._judge()
        return self._reports.receive(until + self._tick / 2), self.verdict

    def _carry_out(self, command: TwinCommand) -> None:
        if command.time < self._latest:
            return  # a later one was faster
        self._latest = command.time
        if command.angles is not None:
            self._target, self._holds = command.angles, False
            self._grip_controller.follow(np.array([command.opening]))
        elif not self._holds:
            angles = [state[0] for state in self._only.robot.states()]
            self._target = self._joints = np.array(angles[: len(self._target)])
            self._holds = True
        half = self._twin.backlash / 2
        self._joints = np.clip(self._joints, self._target - half, self._target + half)
        self._drive()

    def _drive(self) -> None:
        self._only.robot.drive([*self._joints.tolist(), *self._grip_controller.targets[0].tolist()])

    def _look(self) -> None:
        """Read where things really are, and let a closed gripper take hold."""
        self._arrays.read(self._arrays.index)
        if self._grip_controller.can_grip:
            self._grip_controller.update_grasps()

    def _report(self) -> None:
        """Send what the encoders show, and where objects are."""
        step, robot = TURN / self._twin.encoder, self.config.robot
        joints = self._arrays.joints[0, :, 0]
        angles = np.rint(joints[: len(robot.joints)] / step) * step
        opening = float(self._grip_controller.opening[0])
        if robot.fingers:
            opening = float(robot.finger_opening_at(joints[len(robot.joints) :]).mean() / robot.finger_opening)
        state = ArmState(self.time, angles, opening, self._only.held is not None)
        self._reports.send(self.time, TwinReport(state, self._only.object_poses(), self._pictures()))

    def _pictures(self) -> dict[str, Picture] | None:
        """Take a picture with each camera, once in a control period; None between."""
        if self._cameras is None or 0 < self._count < self._pictured + self._substeps:
            return None
        self._pictured = self._count
        pose = self._arrays.pose
        return self._cameras.pictures(self._only, (pose.position[0], pose.rotation[0]))

    def _judge(self) -> None:
        """Once in a control period: whether the episode has ended, as in training. Its time begins with a command."""
        self._look()
        if self._latest == -np.inf:
            return
        self._arrays.steps += 1
        if self.verdict is None:
            ended = self._outcome()
            if bool(ended["done"][0]):
                success, wrong = (bool(ended[name][0]) for name in ("success", "wrong_object"))
                self.verdict = EpisodeVerdict(success, wrong, int(self._arrays.steps[0]))


def _serve(connection: Connection, setup: EnvConfig, config: TwinConfig) -> None:
    """Answer the other end until it closes the pipe."""
    detach()
    with closing(TwinEnv(setup, config)) as twin:
        connection.send(None)
        while True:
            try:
                name, arguments = connection.recv()
            except EOFError:
                return
            connection.send(getattr(twin, name)(*arguments))


# ---- at the other end of the pipe


class TwinClock(Clock):
    """The twin's time, seconds: that of its physics, or in real time that of this machine.

    pass_time: lets the twin's time pass until a time.
    """

    def __init__(self, pass_time: Callable[[float], None], real_time: bool) -> None:
        self._pass, self._real, self._now, self._start = pass_time, real_time, 0.0, time.monotonic()

    def now(self) -> float:
        return time.monotonic() - self._start if self._real else self._now

    def sleep(self, seconds: float) -> None:
        if self._real:
            super().sleep(seconds)
        else:
            self._now += max(0.0, seconds)
        self._pass(self.now())


class TwinArm(Arm):
    """The arm of a twin.

    report: the newest that has arrived, with the places of objects. pictured: the newest with pictures. verdict: how
    the episode ended, None before.
    """

    settings: ClassVar[type[Checked]] = TwinConfig
    on_hardware: ClassVar[str] = "a simulation"

    def __init__(self, config: TwinConfig, setup: EnvConfig) -> None:
        super().__init__(config, setup)
        self.clock = TwinClock(self._pass_time, config.real_time)
        self._process: ChildProcess | None = None
        self._commands: list[TwinCommand] = []
        self._news: TwinReport | None = None
        self._failure: ArmError | None = None
        self.report: TwinReport | None = None
        self.pictured: TwinReport | None = None
        self.verdict: EpisodeVerdict | None = None

    def connect(self) -> None:
        try:
            self._process = ChildProcess(_serve, self.setup, self.config)
        except (EOFError, OSError):  # such as for Ctrl-C, which ends the server of processes while it starts
            raise ArmError("the twin's process was not started: it was interrupted") from None
        self._answer()
        self.begin(0)

    def begin(self, seed: int, episode: EpisodeSpec | None = None) -> EpisodeSpec:
        """Begin an episode in the twin, and return it. Whatever is on its way is lost."""
        self._commands.clear()
        self._news = self.report = self.pictured = self.verdict = None
        return self._ask("begin", seed, episode)

    def put(self, number: int, position: Sequence[float]) -> None:
        """Put a loose object elsewhere in the twin: position (3,), metres."""
        self._ask("put", number, list(position))

    def observe(self) -> ArmState | None:
        if self.config.real_time:
            self._pass_time(self.clock.now())
        if self._failure is not None:
            raise self._failure
        news, self._news = self._news, None
        return None if news is None else news.state

    def command(self, angles: Array, opening: float) -> None:
        self._commands.append(TwinCommand(self.clock.now(), np.array(angles), opening))

    def hold(self) -> None:
        self._commands.append(TwinCommand(self.clock.now(), None, 1.0))

    def disconnect(self) -> None:
        if self._process is not None:
            self._process.kill()
        self._process = None

    def _pass_time(self, until: float) -> None:
        try:
            reports, self.verdict = self._ask("run", until, self._commands)
        except ArmError as error:
            self._failure = error  # for `observe`: time itself does not fail
            return
        self._commands.clear()
        for report in reports:
            if self.report is None or report.state.time > self.report.state.time:
                self.report = self._news = report
            if report.pictures and (self.pictured is None or report.state.time > self.pictured.state.time):
                self.pictured = report

    def _ask(self, name: str, *arguments: Any) -> Any:
        if self._process is None:
            raise ArmError("the twin is not connected")
        self._process.send((name, arguments))
        return self._answer()

    def _answer(self) -> Any:
        assert self._process is not None
        try:
            if self._process.connection.poll(PATIENCE):
                return self._process.connection.recv()
            raise ArmError(f"the twin did not answer for {PATIENCE:g} s")
        except (EOFError, OSError):
            raise ArmError(f"the twin's process {self._process.ending()}") from None


class TwinCameras:
    """Tells what is seen in the pictures that the twin sends: a `Reader` for one world.

    Args:
        arm: the twin.
        setup: with the cameras.
        detector: finds things in pictures.
    """

    def __init__(self, arm: TwinArm, setup: EnvConfig, detector: Detector) -> None:
        self._arm, self._detector = arm, detector
        self._cameras = NamedCameras(setup.workspace, setup.perception)

    def angles(self, world: int) -> Array | None:
        """(J,) radians of the arm when the newest pictures were taken; None: there are none."""
        return None if self._arm.pictured is None else self._arm.pictured.state.angles

    def read(self, world: int, gripper: Gripper) -> Detections:
        """Return what is seen in the newest pictures. Raises UnusablePicture where they are old, or show nothing."""
        report = self._arm.pictured
        if report is None or report.pictures is None:
            raise UnusablePicture("no picture has come from the cameras yet")
        age = self._arm.clock.now() - report.state.time
        if age > STALE:
            raise UnusablePicture(f"no picture has come from the cameras for {age:.1f} s")
        return self._detector(self._cameras.views(report.pictures, gripper))

    def places(self, gripper: Gripper) -> Array:
        """(C, 3) where the cameras are, metres."""
        return self._cameras.places(gripper)
