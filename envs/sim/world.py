"""One PyBullet simulation: its bodies, the beginning of episodes, and physics steps with the same bits for a seed."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
import pybullet as bullet
import pybullet_data
from numpy.typing import NDArray

from core.cameras import CameraFrame, Light
from core.platform_tuning import without_zero_pages
from core.schema import Checked, within
from envs.sim.backdrop import Backdrop
from envs.sim.device_bodies import DeviceBodies, DeviceSpec
from envs.sim.furniture import Furniture, Palm
from envs.sim.gripper import BASE, GRIPPERS, Gripper, GripperConfig
from envs.sim.object_pool import ObjectPool, PoolSpec, ShownObjects
from envs.sim.rendering import DAYLIGHT, INVISIBLE, Array, Photo, Renderer, paint
from envs.sim.robot import Robot
from envs.sim.robot_config import RobotConfig
from envs.sim.window import Window
from envs.sim.workspace import WorkspaceConfig
from human import Body, Camera, PointingArm, read_arm
from language import SEE_THROUGH

# Bullet's own collision group and mask of what moves, and of what does not.
MOVING_FILTER, FIXED_FILTER = (1, -1), (2, -3)
CLEANED = 3  # steps within which Bullet takes a body at rest to be fixed; only then it looks for parted pairs
SLEEP_STEPS = 3  # physics steps until a body that is put to sleep is asleep
CONE = (1.0, 1.0, 1.0, SEE_THROUGH)  # RGBA of the cone along a pointing finger
CONTACT_BREAKING = 0.02  # metres, Bullet's own
NO_DEVICES = DeviceSpec()


@dataclass(frozen=True, kw_only=True)
class PhysicsConfig(Checked):
    """time_step in seconds; a control step is `substeps` of them."""

    time_step: float = within(1e-4, 0.05)
    substeps: int = within(1, 1000)
    solver_iterations: int = within(1, 500)
    sleeping: bool  # let objects at rest sleep
    # Share of a penetration that Bullet corrects in a physics step; None: Bullet's own, with which tall stacks fall.
    contact_erp: float | None = within(0.01, 1)
    # Metres at which a contact ends. Objects nearer to each other than twice as much wake together. None: Bullet's own.
    contact_breaking: float | None = within(1e-4, 0.1)


class SimulatedWorld:
    """Joint angles in radians, finger positions and places in metres, in the workspace frame.

    client: PyBullet's client. robot: the loaded arm. pool: the objects. person: the person in the workspace, or None.
    palm: the open hand that the person holds out, or None.

    Args:
        robot, workspace, physics: configuration of the world.
        objects: the bodies of the object pool.
        visuals: load visual shapes, for `render`. A world without them takes half the memory.
        window: where the world is shown. The world closes it.
        gripper: the gripper of the robot; None: it cannot grip.
        devices: those that an episode shows at most.
        holds: whether the gripper can hold objects; otherwise it is only a body.
        offers: whether the person holds out an open hand.

    Raises:
        ConfigError: for a robot or gripper that cannot be built.
    """

    _contact_breaking_in_force = CONTACT_BREAKING  # Bullet has one value for all clients of a process

    def __init__(
        self,
        *,
        robot: RobotConfig,
        workspace: WorkspaceConfig,
        physics: PhysicsConfig,
        objects: PoolSpec,
        visuals: bool = False,
        window: Window | None = None,
        gripper: GripperConfig | None = None,
        devices: DeviceSpec = NO_DEVICES,
        holds: bool = True,
        offers: bool = False,
    ) -> None:
        self.client = window.client if window is not None else without_zero_pages(lambda: bullet.connect(bullet.DIRECT))
        self._physics, self._workspace, self._visuals = physics, workspace, visuals or window is not None
        self._window, self._renderer = window, Renderer(self.client)
        try:
            self._build(robot=robot, gripper=gripper, objects=objects, devices=devices, holds=holds, offers=offers)
            self._draw(True)
        except BaseException:
            self.close()
            raise

    def _build(
        self,
        *,
        robot: RobotConfig,
        gripper: GripperConfig | None,
        objects: PoolSpec,
        devices: DeviceSpec,
        holds: bool,
        offers: bool,
    ) -> None:
        """Build the bodies. Their order must not change: Bullet solves contacts in this order."""
        self._set_up_physics()
        name = gripper and gripper.of(robot)
        self.robot = Robot(robot, self.client, self._visuals, name == "magnet")
        each = self.robot.damped or self._window is not None
        self._stepper = Stepper(self.client, self._physics.time_step, each)
        self._gripper: Gripper | None = None
        self._finger_targets: Sequence[float] = ()  # of the last control step, metres
        self._release_after = 0  # physics steps into the next control step; 0: no release is due
        if gripper and name and holds:
            self._gripper = GRIPPERS[name](gripper, self.robot, self.client)
        self.furniture = Furniture(self._workspace, self.robot, self.client, self._visuals)
        self.devices = DeviceBodies(devices, self.client, self._visuals)
        self.palm = Palm(self.client, self._visuals) if offers else None
        for body in self.devices.bodies + ([self.palm.body] if self.palm else []):
            self.furniture.join(body)
        self.pool = ObjectPool(objects, self.client, self._visuals, self._physics.sleeping)
        self._pairs = CollisionPairs(self.client, self.pool.movable)  # nothing touches the person, who comes after
        self.person = self._make_person()
        self._backdrop = Backdrop(self.client, self.furniture.boxes)
        drawn = self._renderer if self._visuals else None
        self._shown = ShownObjects(
            pool=self.pool,
            devices=self.devices,
            furniture=self.furniture,
            renderer=drawn,
            client=self.client,
            palm=self.palm,
        )

    def _set_up_physics(self) -> None:
        bullet.setAdditionalSearchPath(pybullet_data.getDataPath(), self.client)
        bullet.setGravity(0, 0, -9.81, self.client)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=self._physics.time_step,
            numSolverIterations=self._physics.solver_iterations,
            deterministicOverlappingPairs=1,  # same seed, same bits
            physicsClientId=self.client,
        )
        if self._physics.contact_erp is not None:
            bullet.setPhysicsEngineParameter(contactERP=self._physics.contact_erp, physicsClientId=self.client)
        self._contact_breaking = self._physics.contact_breaking or CONTACT_BREAKING

    def _make_person(self) -> PointingArm | None:
        """Nothing touches the person, so a world without visuals needs no body for them.

        The body is made after all moving ones: otherwise the order of moving bodies, and so the bits, would depend on
        whether the world is drawn.
        """
        human = self._workspace.human
        if human is None:
            return None
        return Body(human, self.client, visuals=True) if self._visuals else read_arm(human)

    def reset(
        self,
        *,
        joints: Sequence[float],
        opening: float,
        nouns: Sequence[int],
        mobilities: Sequence[int],
        positions: Sequence[Sequence[float]],
        yaw: Sequence[float],
        colors: NDArray[np.float64],
        resting: Sequence[bool] | None = None,
        shares: Sequence[float] | None = None,
    ) -> None:
        """Begin an episode: place the arm, and show K objects.

        Args:
            joints: (J,) angles of the arm.
            opening: of each finger, metres.
            nouns, mobilities: (K,) indices into the pool; other nouns are those of devices and fittings.
            positions: (K, 3) of objects, or of the devices' handles; fittings stay where they are. An object above the
                table falls.
            yaw: (K,) radians.
            colors: (K, 4) RGBA.
            resting: (K,) which objects rest on others and do not fall; None: none.
            shares: (K,) in [0, 1], of the ranges of fittings and devices; None: they are shut, and at their start.
        """
        self._draw(False)
        self.release()
        self._settle()
        self.robot.place(joints, opening)
        self._finger_targets = [opening] * len(self.robot.fingers)
        if self._visuals:
            self._renderer.clear()
            self.show_finger(False)
        self._shown.show(
            nouns=nouns,
            mobilities=mobilities,
            positions=positions,
            yaw=yaw,
            colors=colors.tolist(),
            resting=resting,
            shares=shares,
        )
        self._pairs.forget()
        if self.palm and isinstance(self.person, Body):
            self.person.offer(self.palm.place)
        self._draw(True)

    def _settle(self) -> None:
        """Park the shown objects, and step until they sleep in Bullet.

        A body that the last episode touched would otherwise be simulated for some steps more, and the same
        seed would give other bits than on a fresh world.
        """
        self.pool.park()
        if self.person is not None:
            self.person.relax()
        self.furniture.park()
        self.step_physics(max(SLEEP_STEPS, self.furniture.parting))
        self.furniture.reset()
        self.devices.reset()
        if self.palm:
            self.palm.reset()

    def _draw(self, enabled: bool) -> None:
        """Switch drawing in the window on or off, if there is one."""
        if self._window is not None:
            self._window.show(enabled)

    def show_finger(self, shown: bool) -> None:
        """Show or hide the cone along the person's finger, which shows where they point."""
        if isinstance(self.person, Body) and self.person.cone is not None:
            body, link = self.person.body, self.person.cone
            self._renderer.set_see_through(body, link, CONE if shown else None)
            paint(body, CONE if shown else INVISIBLE, self.client, link)

    # ---- gripping: objects are given by their number among those that are shown

    def attach(self, number: int, centre: Sequence[float]) -> None:
        """Let the gripper hold this object from the start of an episode. centre: the gripper's, metres."""
        assert self._gripper is not None
        self._gripper.attach(self._shown.holdable[number], centre)

    def update_grasp(self, near: Sequence[int], centre: Sequence[float]) -> None:
        """Once per control step: let the closed gripper hold what it touches, or release what has slipped.

        near: numbers of the objects that are near enough to be held. centre: the gripper's, metres.
        """
        assert self._gripper is not None
        before = self._gripper.held
        self._gripper.update([self._shown.holdable[number] for number in near], centre)
        held = self._gripper.held
        if held is not None and held is not before and held.link != BASE:
            self.pool.wake()  # objects in the drawer move with it

    @property
    def held(self) -> int | None:
        """The number of the object that the gripper holds, or None."""
        if self._gripper is None or self._gripper.held is None:
            return None
        return self._shown.holdable.index(self._gripper.held)

    def release(self, after: int = 0) -> None:
        """Release the held object: now, or `after` physics steps into the next control step."""
        self._release_after = after
        if self._gripper is not None and not after:
            self._gripper.release()

    # ---- time

    def advance(self, targets: Sequence[float]) -> None:
        """One control step towards these motor targets (arm joints, then fingers)."""
        before_release, self._release_after = self._release_after, 0
        if before_release:
            self._advance_holding(targets, before_release)
        self.robot.drive(targets)
        self.step_physics(self._physics.substeps - before_release)
        self._finger_targets = targets[len(self.robot.arm) :]

    def _advance_holding(self, targets: Sequence[float], steps: int) -> None:
        """Move the arm for this number of physics steps, then release."""
        self.robot.drive([*targets[: len(self.robot.arm)], *self._finger_targets])
        self.step_physics(steps)
        self.release()

    def step_physics(self, steps: int = 1) -> None:
        """Take this number of physics steps, and update the person's posture after each."""
        if SimulatedWorld._contact_breaking_in_force != self._contact_breaking:
            value = SimulatedWorld._contact_breaking_in_force = self._contact_breaking
            bullet.setPhysicsEngineParameter(contactBreakingThreshold=value, physicsClientId=self.client)
        while steps and self.person is not None and self.person.moving:
            self._stepper.step()
            self.person.advance()
            steps -= 1
        if steps:
            self._stepper.run(steps)

    # ---- state

    def object_poses(self) -> list[tuple[tuple[float, ...], tuple[float, ...]]]:
        """(position, quaternion) of each object that is shown; of a device or a fitting, that of its handle."""
        return self._shown.poses()

    def fitting_positions(self) -> list[float]:
        """Return the joint value of each of the workspace's fittings, metres or radians."""
        return self.furniture.values()

    def render(self, camera: Camera | None = None) -> NDArray[np.uint8]:
        """(height, width, 3) the image of a camera that is fixed in the workspace. Needs visuals.

        camera: None: that of films. The image of any other shows the furniture as the config says, drawn once.
        """
        if camera is None or self._window is not None:
            return self._renderer.render(camera or self._workspace.film)
        solid = partial(self._backdrop.photograph, camera)
        return self._renderer.photograph(camera, CameraFrame.of(camera), solid=solid).colors

    def photograph(self, camera: Camera, gripper: tuple[Array, Array], light: Light = DAYLIGHT) -> Photo:
        """Return what a camera sees, without the cone along a pointing finger. Needs visuals.

        gripper: position (3,), metres, and rotation (3, 3) of the gripper's centre, where cameras may be mounted.
        """
        return self._renderer.photograph(camera, CameraFrame.of(camera, gripper), light, without=self._cones())

    def picture(self, camera: Camera, gripper: tuple[Array, Array]) -> NDArray[np.uint8]:
        """(height, width, 3) the colors of `photograph`, sooner: for a fixed camera furniture is drawn once.

        For worlds whose furniture looks as the config says.
        """
        if camera.mount != "workspace" or self._window is not None:  # in a window the furniture would flicker
            return self.photograph(camera, gripper).colors
        solid = partial(self._backdrop.photograph, camera)
        return self._renderer.photograph(camera, CameraFrame.of(camera), without=self._cones(), solid=solid).colors

    def _cones(self) -> list[tuple[int, int]]:
        """Return (body, link) of the cone along the person's finger."""
        body = self.person
        return [(body.body, body.cone)] if isinstance(body, Body) and body.cone is not None else []

    def fade(self, opacity: float) -> None:
        """Draw the see-through objects of this episode with this opacity, in (0, 1)."""
        self._renderer.fade(opacity)

    def close(self) -> None:
        """Free the client. Idempotent."""
        self._renderer.close()
        if self.client >= 0 and self._window is not None:
            self._window.close()
        elif self.client >= 0:
            bullet.disconnect(self.client)
        self.client = -1


# ---- physics steps, and what Bullet keeps from one to the next


class Stepper:
    """Takes the physics steps of a client.

    client: PyBullet's client. time_step: its time step between calls, seconds.
    each: take every step in a call of its own, where something happens between steps: Bullet computes the damping of
    joints once in a call, and a window draws once in a call.
    """

    def __init__(self, client: int, time_step: float, each: bool = False) -> None:
        self._time_step, self._each = time_step, each
        self.step = partial(bullet.stepSimulation, client)
        self._set = partial(bullet.setPhysicsEngineParameter, physicsClientId=client)

    def run(self, count: int) -> None:
        """Take `count` physics steps, with the same bits as one call for each."""
        if self._each or count < 3 or not _divides(self._time_step, count):
            for _ in range(count):
                self.step()
        else:
            self._set(fixedTimeStep=self._time_step * count, numSubSteps=count)
            self.step()
            # Forces of motors and constraints that are set from now on are for a single time step.
            self._set(fixedTimeStep=self._time_step, numSubSteps=0)


@cache
def _divides(time_step: float, count: int) -> bool:
    """Return whether Bullet, which divides the total time by `count`, takes steps of exactly this length, seconds."""
    total = time_step * count
    return total / count == time_step and int(total / time_step) == count


class CollisionPairs:
    """The pairs of the bodies that one PyBullet client has when this is made.

    client: PyBullet's client. movable: the bodies whose base moves; links always do.
    """

    def __init__(self, client: int, movable: Collection[int]) -> None:
        self._client = client
        self._filters: list[tuple[int, int, int, int]] = []  # body, link, group and mask, in the order of creation
        for body in range(bullet.getNumBodies(client)):
            for link in range(BASE, bullet.getNumJoints(body, client)):
                if bullet.getCollisionShapeData(body, link, client):
                    moves = link != BASE or body in movable
                    self._filters.append((body, link, *(MOVING_FILTER if moves else FIXED_FILTER)))

    def forget(self) -> None:
        """Drop all pairs, and the margins of the bounding boxes from which they follow; Bullet finds both again.

        Bullet keeps a bounding box that a body has left only slightly, and a pair for some steps after its bodies have
        parted. Both would carry one episode into the next, and the same seed would give other bits than in a fresh
        world. Setting a collision filter, even to its present value, makes the box anew and drops all its pairs.

        How many steps a parted pair is kept follows from Bullet's place in its list of pairs, which it remembers. A
        list of one pair leads it back to the first place: the robot's base and its first link, which always touch.
        """
        for body, link, *_ in self._filters:
            bullet.setCollisionFilterGroupMask(body, link, 0, 0, self._client)
        for each in self._filters[:2]:
            bullet.setCollisionFilterGroupMask(*each, self._client)
        for _ in range(CLEANED):
            bullet.performCollisionDetection(self._client)
        for each in self._filters:
            bullet.setCollisionFilterGroupMask(*each, self._client)
