"""A person chooses with keys, and the robot goes where they chose."""

from __future__ import annotations

import json

import numpy as np
import pytest

import envs.interactive.by_hand
import evaluate
from conf.schema import ConfigError
from envs import read_env
from envs.experts import Oracle
from envs.experts.reach import ReachExpert
from envs.interactive.by_hand import HandEnv, play
from human import NothingPointedAt, RecordingDisplay, ScriptedKeys
from tests.helpers.env_cases import compose

STEPS = (0.10, 0.01)


def made(*overrides, seed=0):
    return HandEnv(read_env(compose([*overrides])), seed, window=False)


@pytest.fixture(scope="module")
def env():
    env = made("task=reach_gesture", "gesture.frames=8")
    yield env
    env.close()


def keys_to(env, place):
    """The presses that bring the finger from where it starts to within a centimetre of place (3,)."""
    x0, x1, y0, y1 = env.config.workspace.object_area
    offset = place[:2] - np.array([(x0 + x1) / 2, (y0 + y1) / 2])
    pressed = ["1"]
    for way, names in zip(offset, (("left", "right"), ("down", "up")), strict=True):
        pressed += [names[int(way > 0)]] * round(abs(way) / 0.01)
    return pressed


def scenes(env, count):
    """The objects' places in the next `count` episodes, which `play` begins with the same seed."""
    env.set_seed(5)
    found = []
    for _ in range(count):
        env.reset()
        found.append(env.scene().positions)
    env.set_seed(5)
    return found


def test_each_object_in_turn_is_reached_when_it_is_chosen(env):
    places = scenes(env, 3)
    script = [key for k in range(3) for key in [*keys_to(env, places[k][k]), "enter", "enter"]]
    view = RecordingDisplay()
    played = play(env, Oracle(env), 3, ScriptedKeys(script), view, hurry=True)
    assert [each.ending for each in played] == ["success"] * 3
    assert view.beam is None
    assert all(f"meant: {each.meant}" in [line for page in view.pages for line in page] for each in played)


def test_the_scene_is_judged_by_what_was_chosen(env):
    """An arm that goes elsewhere fails."""
    places = scenes(env, 1)[0]
    state = env.reset()
    for index, place in enumerate(places):
        env.point(place)
        state = env.mean(index)
        slot = int(state["privileged", "referent"][0])
        np.testing.assert_allclose(state["objects"][0, slot, :3], place, atol=1e-3)
    expert = ReachExpert(env)
    goal = state["objects"][:, int(np.flatnonzero(np.arange(3) != slot)[0]), :3].numpy().astype(float)
    while not state["done"].any():
        state = env.step(state.set("action", expert.towards(goal)))["next"]
    assert state["wrong_object"].all()


def test_pointing_moves_the_arm_and_what_is_observed(env):
    env.reset()
    steps = env.elapsed
    origin, direction = env.point(np.array([0.4, 0.1, 0.02]))
    state = env.mean(0)
    np.testing.assert_allclose(state["gesture"][0, :6], [*origin, *direction], atol=1e-6)
    assert state["gesture"][0, 6] == 1
    before = state["gesture"].clone()
    env.point(np.array([0.4, -0.1, 0.02]))
    assert (env.mean(0)["gesture"] != before).any()
    assert (env.elapsed == steps).all()


def test_a_finger_moved_by_hand_stays_where_it_is():
    env = made("task=reach_gesture", "gesture.switch=1", "gesture.dropout=1")
    try:
        env.reset()
        env.point(np.array([0.4, 0.1, 0.02]))
        state = env.mean(1)
        ray, meant = state["gesture"].clone(), state["privileged", "referent"].clone()
        for _ in range(20):
            state = env.step(state.set("action", env.towards(env.gripper)))["next"]
        assert (state["gesture"] == ray).all()
        assert state["gesture"][0, 6] == 1
        assert (state["privileged", "referent"] == meant).all()
    finally:
        env.close()


def test_words_that_fit_nothing_that_is_shown_are_asked_about():
    env = made("task=nl_reach_gesture")
    try:
        env.reset()
        pointing = envs.interactive.by_hand.Pointing(env)
        scene = env.scene()
        fitting, refused = [], []
        for index, place in enumerate(scene.positions):
            pointing.point(place)
            assert pointing.nearest() == index
            assert scene[index].color in pointing.name(index)
            try:
                fitting.append(pointing.meant())
            except NothingPointedAt:
                refused.append(index)
        assert len(fitting) == 2
        pointing.point(scene.positions[refused[0]])
        with pytest.raises(NothingPointedAt, match="point at it"):
            pointing.meant()
    finally:
        env.close()


def test_a_task_in_which_nobody_points_is_refused():
    with pytest.raises(ConfigError, match=r"by_hand=true needs a person.*nl_reach.*gesture.source=none; take "):
        made("task=nl_reach")


@pytest.mark.parametrize(
    ("display", "said"), [(None, "DISPLAY is not set"), (":4711", "DISPLAY=:4711 cannot be opened")]
)
def test_without_a_display_there_is_one_clear_line(display, said, monkeypatch):
    if display is None:
        monkeypatch.delenv("DISPLAY", raising=False)
    else:
        monkeypatch.setenv("DISPLAY", display)
    with pytest.raises(ConfigError, match=f"by_hand=true needs a display: ({said}|libX11 is not installed)"):
        HandEnv(read_env(compose(["task=reach_gesture"])))


def test_evaluate_saves_what_was_played_by_hand(monkeypatch, tmp_path):
    import train
    from trainers.run import checkpoint

    tiny = ["task=reach_gesture", "total_frames=64", "collector.workers=1", "collector.worlds=4", "algo.horizon=16"]
    tiny += ["eval.episodes=4", "eval.interval_episodes=4", "eval.worlds=4", "eval.video_episodes=0", "logger=[]"]
    train.run(compose([*tiny, "algo.minibatch=32"]), tmp_path)
    monkeypatch.setattr(envs.interactive.by_hand, "HandEnv", lambda config, seed: _unseen(config, seed))
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


class _unseen(HandEnv):
    def __init__(self, config, seed):
        super().__init__(config, seed, window=False)

    def face(self):
        return ScriptedKeys(["up", "enter", "enter", "left", "enter", "enter", "escape"]), RecordingDisplay()
