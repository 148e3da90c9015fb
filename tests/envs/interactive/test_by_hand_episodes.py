"""A person chooses the referent with keys, and the robot goes there."""

from __future__ import annotations

import json

import numpy as np
import pytest

import envs.interactive.by_hand
import evaluate
from core.errors import ConfigError
from envs import read_env
from envs.experts import Oracle
from envs.experts.reach import ReachExpert
from envs.interactive.by_hand import ByHandEnv, ScenePointer, run_by_hand
from human import NothingPointedAt
from tests.helpers.env_cases import compose
from tests.helpers.keys import RecordingDisplay, ScriptedKeys

STEPS = (0.10, 0.01)


def make_by_hand(*overrides, seed=0):
    return ByHandEnv(read_env(compose([*overrides])), seed, window=False)


@pytest.fixture(scope="module")
def env():
    env = make_by_hand("task=reach_gesture", "gesture.frames=8")
    yield env
    env.close()


def keys_to(env, place):
    """Keys that move the finger from its start to within a centimetre of place (3,)."""
    x0, x1, y0, y1 = env.config.workspace.object_area
    offset = place[:2] - np.array([(x0 + x1) / 2, (y0 + y1) / 2])
    pressed = ["1"]
    for distance, names in zip(offset, (("left", "right"), ("down", "up")), strict=True):
        pressed += [names[int(distance > 0)]] * round(abs(distance) / 0.01)
    return pressed


def next_positions(env, count):
    """Positions of the objects in the next `count` episodes, which `run_by_hand` starts with the same seed."""
    env.set_seed(5)
    found = []
    for _ in range(count):
        env.reset()
        found.append(env.scene().positions)
    env.set_seed(5)
    return found


def test_the_chosen_object_is_reached(env):
    places = next_positions(env, 3)
    script = [key for k in range(3) for key in [*keys_to(env, places[k][k]), "enter", "enter"]]
    display = RecordingDisplay()
    results = run_by_hand(env, Oracle(env), 3, keys=ScriptedKeys(script), display=display, real_time=False)
    assert [each.ending for each in results] == ["success"] * 3
    assert display.beam is None
    assert all(f"meant: {each.referent}" in [line for page in display.pages for line in page] for each in results)


def test_reaching_another_object_than_the_chosen_one_fails(env):
    places = next_positions(env, 1)[0]
    state = env.reset()
    for index, place in enumerate(places):
        env.point_at(place)
        state = env.set_referent(index)
        slot = int(state["privileged", "referent"][0])
        np.testing.assert_allclose(state["objects"][0, slot, :3], place, atol=1e-3)
    expert = ReachExpert(env)
    goal = state["objects"][:, int(np.flatnonzero(np.arange(3) != slot)[0]), :3].numpy().astype(float)
    while not state["done"].any():
        state = env.step(state.set("action", env.towards(expert.over(goal))))["next"]
    assert state["wrong_object"].all()


def test_pointing_changes_the_observed_gesture_and_takes_no_control_step(env):
    env.reset()
    steps = env.elapsed
    origin, direction = env.point_at(np.array([0.4, 0.1, 0.02]))
    state = env.set_referent(0)
    np.testing.assert_allclose(state["gesture"][0, :6], [*origin, *direction], atol=1e-6)
    assert state["gesture"][0, 6] == 1
    before = state["gesture"].clone()
    env.point_at(np.array([0.4, -0.1, 0.02]))
    assert (env.set_referent(0)["gesture"] != before).any()
    assert (env.elapsed == steps).all()


def test_a_finger_moved_by_hand_keeps_its_ray_and_referent():
    env = make_by_hand("task=reach_gesture", "gesture.switch=1", "gesture.dropout=1")
    try:
        env.reset()
        env.point_at(np.array([0.4, 0.1, 0.02]))
        state = env.set_referent(1)
        ray, meant = state["gesture"].clone(), state["privileged", "referent"].clone()
        for _ in range(20):
            state = env.step(state.set("action", env.towards(env.gripper)))["next"]
        assert (state["gesture"] == ray).all()
        assert state["gesture"][0, 6] == 1
        assert (state["privileged", "referent"] == meant).all()
    finally:
        env.close()


def test_pointing_at_an_object_that_the_words_exclude_raises():
    env = make_by_hand("task=nl_reach_gesture")
    try:
        env.reset()
        pointer = ScenePointer(env)
        scene = env.scene()
        fitting, refused = [], []
        for index, place in enumerate(scene.positions):
            pointer.point(place)
            assert pointer.nearest() == index
            assert scene[index].color in pointer.name(index)
            try:
                fitting.append(pointer.meant())
            except NothingPointedAt:
                refused.append(index)
        assert len(fitting) == 2
        pointer.point(scene.positions[refused[0]])
        with pytest.raises(NothingPointedAt, match="point at it"):
            pointer.meant()
    finally:
        env.close()


def test_a_task_without_pointing_is_refused():
    with pytest.raises(ConfigError, match=r"by_hand=true requires a person.*nl_reach.*gesture.source=none; take "):
        make_by_hand("task=nl_reach")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("display", "message"), [(None, "DISPLAY is not set"), (":4711", "DISPLAY=:4711 cannot be opened")]
)
def test_without_a_display_the_error_is_one_line(display, message, monkeypatch):
    if display is None:
        monkeypatch.delenv("DISPLAY", raising=False)
    else:
        monkeypatch.setenv("DISPLAY", display)
    with pytest.raises(ConfigError, match=f"by_hand=true needs a display: ({message}|libX11 is not installed)"):
        ByHandEnv(read_env(compose(["task=reach_gesture"])))


@pytest.mark.slow
def test_evaluate_saves_the_episodes_by_hand(monkeypatch, tmp_path):
    import train
    from trainers.run import checkpoint

    tiny = ["task=reach_gesture", "total_frames=64", "collector.workers=1", "collector.worlds=4", "algo.horizon=16"]
    tiny += ["eval.episodes=4", "eval.interval_episodes=4", "eval.worlds=4", "eval.video_episodes=0", "logger=[]"]
    train.run(compose([*tiny, "algo.minibatch=32"]), tmp_path)
    monkeypatch.setattr(envs.interactive.by_hand, "ByHandEnv", lambda config, seed: WindowlessEnv(config, seed))
    report = evaluate.main([f"checkpoint={tmp_path}", "by_hand=true", "episodes=3", "reader=oracle"])
    assert checkpoint.find(tmp_path).is_file()
    assert (report["by_hand"], report["episodes"], report["success_at_end"]) == (True, 2, 1.0)
    saved = json.loads((tmp_path / "evaluation_1.json").read_text())
    assert saved == report
    assert [each["success"] for each in saved["played"]] == [True, True]
    with pytest.raises(ConfigError, match="by_hand=true needs splits=false"):
        evaluate.main([f"checkpoint={tmp_path}", "by_hand=true", "in_turn=3"])
    with pytest.raises(ConfigError, match=r"gesture\.source=none"):
        evaluate.main([f"checkpoint={tmp_path}", "by_hand=true", "gesture=none", "task=nl_reach"])


class WindowlessEnv(ByHandEnv):
    def __init__(self, config, seed):
        super().__init__(config, seed, window=False)

    def user_interface(self):
        return ScriptedKeys(["up", "enter", "enter", "left", "enter", "enter", "escape"]), RecordingDisplay()
