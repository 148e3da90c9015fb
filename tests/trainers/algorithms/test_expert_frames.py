"""Off-policy learning with demonstrations: the expert acts first, and half of each batch is drawn from its frames."""

import pytest
import torch

from core.errors import ConfigError
from tests.helpers.labelled_fake_env import LABEL, make_labelled
from tests.helpers.training_configs import training
from trainers.algorithms.algorithm import build_algorithm
from trainers.collect.rollouts import Rollouts

SHOWN, BATCH = 256, 32
OVERRIDES = (f"algo.demonstrations={SHOWN}", "algo.updates_per_frame=0.1", "algo.horizon=8")


def collected(algo, count, *more):
    """The algorithm, and the batches that it was given."""
    small, env = training(algo, overrides=(*OVERRIDES, *more)), make_labelled(8, 0)
    torch.manual_seed(0)
    _, algorithm = build_algorithm(small, env.observation_spec, env.action_unit)
    rollouts, batches = Rollouts(make_labelled, algorithm.behaviour, small.collector, horizon=8, seed=0), []
    try:
        for i in range(count):
            rollouts.sync(algorithm.behaviour)
            batches.append(rollouts.next().clone())
            measured = algorithm.update(batches[-1].clone(), i / count)
            assert (measured["updates"] > 0) == (i >= SHOWN // 64)
    finally:
        rollouts.close()
    return algorithm, batches


@pytest.mark.slow
@pytest.mark.parametrize("algo", ["sac", "td3"])
def test_the_expert_acts_in_the_first_frames_and_the_policy_in_all_others(algo):
    algorithm, batches = collected(algo, 8)
    experts = [torch.equal(batch["action"], batch[LABEL]) for batch in batches]
    assert experts == [True] * (SHOWN // 64) + [False] * 4
    move = (batches[0]["action"] - batches[0]["hold"]) / algorithm.policy.action_unit
    torch.testing.assert_close(batches[0]["move"], move.clamp(-1, 1))


def test_half_of_each_batch_is_drawn_from_the_demonstrations():
    algorithm, batches = collected("sac", 8)
    shown = torch.cat([batch["robot"].reshape(-1, batch["robot"].shape[-1]) for batch in batches[:4]])
    drawn = algorithm.sample(5)
    assert len(drawn) == 5 * BATCH
    for part in drawn.split(BATCH):
        among = (part["robot"][:, None] == shown).all(-1).any(1)
        assert among.tolist() == [False] * (BATCH // 2) + [True] * (BATCH // 2)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (("algo.demonstrations=8",), "algo.demonstrations=8 must be 0, or at least a batch: 32 frames"),
        (("algo.demonstrations=512",), "algo.demonstrations=512 must be less than total_frames=512"),
    ],
)
def test_bad_numbers_of_demonstrations_are_refused(overrides, message):
    with pytest.raises(ConfigError, match=message):
        training("td3", overrides=overrides)
