"""Sentences of nl_reach: splits, wordings and viewpoints; and the oracle, which uses the parser."""

import numpy as np
import pytest
import torch

from core.errors import ConfigError
from envs.experts import Oracle
from envs.mdp.object_rows import scene_of_rows
from language import ground, parse, say
from tests.helpers.env_cases import make, task_of

PAIRS = {("red", "cube"), ("green", "sphere"), ("blue", "cylinder")}
RELATED = {("left of", "cube"), ("behind", "sphere"), ("nearest to", "cylinder")}
WORDS = ("touch", "ball", "tube", "violet", "thing", "to the left of", "close to", "furthest from", "move to")


def drawn(*overrides, count=300, seed=0):
    task, rng = task_of("nl_reach_large", *overrides), np.random.default_rng(seed)
    return [task.draw(rng) for _ in range(count)]


def holds_a_pair(sentence):
    parts = list(parse(sentence).phrase.parts())
    return any((p.color, p.noun) in PAIRS or (p.relation, p.noun) in RELATED for p in parts)


def holds_a_word(sentence):
    return any(f" {word} " in f" {sentence.replace(',', ' ')} " for word in WORDS)


def test_training_never_says_what_is_held_out():
    for episode in drawn():
        assert not holds_a_pair(episode.sentence)
        assert not holds_a_word(episode.sentence)


@pytest.mark.slow
def test_test_composition_always_says_a_held_out_pair_in_known_words():
    for episode in drawn("task.split=test_composition"):
        assert holds_a_pair(episode.sentence)
        assert not holds_a_word(episode.sentence)


def test_test_paraphrase_always_says_a_held_out_word_but_no_held_out_pair():
    for episode in drawn("task.split=test_paraphrase"):
        assert holds_a_word(episode.sentence)
        assert not holds_a_pair(episode.sentence)


@pytest.mark.slow
def test_test_length_nests_relations_deeper_than_training_does():
    assert {parse(episode.sentence).phrase.depth for episode in drawn("task.split=test_length")} == {2}
    assert {parse(episode.sentence).phrase.depth for episode in drawn()} == {0, 1}


@pytest.mark.slow
@pytest.mark.parametrize("split", ["all", "train", "test_composition", "test_paraphrase", "test_length"])
def test_every_split_names_its_referent(split):
    for episode in drawn(f"task.split={split}", count=100):
        assert ground(parse(episode.sentence), episode.scene) == episode.referent


def test_rephrased_sentences_are_read_in_our_own_words():
    episodes = drawn("task.split=test_paraphrase", "task.rephrased=true", count=50)
    for episode in episodes:
        assert episode.heard == say(parse(episode.sentence)) != episode.sentence


def test_from_the_humans_side_left_is_right():
    for episode in drawn("task.viewpoint=human", "task.kinds=[superlative]", count=50):
        instruction = parse(episode.sentence)
        assert episode.scene.viewpoint == "human"
        sides = {"leftmost": np.argmin, "rightmost": np.argmax, "nearest": None, "farthest": None}
        side = sides[instruction.phrase.superlative]
        if side is not None and instruction.phrase.label.endswith("most object"):
            assert side(episode.scene.positions[:, 1]) == episode.referent


@pytest.mark.slow
@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("task.split=test", "task.split=test is not known; choose from"),
        ("task.viewpoint=child", "task.viewpoint=child is not known"),
        ("task.held_out.color_noun=[[redd,cube]]", "did you mean 'red'"),
        ("task.held_out.color_noun=[[red]]", "must be pairs"),
        ("task.held_out.relation_noun=[[leftof,cube]]", "did you mean 'left of'"),
        ("task.held_out.phrases=[sphere]", "hold out a synonym"),
        ("task.held_out.phrases=[bal]", "did you mean 'ball'"),
        (
            "'task.held_out={color_noun: [], relation_noun: [], phrases: []}' task.split=test_paraphrase",
            "needs phrases",
        ),
    ],
)
def test_bad_splits_are_refused_in_one_sentence(override, said):
    from shlex import split

    with pytest.raises(ConfigError, match=said) as caught:
        task_of("nl_reach_large", *split(override))
    assert "task." in str(caught.value)


def test_drawn_scenes_are_what_episodes_begin_with():
    env = make(task="nl_reach_large", worlds=2)
    scenes = env.draw_scenes(40, seed=5)
    for i in range(40):
        shown = scenes["objects_mask"][i].numpy()
        scene = scene_of_rows(scenes["objects"][i].numpy()[shown])
        referent = int(np.flatnonzero(shown)[ground(parse(env.tokenizer.decode(scenes["instruction"][i])), scene)])
        assert referent == scenes["privileged", "referent"][i]
    assert torch.equal(scenes["objects"], env.draw_scenes(40, seed=5)["objects"])
    spec = env.observation_spec
    for key in ("objects", "objects_mask", "instruction"):
        assert scenes[key].dtype == spec[key].dtype
        assert scenes[key].shape[1:] == spec[key].shape[1:]


def test_started_episodes_differ_only_in_their_words():
    env = make(task="nl_reach_large", worlds=6)
    episodes = env.task.each_in_turn(np.random.default_rng(0))
    begun = env.start(episodes, seed=3)
    assert len(episodes) == 6
    for key in ("robot", "objects", "objects_mask", "hold"):
        assert (begun[key] == begun[key][0]).all(), key
    assert len(set(begun["privileged", "referent"].tolist())) == 6
    assert [env.sentence(i) for i in range(6)] == [episode.sentence for episode in episodes]


@pytest.mark.slow
def test_the_oracle_finds_and_reaches_what_every_split_says():
    for split in ("train", "test_paraphrase", "test_length"):
        env = make("kuka", "step", "nl_reach_large", f"task.split={split}", worlds=8, seed=4)
        oracle, state = Oracle(env), env.reset()
        success, ended = np.zeros(8, bool), np.zeros(8, bool)
        while not ended.all():
            state = env.step(oracle(state.exclude("privileged")))["next"]
            success |= state["success"][:, 0].numpy() & ~ended
            ended |= state["done"][:, 0].numpy()
        assert success.mean() >= 0.85, split
        env.close()
