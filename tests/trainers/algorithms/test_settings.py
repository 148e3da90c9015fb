"""Algorithms are found by name, without torch."""

import subprocess
import sys
from pathlib import Path

import pytest

import trainers.algorithms
from core.errors import ConfigError
from core.overrides import compose
from tests.helpers.training_configs import CONF
from trainers.algorithms.algorithm import find_device
from trainers.algorithms.settings import read_algorithm, register
from trainers.config import read_training

ROOT = Path(__file__).parents[3]
ALGOS = sorted(path.stem for path in (CONF / "algo").glob("*.yaml"))


@pytest.mark.slow
@pytest.mark.parametrize("name", ALGOS)
def test_every_yaml_of_an_algorithm_is_read(name):
    algo = read_training(compose([f"algo={name}"])).algo
    assert algo.name == name.removesuffix("_rising_gamma")  # an option of PPO
    assert algo.on_policy == (not hasattr(algo, "buffer"))
    assert not (algo.squashes and algo.clips)


def test_the_yamls_include_our_own_algorithms_and_the_adapters():
    assert {"a2c", "crossq", "ppo", "redq", "sac", "td3", "tqc"} <= set(ALGOS)
    adapters = {type(read_training(compose([f"algo={name}"])).algo).__name__ for name in ALGOS}
    assert adapters == {"PPOConfig", "SACConfig", "BCConfig", "TorchRLOffPolicyConfig", "TorchRLOnPolicyConfig"}


REFUSED = """
import sys
from core.errors import ConfigError
from core.overrides import compose
from trainers.config import read_training
try:
    read_training(compose(["algo={name}", "algo.horizon=0"]))
except ConfigError as error:
    assert "horizon=0" in str(error), error
    sys.exit("torch" in sys.modules)
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ppo", "td3"])
def test_a_wrong_value_is_refused_without_torch(name):
    assert subprocess.run([sys.executable, "-c", REFUSED.format(name=name)], cwd=ROOT).returncode == 0


ADDED = """
from dataclasses import dataclass
from core.schema import within
from trainers.algorithms.on_policy import OnPolicyAlgorithm
from trainers.algorithms.settings import OnPolicyConfig, register

@register("added", builds="added.Added")
@dataclass(frozen=True, kw_only=True)
class AddedConfig(OnPolicyConfig):
    weight: float = within(0.0, 1.0)

class Added(OnPolicyAlgorithm):
    pass
"""


def test_an_algorithm_registers_its_settings_in_its_own_file(tmp_path, monkeypatch):
    (tmp_path / "added.py").write_text(ADDED)
    monkeypatch.setattr("trainers.algorithms.__path__", [*trainers.algorithms.__path__, str(tmp_path)])
    node = dict(compose(["algo=ppo"]).algo) | {"name": "added", "weight": 0.5}
    own = {"loss", "clip", "entropy", "critic_weight", "target_kl"}  # of PPO alone
    node = {key: value for key, value in node.items() if key not in own}
    config = read_algorithm(node)
    assert (config.weight, config.algorithm) == (0.5, "added.Added")
    with pytest.raises(ConfigError, match="weight=2"):
        read_algorithm(node | {"weight": 2.0})


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


@pytest.mark.parametrize("name", ["gpu", "abacus"])
def test_a_device_that_torch_does_not_know_is_refused_with_those_that_it_has(name):
    with pytest.raises(ConfigError, match=f"^device={name} cannot be used: torch knows no such device; choose cpu, or"):
        find_device(name)
