"""The actor is given the nearest obstacle: an object that the arm could hit and that is not the referent."""

from contextlib import closing

import pytest
import torch
from torchrl.envs.utils import ExplorationType, set_exploration_type

from envs import make_env
from envs.mdp.object_rows import NEAR, OFFSET
from tests.helpers.training_configs import training
from trainers.models.policy import build_policy


@pytest.fixture(scope="module")
def scene():
    """What eight worlds with three cubes and two targets show, the grippers near some of them, and a policy."""
    overrides = ["task=nl_pick_and_place", "task.num_objects=3", "task.curriculum={near: 1.0, held: 0.0, placed: 0.0}"]
    with closing(make_env(overrides, num_worlds=8, seed=4)) as env:
        torch.manual_seed(0)
        yield env.reset(), build_policy(training(policy="grounded").policy, env.observation_spec, env.action_unit)


@pytest.mark.slow
def test_only_obstacles_within_reach_are_near(scene):
    td, _ = scene
    rows, near = td["objects"], td["objects_near"]
    distance = rows[..., OFFSET][..., :3].norm(dim=-1)
    could = td["privileged", "movable"] & (distance < NEAR)
    assert could.any()
    assert not could.all()
    assert torch.equal(near > 0, could)
    torch.testing.assert_close(near[could], 1 - distance[could] / NEAR, atol=1e-4, rtol=0)


def test_the_obstacle_is_the_nearest_object_other_than_the_referent(scene):
    td, policy = scene
    labelled = td.clone()
    policy.encoder.select_labelled(labelled)
    others = td["objects_near"].clone()
    others[torch.arange(8), td["privileged", "referent"]] = 0
    nearest, slot = others.max(1)
    row = policy.encoder.normalise(td["objects"])[torch.arange(8), slot]
    assert (nearest > 0).any()
    torch.testing.assert_close(labelled["obstacle"][:, -1], nearest)
    torch.testing.assert_close(labelled["obstacle"][:, :-1], row * nearest.unsqueeze(1))


def test_without_an_obstacle_its_row_is_zero(scene):
    td, policy = scene
    td = td.clone()
    td["objects_near"].zero_()
    policy.encoder.select_labelled(td)
    assert not td["obstacle"].any()


@pytest.mark.parametrize("mode", [ExplorationType.RANDOM, ExplorationType.DETERMINISTIC])
def test_the_actor_is_given_the_obstacle(scene, mode):
    td, policy = scene
    act = policy.act
    seen = td.select(*act.in_keys)
    assert not any("privileged" in key for key in act.in_keys)
    free = seen.clone()
    free["objects_near"].zero_()
    with set_exploration_type(mode), torch.no_grad():
        torch.manual_seed(1)
        beside = act(seen.clone())
        torch.manual_seed(1)
        alone = act(free)
    crowded = beside["obstacle"].any(1)
    assert crowded.any()
    assert (beside["move"] != alone["move"]).any(1)[crowded].all()
    assert torch.equal(beside["move"][~crowded], alone["move"][~crowded])
