"""The twin: messages, encoders and play in this process, and a policy on it in another one."""

from __future__ import annotations

import json
from contextlib import closing

import numpy as np
import pytest

import deploy
from core.errors import ConfigError, RunError
from core.overrides import compose
from deployment.arm import ArmError, make_arm
from deployment.connecting import connect, episode_of, split_arm
from deployment.safety import Decision
from deployment.twin import STALE, Channel, TwinCameras, TwinCommand, TwinConfig, TwinEnv
from envs import read_env
from envs.perception import Detections, UnusablePicture
from envs.sim.robot import read_kinematics

PERIOD = 0.05  # seconds


@pytest.fixture(scope="module")
def setup():
    return read_env(compose(["task=nl_pick_and_place"])).without_curriculum()


def test_messages_are_late_in_turn_and_lost():
    config = TwinConfig(latency=0.06, jitter=0.02, dropped=0.25)
    channel = Channel(config, np.random.default_rng(0))
    for i in range(1000):
        channel.send(i * 0.001, i)
    assert channel.receive(0.06) == []
    early = channel.receive(0.5)
    assert max(early) <= 440
    assert early != sorted(early)
    assert len(early) + len(channel.receive(2.0)) == pytest.approx(750, abs=50)


@pytest.fixture(scope="module")
def made(setup):
    config = TwinConfig(latency=0.06, encoder=1024, backlash=0.02)
    with closing(TwinEnv(setup, config)) as twin:
        yield twin


def test_a_command_takes_effect_late_and_is_reported_later(made):
    made.begin(1)
    start = made._arrays.angles[0].copy()
    began = made.time
    target = start.copy()
    target[6] += 0.3
    moved = []
    for i in range(1, 40):
        reports, _ = made.run(began + 0.01 * i, [TwinCommand(began, target, 1.0)] if i == 1 else [])
        moved += [(0.01 * i, report.state.angles[6] - start[6]) for report in reports]
    assert max(way for time, way in moved if time < 0.12) < 0.01
    assert moved[-1][1] == pytest.approx(0.3 - 0.01, abs=0.007)  # the play takes half of its width


def test_measurements_have_the_steps_of_the_encoder(made):
    made.begin(2)
    reports, _ = made.run(made.time + 0.3, [])
    turns = np.array([report.state.angles for report in reports]) / (2 * np.pi / 1024)
    np.testing.assert_allclose(turns, turns.round(), atol=1e-9)


@pytest.mark.parametrize("robot", ["robot=panda", "robot=so_arm gripper=hinge"])
def test_the_opening_of_fingers_and_jaws_is_measured_from_shut_to_open(robot):
    setup = read_env(compose(["task=nl_pick_and_place", *robot.split()])).without_curriculum()
    with closing(TwinEnv(setup, TwinConfig())) as twin:
        twin.begin(1)
        openings = []
        for wanted in (1.0, 0.0):
            reports, _ = twin.run(twin.time + 1.0, [TwinCommand(twin.time, twin._arrays.angles[0].copy(), wanted)])
            openings.append(reports[-1].state.opening)
    assert openings == pytest.approx([1.0, 0.0], abs=0.03)


def test_an_episode_follows_from_its_seed(made):
    seen = []
    for seed in (3, 4, 3):
        began = made.begin(seed).scene.positions
        reports, _ = made.run(made.time + 0.3, [])
        seen.append((began, reports[-1].state.angles))
    np.testing.assert_array_equal(seen[0][0], seen[2][0])
    np.testing.assert_array_equal(seen[0][1], seen[2][1])
    assert (seen[0][0] != seen[1][0]).any()


@pytest.mark.slow
def test_a_policy_on_a_late_twin_reaches_what_is_meant(tmp_path, capsys):
    words = ["checkpoint=nl_reach_kuka", "arm=sim", "arm.latency=0.06", "arm.gains=0.2", "episodes=4"]
    log = tmp_path / "commands.jsonl"
    result = deploy.main([*words, f"out={tmp_path / 'result.json'}", f"log={log}"])
    assert result["successes"] >= 3
    assert (tmp_path / "result.json").is_file()
    assert len(log.read_text().splitlines()) == result["steps"]
    told = deploy.main([*words[:3], "instruction=reach the cube nearest to you", f"log={tmp_path / 'told'}"])
    assert told["steps"] > 5
    assert "limits: joints at most 1.71 to 3.14 rad/s; gripper within x " in capsys.readouterr().out


@pytest.mark.slow
def test_an_episode_of_a_dry_run_ends_with_the_time_of_the_task():
    result = deploy.main(["checkpoint=nl_reach_kuka", "arm=sim", "safety.dry_run=true", "episodes=2"])
    assert (result["episodes"], result["successes"]) == (2, 0)
    assert result["steps"] == 2 * read_env(compose([])).task.max_steps


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["arm=simm"], "arm=simm is not an arm; did you mean 'sim'?"),
        ([], "arm=<name> is missing: arm=sim is the simulated twin"),
        (["arm.latency=0.1"], "arm.latency needs an arm: arm=sim"),
        (["arm=sim", "safety.speed=2"], "safety.speed=2.0 is out of range: it must be in [0.01, 1]"),
        (["arm=sim", "safety.sped=1"], "safety.sped is not a known key; did you mean 'speed'?"),
        (["arm=sim", "arm.latency=-1"], "arm.latency=-1.0 is out of range: it must be in [0, 1]"),
        (["arm=sim", "arm.late=1"], "arm.late is not a known key"),
        (["arm=sim", "arm.latency="], "arm.latency= has no value"),
        (["arm=sim", "arm=sim"], "arm is given twice"),
        (["arm=sim", "predict=maybe"], "predict=maybe must be true or false"),
        (["arm=sim", "episodes=0"], "episodes=0 is out of range"),
        (["arm=sim", "instruction=reach it", "episodes=3"], "episodes and out need no instruction"),
        (["arm=sim", "scene=/nosuch.yaml", "instruction=reach it"], "scene=/nosuch.yaml: "),
        (["arm=sim", "scene=it.yaml", "episodes=3"], "episodes of the twin draw their own scenes"),
        (["arm=sim", "safety.deadman=1"], "safety.deadman=1 needs a terminal"),
        (["arm=sim", "instruction=reach it", f"log={__file__}"], "exists already and is not overwritten"),
    ],
)
def test_bad_input_is_one_sentence(words, message):
    with pytest.raises(ConfigError) as refusal:
        deploy.main(["checkpoint=nl_reach_kuka", *words])
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("places", "message"),
    [
        ([[5.0, 0.0, 0.0]], "object 1 at 5, 0, 0 is outside of where the gripper gets to: x "),
        ([[0.45, 0.1, 0.0], [0.45, -0.1, -0.4]], "object 2 has z=-0.4 m, which is below the top of the table"),
        ([[0.45, 0.1, 0.0], [0.46, 0.1, 0.0]], "object 1 is inside object 2"),
    ],
)
def test_a_scene_that_cannot_be_there_is_refused(setup, tmp_path, places, message):
    colors = ("red", "green")
    lines = [f"- {{noun: cube, color: {colors[i]}, position: {place}}}" for i, place in enumerate(places)]
    (tmp_path / "scene.yaml").write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(ConfigError, match=message):
        episode_of(tmp_path / "scene.yaml", setup)


@pytest.mark.slow
def test_a_twin_begins_with_the_scene_of_a_file(tmp_path):
    place = [0.5, -0.2, 0.0]
    (tmp_path / "scene.yaml").write_text(f"- {{noun: cube, color: red, position: {place}}}", encoding="utf-8")
    words = ["checkpoint=nl_reach_kuka", "arm=sim", f"scene={tmp_path / 'scene.yaml'}", f"log={tmp_path / 'log'}"]
    assert deploy.main([*words, "instruction=reach the red cube"])["status"].startswith("Done")
    last = [json.loads(line) for line in (tmp_path / "log").read_text().splitlines()][-1]
    kinematics = read_kinematics(read_env(compose([])).robot)
    tip = kinematics.forward(np.array([last["measured"]])).position[0]
    assert np.linalg.norm(tip[:2] - place[:2]) < 0.05


@pytest.mark.slow
def test_an_instruction_that_is_not_done_is_an_error(tmp_path, monkeypatch):
    def run_out(session):
        session.env.world.decision = Decision(None, 1.0)
        session._end("Not done: out of time.")

    monkeypatch.setattr("demo.session.Session.step", run_out)
    words = ["checkpoint=nl_reach_kuka", "arm=sim", f"log={tmp_path / 'log'}"]
    with pytest.raises(RunError, match=r"Not done: out of time\. Commands: "):
        deploy.main([*words, "instruction=reach the cube nearest to you"])


def test_a_task_with_what_nothing_perceives_is_refused_before_an_arm_moves(monkeypatch):
    config = read_env(compose(["task=nl_open", "workspace=room"]))
    monkeypatch.setattr("deployment.twin.TwinArm.connect", lambda arm: pytest.fail("it was connected"))
    choice, _ = split_arm(["arm=sim"])
    with pytest.raises(ConfigError, match="furniture that moves"):
        connect(choice, config)


def test_an_arm_that_is_not_connected_says_so(setup):
    arm = make_arm("sim", {}, setup)
    with pytest.raises(ArmError, match="the twin is not connected"):
        arm.begin(0)


# ---- cameras


@pytest.fixture(scope="module")
def seeing_setup():
    return read_env(compose(["task=nl_reach", "perception=camera"])).without_curriculum()


def test_a_twin_with_cameras_sends_a_picture_of_each_in_a_control_period(seeing_setup):
    with closing(TwinEnv(seeing_setup, TwinConfig())) as twin:
        twin.begin(1)
        reports = [report for i in range(1, 9) for report in twin.run(twin.time + PERIOD / 2, [])[0]]
        pictured = [report for report in reports if report.pictures]
        assert 4 <= len(pictured) <= 6
        assert len(reports) > 2 * len(pictured)
        assert {name: each.shape for name, each in pictured[-1].pictures.items()} == {
            "front": (128, 128, 3),
            "side": (128, 128, 3),
        }


def test_what_a_twin_sees_is_read_from_where_its_arm_was(seeing_setup):
    given = []

    def note(views):
        given.append(views)
        return Detections.none()

    arm = make_arm("sim", {}, seeing_setup)
    cameras = TwinCameras(arm, seeing_setup, note)
    gripper = np.zeros(3), np.eye(3)
    assert cameras.angles(0) is None
    with pytest.raises(UnusablePicture, match="no picture has come from the cameras yet"):
        cameras.read(0, gripper)
    with closing(TwinEnv(seeing_setup, TwinConfig())) as twin:
        twin.begin(1)
        arm.pictured = twin.run(PERIOD, [])[0][0]
    assert (cameras.angles(0) == arm.pictured.state.angles).all()
    assert len(cameras.read(0, gripper)) == 0
    assert list(given[0]) == ["front", "side"]
    arm.clock._now += STALE + 0.5
    with pytest.raises(UnusablePicture, match=r"no picture has come from the cameras for 1\.\d s"):
        cameras.read(0, gripper)
