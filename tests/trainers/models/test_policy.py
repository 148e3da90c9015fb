import pytest
import torch
from torchrl.data import Bounded
from torchrl.envs.utils import ExplorationType, check_env_specs, set_exploration_type

from tests.helpers.fake_env import make_env
from tests.helpers.training_configs import training
from trainers.algorithms.algorithm import build_algorithm
from trainers.models.grounding import grounding_loss
from trainers.models.networks import Normalise
from trainers.models.policy import FlatEncoder, MoveBounds, build_policy, stochastic_actor


@pytest.fixture(scope="module")
def env():
    return make_env(8, 0)


def make(env, policy="grounded", squash=False):
    torch.manual_seed(0)
    return build_policy(
        training(policy=policy).policy, env.observation_spec, env.action_unit, MoveBounds(squash=squash)
    )


def test_the_fake_environment_passes_check_env_specs(env):
    check_env_specs(env)


@pytest.mark.parametrize("policy", ["grounded", "mlp"])
@pytest.mark.parametrize("squash", [False, True])
def test_a_policy_acts_on_public_observations(env, policy, squash):
    act = make(env, policy, squash).act
    state = env.reset().select(*act.in_keys)
    assert not any("privileged" in key for key in act.in_keys)
    for mode in (ExplorationType.RANDOM, ExplorationType.DETERMINISTIC):
        with set_exploration_type(mode), torch.no_grad():
            action = act(state.clone())["action"]
        assert action.shape == (8, 3)
        assert action.abs().max() <= 1


@pytest.mark.parametrize("policy", ["grounded", "mlp"])
def test_actions_are_finite_without_words_and_objects(env, policy):
    state = env.reset()
    state["instruction"].zero_()
    state["objects_mask"].zero_()
    out = make(env, policy).act(state)
    assert out["action"].isfinite().all()
    out["action"].sum().backward()


@pytest.mark.parametrize("policy", ["grounded", "mlp"])
def test_masked_slots_do_not_change_the_context(env, policy):
    made, state = make(env, policy), env.reset()
    state["objects_mask"][:, 1] = False
    other = state.clone()
    other["objects"][:, 1] = 0.3
    torch.testing.assert_close(made.encode(state)[made.context_key], made.encode(other)[made.context_key])


def test_the_order_of_slots_does_not_change_the_referent(env):
    made, state = make(env), env.reset()
    turned = state.clone()
    turned["objects"] = state["objects"].roll(1, 1)
    torch.testing.assert_close(made.encode(state)["referent"], made.encode(turned)["referent"])
    torch.testing.assert_close(state["attention_logits"].roll(1, 1), turned["attention_logits"])


def test_the_order_of_words_changes_the_queries(env):
    ask = make(env).encoder.query_encoder
    one, other = torch.tensor([[1, 2, 3, 4, 0, 0]]), torch.tensor([[1, 2, 4, 3, 0, 0]])
    assert (ask(one) - ask(other)).abs().max() > 1e-3


def test_repeated_sentences_get_the_same_queries(env):
    ask = make(env).encoder.query_encoder
    tokens = torch.randint(0, 6, (20, 6)).repeat(5, 1)
    torch.testing.assert_close(ask(tokens), ask.encode(tokens))


@pytest.mark.parametrize(("policy", "attends"), [("grounded", True), ("mlp", False)])
def test_only_the_grounded_policy_attends(env, policy, attends):
    assert make(env, policy).attends == attends


def test_the_grounding_loss_is_zero_for_attention_on_the_referent(env):
    state = make(env).encode(env.reset())
    state["attention_logits"] = 50.0 * torch.nn.functional.one_hot(state["privileged", "referent"], 3)
    loss, accuracy = grounding_loss(state)
    assert loss < 1e-6
    assert accuracy == 1


@pytest.mark.parametrize("algo", ["ppo", "sac"])
@pytest.mark.parametrize("policy", ["grounded", "mlp"])
def test_an_unprivileged_critic_reads_no_goal_and_trains_no_words(env, algo, policy):
    small = training(algo, policy, ("policy.privileged_critic=false",))
    made, learner = build_algorithm(small, env.observation_spec, env.action_unit)
    state = made.encode(env.reset().exclude("privileged"))
    aim = state[made.context_key]
    action = [torch.zeros(8, 3)] if algo == "sac" else []
    critic = learner.critic if algo == "sac" else learner.critic.module
    critic(state["robot"], aim, *action).sum().backward()
    assert all(p.grad is None for p in made.encoder.parameters())


@pytest.mark.parametrize("policy", ["grounded", "mlp"])
def test_encode_transition_equals_encode_of_both_ends(env, policy):
    made, before, after = make(env, policy), env.reset(), env.reset()
    after["instruction"] = before["instruction"]
    alone = made.encode(before.clone())[made.context_key], made.encode(after.clone())[made.context_key]
    made.encode_transition(before, after)
    torch.testing.assert_close((before[made.context_key], after[made.context_key]), alone)
    assert before[made.context_key].requires_grad
    assert not after[made.context_key].requires_grad


def test_the_log_probability_of_a_move_is_that_of_the_stochastic_actor(env):
    made = make(env)
    with torch.no_grad():
        state = made.act(env.reset())
        again = stochastic_actor(made).log_prob(state.clone())
    torch.testing.assert_close(state["move_log_prob"], again)
    assert ((state["hold"] + state["move"]).clamp(-1, 1) == state["action"]).all()


def test_a_mean_move_is_within_one_control_step(env):
    made, state = make(env), env.reset()
    with torch.no_grad():
        made.actor.net[-1].weight.mul_(1e4)
        loc, _ = made.move_parameters(made.encode(state))
    assert loc.abs().max() <= 1
    assert loc.abs().max() > 0.9


def test_a_task_without_words_is_encoded_as_padding_is():
    encoder = FlatEncoder(Normalise(Bounded(-1.0, 1.0, (1, 2, 3))), slots=2, vocabulary=7, embedding=4)
    padding = torch.zeros(5, 6, dtype=torch.int64)
    words = encoder.encode_words(padding)
    torch.testing.assert_close(words, encoder.word_embedding(padding).detach())
    assert not words.requires_grad
    assert encoder.encode_words(padding + 1).requires_grad
