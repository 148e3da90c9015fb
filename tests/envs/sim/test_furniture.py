"""Furniture: every workspace builds, and what slides or turns does so when pushed, stays, and goes back at reset."""

import copy
import re

import numpy as np
import pybullet as bullet
import pytest
import torch
from omegaconf import OmegaConf
from torchrl.envs.utils import check_env_specs

from core.errors import ConfigError
from core.overrides import compose
from envs import read_env
from tests.helpers.env_cases import LONG_ARMS, TOUCHING, act, differences, make, options, partial_reset

WORKSPACES = options("workspace")
CONFIGS = {name: read_env(compose([f"workspace={name}"])).workspace for name in WORKSPACES}
LOW = (TOUCHING, "task.object_size=0.03", "task.randomize.start=0")  # the gripper comes down to the table
FITTINGS = [(name, each) for name in WORKSPACES for each in CONFIGS[name].fittings]
ROOMS = ("room", "studio")  # where grippers reach into the furniture
PUSHED = [
    (name, each) for name, each in FITTINGS if name not in ROOMS
]  # stand where grippers that go straight on push them
BEFORE, BEYOND, AWAY = [0.45, 0.05, 0.12], [0.64, 0.05, 0.12], [0.4, 0.05, 0.3]  # where grippers go to push and leave


def go(env, td, place, steps):
    for _ in range(steps):
        td = act(env, td, env.towards(np.tile(place, (env.batch_size[0], 1))))
    return td


def pushed(env, td):
    """Every gripper goes down before the furniture, into it, and away."""
    for place, steps in ((BEFORE, 20), (BEYOND, 40), (AWAY, 25)):
        td = go(env, td, place, steps)
    return td


def value(env):
    return np.concatenate(list(env.fittings.values()))


# ---- every workspace ------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("workspace", WORKSPACES)
def test_torchrl_finds_no_fault_with_an_environment_in_any_workspace(workspace):
    env = make("kuka", "step", "nl_reach", f"workspace={workspace}", worlds=2)
    check_env_specs(env, seed=0)
    env.close()


def corners(box):
    return np.array([np.array(box.position) - np.array(box.size) / 2, np.array(box.position) + np.array(box.size) / 2])


def overlap(one, other):
    """Whether two boxes (2, 3) have more than a face in common."""
    return bool((np.minimum(one[1], other[1]) - np.maximum(one[0], other[0]) > 1e-6).all())


@pytest.mark.parametrize("workspace", WORKSPACES)
def test_areas_for_gripper_and_objects_are_clear_of_the_furniture(workspace):
    config = CONFIGS[workspace]
    solid = [box for box in config.furniture.values() if box.contact]
    room = np.reshape(config.gripper_box, (3, 2)).T
    objects = np.concatenate((np.reshape(config.object_area, (2, 2)).T, [[0.0], [0.06]]), axis=1)
    for box in solid:
        assert workspace in ROOMS or not overlap(corners(box), room)
        assert not overlap(corners(box), objects)


@pytest.mark.parametrize(("workspace", "name"), FITTINGS)
def test_a_closed_fitting_does_not_overlap_other_furniture(workspace, name):
    fitting = CONFIGS[workspace].fittings[name]
    assert fitting.low == 0
    for part in fitting.parts.values():
        for box in CONFIGS[workspace].furniture.values():
            assert not overlap(corners(part), corners(box))


# ---- fittings -------------------------------------------------------------------------------------------------------


@pytest.mark.sampled
# xarm7's motors are weak: it stalls after 2 of the 10 cm that the drawer can be pushed.
@pytest.mark.slow
@pytest.mark.parametrize("robot", [robot for robot in LONG_ARMS if robot != "xarm7"])
@pytest.mark.parametrize(("workspace", "name"), PUSHED)
def test_a_fitting_moves_when_pushed_stays_there_and_is_reset(workspace, name, robot):
    env = make(robot, "step", "reach", *LOW, f"workspace={workspace}", "task.max_steps=500", worlds=3)
    fitting, td = env.config.workspace.fittings[name], env.reset()
    td = go(env, td, AWAY, 10)
    assert (env.fittings[name] == fitting.start).all()  # nothing has touched it
    td = pushed(env, td)
    left = env.fittings[name]
    slack = 0.1 * (fitting.high - fitting.low)  # an arm's full force presses a little past the end
    assert (np.abs(left - fitting.start) > 0.03).all()
    assert (left > fitting.low - slack).all()
    td = go(env, td, AWAY, 60)
    assert (env.fittings[name] == left).all()
    partial_reset(env, td, [1])
    assert env.fittings[name].tolist() == [left[0], fitting.start, left[2]]
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize(("workspace", "name"), FITTINGS)
def test_a_fitting_stays_within_its_limits(workspace, name):
    env = make("kuka", "step", "reach", f"workspace={workspace}")
    env.reset()
    fitting, (world,) = env.config.workspace.fittings[name], env._worlds  # only Bullet can pull
    body = world.furniture.bodies[name]
    for sign, end in ((1, fitting.high), (-1, fitting.low), (1, fitting.high)):
        pull(world, body, fitting, 2.0 * sign * fitting.friction)
        assert env.fittings[name] == pytest.approx(end, abs=0.03 if fitting.joint == "slide" else 0.08)
    env.close()


def pull(world, body, fitting, strength):
    """Physics steps under a force (N) along the joint's axis, or a torque (N m) about it."""
    load = (np.array(fitting.axis) * strength).tolist()
    for _ in range(480):
        if fitting.joint == "turn":
            bullet.applyExternalTorque(body, 0, load, bullet.WORLD_FRAME, world.client)
        else:
            place = bullet.getLinkState(body, 0, physicsClientId=world.client)[0]
            bullet.applyExternalForce(body, 0, load, place, bullet.WORLD_FRAME, world.client)
        world.step_physics()


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.parametrize(("robot", "control"), [("kuka", "step"), ("panda", "joints")])
@pytest.mark.parametrize(("workspace", "name"), PUSHED)
def test_a_seed_gives_the_same_bits_after_a_fitting_was_pushed(workspace, name, robot, control):
    def made(worlds):
        options = (*LOW, f"workspace={workspace}", "task.hold_steps=60")
        return make(robot, control, "nl_reach", *options, worlds=worlds, seed=5)

    env, other = made(2), made(3)
    fresh, fresh_values = recorded(env)
    assert len(np.unique(fresh_values)) > 5  # else the test would show little
    env.set_seed(6)
    pushed(env, env.reset())
    env.set_seed(5)
    for again in (env, other):
        history, values = recorded(again)
        assert differences(history[:, :2], fresh) == []
        assert (values[:, :2] == fresh_values).all()
        again.close()


def recorded(env):
    """What is observed, and the fittings' values (T, N), while grippers push and each world is reset in its time."""
    rngs = [np.random.default_rng(i) for i in range(env.batch_size[0])]
    places = np.stack([rng.uniform([0.45, -0.1, 0.04], [0.66, 0.2, 0.3], (9, 3)) for rng in rngs], axis=1)
    td, history, values = env.reset(), [], []
    for t in range(90):
        td = act(env, td, env.towards(places[t // 10]))
        history.append(td.exclude("action").clone())
        over = [i for i in range(env.batch_size[0]) if td["done"][i] or t % (17 + 7 * i) == 13]
        td = partial_reset(env, td, over) if over else td
        values.append(value(env))
    return torch.stack(history), np.array(values)


def test_a_workspace_without_fittings_reports_none():
    env = make(worlds=2)
    assert env.fittings == {}
    env.close()


# ---- what is refused ------------------------------------------------------------------------------------------------

BAD = [
    ({"low": 0.2}, "workspace.fittings.drawer.low=0.2 must be less than high=0.2"),
    ({"start": 0.3}, "workspace.fittings.drawer.start=0.3 must be between low=0.0 and high=0.2"),
    ({"joint": "turns"}, "workspace.fittings.drawer.joint=turns is not known; did you mean 'turn'?"),
    ({"axis": [0, 0, 0]}, "workspace.fittings.drawer.axis=[0.0, 0.0, 0.0] must be of length 1"),
    ({"axis": [1]}, "workspace.fittings.drawer.axis=[1.0] must be 3 numbers"),
    ({"mass": 0}, "workspace.fittings.drawer.mass=0.0 is out of range: it must be in [0.01, 1000]"),
    ({"friction": float("nan")}, "workspace.fittings.drawer.friction=nan is not a finite number"),
    ({"parts": {}}, "workspace.fittings.drawer.parts={} must name at least one box"),
    ({"parts.front.size": [1, 1]}, "workspace.fittings.drawer.parts.front.size=[1.0, 1.0] must be 3 numbers"),
    ({"hight": 0.2}, "workspace.fittings.drawer.hight is not a known key; did you mean 'high'?"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("changes", "message"), BAD, ids=[next(iter(changes)) for changes, _ in BAD])
def test_an_invalid_fitting_is_an_error_that_names_it(changes, message):
    config = copy.deepcopy(compose(["workspace=drawer"]))
    for key, changed in changes.items():
        OmegaConf.update(config, f"workspace.fittings.drawer.{key}", changed, merge=False, force_add=True)
    with pytest.raises(ConfigError, match=re.escape(message)) as caught:
        read_env(config)
    assert "\n" not in str(caught.value)


def test_a_workspace_without_the_key_fittings_is_an_error():
    config = copy.deepcopy(compose())
    OmegaConf.set_struct(config, False)
    del config["workspace"]["fittings"]
    with pytest.raises(ConfigError, match=r"workspace\.fittings has no value; give workspace\.fittings="):
        read_env(config)
