"""What is guessed from a URDF, and what of it is mended so that Bullet moves the arm that was drawn."""

import itertools
import re
from dataclasses import replace
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest

from core.schema import read
from deixis.robot import workspaces
from envs.sim.robot import read_kinematics
from envs.sim.robot_config import RobotConfig
from envs.sim.robot_import.guess import Given, RobotGuess
from envs.sim.robot_import.meshes import Meshes
from envs.sim.robot_import.tree import URDFTree
from envs.sim.urdf_file import read_urdf
from tests.helpers.own_urdfs import ARM, BASE, LEFT, RIGHT, Part, changed, urdf_of, written

TRIANGLE = "facet normal 0 0 1 outer loop vertex 0 0 0 vertex .1 0 0 vertex 0 .2 .3 endloop endfacet"
PLY = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
0.1 0 0
0 0.2 0.3
3 0 1 2
"""


def guess(folder, text, still=False, **fields):
    """The robot that is guessed from this text, and its config."""
    (folder / "made").mkdir(exist_ok=True)
    given = Given(name="small", fields=fields, still=still)
    found = RobotGuess(written(folder, text), given, folder / "made").make(*workspaces())
    place = written(folder, found.urdf, "small_mended.urdf") if found.urdf else folder / "small.urdf"
    return found, read(RobotConfig, {**found.values, "package": "file", "urdf": str(place)}, "robot")


def told(found, part):
    return any(part in note for note in found.notes)


def test_an_arm_that_has_everything_is_taken_as_it_is(tmp_path):
    found, config = guess(tmp_path, urdf_of())
    assert found.urdf is None
    assert found.notes == ()
    assert found.share == 1.0
    assert config.joints == [part.joint for part in ARM]
    assert (config.grippers, config.tip, config.approach) == (["magnet"], "flange", [0.0, 0.0, 1.0])
    chain = read_kinematics(config)  # it checks the chain against Bullet's body, and the motors
    assert chain.forward(chain.rest[None]).position[0, 2] > 0.1


def test_values_that_are_given_are_kept(tmp_path):
    found, _ = guess(
        tmp_path, urdf_of(), base=[0.0, 0.1, 0.0], gain=0.2, magnet=[0.01, 0.03], reach=[0.3, 0.5, 0, 0.1, 0, 0.2]
    )
    assert found.values["base"] == [0.0, 0.1, 0.0]
    assert (found.values["gain"], found.values["magnet"]) == (0.2, [0.01, 0.03])
    assert found.values["reach"] == [0.3, 0.5, 0, 0.1, 0, 0.2]


def test_a_slide_before_the_arm_is_one_of_its_joints(tmp_path):
    rail = Part("rail", "cart", "base", axis="0 1 0", kind="prismatic", limit='lower="-.1" upper=".1" effort="500"')
    parts = (replace(rail, mass=2.0, box="0.1 0.1 0.02", at="0 0 0.01"), replace(ARM[0], parent="cart"), *ARM[1:])
    _, config = guess(tmp_path, urdf_of(parts))
    assert config.joints[0] == "rail"
    chain = read_kinematics(config)
    joints, moved = np.stack((chain.rest, chain.rest)), 0.07
    joints[1, 0] += moved
    one, other = chain.forward(joints).position
    np.testing.assert_allclose(other - one, [0.0, moved, 0.0], atol=1e-12)
    pose, jacobian = chain.jacobian(joints[:1])
    for j, step in itertools.product(range(7), [1e-6]):
        near = joints[:1].copy()
        near[0, j] += step
        change = (chain.forward(near).position - pose.position)[0] / step
        np.testing.assert_allclose(jacobian[0, :3, j], change, atol=1e-5)
    np.testing.assert_array_equal(jacobian[0, 3:, 0], 0.0)


def test_a_slide_that_is_held_still_stays_in_the_middle_of_its_range(tmp_path):
    rail = replace(
        LEFT, joint="rail", link="cart", parent="base", origin="0 0 0", limit='lower="0" upper=".1" effort="9"'
    )
    text = urdf_of((rail, replace(ARM[0], parent="cart"), *ARM[1:]))
    found, config = guess(tmp_path, text, still=True)
    assert told(found, "rail, which slides at 0 m/s, holds the arm back: it was fixed at 0.05 m")
    assert config.joints == [part.joint for part in ARM]
    place = read_kinematics(config).forward(np.zeros((1, 6))).position[0]
    np.testing.assert_allclose(place[1] - config.base[1], 0.05, atol=1e-6)


def test_an_inertia_that_is_turned_turns_no_axis(tmp_path):
    """Bullet gives the axis of a joint in the frame of the link's inertia."""
    mass = '<mass value="2.0"/>'
    text = urdf_of().replace(mass, f'<origin xyz="0 0 0.18" rpy="0 1.5707963 0"/>{mass}')
    _, config = guess(tmp_path, text)
    one = read_kinematics(config)
    (tmp_path / "plain").mkdir()
    other = read_kinematics(replace(config, urdf=str(written(tmp_path / "plain", urdf_of()))))
    np.testing.assert_allclose(one.forward(one.rest[None]).position, other.forward(one.rest[None]).position, atol=1e-6)


def test_a_joint_without_limits_turns_half_a_turn_from_rest(tmp_path):
    found, config = guess(tmp_path, urdf_of(changed(turn={"kind": "continuous"}, twist={"limit": ""})))
    assert told(found, "joints without limits (turn, twist)")
    chain = read_kinematics(config)
    for j in (0, 5):
        np.testing.assert_allclose([chain.low[j], chain.high[j]], chain.rest[j] + np.array([-np.pi, np.pi]), atol=1e-3)


def test_masses_that_are_guessed_are_held_by_the_efforts_that_are_given(tmp_path):
    bare = {part.joint: {"mass": None} for part in ARM}
    found, config = guess(tmp_path, urdf_of(changed(**bare)))
    assert told(found, "6 links have no mass (column, upper, lower, ...)")
    read_kinematics(config)
    weak = {part.joint: {"mass": None, "limit": 'lower="-2.8" upper="2.8" effort="4"'} for part in ARM}
    found, config = guess(tmp_path, urdf_of(changed(**weak)))
    masses = [float(mass.get("value")) for mass in fromstring(found.urdf).iter("mass")]
    assert sum(masses[1:]) < 1.0
    read_kinematics(config)


@pytest.mark.parametrize("case", ["as drawn", "along one axis", "the other way", "apart at 0", "through each other"])
def test_fingers_open_from_0_whatever_their_axes_and_limits(case, tmp_path):
    left, right = LEFT, RIGHT
    back = 'lower="-0.04" upper="0" effort="20" velocity="0.1"'
    if case == "along one axis":
        right = replace(RIGHT, axis="0 1 0", limit=back)
    elif case == "the other way":
        left, right = (replace(each, axis=other.axis, limit=back) for each, other in ((LEFT, RIGHT), (RIGHT, LEFT)))
    elif case == "apart at 0":
        left, right = (
            replace(LEFT, origin="0 0.045 0.02", limit=back),
            replace(RIGHT, origin="0 -0.045 0.02", limit=back),
        )
    elif case == "through each other":
        left, right = replace(LEFT, limit=back), replace(RIGHT, limit=back)
    found, config = guess(tmp_path, urdf_of((*ARM, left, right)))
    assert (config.grippers, config.finger_opening) == (["fingers", "magnet"], 0.04)
    np.testing.assert_allclose(config.tip_offset, [0, 0, 0.072], atol=1e-3)
    assert told(found, "lead them through each other") is (case == "through each other")
    assert (found.urdf is None) is (case == "as drawn")
    read_kinematics(config)  # refuses fingers that do not open


@pytest.mark.parametrize(
    ("hand", "note"),
    [
        ((replace(LEFT, kind="revolute"),), "its hand (left) has no two sliding fingers"),
        ((replace(LEFT, limit='lower="0" upper="0.02" effort="9"'), RIGHT), "too little for objects of 5 cm"),
    ],
)
def test_a_hand_without_two_wide_fingers_gets_a_magnet(hand, note, tmp_path):
    found, config = guess(
        tmp_path, urdf_of((*ARM, replace(hand[0], joint="jaw_left"), *hand[1:])).replace("jaw_left", "finger")
    )
    assert told(found, note.replace("left", "finger"))
    assert (config.grippers, config.fingers) == (["magnet"], [])


def test_damping_with_which_bullet_diverges_is_left_out(tmp_path):
    found, config = guess(tmp_path, urdf_of((*ARM, replace(LEFT, more='<dynamics damping="100"/>'), RIGHT)))
    assert told(found, "damping that is too great for Bullet was left out: left 100")
    read_kinematics(config)


@pytest.mark.slow
def test_an_arm_that_looks_the_other_way_is_turned(tmp_path):
    side = changed(turn={"origin": "0 0 0.05", "limit": 'lower="1.2" upper="1.9" effort="150"'})
    found, config = guess(tmp_path, urdf_of(side))
    assert told(found, "its front does not look along x: it was turned by")
    assert found.share > 0.4
    read_kinematics(config)


def test_an_arm_of_five_joints_tilts_and_declares_what_it_reaches(tmp_path):
    parts = (*ARM[:2], replace(ARM[2], origin="0 0 0.15"), replace(ARM[4], parent="lower", origin="0 0 0.15"), ARM[5])
    _, config = guess(tmp_path, urdf_of(parts))
    assert config.position_first
    assert len(config.reach) == 6
    assert config.reach[1] - config.reach[0] > 0.1


def test_links_that_are_in_each_other_at_rest_are_named(tmp_path):
    box = replace(ARM[5], box="0.05 0.05 0.02")
    plate = '<link name="plate"><collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision></link>'
    ends = '<origin xyz="0.4 0 0"/><parent link="base"/><child link="plate"/>'
    more = f'{plate}<joint name="to_plate" type="fixed">{ends}</joint>'
    found, _ = guess(tmp_path, urdf_of((*ARM[:5], box), more=more), base=[0.05, 0, 0], rest=[0, 2.2, -0.63, 0, 0, 0])
    assert any("plate" in pair for pair in found.touching)


# ---- which arm


def test_of_two_arms_one_is_taken_and_the_other_named(tmp_path):
    other = tuple(
        replace(part, joint=f"r_{part.joint}", link=f"r_{part.link}", parent=f"r_{part.parent}") for part in ARM
    )
    text = urdf_of((*ARM, replace(other[0], parent="base"), *other[1:]))
    found, config = guess(tmp_path, text)
    assert told(found, "it has 2 arms: the others are arm=1: r_turn to r_twist")
    assert config.joints[0] == "turn"
    _, config = guess(tmp_path, text, joints=[f"r_{part.joint}" for part in ARM])
    assert config.tip == "r_flange"


@pytest.mark.parametrize(
    ("hand", "expected"),
    [
        ((LEFT, RIGHT), 6),  # branches
        ((replace(LEFT, joint="gripper_axis", kind="revolute"),), 6),  # by its name
        ((replace(LEFT, joint="drive", kind="revolute"), replace(RIGHT, more='<mimic joint="drive"/>')), 6),  # followed
        ((replace(LEFT, joint="seventh", kind="revolute"),), 7),
    ],
)
def test_joints_of_the_hand_are_none_of_the_arm(hand, expected):
    arm = URDFTree(fromstring(urdf_of((*ARM, *hand)))).arms()[0]
    assert len(arm.joints) == expected


def test_a_link_made_for_tools_carries_the_gripper():
    frames = "".join(
        f'<link name="{name}"/><joint name="j{name}" type="fixed"><parent link="flange"/><child link="{name}"/></joint>'
        for name in ("camera_optical", "cover", "tool0")
    )
    tree = URDFTree(fromstring(urdf_of(more=frames)))
    assert tree.tips(tree.arms()[0]) == ["tool0", "flange", "cover"]


# ---- meshes


def meshed(folder, name, content, path=None):
    """A tree whose base has a mesh, after its meshes were looked at."""
    (folder / "pkg" / "meshes").mkdir(parents=True, exist_ok=True)
    if content is not None:
        (folder / "pkg" / "meshes" / name).write_bytes(content)
    shape = f'<collision><geometry><mesh filename="{path or "package://pkg/meshes/" + name}"/></geometry></collision>'
    urdf = written(folder, urdf_of(base=BASE.replace("</link>", shape + "</link>")))
    root = read_urdf(urdf)
    return Meshes(root, urdf, (), "small_meshes"), root


@pytest.mark.parametrize(("name", "text"), [("a.stl", f"solid a\n{TRIANGLE}\nendsolid"), ("a.PLY", PLY)])
def test_a_mesh_that_bullet_does_not_read_is_converted(name, text, tmp_path):
    if name.endswith("PLY"):
        pytest.importorskip("trimesh")
    meshes, root = meshed(tmp_path, name, text.encode())
    assert [len(content) for content in meshes.converted.values()] == [84 + 50]
    assert root.find(".//mesh").get("filename") == "small_meshes/0_a.stl"
    assert re.search("which Bullet does not read", meshes.notes[0])


@pytest.mark.parametrize(
    ("name", "content", "note"),
    [
        ("a.stl", None, "1 meshes are not there"),
        ("a.stl", b"version https://git-lfs.github.com/spec/v1\n", "is a pointer of Git LFS"),
        ("a.stl", b"", "is no STL file: it has no triangles"),
        ("a.dae", b"junk", "is no DAE file"),
        ("a.dae", b"<COLLADA><asset/></COLLADA>", "with which Bullet ends"),
        ("a.dae", b"<COLLADA><asset><unit/></asset><library_geometries/></COLLADA>", "with which Bullet ends"),
        ("a.obj", b"junk", "is no OBJ file"),
        ("a.ply", b"junk", "cannot be read"),
        ("a.step", b"junk", "is of an unknown format"),
    ],
)
def test_a_shape_whose_mesh_cannot_be_used_is_left_out(name, content, note, tmp_path):
    meshes, root = meshed(tmp_path, name, content)
    assert root.find(".//mesh") is None
    assert note in " ".join(meshes.notes)


def test_a_mesh_is_found_under_another_name_of_its_package(tmp_path):
    cube = f"solid a\n{TRIANGLE}\nendsolid".encode()
    for path in ("package://other/meshes/a.stl", "package://a.stl", "meshes/a.stl", "../pkg/meshes/a.stl"):
        folder = tmp_path / str(len(path))
        (folder / "pkg").mkdir(parents=True)
        _, root = meshed(folder, "a.stl", cube, path)
        assert root.find(".//mesh") is not None, path
