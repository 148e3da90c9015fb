"""Running episodes are continued in another environment, bit for bit, from generators and actions alone."""

import pytest
import torch

from envs.experts import expert
from tests.helpers.env_cases import differences, make

CASES = [
    ("panda", "nl_pick_and_place", ()),
    ("kuka", "throw", ()),
    ("kuka", "anything", ("task.instructions=3", "task.curriculum.automatic=true")),
    ("jaco", "nl_reach_gesture", ("gesture=ray", "workspace=collabtable")),
]


def stepped(env, td, noise):
    """The frame and the next observation of an expert that is disturbed."""
    action = (expert(env)(td.clone(recurse=False))["action"] + noise).clamp(-1, 1)
    return env.step_and_maybe_reset(td.clone(recurse=False).set("action", action))


def noises(env, steps):
    generator = torch.Generator().manual_seed(1)
    return [0.3 * torch.randn(env.action_spec.shape, generator=generator) for _ in range(steps)]


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "task", "more"), CASES)
def test_running_episodes_continue_with_the_same_bits_elsewhere(robot, task, more):
    more = (*more, "task.max_steps=17")
    env, other = (make(robot, "step", task, *more, worlds=3, seed=seed) for seed in (5, 8))
    other.reset()
    td, actions, lengths = env.reset(), [], torch.zeros(3, dtype=torch.int64)
    for t, noise in enumerate(noises(env, 40)):
        if t == 9:  # worlds end at different times from here on
            td = env.reset(td.set("_reset", torch.tensor([[True], [False], [False]])))
            lengths[0] = 0
        frame, td = stepped(env, td, noise)
        actions.append(frame["action"])
        lengths = torch.where(frame["next", "done"][:, 0], 0, lengths + 1)
    assert lengths.unique().numel() > 1
    other.continue_episodes(env.beginnings, torch.stack(actions, 1)[:, -int(lengths.max()) :], lengths)
    again = other.reset()
    assert differences(td.select(*again.keys()), again) == []
    for noise in noises(env, 20):
        (one, td), (two, again) = stepped(env, td, noise), stepped(other, again, noise)
        assert differences(one, two) == []
    assert env.beginnings == other.beginnings
    env.close()
    other.close()
