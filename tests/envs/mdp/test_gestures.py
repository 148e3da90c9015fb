"""Gestures that are hidden, moving, far off, or configured without effect."""

import numpy as np
import pytest
import torch

from core.errors import ConfigError
from core.overrides import apply, compose
from envs import make_env, read_env
from envs.experts import Oracle
from envs.tasks import EpisodeSpec
from language import parse, say
from tests.helpers.env_cases import act, make, task_of
from trainers.evaluation.instruction_ablations import run_to_end
from trainers.run.checkpoint import CheckpointError, check_fits, widths


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ["task=nl_reach_gesture", "gesture.switch=1", "gesture.frames=30", "gesture.noise_deg=0"],
        ["task=reach_gesture", "gesture.noise_deg=30"],
        ["task=nl_reach_gesture", "gesture.dropout=0.5", "gesture.switch=1"],
    ],
)
def test_the_oracle_acts_if_the_finger_points_at_no_object_of_the_sentence(words):
    env = make_env(words, num_worlds=16)
    successes = sum(int(run_to_end(env, Oracle(env), env.reset()).sum()) for _ in range(2))
    env.close()
    assert successes > 8  # of 32: better than going for any of three or six


@pytest.mark.slow
def test_only_shown_gestures_switch_and_stay_shown():
    env = make("kuka", "step", "nl_reach_gesture", "gesture.dropout=0.5", "gesture.switch=1", worlds=24)
    before = env.reset()
    td = before
    for _ in range(20):
        td = act(env, td, torch.zeros(24, 3))
    shown = before["gesture"][:, 6] > 0
    assert 0 < shown.sum() < 24
    assert torch.equal(td["gesture"][:, 6] > 0, shown)
    assert torch.equal(td["privileged", "referent"] != before["privileged", "referent"], shown)
    env.close()


def test_an_episode_without_a_gesture_shows_none_after_one_with_a_gesture():
    env = make("kuka", "step", "nl_reach_gesture", "gesture.switch=1", worlds=1)
    env.reset()
    drawn = env.task.draw(np.random.default_rng(0))
    bare = EpisodeSpec(scene=drawn.scene, referent=drawn.referent, kind=drawn.kind, sentence=drawn.sentence)
    td = env.start([bare], seed=0)
    for _ in range(20):
        assert (td["gesture"] == 0).all()
        assert td["privileged", "referent"][0] == env._state.referent[0]
        td = act(env, td, torch.zeros(1, 3))
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["workspace=collabtable", "gesture=ray", "gesture.switch=0.5"], r"gesture.switch=0.5 needs words that fit"),
        (["task=reach_gesture", "gesture.weights=my.npz"], r"gesture.weights=my.npz is read by source=camera alone"),
    ],
)
def test_a_setting_without_effect_is_an_error(words, message):
    with pytest.raises(ConfigError, match=message):
        make_env(words)


@pytest.mark.slow
def test_another_source_keeps_the_aiming_noise():
    trained = compose(["task=nl_reach_gesture", "gesture.noise_deg=3"])
    for word in ("gesture=camera", "gesture.source=camera"):
        changed = apply(trained, [word]).gesture
        assert (changed.source, changed.noise_deg) == ("camera", 3)


def test_a_config_without_the_gesture_group_is_an_error_that_says_what_to_give():
    old = {key: value for key, value in compose().items() if key != "gesture"}
    with pytest.raises(ConfigError, match=r"gesture is missing.*gesture=none"):
        read_env(old)
    assert read_env(apply(old, ["gesture=none"])).gesture.source == "none"


@pytest.mark.slow
@pytest.mark.parametrize(("trained", "judged"), [("none", "ray"), ("ray", "none")])
def test_a_policy_is_refused_with_another_gesture_source_than_it_was_trained_with(trained, judged):
    shapes, words = {}, []
    for source in (trained, judged):
        env = make("kuka", "step", "nl_reach", "workspace=collabtable", f"gesture={source}")
        shapes[source] = widths(env.observation_spec, env.action_spec)
        words = list(env.tokenizer.vocabulary)
        env.close()
    saved = {"config": {"policy": {"name": "grounded"}}, "vocabulary": words, "widths": shapes[trained]}
    check_fits(saved, words, shapes[trained])
    with pytest.raises(CheckpointError, match=r"another environment: gesture is .* and gesture it was trained with"):
        check_fits(saved, words, shapes[judged])


def test_a_sentence_with_a_gesture_is_rephrased_on_request():
    task, rng = task_of("nl_reach_gesture", "task.rephrased=true"), np.random.default_rng(0)
    for _ in range(30):
        episode = task.draw(rng)
        assert episode.heard == say(parse(episode.sentence))
