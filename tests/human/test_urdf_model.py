"""The person's URDF, its proportions and meshes, and URDF files of users."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np
import pybullet as bullet
import pytest

from core.errors import ConfigError
from human.body.urdf_model import Proportions, urdf, write
from tests.helpers.human_cases import REST, standing


def root(proportions: Proportions | None = None) -> ElementTree.Element:
    return ElementTree.fromstring(urdf(proportions))


def test_the_urdf_has_the_links_that_other_modules_use():
    links = {link.get("name") for link in root().iter("link")}
    assert links >= {"r_hand", "r_index1", "r_index2", "r_index3_endeffector", "eyes", "cone", "head", "l_hand"}


def test_the_urdf_refers_exactly_to_the_meshes_that_are_written(tmp_path):
    tree = ElementTree.parse(write(tmp_path))
    meshes = {str(mesh.get("filename")) for mesh in tree.iter("mesh")}
    assert "cone.obj" in meshes
    assert meshes == {path.name for path in tmp_path.glob("*.obj")}


def test_arms_and_trunk_have_collision_shapes_and_the_cone_has_none():
    touched = {link.get("name") for link in root().iter("link") if link.find("collision") is not None}
    assert "cone" not in touched
    assert touched >= {"trunk", "head", "r_upper_arm", "r_forearm", "r_hand", "r_index1", "l_hand"}


def test_masses_sum_to_that_of_a_person():
    masses = [float(str(mass.get("value"))) for mass in root().iter("mass")]
    assert min(masses) > 0
    assert sum(masses) == pytest.approx(70, rel=0.05)


def test_left_and_right_arm_are_mirrored():
    joints = {joint.get("name"): joint for joint in root().iter("joint")}
    pairs = [(joint, joints["r" + name[1:]]) for name, joint in joints.items() if name and name.startswith("l_")]
    assert len(pairs) == 7
    for left, right in pairs:
        assert attribute(left, "limit", "lower") == attribute(right, "limit", "lower")
        np.testing.assert_allclose(numbers(left, "origin", "xyz"), numbers(right, "origin", "xyz") * (1, -1, 1))
        # an axis of rotation is mirrored the other way round than a place
        np.testing.assert_allclose(numbers(left, "axis", "xyz"), numbers(right, "axis", "xyz") * (-1, 1, -1))


def attribute(joint: ElementTree.Element, tag: str, name: str) -> str:
    element = joint.find(tag)
    assert element is not None
    return str(element.get(name))


def numbers(joint: ElementTree.Element, tag: str, name: str) -> np.ndarray:
    return np.array([float(number) for number in attribute(joint, tag, name).split()])


def test_a_taller_person_has_higher_eyes(tmp_path):
    heights = []
    for height in (1.5, 1.75, 2.0):
        client = bullet.connect(bullet.DIRECT)
        path = write(tmp_path, Proportions(height=height))
        body = bullet.loadURDF(str(path), useFixedBase=True, physicsClientId=client)
        links = [bullet.getJointInfo(body, i, client)[12] for i in range(bullet.getNumJoints(body, client))]
        heights.append(bullet.getLinkState(body, links.index(b"eyes"), physicsClientId=client)[4][2])
        bullet.disconnect(client)
    np.testing.assert_allclose(np.array(heights) / (1.5, 1.75, 2.0), 0.92, atol=0.03)


@pytest.mark.parametrize("link", ["r_index2", "r_index3_endeffector", "r_hand", "eyes"])
def test_a_urdf_without_a_required_link_is_refused(tmp_path, link):
    path = write(tmp_path)
    path.write_text(path.read_text().replace(f'"{link}"', f'"my_{link}"'))
    with (
        pytest.raises(ConfigError, match=f"workspace.human.urdf=.*has no link '{link}'; did you mean"),
        standing(urdf=str(path)),
    ):
        pass


def test_a_urdf_file_points_like_the_built_in_model(tmp_path):
    with standing(urdf=str(write(tmp_path))) as other, standing() as ours:
        assert (other.solve((0.4, 0.1, 0.0)) == ours.solve((0.4, 0.1, 0.0))).all()


def test_missing_and_broken_urdf_files_are_refused_with_their_key(tmp_path):
    broken = tmp_path / "broken.urdf"
    broken.write_text("<robot")
    for path, message in ((tmp_path / "none.urdf", "is not a file"), (broken, "does not load")):
        with pytest.raises(ConfigError, match=f"workspace.human.urdf=.*{message}"), standing(urdf=str(path)):
            pass


@pytest.mark.parametrize(
    ("rest", "message"),
    [
        (REST | {"r_elbow": 0.1}, "workspace.human.rest: 'r_elbow' .*did you mean 'r_elbow_flexion'"),
        (REST | {"r_elbow_flexion": -0.5}, "workspace.human.rest.r_elbow_flexion=-0.5 is beyond"),
        ({}, "at least one joint"),
    ],
)
def test_an_impossible_rest_posture_is_refused(rest, message):
    with pytest.raises(ConfigError, match=message), standing(rest=rest):
        pass
