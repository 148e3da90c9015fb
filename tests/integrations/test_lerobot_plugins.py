"""Environments and policies of Deixis in LeRobot's own evaluation. They need LeRobot, which begins at Python 3.12."""

from __future__ import annotations

from contextlib import closing
from importlib import import_module

import numpy as np
import pytest
import torch

from core.errors import RunError, UseError

envs = pytest.importorskip("lerobot.envs", reason="LeRobot begins at Python 3.12")
policies, evaluation = import_module("lerobot.policies"), import_module("lerobot.scripts.lerobot_eval")
DeixisEnvConfig = import_module("lerobot_env_deixis").DeixisEnvConfig
DeixisConfig = import_module("lerobot_policy_deixis").DeixisConfig

SMALL = ["task.num_objects=2", "workspace.cameras.film.width=64", "workspace.cameras.film.height=48"]
ALL_STATE = {"cameras": [], "objects": True}


def built(worlds):
    """What LeRobot's evaluation builds: so many worlds, a policy, and the steps around both."""
    env_config, config = DeixisEnvConfig(**ALL_STATE), DeixisConfig(checkpoint="nl_reach_kuka")
    steps = (*envs.make_env_pre_post_processors(env_config, config), *policies.make_pre_post_processors(config))
    names = ("env_preprocessor", "env_postprocessor", "preprocessor", "postprocessor")
    made = envs.make_env(env_config, n_envs=worlds)["deixis"][0]
    return made, policies.make_policy(config, env_cfg=env_config), dict(zip(names, steps, strict=True))


def test_the_features_of_an_environment_are_those_of_its_observations():
    config = DeixisEnvConfig(overrides=SMALL, objects=True)
    features = envs.env_to_policy_features(config)
    assert features["observation.images.film"].shape == (3, 48, 64)
    with closing(envs.make_env(config, n_envs=2)["deixis"][0]) as worlds:
        seen = envs.preprocess_observation(worlds.reset(seed=[3, 4])[0])
        assert {key: (2, *feature.shape) for key, feature in features.items() if key != "action"} == {
            key: tuple(value.shape) for key, value in seen.items()
        }
        assert features["action"].shape == worlds.single_action_space.shape
        assert all(words.startswith("reach the ") for words in worlds.call("task_description"))


def test_a_policy_from_pictures_gets_no_state_of_the_objects():
    assert set(envs.env_to_policy_features(DeixisEnvConfig(overrides=SMALL))) == {
        "observation.state",
        "observation.images.film",
        "action",
    }


def test_a_policy_gets_a_picture_of_each_camera_that_is_named():
    config = DeixisEnvConfig(overrides=SMALL, cameras=["front", "wrist"])
    names = {f"observation.images.{name}" for name in ("front", "wrist")}
    assert set(envs.env_to_policy_features(config)) == {"observation.state", "action", *names}
    with closing(envs.make_env(config)["deixis"][0]) as worlds:
        assert {key for key in envs.preprocess_observation(worlds.reset(seed=[3])[0]) if "images" in key} == names
    with pytest.raises(RunError, match="has no camera frnt; did you mean 'front'"):
        DeixisEnvConfig(cameras=["frnt"])


def test_a_seed_begins_the_same_episode_whatever_the_batch():
    config = DeixisEnvConfig(overrides=SMALL, **ALL_STATE)
    with (
        closing(envs.make_env(config, n_envs=2)["deixis"][0]) as two,
        closing(envs.make_env(config)["deixis"][0]) as one,
    ):
        first, second = two.reset(seed=[8, 9])[0], one.reset(seed=[9])[0]
        for key, value in second.items():
            np.testing.assert_array_equal(first[key][1], value[0])


def test_the_loop_of_lerobot_takes_the_actions_of_the_policy_itself():
    worlds, acting, steps = built(1)
    with closing(worlds), closing(acting.acting.make_env(1)) as own:
        for seed in (5, 6):
            taken = evaluation.rollout(worlds, acting, seeds=[seed], **steps)["action"]
            own.set_seed(seed)
            assert torch.equal(taken, own.rollout(60, acting.acting)["action"])


def test_its_evaluation_counts_the_successes():
    worlds, acting, steps = built(2)
    with closing(worlds):
        result = evaluation.eval_policy(worlds, acting, n_episodes=4, start_seed=1000, **steps)
    assert result["aggregated"]["pc_success"] == 100.0


def built_policy():
    return policies.make_policy(DeixisConfig(checkpoint="nl_reach_kuka"), env_cfg=DeixisEnvConfig(**ALL_STATE))


def batch_of(state, sentence):
    """An observation (1,) as LeRobot hands it on, with the words as text."""
    return {
        "observation.state": state["robot"],
        "observation.environment_state": state["objects"].reshape(1, -1),
        "observation.objects_mask": state["objects_mask"].float(),
        "observation.hold": state["hold"],
        "task": [sentence],
    }


def test_the_words_reach_the_policy_as_text_where_there_are_no_tokens():
    acting = built_policy()
    with closing(acting.acting.make_env(1)) as env:
        state = env.reset()
        action = acting.select_action(batch_of(state, env.sentence()))
        assert torch.equal(action, acting.acting(state)["action"])
        assert not torch.equal(action, acting.select_action(batch_of(state, "please")))


def test_a_policy_without_what_it_reads_says_what_is_missing():
    acting = built_policy()
    with closing(acting.acting.make_env(1)) as env:
        batch = batch_of(env.reset(), env.sentence())
    with pytest.raises(UseError, match=r"the policy reads observation\.\w+, which the environment does not give"):
        acting.select_action({"observation.state": batch["observation.state"]})
    with pytest.raises(UseError, match=r"observation.state has 22 numbers, but .* was trained with \[24\]"):
        acting.select_action(batch | {"observation.state": torch.zeros(1, 22)})


def test_a_saved_policy_needs_no_other_file(tmp_path):
    import_module("lerobot_policy_deixis.__main__").main(["nl_reach_kuka", str(tmp_path / "policy")])
    config = DeixisConfig.from_pretrained(tmp_path / "policy")
    config.pretrained_path = tmp_path / "policy"
    again = policies.make_policy(config, env_cfg=DeixisEnvConfig(**ALL_STATE))
    for one, other in zip(built_policy().parameters(), again.parameters(), strict=True):
        assert torch.equal(one, other)
    policies.make_pre_post_processors(
        config,
        pretrained_path=str(tmp_path / "policy"),
        preprocessor_overrides={"device_processor": {"device": "cpu"}, "rename_observations_processor": {}},
    )


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"task": "nl_rech"}, "nl_reach"),
        ({"overrides": ["task.num_objects=x"]}, "task.num_objects=x"),
        ({"checkpoint": "nl_reach_kuca"}, "checkpoint=nl_reach_kuca does not exist"),
    ],
)
def test_a_wrong_option_is_told_in_one_sentence(options, told):
    with pytest.raises(RunError, match=told):
        DeixisEnvConfig(**options)
