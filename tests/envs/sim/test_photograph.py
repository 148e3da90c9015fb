import numpy as np
import pytest

from core.cameras import CameraFrame, Light, project
from core.overrides import compose
from envs.config import read_env
from envs.workspace_env import WorkspaceEnv


def world_of(*overrides):
    config = read_env(compose([*overrides])).without_curriculum()
    env = WorkspaceEnv(config, 1, 0, render=True)
    env.reset()
    pose = env._arrays.pose
    return env, config.workspace.cameras, (pose.position[0], pose.rotation[0])


@pytest.fixture(scope="module")
def placing():
    env, cameras, gripper = world_of("task=nl_pick_and_place")
    yield env, cameras, gripper
    env.close()


@pytest.mark.parametrize("name", ["front", "side", "top", "wrist"])
def test_objects_are_where_their_places_project_to(placing, name):
    env, cameras, gripper = placing
    photo, frame = env._worlds[0].photograph(cameras[name], gripper), CameraFrame.of(cameras[name], gripper)
    bodies = [each.body for each in env._worlds[0]._shown.holdable]
    seen = 0
    for body, (place, _) in zip(bodies, env._worlds[0].object_poses(), strict=True):
        rows, columns = np.nonzero(photo.links == body)
        if len(rows) > 30 and rows.min() > 3 and rows.max() < 124 and columns.min() > 3 and columns.max() < 124:
            (u, v), _ = project(cameras[name], frame, np.array(place))
            assert abs(columns.mean() + 0.5 - u) < 2.5
            assert abs(rows.mean() + 0.5 - v) < 2.5
            seen += 1
    assert seen or name == "wrist"


def test_a_see_through_object_lets_the_table_through(placing):
    env, cameras, gripper = placing
    world, camera = env._worlds[0], cameras["front"]
    photo = world.photograph(camera, gripper)
    for (body, link), color in world._renderer._see_through.items():
        mask = photo.links == body + ((link + 1) << 24)
        opaque = np.array(color[:3]) * 255
        assert mask.any()
        assert np.abs(photo.colors[mask].mean(0) - opaque).max() > 15


def test_the_same_world_gives_the_same_bits(placing):
    env, cameras, gripper = placing
    one, other = (env._worlds[0].photograph(cameras["front"], gripper) for _ in range(2))
    assert np.array_equal(one.colors, other.colors)
    assert np.array_equal(one.depths, other.depths)


@pytest.mark.parametrize("name", ["front", "side", "top", "wrist"])
def test_a_picture_for_which_furniture_is_drawn_once_has_the_same_bits(placing, name):
    env, cameras, gripper = placing
    world = env._worlds[0]
    for seed in range(2):
        env.set_seed(seed)
        env.reset()
        whole = world.photograph(cameras[name], gripper).colors
        assert np.array_equal(world.picture(cameras[name], gripper), whole)
        assert np.array_equal(world.photograph(cameras[name], gripper).colors, whole)


def test_bodies_as_near_as_furniture_are_drawn_in_the_order_in_which_they_were_made():
    env, cameras, gripper = world_of("task=nl_reach", "robot=so_arm")  # its base stands in the table's plane
    world, top = env._worlds[0], cameras["top"]
    assert np.array_equal(world.picture(top, gripper), world.photograph(top, gripper).colors)
    env.close()


def test_depths_are_metres_ahead_of_the_camera(placing):
    env, cameras, gripper = placing
    camera = cameras["top"]
    depths = env._worlds[0].photograph(camera, gripper).depths
    table = CameraFrame.of(camera).place[2]
    assert np.abs(depths - table).min() < 0.002


def test_shadows_are_drawn_where_the_light_asks_for_them(placing):
    env, cameras, gripper = placing
    plain, shaded = (env._worlds[0].photograph(cameras["top"], gripper, Light(shadow=each)) for each in (False, True))
    assert shaded.colors.mean() < plain.colors.mean()


def test_the_cone_along_a_finger_is_left_out():
    env, cameras, gripper = world_of("task=nl_reach_gesture", "gesture=ray")
    world = env._worlds[0]
    world.show_finger(True)
    cone = world.person.body + ((world.person.cone + 1) << 24)
    photo = world.photograph(cameras["top"], gripper)
    assert not (photo.links == cone).any()
    env.close()


def test_pictures_agree_with_the_camera_model_within_a_fifth_of_a_pixel():
    env, cameras, gripper = world_of("task=nl_reach", "task.nouns=[sphere]", "task.num_objects=6")
    shifts = []
    for seed in range(4):
        env.set_seed(seed)
        env.reset()
        bodies = [each.body for each in env._worlds[0]._shown.holdable]
        for name in ("front", "side"):
            frame, photo = CameraFrame.of(cameras[name]), env._worlds[0].photograph(cameras[name], gripper)
            for body, (place, _) in zip(bodies, env._worlds[0].object_poses(), strict=True):
                rows, columns = np.nonzero(photo.links == body)
                pixel, depth = project(cameras[name], frame, np.array(place))
                if len(rows) > 0.7 * (cameras[name].focal * 0.05 / float(depth)) ** 2:
                    shifts.append((columns.mean() + 0.5 - pixel[0], rows.mean() + 0.5 - pixel[1]))
    env.close()
    assert len(shifts) > 15
    assert np.abs(np.median(shifts, axis=0)).max() < 0.2
