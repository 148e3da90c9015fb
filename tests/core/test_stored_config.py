"""What a config that comes from a file may say, through every door that reads one."""

import copy
import importlib
import json
import pkgutil
import socket
import typing
from dataclasses import fields, is_dataclass
from pathlib import Path

import pytest
import torch
from omegaconf import OmegaConf

import deixis
import deploy
import evaluate
import record
import train
from core.composition import groups
from core.errors import ConfigError
from core.overrides import compose
from core.schema import Checked
from core.stored_config import PLACES, UNUSED, WORDS, config_from_file, place_overrides
from demo import session_config
from trainers.datasets import dataset
from trainers.export import policy_file
from trainers.run import checkpoint

SOURCE = Path("somebody/checkpoints/last.pt")
OWN_PROGRAMS = (
    "human.camera",
    "demo.session_config",
    "demo.study.study_config",
    "evaluate",
    "record",
    "deploy",
    "deixis.export",
    "deixis.calibrate",
    "envs.perception_training.__main__",
)  # their configs are command lines of their own, and no file's


def plain(*overrides):
    return OmegaConf.to_container(compose(overrides), resolve=True)


def leaves(node, prefix=""):
    for name, value in node.items():
        if isinstance(value, dict):
            yield from leaves(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def is_listed(key):
    return any(key == name or key.startswith(f"{name}.") for name in (*PLACES, *UNUSED, *WORDS))


def holds_text(value):
    return isinstance(value, str) or (isinstance(value, list) and any(map(holds_text, value)))


@pytest.mark.slow
def test_every_key_with_text_is_a_place_or_a_word():
    unlisted = set()
    for group, options in groups().items():
        for option in options:
            config = plain(f"{group}={option}")
            unlisted |= {key for key, value in leaves(config) if holds_text(value) and not is_listed(key)}
    assert unlisted == set()


def free_text(kind):
    """Whether a field of this type can hold any text."""
    return kind is str or any(map(free_text, typing.get_args(kind)))


def config_classes(cls=Checked):
    for each in cls.__subclasses__():
        yield each
        yield from config_classes(each)


def test_every_declared_field_with_free_text_is_a_place_or_a_word():
    for package in ("envs", "human", "trainers"):
        for module in pkgutil.walk_packages(importlib.import_module(package).__path__, f"{package}."):
            if not module.name.endswith(("__main__", "fork_server_setup")):
                importlib.import_module(module.name)
    last = {key.rpartition(".")[2] for key in (*PLACES, *UNUSED, *WORDS)}
    within = {"color_noun", "relation_noun", "phrases", "noun", "color", "role"}  # of task.held_out and task.objects
    names_only = {"rest", "parts", "furniture", "fittings", "reward"}  # groups whose names are free, not their values
    unlisted = set()
    for cls in config_classes():
        if (
            not is_dataclass(cls)
            or cls.__module__ in OWN_PROGRAMS
            or cls.__module__.startswith(("tests", "tools", "deployment"))
        ):
            continue
        hints = typing.get_type_hints(cls)
        unlisted |= {
            f"{cls.__name__}.{each.name}"
            for each in fields(cls)
            if free_text(hints[each.name]) and "one_of" not in each.metadata
        } - {f"{cls.__name__}.{name}" for name in last | within | names_only}
    assert unlisted == set()


def changed(key, value, config=None):
    config = copy.deepcopy(config or plain())
    OmegaConf.update(node := OmegaConf.create(config), key, value, force_add=True)
    return OmegaConf.to_container(node)


HOSTILE = [  # key and value, where a run that is resumed would use them
    ("device", "cuda:7"),
    ("logger", ["wandb"]),
    ("collector", {"name": "ray", "address": "192.0.2.1:6379"}),
    ("collector.name", "ray"),
    ("collector.address", "192.0.2.1:6379"),
    ("collector.dashboard", True),
    ("robot", {"package": "file", "urdf": "/etc/passwd"}),
    ("robot.urdf", "../../../etc/passwd"),
    ("robot.urdf", "/etc/passwd"),
    ("workspace.human", {"urdf": "/etc/passwd"}),
    ("gesture.weights", "/etc/passwd"),
    ("seed", "${oc.env:HOME}"),
    ("task._target_", "os.system"),
    ("task.name", "//192.0.2.1/share"),
    ("robot.name", "http://192.0.2.1/"),
    ("algo.loss", "/tmp/evil.Loss"),
]
IN_AN_ENV = [pair for pair in HOSTILE if pair[0].split(".")[0] not in ("device", "logger", "collector")]


@pytest.mark.parametrize(("key", "value"), HOSTILE)
def test_a_run_that_is_resumed_names_no_place(key, value):
    with pytest.raises(ConfigError, match=r"somebody/checkpoints/last\.pt") as caught:
        config_from_file(changed(key, value), SOURCE, to_train=True)
    assert "\n" not in str(caught.value)


def test_the_command_line_may_name_places():
    config = changed("collector", {"name": "ray", "address": "192.0.2.1:6379", "worlds": 8})
    for given in (["collector=local"], ["collector=ray", "collector.address=127.0.0.1:1"]):
        found = config_from_file(config, SOURCE, given, to_train=True)
        assert found["collector"]["address"] is None
    found = config_from_file(
        changed("robot", {"package": "file", "urdf": "mine.urdf"}), SOURCE, ["robot.urdf=mine.urdf"]
    )
    assert found["robot"]["urdf"] == "mine.urdf"


def test_a_job_that_resumes_is_given_its_places_again():
    words = ["robot=kuka", "collector=ray", "collector.address=127.0.0.1:1", "seed=1", "logger=[wandb]", "algo.lr=0.1"]
    assert place_overrides(words) == ["collector=ray", "collector.address=127.0.0.1:1", "logger=[wandb]"]


def test_a_policy_of_a_cluster_is_evaluated_without_the_cluster():
    config = changed("collector", {"name": "ray", "address": "192.0.2.1:6379", "worlds": 8})
    config |= {"device": "cuda:3", "logger": ["wandb"], "resume": "/x", "init": "/y"}
    found = config_from_file(config, SOURCE)
    assert found["collector"] == {"name": "local", "worlds": 8}
    assert (found["device"], found["logger"], found["resume"], found["init"]) == ("cpu", ["tensorboard"], None, None)


def test_what_a_run_saves_itself_is_accepted():
    for task in groups()["task"]:
        config = plain(f"task={task}")
        assert config_from_file(config, SOURCE, to_train=True) == config
    for robot in groups()["robot"]:
        assert config_from_file(plain(f"robot={robot}"), SOURCE) == plain(f"robot={robot}")


def test_a_config_from_before_the_named_cameras_gets_those_of_its_workspace():
    config, today = plain("workspace=room"), plain("workspace=room")["workspace"]["cameras"]
    own = config["workspace"].pop("cameras")["film"] | {"fov": 44.0}
    found = config_from_file(config | {"workspace": config["workspace"] | {"camera": own}}, SOURCE)
    assert found["workspace"] == config["workspace"] | {"cameras": today | {"film": own}}


@pytest.fixture(scope="module")
def policy_folder(tmp_path_factory):
    """A function that makes a copy of a pretrained policy with another config, and returns its folder."""
    payload = checkpoint.load(checkpoint.find(Path("nl_reach_kuka")))

    def make(key, value):
        folder = tmp_path_factory.mktemp("policy")
        content = policy_file.pack(payload | {"config": changed(key, value, payload["config"])}, checkpoint.FORMAT)
        (folder / policy_file.NAME).write_bytes(content)
        return folder

    return make


@pytest.fixture
def no_connection(monkeypatch):
    def refuse(*_):
        pytest.fail("connects")

    monkeypatch.setattr(socket.socket, "connect", refuse)
    monkeypatch.setattr(torch, "load", refuse)


def doors(folder):
    yield "load_policy", lambda: deixis.load_policy(folder)
    yield "evaluate", lambda: evaluate.main([f"checkpoint={folder}", "episodes=1"])
    yield "record", lambda: record.main([f"checkpoint={folder}", "episodes=1", f"out={folder / 'out'}"])
    yield "deploy", lambda: deploy.main([f"checkpoint={folder}", "arm=sim"])
    yield "play", lambda: session_config.check_choices({"checkpoint": str(folder)})


@pytest.mark.slow
@pytest.mark.parametrize(("key", "value"), IN_AN_ENV)
def test_no_program_uses_a_place_that_a_policy_names(key, value, policy_folder, no_connection):
    folder = policy_folder(key, value)
    for name, call in doors(folder):
        with pytest.raises(ConfigError) as caught:
            call()
        assert "\n" not in str(caught.value), name
        assert not (folder / "out").exists()


@pytest.mark.parametrize(("key", "value"), IN_AN_ENV)
def test_no_replay_uses_a_place_that_a_recording_names(key, value, tmp_path, no_connection):
    config = changed(key, value, {name: plain()[name] for name in ("robot", "task", "workspace", "gesture", "algo")})
    values = dict.fromkeys(dataset.METADATA_KEYS, 0) | {"config": config, "kind": "minari"}
    (tmp_path / dataset.METADATA).write_text(json.dumps(values))
    with pytest.raises(ConfigError, match=r"deixis\.json"):
        dataset.read(tmp_path)


@pytest.mark.slow
def test_training_does_not_resume_a_run_that_names_an_address(tmp_path, no_connection, monkeypatch):
    payload = {"config": changed("collector", {"name": "ray", "address": "192.0.2.1:6379"}), "counters": {"frames": 0}}
    monkeypatch.setattr(checkpoint, "_read", lambda path, is_policy: copy.deepcopy(payload))
    file = tmp_path / "checkpoints" / "last.pt"
    file.parent.mkdir()
    file.touch()
    with pytest.raises(ConfigError, match=r"asks for collector\.name=ray"):
        train.resumed(str(tmp_path), [f"resume={tmp_path}"])
    config, folder = train.resumed(str(tmp_path), [f"resume={tmp_path}", "collector=local"])
    assert (config.collector.name, folder) == ("local", tmp_path)


def test_the_words_that_a_resumed_run_needs_again_are_known_from_its_config():
    from core.stored_config import places_of

    config = {"device": "cuda:0", "logger": ["tensorboard"], "collector": {"name": "ray", "address": "10.0.0.1:6379"}}
    config |= {"robot": {"package": "file", "urdf": "/my robot/a.urdf"}, "gesture": {"weights": None}}
    wanted = ["device=cuda:0", "collector=ray", "collector.address=10.0.0.1:6379", "robot.urdf=/my robot/a.urdf"]
    assert places_of(config) == wanted
    assert places_of({"device": "cpu", "logger": [], "collector": {"name": "local"}}) == []
