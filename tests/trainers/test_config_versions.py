"""Configs of earlier versions are read, and a key that did nothing is refused only where it has a value."""

import copy
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from core.errors import ConfigError
from core.overrides import check, compose
from tests.helpers.plans import config
from trainers.config import FORMER_KEYS, NEW_KEYS, read_plan
from trainers.export import policy_file
from trainers.run import checkpoint
from trainers.sweeps.runs import overrides_of

FORMER = [(key, option) for key, options in FORMER_KEYS.items() for option in options]


def of_earlier_version(key, option, value):
    saved = OmegaConf.create(config(option) if key.startswith("algo.") else config())
    OmegaConf.update(saved, key, value, force_add=True)
    return OmegaConf.to_container(saved)


@pytest.mark.parametrize(("key", "option"), FORMER)
def test_a_former_key_without_a_value_is_left_out(key, option):
    saved = of_earlier_version(key, option, None)
    before = copy.deepcopy(saved)
    assert read_plan(saved) == read_plan(config(option))
    assert saved == before


@pytest.mark.parametrize(("key", "option"), FORMER)
def test_a_former_key_with_a_value_is_refused_by_name(key, option):
    with pytest.raises(ConfigError, match=f"{key} is not a known key"):
        read_plan(of_earlier_version(key, option, 20.0))
    with pytest.raises(ConfigError, match=f"{key} is not a known key"):
        check([f"algo={option}", f"{key}=20"])


@pytest.mark.parametrize("option", ["ppo", "a2c"])
def test_algorithms_on_policy_keep_the_gain(option):
    assert read_plan(config(option, overrides=("algo.grounding_gain=null",))).algo.grounding_gain is None
    assert read_plan(config(option)).algo.grounding_gain == 20.0


@pytest.mark.parametrize("key", NEW_KEYS)
def test_a_new_key_has_its_default(key):
    saved = OmegaConf.to_container(compose(["algo=ppo"]), resolve=True)
    group, _, name = key.rpartition(".")
    del (saved[group] if group else saved)[name]
    assert read_plan(saved) == read_plan(compose(["algo=ppo"]))


@pytest.mark.parametrize("name", policy_file.names())
def test_the_config_of_every_pretrained_policy_is_read(name):
    saved = checkpoint.load(checkpoint.find(Path(name)))["config"]
    option = saved["algo"]["name"]
    assert read_plan(saved).algo.name == option
    for key, options in FORMER_KEYS.items():
        if option in options:  # saved by the version before the key went
            again = OmegaConf.to_container(OmegaConf.merge(saved, OmegaConf.from_dotlist([f"{key}=null"])))
            assert read_plan(again) == read_plan(saved)


def test_the_overrides_of_an_earlier_config_compose_now():
    saved = OmegaConf.to_container(compose(["algo=sac", "algo.lr=0.002"]), resolve=True)
    words = overrides_of(saved)
    saved["algo"]["grounding_gain"] = None
    assert overrides_of(saved) == words == ["algo=sac", "algo.lr=0.002"]
