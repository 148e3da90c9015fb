"""URDFs of people: whatever Bullet reads is read, all else gets one sentence that says why."""

import re

import pybullet as bullet
import pytest

from core.errors import ConfigError
from envs import make_env
from envs.sim.robot import load, read_kinematics
from tests.helpers.own_robots import overrides, own_robot, swapped
from tests.helpers.thorough import some

KUKA = [f"lbr_iiwa_joint_{i}" for i in range(1, 8)]
SIX = {"joints": KUKA[:6], "rest": [0.0, 0.6, 0.0, -1.7, 0.0, 0.8], "max_speed": [1.0] * 6}


def before_links(markup):
    """A change of a URDF: this before its first link."""
    return lambda text: text.replace("<link ", markup + "<link ", 1)


BULLET_READS = {
    "two hyphens in a comment": before_links("<!-- a -- b --- -->"),
    "an undeclared prefix": before_links('<gz:plugin gz:name="a"><gz:inner/></gz:plugin>'),
    "a bare ampersand": before_links('<gazebo name="a & b" other="&copy;">R&D</gazebo>'),
    "a less-than sign in an attribute": before_links('<gazebo name="a < b > c"/>'),
    "a Latin-1 letter": lambda text: before_links("<!-- Bär --><gazebo name='Bär'/>")(text).encode("latin-1"),
    "a declared multi-byte encoding": lambda text: re.sub(
        r"<\?xml[^>]*>", '<?xml version="1.0" encoding="Shift_JIS"?>', before_links("<!-- 日本 -->")(text)
    ).encode("shift_jis"),
    "an unknown encoding": lambda text: re.sub(r"<\?xml[^>]*>", '<?xml version="1.0" encoding="klingon"?>', text),
    "a byte order mark": lambda text: b"\xef\xbb\xbf" + text.encode(),
    "a control character": before_links('<gazebo name="a\x01b"/>'),
    "an element after the robot": lambda text: text + "<more/>",
    "CDATA and a document type": before_links("<![CDATA[ <link> ]]>"),
    "Windows line ends": lambda text: text.replace("\n", "\r\n"),
}


@pytest.mark.parametrize("name", some(BULLET_READS, 4))
def test_what_bullet_reads_is_read_and_joints_that_are_not_used_are_fixed(tmp_path, name):
    config = own_robot(tmp_path, "kuka", BULLET_READS[name], **SIX)
    client = bullet.connect(bullet.DIRECT)
    try:
        body = load(config, client, visuals=False, magnet=True)
        kinds = {j[1].decode(): j[2] for j in (bullet.getJointInfo(body, i, client) for i in range(7))}
    finally:
        bullet.disconnect(client)
    assert [kinds[joint] for joint in KUKA] == [bullet.JOINT_REVOLUTE] * 6 + [bullet.JOINT_FIXED]


def test_a_joint_whose_name_is_latin_1_can_be_used(tmp_path):
    config = own_robot(tmp_path, "kuka", lambda text: text.replace(KUKA[0], "drehgelenk_ä").encode("latin-1"))
    with pytest.raises(ConfigError, match=r"'lbr_iiwa_joint_1' is not in the URDF"):
        read_kinematics(config)
    named = own_robot(
        tmp_path / "named",
        "kuka",
        lambda text: text.replace(KUKA[0], "drehgelenk_ä").encode(),
        joints=["drehgelenk_ä", *KUKA[1:]],
    )
    assert len(read_kinematics(named).rest) == 7


SENTENCES = {
    "UTF-16": (lambda text: text.encode("utf-16"), "is UTF-16, which Bullet does not read: save it as UTF-8"),
    "an element that is not closed": (lambda text: text.replace("</robot>", ""), "<robot> is never closed"),
    "a wrong end": (lambda text: text.replace("</link>", "", 1), "which closes nothing"),
    "no file of XML": (lambda text: "robot: kuka", "holds no XML"),
    "nothing": (lambda text: "", "holds no XML"),
    "another root": (lambda text: "<robots/>", "has the root element 'robots' in place of 'robot'"),
    "SDF": (lambda text: '<sdf version="1.6"><model name="a"/></sdf>', "is an SDF file"),
    "MJCF": (lambda text: '<mujoco model="a"><worldbody/></mujoco>', "is an MJCF file"),
    "xacro": (
        lambda text: swapped(text, "</robot>", '<xacro:arm prefix="a"/></robot>'),
        "is a xacro template: expand it with `xacro <file> > robot.urdf`",
    ),
    "a xacro argument": (lambda text: text.replace('"lbr_iiwa_link_3"', '"${prefix}link_3"'), "is a xacro template"),
    "a mesh that is missing": (
        lambda text: text.replace("meshes/link_3.stl", "meshes/link_three.stl"),
        "cannot find 'meshes/link_three.stl'",
    ),
    "two links of one name": (
        lambda text: text.replace('<link name="lbr_iiwa_link_3"', '<link name="lbr_iiwa_link_2"'),
        "Link name is not unique",
    ),
    "a parent that is missing": (
        lambda text: text.replace('parent link="lbr_iiwa_link_3"', 'parent link="nobody"'),
        "Cannot find parent link for a joint",
    ),
}


@pytest.mark.parametrize("name", some(SENTENCES, 5))
def test_a_file_that_cannot_be_loaded_gets_one_sentence_with_the_reason(tmp_path, name):
    change, message = SENTENCES[name]
    config = own_robot(tmp_path, "kuka", change)
    with pytest.raises(ConfigError, match=re.escape(message)) as refused:
        read_kinematics(config)
    assert str(refused.value).startswith("robot.urdf=")
    assert "\n" not in str(refused.value)


def test_make_env_names_the_mesh_that_is_missing(tmp_path):
    config = own_robot(tmp_path, "kuka", lambda text: text.replace("link_3.stl", "link_three.stl"))
    with pytest.raises(ConfigError, match=r"cannot find 'meshes/link_three\.stl'"):
        make_env(overrides(config))
