"""Every visual shape of a world, with its pose and current colour."""

from contextlib import closing

import numpy as np
import pybullet as bullet
import pytest

from core.overrides import compose
from envs import read_env
from envs.interactive.interactive_env import InteractiveEnv
from language import rgba as named


def made(*overrides):
    return InteractiveEnv(read_env(compose([*overrides, "workspace=collabtable"])), seed=0)


def centres(stage, bodies):
    """(S, 3) where the middles of these bodies' shapes are, metres."""
    shapes = [shape for shape in stage.visual_shapes.shapes() if shape.body in bodies]
    poses = stage.visual_shapes.poses([(shape.body, shape.link) for shape in shapes])
    return np.array(
        [
            bullet.multiplyTransforms(pose[:3], pose[3:], shape.position, shape.quaternion)[0]
            for shape, pose in zip(shapes, poses, strict=True)
        ]
    )


def test_objects_are_drawn_where_they_are_observed_and_in_their_colours():
    with closing(made("task=nl_pick_and_place")) as stage:
        for _ in range(2):
            stage.reset()
            scene, bodies = stage.scene(), stage.bodies()
            assert np.allclose(centres(stage, bodies)[np.argsort(np.argsort(bodies))], scene.positions, atol=1e-6)
            rgba = {shape.body: shape.rgba for shape in stage.visual_shapes.shapes()}
            for body, thing, see_through in zip(bodies, scene, scene.targets, strict=True):
                assert np.allclose(rgba[body][:3], named(thing.color)[:3], atol=0.01)
                assert (rgba[body][3] < 1) == see_through


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["kuka", "panda", "jaco", "ur5", "xarm7", "so_arm"])
def test_the_arm_is_drawn_from_its_base_to_its_gripper(robot):
    with closing(made(f"robot={robot}")) as stage:
        stage.reset()
        body = min(shape.body for shape in stage.visual_shapes.shapes())
        places = centres(stage, [body])
        base = np.array(stage.config.robot.base)
        assert np.linalg.norm(places - base, axis=1).min() < 0.2
        assert np.linalg.norm(places - stage.gripper[0], axis=1).min() < 0.2
        assert places[:, 2].min() > -0.05


def test_the_person_stands_on_the_floor():
    with closing(made()) as stage:
        stage.reset()
        x, y, floor = stage.config.workspace.human.position
        bodies = [shape.body for shape in stage.visual_shapes.shapes()]
        person = max(set(bodies), key=bodies.count)
        places = centres(stage, [person])
        assert floor - 1e-3 < places[:, 2].min() < floor + 0.15  # feet
        assert floor + 1.5 < places[:, 2].max() < floor + 2.0  # head
        assert np.abs(places[:, :2] - [x, y]).max() < 1.0
