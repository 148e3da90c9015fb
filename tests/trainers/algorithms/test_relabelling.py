"""Episodes are assembled, relabelled and learned from."""

import pytest
import torch

from tests.helpers.fake_env import NEAR, make_env
from tests.helpers.short_training import train
from tests.helpers.training_configs import training
from trainers.algorithms.algorithm import build_algorithm
from trainers.algorithms.replay import Relabelling
from trainers.collect.rollouts import Rollouts
from trainers.run.metrics import read_metrics


@pytest.fixture
def batches():
    env, small = make_env(8, 0), training("sac")
    torch.manual_seed(0)
    policy, _ = build_algorithm(small, env.observation_spec, env.action_unit)
    rollouts = Rollouts(make_env, policy, small.collector, horizon=6, seed=0)
    try:
        return [rollouts.next().clone() for _ in range(12)]
    finally:
        rollouts.close()


def test_episodes_are_whole_and_of_one_world(batches):
    whole = torch.cat(batches, 1)
    kept = Relabelling(None, 1.0)
    episodes = [episode for batch in batches for episode in kept.episodes(batch)]
    assert len(episodes) == int(whole["next", "done"].sum()) > 20
    for episode in episodes:
        assert episode["next", "done"].flatten().tolist() == [False] * (len(episode) - 1) + [True]
        assert len(episode["collector", "traj_ids"].unique()) == 1
        assert (episode["objects"] == episode["objects"][0]).all()
        assert torch.equal(episode["robot"][1:], episode["next", "robot"][:-1])
    trajectories = torch.cat([episode["collector", "traj_ids"][:1] for episode in episodes])
    assert len(trajectories.unique()) == len(episodes)
    assert sum(map(len, episodes)) + kept.unfinished.numel() >= whole.numel()  # no frame is lost
    assert kept.unfinished.shape[1] <= 20


def test_kept_frames_do_not_share_memory_with_the_batch(batches):
    one, two, spoilt = Relabelling(None, 1.0), Relabelling(None, 1.0), [batch.clone() for batch in batches]
    expected = [episode.clone() for batch in batches for episode in one.episodes(batch)]
    found = []
    for batch in spoilt:
        found += [episode.clone() for episode in two.episodes(batch)]
        batch.apply_(torch.Tensor.zero_)  # a collector writes the next batch there
    assert all((a == b).all() for a, b in zip(expected, found, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize(("copies", "least", "most"), [(0.0, 0, 0), (0.5, 0.3, 0.7), (1.0, 1, 1), (2.0, 2, 2)])
def test_each_episode_is_relabelled_the_configured_number_of_times(batches, copies, least, most):
    asked = []
    kept = Relabelling(lambda episodes, seed: asked.extend(episodes) or [], copies)
    ended = sum(int(batch["next", "done"].sum()) for batch in batches)
    assert all(kept(batch) == [] for batch in batches)
    assert least * ended <= len(asked) <= most * ended


@pytest.mark.slow
def test_relabelled_episodes_enter_replay_and_scenes(batches):
    env, small = make_env(8, 0), training("sac")
    _, sac = build_algorithm(small, env.observation_spec, env.action_unit, relabel=env.hindsight)
    expected = [episode for batch in batches for episode in Relabelling(env.hindsight, 1.0)(batch)]
    for batch in batches:
        sac.update(batch, 0.0)
    frames = sac.replay.frames[:]
    assert len(frames) > sum(batch.numel() for batch in batches)
    there = (frames["next", "robot"][:, :3] - frames["next", "privileged", "goal"]).norm(dim=-1) < NEAR
    assert torch.equal(there, (frames["next", "reward"] > 0.5).squeeze(-1))
    assert (frames["next", "terminated"].squeeze(-1) >= there).all()
    torch.testing.assert_close(frames["referent"][:, :3], frames["privileged", "goal"])
    scenes = sac.grounding.scenes[:]
    begun = int(torch.cat(batches, 1)["next", "done"][:, :-1].sum()) + 8
    assert len(scenes) == begun + len(expected) > begun
    meant = scenes["objects"][torch.arange(len(scenes)), scenes["privileged", "referent"]]
    assert torch.equal(meant[:, 3:6].argmax(-1) + 3, scenes["instruction"][:, 2])


@pytest.mark.slow
def test_sac_learns_with_relabelling(tmp_path):
    overrides = ["total_frames=5120", "algo.batch=64", "eval.episodes=60", "eval.interval=5120"]
    result = train(tmp_path, "sac", overrides=overrides)
    relabelled = [row["relabelled"] for row in read_metrics(tmp_path / "metrics.csv")]
    assert torch.tensor(relabelled).nansum() > 200
    assert result["success_at_end"] > 0.8
