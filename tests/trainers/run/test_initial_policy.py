"""Training that begins with the policy of another run, of any algorithm with the same networks."""

import pytest
import torch

from tests.helpers.labelled_fake_env import make_labelled
from tests.helpers.short_training import train
from trainers.algorithms.bc import BC
from trainers.algorithms.on_policy import OnPolicyAlgorithm
from trainers.export import policy_file
from trainers.run import checkpoint

FRAMES = "total_frames=128"  # one batch


@pytest.fixture(scope="module")
def imitated(tmp_path_factory):
    """The checkpoint of a run that has imitated an expert."""
    folder = tmp_path_factory.mktemp("bc")
    train(folder, "bc", make=make_labelled, overrides=["total_frames=128", "algo.updates_per_frame=0.1"])
    return checkpoint.find(folder)


def first_policies(kind, monkeypatch):
    """The networks that each update of this algorithm begins with, filled as it is called."""
    found, update = [], kind.update

    def recorded(algorithm, *arguments):
        found.append({name: value.clone() for name, value in algorithm.policy.state_dict().items()})
        return update(algorithm, *arguments)

    monkeypatch.setattr(kind, "update", recorded)
    return found


@pytest.mark.slow
@pytest.mark.parametrize(("algo", "kind", "make"), [("ppo", OnPolicyAlgorithm, None), ("bc", BC, make_labelled)])
def test_a_run_begins_with_the_networks_of_another_and_its_own_noise(tmp_path, imitated, monkeypatch, algo, kind, make):
    found = first_policies(kind, monkeypatch)
    overrides = [FRAMES, "policy.initial_std=0.1"]
    train(tmp_path, algo, overrides=overrides, init=imitated, **({"make": make} if make else {}))
    saved = checkpoint.load(imitated)["algorithm"]["policy"]
    for name, value in found[0].items():
        if name.endswith("log_std"):
            torch.testing.assert_close(value.exp(), torch.full_like(value, 0.1))
        else:
            assert torch.equal(value, saved[name]), name


@pytest.mark.slow
def test_the_actor_stays_as_it_is_while_the_critic_alone_learns(tmp_path, imitated):
    overrides = ["total_frames=512", "policy.initial_std=0.1", "algo.final_std=0.1"]
    for warmup in (0.5, 1.0):
        train(tmp_path / str(warmup), overrides=[*overrides, f"algo.critic_warmup={warmup}"], init=imitated)
    saved = checkpoint.load(imitated)["algorithm"]["policy"]
    half, whole = (checkpoint.load(checkpoint.find(tmp_path / each))["algorithm"] for each in ("0.5", "1.0"))
    actor = [name for name in saved if name.startswith("actor.net")]
    assert all(torch.equal(whole["policy"][name], saved[name]) for name in actor)
    assert not any(torch.equal(half["policy"][name], saved[name]) for name in actor)
    other = {name: value for name, value in whole["critic"].items() if not torch.equal(value, half["critic"][name])}
    assert other  # the critic of both has learned, from other moves in the end


def test_a_policy_of_another_environment_is_refused_by_the_name_of_the_key(tmp_path):
    with pytest.raises(checkpoint.CheckpointError, match="cannot be begun with: the checkpoint was"):
        train(tmp_path, overrides=[FRAMES], init=policy_file.FOLDER / "nl_reach_kuka" / "policy.safetensors")


@pytest.mark.parametrize(
    ("override", "message"),
    [("policy.hidden=[32]", "has other networks than this run"), ("policy.embedding=8", "take the values of policy")],
)
def test_other_networks_are_refused_before_anything_is_collected(tmp_path, imitated, override, message):
    with pytest.raises(checkpoint.CheckpointError, match=message):
        train(tmp_path / "run", overrides=[FRAMES, override], init=imitated)
    assert not (tmp_path / "run" / "metrics.csv").exists()
