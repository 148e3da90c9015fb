"""A policy alone in a folder: what is in it, its card, and that it acts as the run it came from."""

from __future__ import annotations

import json
import re
import shutil

import pytest
import torch
from omegaconf import OmegaConf
from safetensors.torch import save_file

import evaluate
import train
from conf.overrides import compose
from conf.schema import ConfigError
from tests.helpers.tiny_run import TINY
from trainers.export import publish
from trainers.run import checkpoint
from trainers.run.checkpoint import CheckpointError
from trainers.run.train_loop import fit
from trainers.sweeps.overrides_of import overrides_of


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "run"
    train.run(compose([*TINY, "seed=3", "policy.width=16", "resume=null"]), folder)
    return folder


@pytest.fixture(scope="module")
def policy(run):
    return publish.publish(run, run.parent / "pretrained" / "tiny")


@pytest.fixture
def copy(run, tmp_path):
    return shutil.copytree(run, tmp_path / "copy")


def test_it_holds_the_policy_and_nothing_that_only_training_needs(run, policy):
    assert {file.name for file in policy.parent.rglob("*")} == {"tiny", "README.md", "policy.safetensors"}
    whole, alone = (checkpoint.load(checkpoint.find(folder)) for folder in (run, policy))
    assert set(alone) == {"format", "config", "vocabulary", "widths", "algorithm"}
    assert set(alone["algorithm"]) == {"policy"} < set(whole["algorithm"])
    for name in ("config", "vocabulary", "widths"):
        assert alone[name] == whole[name]
    weights = whole["algorithm"]["policy"]
    assert set(weights) == set(alone["algorithm"]["policy"])
    assert all(torch.equal(weights[name], tensor) for name, tensor in alone["algorithm"]["policy"].items())


def test_it_is_judged_as_its_run_is_and_stays_as_it_was(run, policy, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    few = ["episodes=6", "worlds=3"]
    reports = [evaluate.main([f"checkpoint={place}", *few]) for place in (run, policy, policy / "policy.safetensors")]
    for report in reports:
        del report["checkpoint"]
    assert reports[0] == reports[1] == reports[2]
    assert len(list(policy.iterdir())) == 2
    assert {file.name for file in (tmp_path / "outputs").iterdir()} == {
        "evaluation_tiny_1.json",
        "evaluation_tiny_2.json",
    }


def test_the_card_says_what_the_run_came_to(run, policy):
    card, final = (policy / "README.md").read_text(), json.loads((run / "eval.json").read_text())
    low, high = final["ci95"]
    assert f"| {final['success_at_end']:.3f} ({low:.3f}-{high:.3f}) | {final['wrong_object']:.3f} | 4 |" in card
    assert "| frames | 256, in 0 min" in card
    assert "bring the gripper to the object that the sentence names" in card
    assert "* `policy.width=16`" in card
    assert re.search(r"\| date \| \d{4}-\d\d-\d\d \|", card)
    assert f"| torch | {torch.__version__} |" in card
    (command,) = re.findall(r"^python train.py (.*?)   #", card, re.MULTILINE)
    again = train_keys(compose(command.split()))
    assert again == train_keys(compose(["seed=3", *(w for w in TINY if "eval" not in w), "policy.width=16"]))


def train_keys(config):
    """What a command must say to get the same training."""
    plain = OmegaConf.to_container(config, resolve=True)
    aside = ("eval", "logger", "device", "resume", "sweep", "update_threads")
    plain["collector"].pop("workers")
    return {name: value for name, value in plain.items() if name not in aside}


@pytest.mark.parametrize(
    "words",
    [
        ["scenario=4", "task.reward.lift=0"],
        ["task=nl_reach_gesture", "robot=jaco", "gesture.noise_deg=3.5", "task.reward.time=-1e-05"],
        ["task=nl_reach_large", "algo=sac", "task.held_out.phrases=['touch {object}', ball]", "task.varied=false"],
    ],
)
def test_a_config_is_told_as_the_words_that_compose_it(words):
    config = compose(words)
    told = overrides_of(OmegaConf.to_container(config, resolve=True))
    assert train_keys(compose(told)) == train_keys(config)
    assert len(told) == len(words)


@pytest.mark.parametrize(
    ("prepare", "said"),
    [
        (lambda run, _: (run / "eval.json").unlink(), "not finished: it has no eval.json"),
        (lambda run, _: rewrite(run / "eval.json", frames=128), "resumed after its eval.json: 128 frames there, 256"),
        (lambda run, _: (run / "checkpoints" / "last.pt").write_bytes(b"x"), "damaged"),
        (lambda run, _: (run / "eval.json").write_text("{"), "damaged"),
        (lambda _, place: place.mkdir(parents=True), "exists already"),
        (lambda _, place: place.parent.write_text(""), "cannot be written"),
    ],
)
def test_what_cannot_be_published_is_refused_and_leaves_nothing(copy, tmp_path, prepare, said):
    place = tmp_path / "pretrained" / "name"
    prepare(copy, place)
    with pytest.raises(ConfigError, match=said) as error:
        publish.main([str(copy), str(place)])
    assert "\n" not in str(error.value)
    assert not list(place.rglob("*")) if place.is_dir() else not list(tmp_path.rglob("*.safetensors"))


def rewrite(file, **values):
    file.write_text(json.dumps(json.loads(file.read_text()) | values))


def test_a_policy_too_large_for_a_repository_is_refused(run, tmp_path, monkeypatch):
    monkeypatch.setattr(publish, "MAX_BYTES", 10_000)
    with pytest.raises(ConfigError, match=r"policy.safetensors would have [\d,]+ bytes; .* less than 10,000"):
        publish.publish(run, tmp_path / "large")
    assert not list(tmp_path.iterdir())


def test_a_directory_of_runs_is_refused(run, tmp_path):
    with pytest.raises(ConfigError, match="holds several runs"):
        publish.publish(run.parent, tmp_path / "name")


def test_training_cannot_go_on_from_a_policy_alone(policy, tmp_path):
    with pytest.raises(CheckpointError, match="a published policy without optimiser and critic"):
        train.resumed(str(policy), [])
    from tests.helpers.fake_env import FakeEnv
    from tests.helpers.plans import plan

    with pytest.raises(CheckpointError, match="a published policy"):
        fit(plan(), FakeEnv, tmp_path, {}, [], resume=checkpoint.find(policy), progress=False)


@pytest.mark.parametrize("damage", ["weight", "text", "header", "cut", "words", "empty"])
def test_a_damaged_policy_is_refused(policy, tmp_path, damage):
    path = shutil.copytree(policy, tmp_path / "copy") / "policy.safetensors"
    data = bytearray(path.read_bytes())
    place = {"weight": len(data) - 7, "text": data.index(b"max_steps") + 14, "header": 3}.get(damage, 0)
    data[place] ^= 2
    path.write_bytes({"cut": data[:-100], "words": b"hello", "empty": b""}.get(damage, data))
    with pytest.raises(ConfigError, match="is damaged") as error:
        evaluate.main([f"checkpoint={path.parent}"])
    assert "\n" not in str(error.value)


def test_another_safetensors_file_is_refused(tmp_path):
    save_file({"w": torch.zeros(3)}, tmp_path / "other.safetensors", {"format": "pt"})
    with pytest.raises(CheckpointError, match="not a checkpoint of this project: its metadata has no deixis"):
        checkpoint.load(tmp_path / "other.safetensors")
