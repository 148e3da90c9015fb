"""Instructions as other libraries read them, and goal positions in their place."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import envs  # noqa: F401  registers the ids
from core.errors import ConfigError, UseError
from language import SentenceEmbedding, Tokenizer

ID = "Deixis/NLReach-v0"
SHORT = ["task.max_steps=6"]


def test_the_text_is_the_sentence_and_the_embedding_that_of_its_tokens():
    seen = {}
    for how in ("tokens", "embedding", "text"):
        env = gymnasium.make(ID, instruction=how)
        observation, _ = env.reset(seed=1)
        assert observation in env.observation_space
        seen[how] = observation["instruction"]
        assert how != "text" or seen[how] == env.unwrapped.sentence
        env.close()
    tokenizer = Tokenizer.default()
    np.testing.assert_array_equal(seen["tokens"], tokenizer.encode(seen["text"]))
    np.testing.assert_array_equal(seen["embedding"], SentenceEmbedding(tokenizer)(seen["tokens"][None])[0])


@pytest.mark.slow
@pytest.mark.parametrize("settings", [{"instruction": "embedding"}, {"instruction": "text"}, {"goal": True}])
def test_the_environment_checker_passes(settings):
    env = gymnasium.make(ID, **settings)
    check_env(env.unwrapped, skip_render_check=True)
    env.close()


@pytest.mark.parametrize("settings", [{"instruction": "embedding"}, {"instruction": "text"}, {"goal": True}])
def test_worlds_have_the_last_observation_of_an_episode(settings):
    worlds = gymnasium.make_vec(ID, num_envs=2, overrides=SHORT, autoreset_mode="SameStep", **settings)
    first, _ = worlds.reset(seed=0)
    assert first in worlds.observation_space
    for _ in range(6):
        later, *_, infos = worlds.step(np.zeros(worlds.action_space.shape, np.float32))
    key = "desired_goal" if "goal" in settings else "instruction"
    for i in range(2):
        assert np.array_equal(infos["final_obs"][i][key], first[key][i])
    assert not np.array_equal(later[key], first[key])
    worlds.close()


def test_the_reward_of_a_goal_is_computed_again_for_any_number_of_goals():
    worlds = gymnasium.make_vec("Deixis/Push-v0", num_envs=3, goal=True)
    worlds.reset(seed=0)
    observation, rewards, terminated, _, infos = worlds.step(worlds.action_space.sample())
    assert worlds.observation_space.contains(observation)
    achieved, desired = observation["achieved_goal"], observation["desired_goal"]
    assert worlds.unwrapped.compute_reward(achieved, desired, {}).tolist() == rewards.tolist() == [-1.0] * 3
    assert worlds.unwrapped.compute_reward(achieved[:, None], achieved[:, None] + 0.02, None).shape == (3, 1)
    assert worlds.unwrapped.compute_reward(achieved[0], achieved[0], {}) == 0.0
    assert not terminated.any()
    assert not infos["is_success"].any()
    worlds.close()


def test_the_gripper_at_its_goal_is_a_success_and_the_observation_does_not_tell_the_goal():
    env = gymnasium.make("Deixis/Reach-v0", goal=True, overrides=["task.randomize.start=0.0"])
    observation, _ = env.reset(seed=0)
    for _ in range(60):
        way = observation["desired_goal"] - observation["achieved_goal"]
        action = np.clip(way / 0.03, -1, 1).astype(np.float32)
        observation, reward, terminated, truncated, info = env.step(action)
        assert not terminated
        assert info["is_success"] == (reward == 0.0)
        if truncated:
            break
    assert truncated
    assert info["is_success"]
    assert observation["observation"].shape == (24,)
    env.close()


def test_what_is_wrong_is_said():
    for id_, settings, text in (
        (ID, {"instruction": "texts"}, "did you mean 'text'"),
        (ID, {"instruction": "text", "goal": True}, "has no effect with goal=True"),
        ("Deixis/NLLift-v0", {"goal": True}, "task=nl_lift has none"),
        ("Deixis/NLStack-v0", {"goal": True}, "task=nl_stack has none"),
    ):
        with pytest.raises(ConfigError, match=text):
            gymnasium.make(id_, **settings)
    env = gymnasium.make(ID).unwrapped
    with pytest.raises(UseError, match="goal=True"):
        env.compute_reward(np.zeros(3), np.zeros(3), {})
    env.close()
