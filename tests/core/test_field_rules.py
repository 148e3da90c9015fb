"""Every field of the config has a rule, so that no value is accepted that nothing can be done with."""

from __future__ import annotations

import copy
import dataclasses
import importlib
from collections.abc import Iterator
from typing import Any, get_args, get_type_hints

import pytest
from omegaconf import OmegaConf

from core.errors import ConfigError
from core.overrides import compose
from core.schema import Checked, read
from envs.config import read_env
from trainers.config import SweepConfig, read_training

MODULES = (
    "evaluate",
    "record",
    "deploy",
    "deployment.safety",
    "deployment.twin",
    "human.camera",
    "demo.session_config",
    "tools.gallery",
    "tools.reference_tables",
)
RULES = {"within", "one_of", "matches", "path", "checked_by"}


def classes(base: type = Checked) -> Iterator[type]:
    for cls in base.__subclasses__():
        if not cls.__module__.startswith("tests"):
            yield cls
        yield from classes(cls)


def test_every_field_has_a_rule_and_every_range_two_ends():
    for module in MODULES:
        importlib.import_module(module)
    found = list(dict.fromkeys(classes()))
    assert len(found) > 35
    for cls in found:
        hints = get_type_hints(cls)
        for field in dataclasses.fields(cls):
            kind = hints[field.name]
            nested = any(dataclasses.is_dataclass(each) for each in (kind, *get_args(kind)))
            name = f"{cls.__name__}.{field.name}"
            assert kind is bool or nested or RULES & {*field.metadata}, f"{name} has no rule"
            assert float("inf") not in field.metadata.get("within", ()), f"{name} has no upper end"


def plain(*words: str) -> dict[str, Any]:
    config: Any = OmegaConf.to_container(compose(words), resolve=True)
    return config


BASES = {words: plain(*words.split()) for words in ("", "gesture=camera", "collector=ray", "algo=sac")}


def refusal(base: str, key: str, value: Any) -> str:
    """Return the message for a value; "" if it is accepted."""
    config = copy.deepcopy(BASES[base])
    *groups, last = key.split(".")
    node = config
    for group in groups:
        node = node[group]
    node[last] = value
    try:
        read_env(config), read_training(config), read(SweepConfig, config["sweep"], "sweep")
    except ConfigError as error:
        return str(error)
    return ""


@pytest.mark.parametrize(
    ("base", "key", "value"),
    [
        ("", "device", "cpu:3"),
        ("", "device", ""),
        ("", "device", "cuda:x"),
        ("", "robot.name", "a/b"),
        ("", "robot.name", "../x"),
        ("", "robot.name", "a\nb"),
        ("", "robot.name", "x" * 5000),
        ("", "robot.tip", ""),
        ("", "robot.urdf", "x" * 5000),
        ("", "robot.urdf", "a\0b"),
        ("", "robot.grippers", ["magnet", "magnet"]),
        ("", "workspace.name", "a/b"),
        ("", "workspace.bounds", [0.9, 0.0, -0.6, 0.6, -0.1, 0.8]),
        ("", "workspace.bounds", [0.0, 0.2, -0.6, 0.6, -0.1, 0.8]),
        ("", "workspace.object_area", [0.32, 0.56, -3.0, 0.3]),
        ("", "workspace.cameras.film.yaw", 1e9),
        ("", "workspace.cameras.film.width", 0),
        ("", "workspace.furniture.top.contact", 2),
        ("", "task.varied", 2),
        ("", "task.nouns", ["cube", "cube"]),
        ("", "task.kinds", ["color"] * 1001),
        ("", "task.hold_steps", 1000),
        ("", "task.reward.success", [1]),
        ("", "policy.hidden", [64] * 33),
        ("", "policy.name", ["mlp"]),
        ("", "algo.max_grad_norm", 1e15),
        ("", "algo.grounding_batch", 10**15),
        ("", "algo.target_kl", 1e15),
        ("", "logger", ["tensorboard", "tensorboard"]),
        ("", "total_frames", 10**15),
        ("", "eval.episodes", 10**9),
        ("", "eval.interval", 10**15),
        ("", "checkpoint.every", 1e15),
        ("", "collector.timeout", 1e15),
        ("", "collector.restarts", 10**9),
        ("", "sweep.gpus", 1.5),
        ("gesture=camera", "gesture.weights", "a\0b"),
        ("collector=ray", "collector.cpus", 1.5),
        ("collector=ray", "collector.address", "http://a b/"),
        ("algo=sac", "algo.updates_per_frame", 0),
        ("algo=sac", "algo.buffer", 10**15),
    ],
    ids=lambda value: str(value)[:30].replace("\n", " ").replace("\0", " "),
)
def test_a_value_that_nothing_can_be_done_with_is_refused_in_one_sentence(base, key, value):
    message = refusal(base, key, value)
    assert message.startswith(key.rpartition(".")[0] or key) or key.rpartition(".")[2] in message
    assert message
    assert "\n" not in message
    assert len(message) < 1000
