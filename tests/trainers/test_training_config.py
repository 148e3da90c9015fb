import ast
import subprocess
import sys
from pathlib import Path

import pytest

from core.errors import ConfigError
from core.overrides import compose
from tests.helpers.training_configs import config, training
from trainers.config import frames_per_batch, read_training, workers

ROOM = Path(__file__).parents[2] / "trainers"


@pytest.mark.parametrize("algo", ["ppo", "sac"])
@pytest.mark.parametrize("policy", ["grounded", "mlp"])
def test_every_yaml_is_read(algo, policy):
    assert training(algo, policy).algo.name == algo


def test_values_are_checked_before_torch_is_loaded():
    code = "import sys, trainers.config; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOM.parent).returncode == 0


@pytest.mark.parametrize("path", sorted(ROOM.glob("*.py")), ids=lambda path: path.stem)
def test_trainers_import_no_environment_language_or_human(path):
    for node in ast.walk(ast.parse(path.read_text())):
        names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        assert not {name.split(".")[0] for name in names} & {"language", "human", "envs"}


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("algo.lr=-1", "algo.lr=-1"),
        ("algo.name=pp", "did you mean 'ppo'"),
        ("algo.epoch=3", "did you mean 'epochs'"),
        ("algo.minibatch=100000", "algo.minibatch=100000 is more than the 128 frames"),
        ("policy.activation=relo", "did you mean 'relu'"),
        ("total_frames=0", "total_frames=0"),
        ("total_frames=7", "total_frames=7 must be at least collector.worlds=8"),
        ("logger=[tensorbord]", "did you mean 'tensorboard'"),
        ("collector.worlds=many", "collector.worlds=many"),
        ("collector.workers=3", "collector.worlds=8 cannot be shared evenly by collector.workers=3"),
    ],
)
def test_a_wrong_value_is_named(override, message):
    with pytest.raises(ConfigError, match=message.replace("[", r"\[")):
        read_training(config(overrides=(override,)))


def test_frames_of_a_batch():
    assert frames_per_batch(training()) == 8 * 16


@pytest.mark.slow
@pytest.mark.parametrize(("cores", "count"), [(1, 1), (2, 2), (3, 2), (6, 4), (64, 8)])
def test_a_batch_is_the_same_on_any_number_of_cores(cores, count, monkeypatch):
    monkeypatch.setattr("trainers.config.cores", lambda: cores)
    plans = [training(), training(overrides=("collector.workers=0",)), training(overrides=("collector.workers=4",))]
    assert [frames_per_batch(each) for each in plans] == [8 * 16] * 3
    assert [workers(each.collector) for each in plans] == [1, count, 4]


def test_a_missing_ray_is_told_before_anything_is_built(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(
        ConfigError, match=r'collector=ray needs ray, which is not installed: pip install -e "\.\[cluster'
    ):
        read_training(compose(["collector=ray"]))


def test_a_config_that_lacks_a_group_is_refused_by_name():
    saved = config()
    del saved["checkpoint"]
    with pytest.raises(ConfigError, match="the config lacks checkpoint"):
        read_training(saved)
