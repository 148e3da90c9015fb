"""The person's URDF: ours to the last mesh, with an arm's limits, and others' are checked before they are used."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np
import pybullet as bullet
import pytest

from conf.schema import ConfigError
from human.body.meshes import Proportions
from human.body.urdf_model import urdf, write
from tests.helpers.human_cases import REST, standing


def root(proportions: Proportions | None = None) -> ElementTree.Element:
    return ElementTree.fromstring(urdf(proportions))


def test_has_the_links_that_others_ask_for():
    links = {link.get("name") for link in root().iter("link")}
    assert links >= {"r_hand", "r_index1", "r_index2", "r_index3_endeffector", "eyes", "cone", "head", "l_hand"}


def test_names_no_mesh_but_those_it_writes(tmp_path):
    tree = ElementTree.parse(write(tmp_path))
    meshes = {str(mesh.get("filename")) for mesh in tree.iter("mesh")}
    assert "cone.obj" in meshes
    assert meshes == {path.name for path in tmp_path.glob("*.obj")}


def test_who_loads_the_urdf_elsewhere_can_touch_arms_and_trunk_and_not_the_cone():
    touched = {link.get("name") for link in root().iter("link") if link.find("collision") is not None}
    assert "cone" not in touched
    assert touched >= {"trunk", "head", "r_upper_arm", "r_forearm", "r_hand", "r_index1", "l_hand"}


def test_masses_are_those_of_a_person():
    masses = [float(str(mass.get("value"))) for mass in root().iter("mass")]
    assert min(masses) > 0
    assert sum(masses) == pytest.approx(70, rel=0.05)


def test_left_and_right_arm_mirror():
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
def test_another_urdf_must_have_the_links(tmp_path, link):
    path = write(tmp_path)
    path.write_text(path.read_text().replace(f'"{link}"', f'"my_{link}"'))
    with (
        pytest.raises(ConfigError, match=f"workspace.human.urdf=.*has no link '{link}'; did you mean"),
        standing(urdf=str(path)),
    ):
        pass


def test_another_urdf_points_as_ours_does(tmp_path):
    with standing(urdf=str(write(tmp_path))) as other, standing() as ours:
        assert (other.solve((0.4, 0.1, 0.0)) == ours.solve((0.4, 0.1, 0.0))).all()


def test_what_is_no_urdf_is_refused_with_its_key(tmp_path):
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
def test_a_rest_that_the_body_cannot_take_is_refused(rest, message):
    with pytest.raises(ConfigError, match=message), standing(rest=rest):
        pass
