"""Algorithms are found by name, without torch."""

import subprocess
import sys
from pathlib import Path

import pytest

from core.errors import ConfigError
from core.overrides import compose
from tests.helpers.plans import CONF
from trainers.algorithms.registry import config_classes, read_algorithm, register
from trainers.config import read_plan

ROOT = Path(__file__).parents[3]
ALGOS = sorted(path.stem for path in (CONF / "algo").glob("*.yaml"))


@pytest.mark.parametrize("name", ALGOS)
def test_every_yaml_of_an_algorithm_is_read(name):
    algo = read_plan(compose([f"algo={name}"])).algo
    assert algo.name == name.removesuffix("_rising_gamma")  # an option of PPO
    assert algo.on_policy == (not hasattr(algo, "buffer"))
    assert not (algo.squashes and algo.clips)


def test_the_yamls_include_our_own_algorithms_and_the_adapters():
    assert {"a2c", "crossq", "ppo", "redq", "sac", "td3", "tqc"} <= set(ALGOS)
    assert {"ppo", "sac", "torchrl_off_policy", "torchrl_on_policy"} <= set(config_classes())


def test_reading_settings_imports_no_torch():
    code = "import sys, trainers.algorithms.registry as r; r.config_classes(); sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT).returncode == 0


def test_a_name_is_registered_once():
    with pytest.raises(ValueError, match="two algorithms are registered as 'ppo'"):
        register("ppo", builds="ppo.Other")(type("Other", (), {}))


@pytest.mark.parametrize(
    ("node", "message"),
    [
        ({"name": "pp"}, "algo.name=pp is not known; did you mean 'ppo'"),
        ({"name": "x", "adapter": "torchrl_of_policy"}, "algo.adapter=torchrl_of_policy is not known; did you mean"),
        ("ppo", "algo=ppo must be a group of keys"),
    ],
)
def test_an_unknown_algorithm_is_named_with_the_nearest_one(node, message):
    with pytest.raises(ConfigError, match=message):
        read_algorithm(node)
