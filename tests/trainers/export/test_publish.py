"""Published policies: their files, their card, and that they act like their run."""

from __future__ import annotations

import json
import re
import shutil

import pytest
import torch

import evaluate
import train
from core.errors import ConfigError
from core.overrides import compose
from tests.helpers.tiny_run import TINY
from tests.helpers.training_keys import training_keys
from trainers.export import publish
from trainers.run import checkpoint
from trainers.run.checkpoint import CheckpointError
from trainers.run.train_loop import fit

pytestmark = pytest.mark.slow


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


def test_a_published_policy_has_no_state_of_training(run, policy):
    assert {file.name for file in policy.parent.rglob("*")} == {"tiny", "README.md", "policy.safetensors"}
    full, published = (checkpoint.load(checkpoint.find(folder)) for folder in (run, policy))
    assert set(published) == {"format", "config", "vocabulary", "widths", "algorithm"}
    assert set(published["algorithm"]) == {"policy"} < set(full["algorithm"])
    for name in ("config", "vocabulary", "widths"):
        assert published[name] == full[name]
    weights = full["algorithm"]["policy"]
    assert set(weights) == set(published["algorithm"]["policy"])
    assert all(torch.equal(weights[name], tensor) for name, tensor in published["algorithm"]["policy"].items())


def test_a_published_policy_evaluates_like_its_run_and_is_not_changed(run, policy, tmp_path, monkeypatch):
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


def test_the_card_has_the_result_and_the_command_of_the_run(run, policy):
    card, final = (policy / "README.md").read_text(), json.loads((run / "eval.json").read_text())
    low, high = final["ci95"]
    assert f"| {final['success_at_end']:.3f} ({low:.3f}-{high:.3f}) | {final['wrong_object']:.3f} | - | 4 |" in card
    assert "| frames | 256, in 0 min" in card
    assert "bring the gripper to the object that the sentence names" in card
    assert "* `policy.width=16`" in card
    assert re.search(r"\| date \| \d{4}-\d\d-\d\d \|", card)
    assert re.search(rf"\| torch \| {re.escape(torch.__version__.partition('+')[0])}", card)
    (command,) = re.findall(r"^python train.py (.*?)   #", card, re.MULTILINE)
    again = training_keys(compose(command.split()))
    assert again == training_keys(compose(["seed=3", *(w for w in TINY if "eval" not in w), "policy.width=16"]))


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
def test_a_run_that_cannot_be_published_is_refused_and_leaves_nothing(copy, tmp_path, prepare, said):
    place = tmp_path / "pretrained" / "name"
    prepare(copy, place)
    with pytest.raises(ConfigError, match=said) as error:
        publish.main([str(copy), str(place)])
    assert "\n" not in str(error.value)
    assert not list(place.rglob("*")) if place.is_dir() else not list(tmp_path.rglob("*.safetensors"))


def test_a_run_that_is_not_there_leaves_no_folder(tmp_path):
    with pytest.raises(ConfigError, match="nothing"):
        publish.main([str(tmp_path / "nothing"), str(tmp_path / "pretrained" / "name")])
    assert not list(tmp_path.iterdir())


def rewrite(file, **values):
    kept = {name: value for name, value in json.loads(file.read_text()).items() if name != "sha256"}
    file.write_text(json.dumps(kept | values))


def test_a_policy_too_large_for_a_repository_is_refused(run, tmp_path, monkeypatch):
    monkeypatch.setattr(publish, "MAX_BYTES", 10_000)
    with pytest.raises(ConfigError, match=r"policy.safetensors would have [\d,]+ bytes; .* less than 10,000"):
        publish.publish(run, tmp_path / "large")
    assert not list(tmp_path.iterdir())


def test_a_directory_of_runs_is_refused(run, tmp_path):
    with pytest.raises(ConfigError, match="holds several runs"):
        publish.publish(run.parent, tmp_path / "name")


def test_training_cannot_resume_from_a_published_policy(policy, tmp_path):
    with pytest.raises(CheckpointError, match="a published policy without optimiser and critic"):
        train.resumed(str(policy), [])
    from tests.helpers.fake_env import FakeEnv
    from tests.helpers.training_configs import training

    with pytest.raises(CheckpointError, match="a published policy"):
        fit(training(), FakeEnv, tmp_path, {}, [], resume=checkpoint.find(policy))
