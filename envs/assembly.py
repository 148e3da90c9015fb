"""Builds the parts of an environment from its config."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from conf.schema import ConfigError
from envs.config import EnvConfig
from envs.mdp.controls import CONTROLS, Control
from envs.mdp.grip_controller import GripController
from envs.mdp.initial_states import InitialStates
from envs.sim.device_bodies import DeviceSpec
from envs.sim.devices import DEVICES
from envs.sim.kinematics import Array, Kinematics
from envs.sim.object_pool import PoolSpec
from envs.sim.robot import read_chain
from envs.sim.window import Window
from envs.sim.world import World
from envs.tasks import TASKS, State, Task
from envs.tasks.reach import reaching_height
from human import Person
from language import HAND

PRESS_DEPTH = 0.005  # metres that a magnet without a gap may go below the top of an object on the table


def make_task(config: EnvConfig, num_worlds: int, person: Person | None) -> Task:
    """The task of N worlds. person: the person who points, or None."""
    task = TASKS[config.task.name](config.task, config.workspace.object_area, num_worlds, person)
    task.furnish(config.workspace.fittings)
    task.prepare(config.workspace)
    return task


def make_chain(config: EnvConfig, task: Task) -> Kinematics:
    """The kinematics of the arm. Its rest pose depends on whether the task moves objects.

    With a rod, the gripper rests over the middle of the object area, at the greatest allowed height.
    """
    chain = read_chain(config.robot if task.moves else config.robot.reaching())
    if not (config.gripper.rod and task.moves):
        return chain
    x0, x1, y0, y1 = config.workspace.object_area
    return chain.resting_at(np.array([(x0 + x1) / 2, (y0 + y1) / 2, config.workspace.gripper_box[-1]]))


def make_world(config: EnvConfig, task: Task, render: bool = False, window: Window | None = None) -> World:
    """One world with all bodies that the task needs."""
    objects = PoolSpec(task.shapes, task.bodies, config.task.object_size)
    gripper = config.gripper if task.moves else None
    holds = task.grips or not task.devices
    devices = DeviceSpec(task.devices, task.device_width)
    offers = HAND in task.fixtures
    parts = config.robot, config.workspace, config.physics, objects
    return World(*parts, render, window, gripper, devices, holds, offers)


def gripper_name(config: EnvConfig, task: Task) -> str | None:
    """The gripper on the robot: "magnet" or "fingers"; None if the task moves no objects."""
    return config.gripper.of(config.robot) if task.moves else None


def gripper_box(config: EnvConfig, task: Task) -> Array:
    """(2, 3) lowest and highest corner of where the gripper may be, metres.

    Raises:
        ConfigError: the workspace's box ends below the least height that the task allows.
    """
    box = np.reshape(config.workspace.gripper_box, (3, 2)).T.copy()
    if not task.moves:  # the gripper reaches objects from above, and pushes none
        box[0, 2] = max(box[0, 2], config.task.object_size / 2 + reaching_height(config.task, config.robot.clearance))
    elif gripper_name(config, task) == "magnet" and task.grips:  # a magnet grips objects and presses buttons from above
        handles = [task.device_width * DEVICES[noun].lowest for noun in task.devices]
        above = config.gripper.gap or -PRESS_DEPTH
        box[0, 2] = max(box[0, 2], min([config.task.object_size + above, *handles]))
    if box[0, 2] >= box[1, 2]:
        raise ConfigError(
            f"workspace.gripper_box={list(config.workspace.gripper_box)} must end above z={box[0, 2]:g}: the gripper "
            f"comes from above to objects of task.object_size={config.task.object_size}"
        )
    return box


def make_control(config: EnvConfig, task: Task, chain: Kinematics) -> Control:
    """The control that the config names."""
    speed = np.array(config.robot.max_speed) * (config.physics.time_step * config.physics.substeps)
    guarded = not task.moves or gripper_name(config, task) == "magnet"
    make = CONTROLS[config.control.name]
    return make(config.control, chain, speed, gripper_box(config, task), guarded, task.turns)


def make_initial_states(config: EnvConfig, task: Task, chain: Kinematics) -> InitialStates:
    """Where the arm begins episodes."""
    curriculum = config.task.curriculum.share > 0
    noise = max(config.task.reset_noise, config.task.randomize.start)
    return InitialStates(chain, noise, gripper_box(config, task) if curriculum else None)


def make_grips(config: EnvConfig, task: Task, worlds: Sequence[World], state: State) -> GripController:
    """The controller of all worlds' grippers. state: the arrays to which it writes the held slots."""
    kind = gripper_name(config, task) if task.grips else None
    return GripController(kind, config.robot, config.task.object_size, worlds, state, task.lag, not task.moves)
