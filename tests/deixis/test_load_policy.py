"""deixis.load_policy, and the other public functions of the package."""

import re
from pathlib import Path

import gymnasium
import pytest
import torch
from tensordict import TensorDict

import deixis
import envs
import language
from core.errors import ConfigError, UseError
from trainers.export.policy_file import names

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text("utf-8")
EXAMPLES = [code for code in re.findall(r"^```python\n(.*?)^```$", README, re.M | re.S) if "load_policy" in code]


@pytest.fixture(scope="module")
def policy():
    return deixis.load_policy("nl_reach_kuka")


def rollout(policy, seed=0, steps=100):
    env = policy.make_env(num_worlds=4, seed=seed)
    try:
        return env.rollout(steps, policy, break_when_any_done=False)
    finally:
        env.close()


def test_an_observation_of_the_gymnasium_interface_is_refused_with_the_reason(policy):
    env = gymnasium.make("Deixis/NLReach-v0")
    observation, _ = env.reset(seed=0)
    env.close()
    frame = TensorDict({key: torch.as_tensor(value)[None] for key, value in observation.items()}, [1])
    with pytest.raises(UseError, match=r"the policy reads hold, which this observation lacks"):
        policy(frame)


@pytest.mark.slow
def test_the_example_of_readme_runs():
    assert len(EXAMPLES) == 1
    scope = {"__name__": "example"}
    exec(compile(EXAMPLES[0], "README.md", "exec"), scope)
    assert scope["rollout"]["next", "success"].any()


@pytest.mark.slow
def test_a_pretrained_policy_obeys(policy):
    seen = rollout(policy)["next"]
    first = seen["done"].long().argmax(1).flatten()  # the step that ends each world's first episode
    success = seen["success"][torch.arange(4), first]
    assert success.float().mean() >= 0.75


@pytest.mark.slow
def test_it_is_deterministic_by_default(policy):
    assert torch.equal(rollout(policy, steps=10)["action"], rollout(policy, steps=10)["action"])
    assert policy.out_keys == ["action"]


@pytest.mark.slow
def test_it_samples_where_that_is_asked_for(policy):
    sampling = deixis.load_policy("nl_reach_kuka", deterministic=False)
    assert not torch.equal(rollout(sampling, steps=3)["action"], rollout(policy, steps=3)["action"])


@pytest.mark.slow
def test_it_takes_a_folder_or_a_file(policy):
    folder = ROOT / "pretrained" / "nl_reach_kuka"
    for source in (folder, str(folder / "policy.safetensors")):
        assert deixis.load_policy(source).path == policy.path


@pytest.mark.slow
def test_its_environment_takes_overrides(policy):
    env = policy.make_env(num_worlds=2, overrides=["task.num_objects=5"], seed=3)
    try:
        now = policy(env.reset())
        assert now["objects"].shape[:2] == (2, 5)
        assert now["action"].shape == (2, 3)
        assert env.config.task.curriculum.share == 0
    finally:
        env.close()
    with pytest.raises(ConfigError, match="the checkpoint was trained with robot=kuka"):
        policy.make_env(overrides=["robot=panda"])


@pytest.mark.slow
def test_its_environment_says_several_instructions_one_after_another(policy):
    anything = deixis.load_policy("anything_kuka")
    env = anything.make_env(num_worlds=4, seed=1, instructions=2)
    try:
        steps = env.rollout(150, anything, break_when_any_done=False)["next"]
        assert (steps["success"] & ~steps["done"]).any()  # the first instruction was carried out, and the next one said
    finally:
        env.close()
    with pytest.raises(ConfigError, match="must be 1 in task"):
        policy.make_env(instructions=2)


def test_an_unknown_name_is_refused_with_all_names():
    with pytest.raises(ConfigError) as error:
        deixis.load_policy("nl_reach_kuca")
    for name in names():
        assert name in str(error.value)
    assert str(error.value).endswith("did you mean 'nl_reach_kuka'?")


def test_the_package_offers_the_functions_of_the_others():
    assert deixis.make_env is envs.make_env
    assert deixis.parse is language.parse
    assert deixis.describe is language.describe
    assert set(dir(deixis)) == set(deixis.__all__)
    with pytest.raises(AttributeError, match="no attribute 'mkae_env'"):
        deixis.mkae_env  # noqa: B018
