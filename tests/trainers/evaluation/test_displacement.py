"""How far objects are moved in evaluated episodes, and which of them count as disturbed."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from tensordict.nn import TensorDictModule

from core.overrides import compose
from envs import read_env
from envs.experts import expert
from envs.workspace_env import WorkspaceEnv
from tests.helpers.fake_env import FakeEnv
from tests.helpers.fake_expert import EXPERT
from trainers.evaluation.evaluation import Displacement, Displacements, evaluate, moved_shares, run_episodes


class Pushed(FakeEnv):
    """In the first step of each episode an object is moved up by 2 cm, and moved back in the second."""

    slot = "referent"

    def _step(self, tensordict):
        world, way = self.world, (self.world["step"] == 0).float() - (self.world["step"] == 1).float()
        rows, referent = torch.arange(self.batch_size[0]), world["referent"]
        slot = referent if self.slot == "referent" else (referent + 1) % 3
        places = world["places"].clone()
        places[rows, slot, 2] += 0.02 * way
        world["places"] = places
        return super()._step(tensordict)


class PushedOther(Pushed):
    slot = "other"


class Moving(Pushed):
    moves_referent = True


def test_what_has_been_moved_back_still_counts_by_its_greatest_distance():
    result = evaluate(Pushed(4, 0), EXPERT, 24, seed=3)
    assert result.success_at_end > 0.9
    assert result.moved == {"referent_1cm": 1.0, "referent_3cm": 0.0, "others_1cm": 0.0, "swept_out_of_reach": 0.0}
    assert result.disturbed == 1.0


def test_another_object_counts_too():
    result = evaluate(PushedOther(4, 0), EXPERT, 24, seed=3)
    assert (result.moved["referent_1cm"], result.moved["others_1cm"], result.disturbed) == (0.0, 1.0, 1.0)


def test_a_referent_that_is_to_be_moved_does_not_count():
    result = evaluate(Moving(4, 0), EXPERT, 24, seed=3)
    assert result.moved == {
        "referent_1cm": None,
        "referent_3cm": None,
        "others_1cm": 0.0,
        "swept_out_of_reach": None,
    }
    assert result.disturbed == 0.0


def test_nothing_that_stands_still_counts_and_a_new_episode_starts_anew():
    env = FakeEnv(3, 0)
    assert all(e.displacement == Displacement(0.0, 0.0, False) for e in run_episodes(env, EXPERT, 30, seed=1))
    begun = env.reset()
    followed = Displacements(env, begun)
    later = begun.clone()
    later["objects"][:, :, 0] += 0.5
    followed.follow(later)
    assert followed.of(0, later).others == pytest.approx(0.5)
    followed.begin(later, torch.tensor([True, False, False]))
    followed.follow(later)
    assert followed.of(0, later) == Displacement(0.0, 0.0, followed.of(0, later).out_of_reach)
    assert followed.of(1, later).others == pytest.approx(0.5)


def test_without_a_success_there_is_no_share():
    assert moved_shares([], [Displacement(0.2, 0.0, True), Displacement()]) == {
        "referent_1cm": None,
        "referent_3cm": None,
        "others_1cm": None,
        "swept_out_of_reach": 0.5,
    }


def world(*overrides: str) -> WorkspaceEnv:
    return WorkspaceEnv(read_env(compose(list(overrides))), 4, 0)


def sweep(env: WorkspaceEnv):
    """A policy that goes down in front of the referent and then on through where it stands."""
    low = np.zeros(4, bool)

    def act(robot):
        low[env.elapsed == 0] = False
        low[env.gripper[:, 2] < 0.03] = True
        goal = env.state.objects[torch.arange(4), env.state.referent] - [[0.1, 0.0, 0.0]]
        goal[low] += [0.4, 0.0, 0.0]
        return env.towards(goal)

    return TensorDictModule(act, in_keys=["robot"], out_keys=["action"])


@pytest.mark.slow
@pytest.mark.parametrize("task", ["reach", "nl_reach"])
def test_real_objects_are_followed(task):
    still = world(f"task={task}")
    result = evaluate(still, expert(still), 8, seed=0)
    assert (result.success_at_end, result.disturbed, result.moved["swept_out_of_reach"]) == (1.0, 0.0, 0.0)
    still.close()
    # a radius that leaves no success, nor room above the objects
    swept = world(f"task={task}", "task.radius=0.001", "workspace.object_area=[0.45,0.5,-0.2,0.2]")
    outcomes = run_episodes(swept, sweep(swept), 8, seed=0)
    swept.close()
    assert min(outcome.displacement.referent for outcome in outcomes) > 0.05


def test_a_place_beyond_the_gripper_box_and_the_radius_is_out_of_reach():
    env = world("task=reach")
    places = torch.tensor([[0.45, 0.0, 0.025], [0.64, 0.0, 0.025], [0.66, 0.0, 0.025], [0.45, -0.4, 0.025]])
    assert [env.is_reachable(place) for place in places] == [True, True, False, False]
    env.close()
