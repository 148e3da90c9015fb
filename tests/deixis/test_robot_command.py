"""`deixis robot`: a URDF becomes a robot that works, or one sentence says why not, and then nothing is written."""

import os
import random
import re
import sys
from contextlib import suppress
from dataclasses import replace

import pytest
import yaml

from core.errors import ConfigError, RunError
from core.plugins import VARIABLE
from deixis import cli, robot
from envs.sim.robot_import.tree import URDFTree
from envs.sim.urdf_file import URDFError, parse_urdf
from tests.helpers.own_urdfs import ARM, BASE, LEFT, RIGHT, changed, urdf_of, written

SHAPES = '<link name="base"><visual><geometry><mesh filename="{}"/></geometry></visual></link>'
XXE = '<!DOCTYPE robot [<!ENTITY secret SYSTEM "file:///etc/passwd">]>'


def joint(name, parent, child, kind="fixed"):
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/></joint>'


REFUSED = {
    "nothing": ("", "holds no XML"),
    "no XML": ("not a robot", "holds no XML"),
    "another format": ("<sdf version='1.6'/>", "is an SDF file"),
    "an open element": ("<robot name='a'><link name='b'>", "is never closed"),
    "a wrong end": ("<robot name='a'></link></robot>", "closes nothing"),
    "deeply nested": ("<robot>" + "<a>" * 100_000, "nested more than 60 deep"),
    "xacro": ('<robot><xacro:include filename="a.xacro"/></robot>', "is a xacro template"),
    "a xacro value": (urdf_of(changed(turn={"origin": "0 0 ${height}"})), "is a xacro template"),
    "no links": ("<robot name='a'/>", "has no links"),
    "a circle": (urdf_of(more=joint("back", "flange", "base")), "its joints form a circle"),
    "a circle beside it": (
        urdf_of(more='<link name="p"/><link name="q"/>' + joint("a", "p", "q") + joint("b", "q", "p")),
        "link p is in a circle of joints",
    ),
    "two roots": (urdf_of(more='<link name="other"/>'), "2 links are moved by no joint (base, other)"),
    "two parents": (urdf_of(more=joint("again", "base", "flange")), "link flange is moved by two joints"),
    "a link twice": (urdf_of(base=BASE + BASE), "has two links named base"),
    "a joint twice": (urdf_of((*ARM, LEFT, LEFT)), "has two"),
    "a link without a name": (urdf_of(more="<link/>"), "has a link without a name"),
    "an unknown parent": (urdf_of(changed(lift={"parent": "colunm"})), "joint lift with parent colunm"),
    "an unknown kind": (urdf_of(changed(lift={"kind": "hinge"})), 'joint lift of type "hinge"'),
    "NaN": (urdf_of(changed(lift={"origin": "0 0 nan"})), "which is not a finite number"),
    "infinity": (urdf_of(changed(lift={"limit": 'lower="-inf" upper="2" effort="1"'})), "which is not a finite number"),
    "two efforts": (
        urdf_of(changed(lift={"limit": 'effort="1 2"'})),
        'limit effort="1 2", which is not a finite number',
    ),
    "two numbers": (urdf_of(changed(lift={"origin": "0 0"})), 'has origin xyz="0 0", which must be 3 numbers'),
    "an axis of length 0": (urdf_of(changed(lift={"axis": "0 0 0"})), "joint lift with an axis of length 0"),
    "a negative mass": (urdf_of(changed(lift={"mass": -1.0})), "link upper with mass -1"),
    "a slide without limits": (
        urdf_of(changed(lift={"kind": "prismatic", "limit": ""})),
        "joint lift that slides without limits",
    ),
    "too few joints": (urdf_of(ARM[:2]), "its longest chain has 2 moving joints (turn, lift)"),
    "no arm": (urdf_of(changed(**{part.joint: {"kind": "fixed"} for part in ARM})), "0 moving joints (none)"),
    "millimetres": (
        urdf_of(changed(lift={"box": "60 60 360"})),
        "link upper with a shape of 360 m: URDFs are in metres",
    ),
    "an entity": (XXE + urdf_of(base=BASE.replace("base", "&secret;")), "joint turn with parent base"),
    "a NUL in a name": (urdf_of().replace("turn", "&#0;"), "it has &#0;"),
    "bytes": (bytes(range(256)) * 20, "is not XML"),
    "UTF-16": (urdf_of().encode("utf-16"), "is UTF-16"),
    "many links": (urdf_of(more="".join(f'<link name="l{i}"/>' for i in range(1001))), "at most 1000 are read"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_file_that_is_no_arm_is_refused_in_one_sentence_and_nothing_is_written(case, tmp_path):
    text, message = REFUSED[case]
    path, out = written(tmp_path, text), tmp_path / "conf"
    with pytest.raises(ConfigError, match=re.escape(message)) as refused:
        robot.main(["add", str(path), f"out={out}"])
    assert str(refused.value).startswith(str(path))
    assert "\n" not in str(refused.value)
    assert "root:" not in str(refused.value)
    assert not out.exists()


@pytest.mark.slow
def test_an_arm_that_cannot_point_down_is_refused_with_what_to_give(tmp_path):
    flat = {"axis": "0 0 1"}
    path = written(tmp_path, urdf_of(changed(lift=flat, bend=flat, nod=flat)))
    with pytest.raises(ConfigError, match=r"nowhere points down over the middle of the table .*: give another tip"):
        robot.main(["add", str(path), f"out={tmp_path}"])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "deixis robot add <urdf>"),
        (["ad", "a.urdf"], "did you mean 'add'"),
        (["add"], "needs what to add first"),
        (["add", "name=arm"], "needs what to add first"),
        (["add", "missing.urdf"], "missing.urdf cannot be read: No such file"),
        (["add", "{folder}"], "is not a regular file"),
        (["add", "{urdf}", "tip"], "arguments are written key=value"),
        (["add", "{urdf}", "tipp=flange"], "did you mean 'tip'"),
        (["add", "{urdf}", "tip=hand"], "tip=hand is not a link that twist moves"),
        (["add", "{urdf}", "joints=[turn,bend,lift]"], "bend does not carry lift"),
        (["add", "{urdf}", "joints=[turn,elbow]"], "has no joint elbow"),
        (["add", "{urdf}", "joints=turn"], "must be a list of names"),
        (["add", "{urdf}", "base=[0,0]"], "a list of numbers, like [0.1,0.2,0.3] of length 3"),
        (["add", "{urdf}", "rest=[0,0]"], "rest=[0.0, 0.0] must be 6 numbers"),
        (["add", "{urdf}", "gain=strong"], "gain=strong must be a number"),
        (["add", "{urdf}", "gain=[1"], "gain=[1: the value"),
        (["add", "{urdf}", "arm=1"], "arm=1: the URDF has 1 arms"),
        (["add", "{urdf}", "episodes=0"], "episodes=0 must be a whole number"),
        (["add", "{urdf}", "force=maybe"], "force=maybe must be true or false"),
        (["add", "{urdf}", "name=../arm"], "name=../arm must begin with a letter"),
        (["add", "{urdf}", "name=kuka"], "name=kuka is the name of one of this project's robots"),
        (["add", "{urdf}", "packages=nowhere"], "packages=nowhere is not a folder"),
        (["add", "{urdf}", "out={urdf}"], "is a file; choose another place"),
        (["check", "kukka"], "kukka is no robot"),
        (["check", "missing.yaml"], "missing.yaml cannot be read"),
    ],
)
def test_a_word_that_cannot_be_is_refused_with_what_would_be_right(words, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    urdf = written(tmp_path, urdf_of())
    with pytest.raises(ConfigError, match=re.escape(message)):
        robot.main([word.format(urdf=urdf, folder=tmp_path) for word in words])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["small.urdf"]


def test_a_drawing_becomes_a_robot_that_works_and_that_other_programs_find(tmp_path, monkeypatch, capsys):
    """No masses, efforts or limits, fingers with a mimic joint, a mesh that is missing, and odd names."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv(VARIABLE, raising=False)
    hand = (LEFT, changed((RIGHT,), right={"more": '<mimic joint="left"/>'})[0])
    parts = changed(
        (*ARM, *hand),
        turn={"kind": "continuous", "limit": "", "mass": None},
        lift={"mass": None, "limit": 'lower="-2.8" upper="2.8" effort="0" velocity="0"'},
    )
    text = urdf_of(parts, base=SHAPES.format("package://gone/base.stl")).replace('"flange"', '"flänge &amp; co"')
    path = written(tmp_path, text, "my arm.v2.urdf")
    monkeypatch.setattr(sys, "argv", ["deixis", "robot", "add", str(path), "episodes=24"])
    assert cli.main() == 0
    said = capsys.readouterr().out
    for part in (
        "no mass",
        "no efforts",
        "joints without limits (turn)",
        "package://gone/base.stl",
        "left and right on",
    ):
        assert part in said, part
    assert said.splitlines()[-1] == "deixis train --config-dir conf robot=my_arm task=nl_reach"
    values = yaml.safe_load((tmp_path / "conf/robot/my_arm.yaml").read_text())
    assert values["fingers"] == ["left", "right"]
    assert values["tip"] == "flänge & co"
    assert os.path.isabs(values["urdf"])
    with pytest.raises(ConfigError, match=r"my_arm\.yaml exists already; give force=true"):
        robot.main(["add", str(path)])
    robot.main(["check", "conf/robot/my_arm.yaml", "episodes=8"])
    assert capsys.readouterr().out.endswith("robot=my_arm works\n")
    with pytest.raises(RunError, match=r"robot=my_arm does not work: the expert of nl_reach succeeds in 0\.00"):
        robot.main(["check", "conf/robot/my_arm.yaml", "episodes=4", "max_speed=[.01,.01,.01,.01,.01,.01]"])


def test_a_folder_that_cannot_be_written_keeps_what_it_has(tmp_path, monkeypatch):
    from deixis import robot_trial

    out = tmp_path / "conf" / "robot"
    out.mkdir(parents=True)
    values = {"name": "small", "joints": ["a"]}

    def fails(path):
        raise OSError(28, "No space left on device")

    kept = robot_trial.atomic_file
    monkeypatch.setattr(robot_trial, "atomic_file", lambda path: fails(path) if path.suffix == ".yaml" else kept(path))
    with pytest.raises(ConfigError, match=r"small\.yaml cannot be written: No space left"):
        robot_trial.write_files({out / "small.urdf": b"<robot/>"}, values, out / "small.yaml", tmp_path / "a.urdf")
    assert list(out.iterdir()) == []


def test_in_a_terminal_the_user_chooses_by_number_or_name(monkeypatch, capsys):
    answers = iter(["9", "what", "2", "three", ""])
    monkeypatch.setattr("builtins.input", lambda prompt: next(answers))
    assert robot.choose("Which?", ["one", "two", "three"]) == 1
    assert robot.choose("Which?", ["one", "two", "three"]) == 2
    assert robot.choose("Which?", ["one", "two", "three"]) == 0
    assert "9 is none of them: give a number from 1 to 3" in capsys.readouterr().out


def test_a_damaged_file_is_read_or_refused():
    rng, whole = random.Random(0), urdf_of((*ARM, LEFT, RIGHT))
    values = ("", "0", "-1", "1e308", "nan", "0 0", "abc", "é", "&", "&#0;", "&#55296;", "../..", "base", "continuous")
    read = 0
    for _ in range(300):
        text = whole
        for _ in range(rng.randint(1, 3)):
            pattern = rng.choice((r'(?<==")[^"]*', r"<[^>]*>"))
            start, end = rng.choice([found.span() for found in re.finditer(pattern, text)])
            text = text[:start] + (rng.choice(values) if "=" in pattern else "") + text[end:]
        with suppress(URDFError):
            read += len(URDFTree(parse_urdf(text.encode())).arms()) > 0
    assert read > 30


def test_the_answers_of_the_user_are_what_is_written(tmp_path, monkeypatch, capsys):
    frame = '<link name="tool0"/><joint name="j" type="fixed"><parent link="flange"/><child link="tool0"/></joint>'
    monkeypatch.setattr("builtins.input", lambda prompt: "flange")
    wished = replace(robot.wishes([f"out={tmp_path}", "episodes=1"]), ask=True)
    added = robot.added(written(tmp_path, urdf_of(more=frame)), wished, print)
    assert "Which link carries the gripper?" in capsys.readouterr().out
    assert added.values["tip"] == "flange"


def test_a_file_that_is_too_large_is_not_read(tmp_path):
    path = tmp_path / "large.urdf"
    with path.open("wb") as file:
        file.truncate(2**30)
    with pytest.raises(ConfigError, match=r"large\.urdf cannot be read: it has 1,073,741,824 bytes"):
        robot.main(["add", str(path), f"out={tmp_path}"])


@pytest.mark.parametrize(
    ("path", "name"),
    [
        ("UR-10e.urdf", "ur_10e"),
        ("panda_v2.arm.urdf", "panda_v2"),
        ("iiwa/urdf/robot.urdf", "iiwa"),
        ("7dof.urdf", "x"),
    ],
)
def test_the_name_comes_from_the_file_or_its_folder(path, name, tmp_path):
    assert robot._name_of(tmp_path / "x" / path) == name
