"""Pictures as observations: they are there where a policy asks for them, and change nothing else."""

import gymnasium
import numpy as np
import pytest
import torch

from core.errors import ConfigError
from envs.mdp.object_rows import scene_of_rows
from language import ground, parse
from tests.helpers.env_cases import act, make

PIXELS = "policy=pixels"


@pytest.fixture(scope="module")
def env():
    made = make("kuka", "step", "nl_reach", PIXELS, worlds=2)
    yield made
    made.close()


def test_nothing_else_changes_with_pictures_by_a_bit(env):
    plain, actions = make(worlds=2), torch.rand(4, 2, 3, generator=torch.Generator().manual_seed(0)) * 2 - 1
    env.set_seed(0)
    seen, told = env.reset(), plain.reset()
    assert set(seen.keys(True)) - set(told.keys(True)) == {"pixels", "tip", ("privileged", "seen_at")}
    for action in actions:
        for key in told.keys(True, True):
            assert torch.equal(seen[key], told[key]), key
        seen, told = act(env, seen, action), act(plain, told, action)
    plain.close()


def test_they_are_those_of_the_workspaces_cameras(env):
    state = env.reset()
    assert state["pixels"].shape == (2, 2, 64, 64, 3)
    assert state["pixels"].dtype == torch.uint8
    assert torch.equal(state["tip"], torch.from_numpy(env.gripper).float())
    for other in (state["pixels"][1, 0], state["pixels"][0, 1]):  # of another world, and of another camera
        assert (state["pixels"][0, 0] != other).any()
    moved = act(env, state, torch.ones(2, 3))
    assert (moved["pixels"] != state["pixels"]).flatten(1).any(1).all()
    again = env.reset(moved.clone().set("_reset", torch.tensor([[True], [False]])))
    assert (again["pixels"] != moved["pixels"]).flatten(1).any(1).tolist() == [True, False]


def test_labels_tell_where_things_are_in_pictures(env):
    scenes = env.draw_scenes(25, seed=3)
    pixel = (scenes["privileged", "seen_at"] * 64).long()  # (25, K, C, 2)
    colors = scenes["objects"][..., 7:10]
    found = []
    for i, k in scenes["objects_mask"].nonzero().tolist():
        for c in range(2):
            u, v = pixel[i, k, c].tolist()
            near = scenes["pixels"][i, c, v - 1 : v + 2, u - 1 : u + 2].float().flatten(0, 1) / 255
            hue = near / near.max(1, keepdim=True).values.clamp(min=0.05)
            wanted = colors[i, k] / colors[i, k].max().clamp(min=0.05)
            found.append((hue - wanted).abs().sum(-1).min().item() < 0.35)
    assert np.mean(found) > 0.75  # the arm hides the others


def test_each_sentence_of_a_drawn_scene_means_its_referent(env):
    scenes = env.draw_scenes(6, seed=1)
    assert scenes["instruction"].shape[:2] == (6, 3)
    for i in range(6):
        rows = scenes["objects"][i][scenes["objects_mask"][i]].double().numpy()
        slots = scenes["objects_mask"][i].nonzero().flatten().tolist()
        for tokens, referent in zip(scenes["instruction"][i], scenes["privileged", "referent"][i], strict=True):
            step = parse(env.tokenizer.decode(tokens.tolist()))
            assert slots[ground(step, scene_of_rows(rows))] == referent
    again = env.draw_scenes(6, seed=1)
    assert all(torch.equal(scenes[key], again[key]) for key in scenes.keys(True, True))
    assert (scenes["tip"] - scenes["tip"].mean(0)).norm(dim=-1).max() > 0.1  # the gripper is anywhere


def test_gymnasium_shows_them():
    env = gymnasium.make("Deixis/NLReach-v0", overrides=[PIXELS])
    observation, _ = env.reset(seed=0)
    assert observation["pixels"] in env.observation_space["pixels"]
    assert env.observation_space["pixels"].dtype == np.uint8
    env.close()


@pytest.mark.parametrize(
    ("override", "message"),
    [
        (
            "policy.pictures.cameras=[front,sides]",
            r"policy\.pictures\.cameras=\[front,sides\]: workspace=table has no camera sides",
        ),
        ("policy.pictures.cameras=[]", r"policy\.pictures\.cameras=\[\] must name at least one camera"),
        ("policy.pictures.size=8", r"policy\.pictures\.size=8 is out of range"),
    ],
)
def test_pictures_that_cannot_be_taken_are_refused(override, message):
    with pytest.raises(ConfigError, match=message):
        make("kuka", "step", "nl_reach", PIXELS, override)
