"""The policy that sees: its action follows from pictures, words and the arm alone, and pictures teach it quickly."""

import pytest
import torch
from tensordict import TensorDict
from torchrl.data import Binary, Bounded, Categorical, Composite
from torchrl.envs.utils import ExplorationType, set_exploration_type

from core.errors import ConfigError
from tests.helpers.training_configs import training
from trainers.algorithms.algorithm import build_algorithm
from trainers.models.pixels import UNIT, chosen_place
from trainers.run.checkpoint import CheckpointError, check_fits

SIZE, SLOTS, LENGTH, ROW = 16, 3, 4, 6
COLORS = torch.tensor([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]])
SMALL = ("policy.channels=[8,16,16]", "policy.cells=16", "policy.hidden=[32]", "algo.lr=0.01")


def spec(worlds):
    box = Bounded(-torch.ones(worlds, 3), torch.ones(worlds, 3))
    rows = torch.ones(worlds, SLOTS, ROW)
    return Composite(
        robot=box,
        objects=Bounded(-rows, rows),
        objects_mask=Binary(SLOTS, (worlds, SLOTS), dtype=torch.bool),
        instruction=Categorical(5, (worlds, LENGTH)),
        pixels=Bounded(0, 255, (worlds, 1, SIZE, SIZE, 3), dtype=torch.uint8),
        tip=box.clone(),
        hold=box.clone(),
        privileged=Composite(
            referent=Categorical(SLOTS, (worlds,)),
            seen_at=Bounded(-1, 2, (worlds, SLOTS, 1, 2), dtype=torch.float32),
            expert_action=box.clone(),
            shape=[worlds],
        ),
        shape=[worlds],
    )


def draw(count, sentences=None):
    """A square of each colour on a black picture that shows [-1, 1] x [-1, 1]; the words name a colour."""
    cells = torch.stack([torch.randperm(16)[:SLOTS] for _ in range(count)])  # 4 x 4 of them
    seen_at = (torch.stack([cells % 4, cells // 4], -1) + 0.5) / 4
    pixels = torch.zeros(count, 1, SIZE, SIZE, 3, dtype=torch.uint8)
    color = torch.stack([torch.randperm(SLOTS) for _ in range(count)])
    for i in range(count):
        for k in range(SLOTS):
            u, v = (seen_at[i, k] * SIZE).long().tolist()
            pixels[i, 0, v - 1 : v + 2, u - 1 : u + 2] = (255 * COLORS[color[i, k]]).byte()
    places = torch.cat([seen_at * 2 - 1, torch.zeros(count, SLOTS, 1)], -1)
    shape = (count,) if sentences is None else (count, sentences)
    referent = torch.randint(SLOTS, shape)
    named = color.gather(1, referent.reshape(count, -1)).reshape(shape)
    instruction = torch.stack([torch.ones_like(named), named + 2, *[torch.zeros_like(named)] * 2], -1)
    tip = torch.rand(count, 3) - 0.5
    aim = places[torch.arange(count), referent.reshape(count, -1)[:, 0]] - tip
    return TensorDict(
        {
            "robot": tip.clone(),
            "tip": tip,
            "hold": torch.zeros(count, 3),
            "objects": torch.cat([places, COLORS[color]], -1),
            "objects_mask": torch.ones(count, SLOTS, dtype=torch.bool),
            "instruction": instruction,
            "pixels": pixels,
            "privileged": {
                "referent": referent,
                "seen_at": seen_at.unsqueeze(2),
                "expert_action": (2 * aim).clamp(-1, 1),
            },
        },
        [count],
    )


def build(*overrides):
    torch.manual_seed(0)
    return build_algorithm(training("bc", "pixels", (*SMALL, *overrides)), spec(1), (1.0, 1.0, 1.0))


def action(policy, frames):
    with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
        return policy.act(frames.select(*policy.act.in_keys))["action"]


def test_the_action_follows_from_pictures_words_and_arm_alone():
    policy, _ = build()
    torch.nn.init.normal_(policy.actor.net[-1].weight)
    frames = draw(8)
    acts = action(policy, frames)
    assert not {"objects", "objects_mask", "objects_near", "gesture", "stage"} & set(policy.act.in_keys)
    assert not any("privileged" in key for key in policy.act.in_keys)
    other = frames.clone()
    other["objects"], other["objects_mask"] = -frames["objects"], ~frames["objects_mask"]
    other["privileged"] = frames["privileged"].apply(lambda value: value.flip(0))
    assert torch.equal(acts, action(policy, other))
    for key in ("pixels", "instruction", "robot", "tip"):
        other = frames.clone()
        other[key] = frames[key].flip(0)
        assert not torch.equal(acts, action(policy, other)), key


def test_pictures_of_squares_teach_places_words_and_moves():
    policy, bc = build("algo.grounding_batch=32", "algo.batch=32")
    bc.add_scenes(draw(600, 3))
    bc.frames.extend(bc.labelled(draw(600)))
    first = bc.learn(1)[0]
    for _ in range(8):
        last = bc.learn(20)[-1]
    assert set(last) | {"expert_share", "updates", "lr"} == set(bc.metrics)
    assert last["loss/imitation"] < first["loss/imitation"] / 2
    fresh = draw(200)
    with torch.no_grad():
        places, measured = bc.teach(fresh)
    assert measured["grounding/accuracy"] > 0.95
    true = bc.labelled_places(fresh)
    assert ((places * UNIT - true).norm(dim=-1)).median() < 0.1  # of a picture that is 2 across
    moves = action(policy, fresh)
    assert (moves - fresh["privileged", "expert_action"]).abs().mean() < 0.2


def test_the_place_of_two_things_is_that_of_the_likelier_one():
    near = 0.03 / UNIT  # between the places that two cells tell of one thing
    places = torch.tensor([[[0.0, 0, 0], [near, 0, 0], [2.0, 0, 0]]])
    place = chosen_place(torch.tensor([[1.0, 1.0, 1.5]]), places)
    torch.testing.assert_close(place, places[:, 2])
    place = chosen_place(torch.tensor([[1.6, 1.6, 1.5]]), places)
    torch.testing.assert_close(place, torch.tensor([[near / 2, 0, 0]]))


@pytest.mark.parametrize(
    ("algo", "override", "message"),
    [
        ("ppo", "policy.width=32", r"policy\.name=pixels learns by imitation alone: take algo=bc, not algo=ppo"),
        ("bc", "policy.networks=3", r"policy\.networks=3 must be 1|networks=3 must be 1"),
        ("bc", "policy.imitation.bach=3", r"imitation\.bach is no key of algo=bc.*batch"),
    ],
)
def test_settings_with_which_it_cannot_learn_are_refused(algo, override, message):
    with pytest.raises(ConfigError, match=message):
        training(algo, "pixels", (override,))


def test_pictures_of_a_size_that_no_cells_divide_are_refused():
    observed = spec(1)
    observed["pixels"] = Bounded(0, 255, (1, 1, 18, 18, 3), dtype=torch.uint8)
    with pytest.raises(ConfigError, match=r"policy\.pictures\.size=18 must be a multiple of 4"):
        build_algorithm(training("bc", "pixels", SMALL), observed, (1.0, 1.0, 1.0))


def test_it_takes_any_number_of_objects_but_pictures_of_its_own_size():
    payload = {"config": {"policy": {"name": "pixels"}}, "vocabulary": ["<pad>"]}
    payload["widths"] = {"objects": [3, 16], "objects_mask": [3], "pixels": [2, 64, 64, 3]}
    check_fits(payload, ["<pad>"], {"objects": [6, 16], "objects_mask": [6], "pixels": [2, 64, 64, 3]})
    with pytest.raises(CheckpointError, match=r"pixels is \[2, 64, 64, 3\] there and \[2, 32, 32, 3\] here"):
        check_fits(payload, ["<pad>"], payload["widths"] | {"pixels": [2, 32, 32, 3]})


def test_an_environment_without_pictures_is_refused():
    observed = spec(1)
    del observed["pixels"]
    with pytest.raises(ConfigError, match="policy=pixels needs an environment that observes pixels"):
        build_algorithm(training("bc", "pixels", SMALL), observed, (1.0, 1.0, 1.0))
