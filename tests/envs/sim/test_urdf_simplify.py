"""Copies of URDFs with unused joints fixed and large meshes as small hulls."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from core.overrides import compose
from envs import read_env
from envs.sim.robot_config import urdf_path
from envs.sim.urdf import DIRECTIONS, STL, simplified


def simple(robot):
    config = read_env(compose([f"robot={robot}"])).robot
    return urdf_path(config), simplified(urdf_path(config), (*config.joints, *config.fingers), small=True)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["kuka", "panda", "jaco", "ur5"])
def test_a_urdf_with_nothing_to_simplify_is_used_as_it_is(robot):
    whole, copy = simple(robot)
    assert copy == whole


def test_joints_that_the_robot_does_not_use_are_fixed():
    whole, copy = simple("so_arm")
    kinds = [{j.get("name"): j.get("type") for j in ElementTree.parse(p).findall("joint")} for p in (whole, copy)]
    assert {name for name in kinds[0] if kinds[0][name] != kinds[1][name]} == {"gripper"}
    assert kinds[1]["gripper"] == "fixed"


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["so_arm", "xarm7"])
def test_a_small_hull_is_nearly_as_large_as_its_mesh(robot):
    meshes = [
        [Path(str(mesh.get("filename"))) for mesh in ElementTree.parse(path).findall("link/collision/geometry/mesh")]
        for path in simple(robot)
    ]
    small = [(whole, hull) for whole, hull in zip(*meshes, strict=True) if hull.suffix == ".obj"]
    assert len(small) > 4
    for whole, hull in small:
        found = Path(_share(), str(whole).removeprefix("package:/"))
        points = np.fromfile(found, STL, offset=84)["points"].reshape(-1, 3)
        kept = np.array([line.split()[1:] for line in hull.read_text().splitlines() if line[:2] == "v "], float)
        assert len(kept) <= DIRECTIONS
        size = np.ptp(points, axis=0)
        np.testing.assert_allclose(np.ptp(kept, axis=0), size, atol=0.03 * size.max())


def _share():
    config = read_env(compose(["robot=so_arm"])).robot
    return str(urdf_path(config)).removesuffix(config.urdf)
