"""One world: a PyBullet client with a robot, the furniture and a pool of objects, all made once and only moved."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import pybullet as bullet
import pybullet_data
from numpy.typing import NDArray

from conf.schema import Checked, within
from envs.sim.device_bodies import DeviceBodies
from envs.sim.furniture import Furniture
from envs.sim.gripper import GRIPPERS, Gripper, GripperConfig
from envs.sim.object_shapes import Hold, solid
from envs.sim.robot import Robot, RobotConfig
from envs.sim.window import Window
from envs.sim.workspace import WorkspaceConfig
from envs.tasks.types import NOTHING
from human import Body, Camera, PointingArm, read_arm
from language import SEE_THROUGH

PARKED = (0.0, 0.0, -5.0)  # where objects wait that this episode does not show, asleep
SLEEP_STEPS = 3  # physics steps until a body told to sleep is asleep
OBJECT_MASS = 0.1  # kg
CONE = (1.0, 1.0, 1.0, SEE_THROUGH)


@dataclass(frozen=True, kw_only=True)
class PhysicsConfig(Checked):
    """time_step in seconds; a control step is `substeps` of them."""

    time_step: float = within(1e-4, 0.05)
    substeps: int = within(1, 1000)
    solver_iterations: int = within(1, 500)
    sleeping: bool


class World:
    """joint angles in radians, fingers and positions in metres, workspace frame.

    nouns: the shapes of the object pool ("cube", "sphere", "cylinder").
    slots: how many bodies of each noun are made of each `Hold`, in its order.
    visuals: load what is drawn, for `render`; a world without them takes half the memory.
    window: where it is shown; the world closes it.
    gripper: what the robot grips with; none: with nothing.
    client: Bullet's number. stock: the bodies of all objects that an episode could show.
    devices: the noun of each that an episode shows at most; where there are any, they are all that it shows, and what
    would grip only touches them.
    """

    def __init__(
        self,
        robot: RobotConfig,
        workspace: WorkspaceConfig,
        physics: PhysicsConfig,
        nouns: Sequence[str],
        slots: Sequence[int],
        object_size: float,
        visuals: bool = False,
        window: Window | None = None,
        gripper: GripperConfig | None = None,
        devices: Sequence[str] = (),
    ) -> None:
        self.client = bullet.connect(bullet.DIRECT) if window is None else window.client
        self._physics, self._workspace, self._visuals = physics, workspace, visuals or window is not None
        self._window = window
        try:
            self._build(robot, gripper, nouns, slots, object_size, devices)
            self._show(True)
        except BaseException:
            self.close()
            raise

    def _build(
        self,
        robot: RobotConfig,
        gripper: GripperConfig | None,
        nouns: Sequence[str],
        slots: Sequence[int],
        object_size: float,
        devices: Sequence[str],
    ) -> None:
        self._set_up_physics()
        name = gripper and gripper.of(robot)
        self.robot = Robot(robot, self.client, self._visuals, name == "magnet")
        self._gripper: Gripper | None = None
        self._fingers: Sequence[float] = ()  # where they were told to go, metres
        self._letting_go = 0  # physics steps into the next control step, after which it does
        if gripper and name and not devices:
            self._gripper = GRIPPERS[name](gripper, self.robot, self.client)
        self._furniture = Furniture(self._workspace, self.robot, self.client, self._visuals)
        self._mechanisms = DeviceBodies(devices, object_size, self.client, self._visuals)
        for body in self._mechanisms.bodies:
            self._furniture.join(body)
        self._step = partial(bullet.stepSimulation, self.client)
        # A body keeps its hold for good: one that switches is put behind the others in Bullet's lists, and the same
        # seed would give other bits than on a fresh world.
        self._pool = [
            [[self._object(noun, object_size, hold) for _ in range(count)] for noun in nouns]
            for hold, count in zip(Hold, slots, strict=True)
        ]
        # After all that moves, or those would come in another order where somebody looks, and give other bits.
        human = self._workspace.human
        self.person: PointingArm | None = None  # nothing touches a person: one whom nobody sees needs no body
        if human is not None:
            self.person = Body(human, self.client, visuals=True) if self._visuals else read_arm(human)
        self.stock = self._shown = [body for pool in self._pool for bodies in pool for body in bodies]
        self._ghosts: dict[tuple[int, int], Sequence[float]] = {}  # bodies and links that are see-through, with RGBA
        self._resting = object_size / 2 + 1e-3
        self._pose = partial(bullet.getBasePositionAndOrientation, physicsClientId=self.client)

    def _set_up_physics(self) -> None:
        bullet.setAdditionalSearchPath(pybullet_data.getDataPath(), self.client)
        bullet.setGravity(0, 0, -9.81, self.client)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=self._physics.time_step,
            numSolverIterations=self._physics.solver_iterations,
            deterministicOverlappingPairs=1,  # same seed, same bits
            physicsClientId=self.client,
        )

    def _object(self, noun: str, size: float, hold: Hold) -> int:
        kind, sides = solid(noun, size)
        shape = visual = -1
        if hold != Hold.GHOST:
            shape = bullet.createCollisionShape(kind, **sides, physicsClientId=self.client)
        if self._visuals:
            if "height" in sides:
                sides = {"radius": sides["radius"], "length": sides["height"]}
            visual = bullet.createVisualShape(kind, **sides, physicsClientId=self.client)
        mass = OBJECT_MASS if hold == Hold.FREE else 0
        body = bullet.createMultiBody(mass, shape, visual, PARKED, physicsClientId=self.client)
        bullet.changeDynamics(
            body,
            -1,
            lateralFriction=0.8,
            rollingFriction=0.002,
            spinningFriction=0.002,
            linearDamping=0.1,
            angularDamping=0.3,
            physicsClientId=self.client,
        )
        return body

    def _rest(self, body: int) -> None:
        state = bullet.ACTIVATION_STATE_ENABLE_SLEEPING | bullet.ACTIVATION_STATE_SLEEP
        if not self._physics.sleeping:
            state = bullet.ACTIVATION_STATE_DISABLE_SLEEPING
        bullet.changeDynamics(body, -1, activationState=state, physicsClientId=self.client)

    def _wake(self, body: int) -> None:
        bullet.changeDynamics(body, -1, activationState=bullet.ACTIVATION_STATE_WAKE_UP, physicsClientId=self.client)

    def _move(self, body: int, position: Sequence[float], yaw: float = 0.0) -> None:
        upright = (0, 0, math.sin(yaw / 2), math.cos(yaw / 2))
        bullet.resetBasePositionAndOrientation(body, position, upright, self.client)
        bullet.resetBaseVelocity(body, (0, 0, 0), (0, 0, 0), physicsClientId=self.client)
        self._rest(body)

    def _put_to_sleep(self) -> None:
        """Park what is shown and step until Bullet has it asleep.

        A body that the last episode touched would otherwise be simulated for some steps more, and the same
        seed would give other bits than on a fresh world.
        """
        for body in self._shown:
            self._move(body, (PARKED[0] + body, PARKED[1], PARKED[2]))
        if self.person is not None:
            self.person.relax()
        self._furniture.park()
        for _ in range(max(SLEEP_STEPS, self._furniture.parting)):
            self.pass_time()
        self._furniture.reset()
        self._mechanisms.reset()

    def reset(
        self,
        joints: Sequence[float],
        opening: float,
        nouns: Sequence[int],
        holds: Sequence[int],
        positions: Sequence[Sequence[float]],
        yaw: Sequence[float],
        colors: NDArray[np.float64],
    ) -> None:
        """Put the arm at `joints` and show one object a slot: nouns and holds index the pool, colors (slots, 4) RGBA.

        A free object rests until something touches it, but one above the table falls. Devices are those that were made,
        whatever nouns and holds say, and positions are those of their handles.
        """
        self._show(False)
        if self._gripper is not None:
            self._gripper.open()
            self._letting_go = 0
        self._put_to_sleep()
        self.robot.place(joints, opening)
        self._fingers = [opening] * len(self.robot.fingers)
        if self._visuals:
            self._ghosts = {}
            self.show_finger(False)
        if self._mechanisms.bodies:
            self._mechanisms.show(positions, yaw, colors.tolist())
        else:
            self._stand(nouns, holds, positions, yaw)
            if self._visuals:
                self._color(holds, colors.tolist())
        self._show(True)

    def _stand(
        self,
        nouns: Sequence[int],
        holds: Sequence[int],
        positions: Sequence[Sequence[float]],
        yaw: Sequence[float],
    ) -> None:
        """Take objects from the pool and stand them there."""
        unused = [[list(reversed(bodies)) for bodies in pool] for pool in self._pool]
        self._shown = [unused[hold][noun].pop() for hold, noun in zip(holds, nouns, strict=True)]
        for body, hold, position, angle in zip(self._shown, holds, positions, yaw, strict=True):
            self._move(body, position, angle)
            if hold == Hold.FREE and position[2] > self._resting:
                self._wake(body)

    def _color(self, holds: Sequence[int], colors: Sequence[Sequence[float]]) -> None:
        for body, hold, color in zip(self._shown, holds, colors, strict=True):
            self._paint(body, color)
            if hold == Hold.GHOST:
                self._ghosts[body, -1] = color

    def _show(self, now: bool) -> None:
        if self._window is not None:
            self._window.show(now)

    def show_finger(self, shown: bool) -> None:
        """Draw the cone along the person's finger, or don't: it tells where they point."""
        if isinstance(self.person, Body) and self.person.cone is not None:
            cone = (self.person.body, self.person.cone)
            self._ghosts.pop(cone, None)
            self._paint(cone[0], CONE if shown else (0, 0, 0, 0), cone[1])
            if shown:
                self._ghosts[cone] = CONE

    def _paint(self, body: int, color: Sequence[float], link: int = -1) -> None:
        bullet.changeVisualShape(body, link, rgbaColor=color, physicsClientId=self.client)

    def seize(self, number: int, centre: Sequence[float]) -> None:
        """Let the gripper, its centre at this place (m), begin with this of the shown objects, which stands in it."""
        assert self._gripper is not None
        self._gripper.seize(self._shown[number], centre)

    def held(self, near: Sequence[int], centre: Sequence[float]) -> int:
        """Which of the shown objects the closed gripper holds, or NOTHING.

        near: those that it could hold. centre: the gripper's, metres.
        """
        assert self._gripper is not None
        body = self._gripper.feel([self._shown[number] for number in near], centre)
        return NOTHING if body == NOTHING else self._shown.index(body)

    def let_go(self, after: int = 0) -> None:
        """Let go of what is held, so many physics steps into the next control step."""
        assert self._gripper is not None
        if after:
            self._letting_go = after
        else:
            self._gripper.open()

    def advance(self, targets: Sequence[float]) -> None:
        """One control step towards these motor targets (arm joints, then fingers)."""
        first, self._letting_go = self._letting_go, 0
        if first:
            self._hold_on(targets, first)
        self.robot.drive(targets)
        for _ in range(self._physics.substeps - first):
            self.pass_time()
        self._fingers = targets[len(self.robot.arm) :]

    def _hold_on(self, targets: Sequence[float], steps: int) -> None:
        """Let the arm go ahead by so many physics steps before the gripper lets go."""
        self.robot.drive([*targets[: len(self.robot.arm)], *self._fingers])
        for _ in range(steps):
            self.pass_time()
        self.let_go()

    def pass_time(self) -> None:
        """One physics step."""
        self._step()
        if self.person is not None and self.person.moving:
            self.person.advance()

    def objects(self) -> list[tuple[tuple[float, ...], tuple[float, ...]]]:
        """(position, quaternion) of the object, or of the device's handle, in each slot."""
        return [self._pose(body) for body in self._shown] + self._mechanisms.poses()

    def bodies(self) -> list[int]:
        """The body of the object in each slot; none of devices."""
        return list(self._shown)

    def put(self, number: int, position: Sequence[float]) -> None:
        """Move one of the shown objects there in mid-episode, (3,) metres; it falls from where it is put."""
        body = self._shown[number]
        bullet.resetBasePositionAndOrientation(body, position, self._pose(body)[1], self.client)
        bullet.resetBaseVelocity(body, (0, 0, 0), (0, 0, 0), physicsClientId=self.client)
        self._wake(body)

    def fittings(self) -> list[float]:
        """The joint value of each of the workspace's fittings, metres or radians."""
        return self._furniture.values()

    def render(self, camera: Camera | None = None) -> NDArray[np.uint8]:
        """What the camera sees, (height, width, 3). The world must have been made with visuals."""
        camera = camera or self._workspace.camera
        picture = self._picture(camera)
        if not self._ghosts:
            return picture
        for (body, link), color in self._ghosts.items():  # the renderer shows every opacity but 0 in full
            self._paint(body, [*color[:3], 0], link)
        behind = self._picture(camera)
        for (body, link), color in self._ghosts.items():
            self._paint(body, color, link)
        opacity = max(color[3] for color in self._ghosts.values())
        return np.rint(opacity * picture + (1 - opacity) * behind).astype(np.uint8)

    def _picture(self, camera: Camera) -> NDArray[np.uint8]:
        view = bullet.computeViewMatrixFromYawPitchRoll(camera.target, camera.distance, camera.yaw, camera.pitch, 0, 2)
        lens = bullet.computeProjectionMatrixFOV(camera.fov, camera.width / camera.height, 0.05, 10)
        pixels = bullet.getCameraImage(
            camera.width,
            camera.height,
            view,
            lens,
            lightDirection=[0.5, -0.6, 1.5],
            renderer=bullet.ER_TINY_RENDERER,
            physicsClientId=self.client,
        )[2]
        return np.reshape(np.asarray(pixels, np.uint8), (camera.height, camera.width, 4))[..., :3].copy()

    def close(self) -> None:
        """Free the client. Twice is once."""
        if self.client >= 0 and self._window is not None:
            self._window.close()
        elif self.client >= 0:
            bullet.disconnect(self.client)
        self.client = -1
