"""Our updates compute what TorchRL's loss modules compute: SACLoss, ClipPPOLoss and the GAE module."""

import copy

import pytest
import torch
from torchrl.objectives import ClipPPOLoss, SACLoss
from torchrl.objectives.value import GAE

from tests.helpers.fake_env import make_env
from tests.helpers.short_training import train, untimed_rows
from tests.helpers.training_configs import training
from trainers.algorithms.algorithm import build_algorithm, total_loss
from trainers.algorithms.ppo import MEASURED

TOLERANCE = {"atol": 1e-5, "rtol": 1e-5}


def learner(algo, *overrides):
    """The algorithm in double precision, and frames (8, 40) of its policy. The same seed gives the same weights."""
    env = make_env(8, 0)
    torch.manual_seed(0)
    policy, algorithm = build_algorithm(training(algo, overrides=overrides), env.observation_spec, env.action_unit)
    with torch.no_grad():
        batch = env.rollout(40, policy.act, break_when_any_done=False)
        for part in (policy, *(getattr(algorithm, name, None) for name in ("critic", "target", "loss"))):
            if isinstance(part, torch.nn.Module):
                part.double()
    return policy, algorithm, batch.apply(lambda x: x.double() if x.is_floating_point() else x)


def gradients(loss, parameters):
    return torch.autograd.grad(loss, parameters, retain_graph=True)


def stacked_heads(critic, theirs):
    """Parameters of a critic with two heads, name by name as (head 0, head 1, both in TorchRL's critics)."""
    heads = [dict(head.named_parameters()) for head in critic.heads]
    return [(*(head[name] for head in heads), theirs["module", "heads", "0", *name.split(".")]) for name in heads[0]]


@pytest.mark.slow
@pytest.mark.parametrize("state_dependent_std", ["true", "false"])
def test_sac_has_the_losses_and_gradients_of_sacloss(state_dependent_std):
    override = f"policy.state_dependent_std={state_dependent_std}"
    policy, sac, batch = learner("sac", override)
    _, reference, _ = learner("sac", override, "algo.loss=torchrl")
    assert isinstance(reference.loss, SACLoss)
    sac.replay.extend(batch)
    frames = sac.replay.sample(64)
    frames["next", "terminated"][::5] = True
    torch.manual_seed(1)
    ours = sac.losses(frames.clone())
    torch.manual_seed(1)
    theirs = reference.losses(frames.clone())
    assert {name for name in ours if name.startswith("loss/")} == {"loss/actor", "loss/critic", "loss/alpha"}
    for name in set(ours) - {"q"}:
        torch.testing.assert_close(ours[name].double(), theirs[name].double(), **TOLERANCE)
    assert_same(
        gradients(ours["loss/actor"], [*policy.actor.parameters()]),
        gradients(theirs["loss/actor"], [*reference.policy.actor.parameters()]),
    )
    for *heads, both in stacked_heads(sac.critic, reference.loss.qvalue_network_params):
        (other,) = gradients(theirs["loss/critic"], [both])
        assert_same(gradients(ours["loss/critic"], heads), other)
    (mine,), (other,) = (
        gradients(ours["loss/alpha"], [sac.log_alpha]),
        gradients(theirs["loss/alpha"], [reference.loss.log_alpha]),
    )
    torch.testing.assert_close(mine.double(), other, **TOLERANCE)


@pytest.mark.slow
def test_an_update_of_sac_is_that_with_sacloss():
    """Gradient clipping, Adam, target critics and temperature too, over forty steps."""
    each = []
    for overrides in ((), ("algo.loss=torchrl",)):
        policy, algorithm, batch = learner("sac", "algo.updates_per_frame=0.125", *overrides)
        before = copy.deepcopy(policy.state_dict())
        torch.manual_seed(1)
        measured = algorithm.update(batch, 0.25)
        assert measured["updates"] == 40
        assert any(not torch.equal(value, before[name]) for name, value in policy.state_dict().items())
        each.append((policy, algorithm, measured))
    (ours, sac, mine), (theirs, reference, other) = each
    for name in set(mine) - {"q"}:
        assert mine[name] == pytest.approx(other[name], rel=1e-5, abs=1e-5), name
    torch.testing.assert_close(ours.state_dict(), theirs.state_dict(), **TOLERANCE)
    torch.testing.assert_close(sac.log_alpha.double(), reference.loss.log_alpha.double(), **TOLERANCE)
    for critic, learned in (
        (sac.critic, reference.loss.qvalue_network_params),
        (sac.target, reference.loss.target_qvalue_network_params),
    ):
        for *heads, both in stacked_heads(critic, learned):
            assert_same(heads, both)


def assert_same(ours, theirs):
    for mine, other in zip(ours, theirs, strict=True):
        torch.testing.assert_close(mine, other, **TOLERANCE)


@pytest.mark.slow
@pytest.mark.parametrize("algo", ["ppo", "sac"])
def test_a_run_with_the_loss_of_torchrl_begins_as_one_with_ours(tmp_path, algo):
    names = ("loss/actor", "loss/critic", "loss/grounding", "entropy")
    runs = []
    for loss in ("own", "torchrl"):
        result = train(tmp_path / loss, algo, overrides=[f"algo.loss={loss}"])
        assert result["frames"] == 512
        runs.append([{name: float(row[name]) for name in names} for row in untimed_rows(tmp_path / loss)])
    ours, theirs = runs
    assert len(ours) == len(theirs)
    first = next(i for i, row in enumerate(ours) if row["loss/critic"] == row["loss/critic"])  # not NaN
    assert theirs[first] == pytest.approx(ours[first], rel=1e-2)


def test_ppo_has_the_losses_and_gradients_of_clipppoloss():
    policy, ppo, batch = learner("ppo", "algo.entropy=0.01")
    _, reference, _ = learner("ppo", "algo.entropy=0.01", "algo.loss=torchrl")
    reference.load_state_dict(ppo.state_dict())
    frames, _ = ppo.compute_advantages(batch)
    with torch.no_grad():
        for each in (policy, reference.policy):
            each.actor.net[-1].bias.add_(0.1)  # the ratio of the likelihoods is no longer 1
    ours, theirs = ppo.compute_losses(frames.clone()), reference.compute_losses(frames.clone())
    assert set(ours) == set(theirs) == set(MEASURED)
    for name, value in ours.items():
        torch.testing.assert_close(value, theirs[name].to(value), **TOLERANCE)
    assert isinstance(reference.loss, ClipPPOLoss)
    assert ours["clip_fraction"] > 0
    for part in ("actor", "critic"):
        mine, other = (
            [*each.policy.actor.parameters()] if part == "actor" else [*each.critic.parameters()]
            for each in (ppo, reference)
        )
        assert_same(gradients(total_loss(ours), mine), gradients(total_loss(theirs), other))


def test_advantages_are_those_of_the_gae_module():
    _, ppo, batch = learner("ppo")
    assert batch["next", "truncated"].any()
    assert batch["next", "terminated"].any()
    gae = GAE(gamma=ppo.config.gamma, lmbda=ppo.config.lmbda, value_network=ppo.critic, average_gae=True)
    with torch.no_grad():
        theirs = gae(batch.clone())
        frames, _ = ppo.compute_advantages(batch)
    torch.testing.assert_close(frames["advantage"], theirs["advantage"].reshape(-1, 1), **TOLERANCE)
    torch.testing.assert_close(frames["value_target"], theirs["value_target"].reshape(-1, 1), **TOLERANCE)
