"""Our updates compute what TorchRL's loss modules compute: SACLoss, ClipPPOLoss and the GAE module."""

import copy

import pytest
import torch
from tensordict.nn import TensorDictModule
from torchrl.objectives import ClipPPOLoss, SACLoss
from torchrl.objectives.value import GAE

from tests.helpers.fake_env import make_env
from tests.helpers.plans import plan
from trainers.algorithms.algorithm import total_loss
from trainers.algorithms.build import build_algorithm
from trainers.algorithms.ppo import MEASURED
from trainers.models.actors import stochastic_actor
from trainers.models.networks import SingleCritic

TOLERANCE = {"atol": 1e-5, "rtol": 1e-5}


def learner(algo, *overrides):
    """The algorithm in double precision, and frames (8, 40) of its policy."""
    env = make_env(8, 0)
    torch.manual_seed(0)
    policy, algorithm = build_algorithm(plan(algo, overrides=overrides), env.observation_spec, env.action_unit)
    with torch.no_grad():
        batch = env.rollout(40, policy.act, break_when_any_done=False)
        for part in (policy, algorithm.critic, getattr(algorithm, "target", None)):
            if part is not None:
                part.double()
    return policy, algorithm, batch.apply(lambda x: x.double() if x.is_floating_point() else x)


def single_critics(critic):
    """The heads of a critic as modules of their own."""
    modules = []
    for head in copy.deepcopy(critic).heads:
        single = SingleCritic.__new__(SingleCritic)
        torch.nn.Module.__init__(single)
        single.robot, single.goal = copy.deepcopy(critic.robot), copy.deepcopy(critic.goal)
        single.heads = torch.nn.ModuleList([head])
        modules.append(single)
    return modules


def torchrl_sac(policy, sac):
    keys = ["robot", sac.critic_key, "move"]
    critics = [TensorDictModule(m, in_keys=keys, out_keys=["state_action_value"]) for m in single_critics(sac.critic)]
    loss = SACLoss(
        stochastic_actor(policy),
        critics,
        num_qvalue_nets=2,
        loss_function="l2",
        alpha_init=sac.config.initial_alpha,
        target_entropy=sac.target_entropy,
    )
    loss.set_keys(action="move", state_action_value="state_action_value")
    loss.make_value_estimator(loss.default_value_estimator, gamma=sac.config.gamma)
    return loss


def gradients(loss, parameters):
    return torch.autograd.grad(loss, parameters, retain_graph=True)


@pytest.mark.parametrize("state_dependent_std", ["true", "false"])
def test_sac_has_the_losses_and_gradients_of_sacloss(state_dependent_std):
    policy, sac, batch = learner("sac", f"policy.state_dependent_std={state_dependent_std}")
    sac.replay.extend(batch)
    frames = sac.replay.sample(64)
    frames["next", "terminated"][::5] = True
    frames["next", "done"] = frames["next", "terminated"]
    reference = torchrl_sac(policy, sac)
    torch.manual_seed(1)
    ours = sac.losses(frames.clone())
    torch.manual_seed(1)
    theirs = reference(frames.clone())
    for name, key in (("loss/critic", "loss_qvalue"), ("loss/actor", "loss_actor"), ("loss/alpha", "loss_alpha")):
        torch.testing.assert_close(ours[name].double(), theirs[key].double(), **TOLERANCE)
    torch.testing.assert_close(ours["entropy"], theirs["entropy"], **TOLERANCE)
    actor = list(policy.actor.parameters())
    assert_same(gradients(ours["loss/actor"], actor), gradients(theirs["loss_actor"], actor))
    critic = dict(sac.critic.named_parameters())
    stacked = reference.qvalue_network_params
    for name, parameter in critic.items():
        head, layer = int(name.split(".")[1]), name.split(".", 2)[2]
        theirs_parameter = stacked["module", "heads", "0", *layer.split(".")]
        (mine,) = gradients(ours["loss/critic"], [parameter])
        (other,) = gradients(theirs["loss_qvalue"], [theirs_parameter])
        torch.testing.assert_close(mine, other[head], **TOLERANCE)
    (mine,), (other,) = (
        gradients(ours["loss/alpha"], [sac.log_alpha]),
        gradients(theirs["loss_alpha"], [reference.log_alpha]),
    )
    torch.testing.assert_close(mine, other, **TOLERANCE)


def assert_same(ours, theirs):
    for mine, other in zip(ours, theirs, strict=True):
        torch.testing.assert_close(mine, other, **TOLERANCE)


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
