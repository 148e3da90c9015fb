"""Tasks with a finger that shows the referent: drawn episodes, observations, and a finger that moves on."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import torch

from core.errors import ConfigError
from envs import make_env
from envs.experts import Oracle
from envs.experts.reach import ReachExpert
from human import pointed_object, ray_offsets
from language import matches, parse
from tests.helpers.env_cases import Poker, act, differences, make, rollout, task_of
from trainers.evaluation.instruction_ablations import run_to_end

GESTURE_TASKS = ["reach_gesture", "nl_reach_gesture"]
PUBLIC = ("robot", "objects", "objects_mask", "instruction", "gesture", "hold")


@pytest.fixture(scope="module")
def shown():
    """Beginnings of 200 episodes of nl_reach_gesture without noise, as they are observed."""
    env = make("kuka", "step", "nl_reach_gesture", "gesture.noise_deg=0", worlds=8)
    yield [env.reset() for _ in range(25)]
    env.close()


def rows(resets, key):
    return torch.cat([td[key] for td in resets]).numpy()


def phrase_of(sentence):
    (step,) = parse(sentence).steps
    return step.phrase


def state_for(episode):
    """Which objects the words alone fit, (K,) bool."""
    return matches(replace(phrase_of(episode.sentence), determiner="the"), episode.scene)


@pytest.mark.slow
def test_in_reach_gesture_the_goal_is_the_object_nearest_to_the_ray():
    env = make("kuka", "step", "reach_gesture", worlds=10)
    for td in (env.reset() for _ in range(10)):
        ray, objects = td["gesture"].double().numpy(), td["objects"].double().numpy()
        found = pointed_object(ray[:, :3], ray[:, 3:6], objects[..., :3], td["objects_mask"].numpy())
        assert found.tolist() == td["privileged", "referent"].tolist()
    env.close()


def test_in_reach_gesture_the_words_carry_no_information():
    task = task_of("reach_gesture")
    rng = np.random.default_rng(0)
    sentences = {task.draw(rng).sentence for _ in range(100)}
    assert sentences == {"reach there", "reach here", "reach this", "reach that"}


@pytest.mark.slow
def test_in_nl_reach_gesture_the_words_fit_two_objects_that_stand_apart_and_one_is_meant():
    task, rng = task_of("nl_reach_gesture"), np.random.default_rng(0)
    for _ in range(200):
        episode = task.draw(rng)
        fits = np.flatnonzero(state_for(episode))
        assert len(fits) == 2
        assert episode.referent in fits
        places = episode.scene.positions
        apart = np.linalg.norm(places[fits[0]] - places[fits[1]])
        neighbour = np.sort(np.linalg.norm(places - places[episode.referent], axis=1))[1]
        assert apart > neighbour
        assert phrase_of(episode.sentence).determiner in ("this", "that")


@pytest.mark.slow
def test_only_the_finger_distinguishes_the_two_candidates():
    """Nearer to the robot, nearer to the person, more to a side, or with more neighbours: each is meant as often."""
    task, rng, guesses, count = task_of("nl_reach_gesture"), np.random.default_rng(1), Counter(), 600
    for _ in range(count):
        episode = task.draw(rng)
        places, fits = episode.scene.positions, np.flatnonzero(state_for(episode))
        x, y = places[fits, 0], places[fits, 1]
        near = (np.linalg.norm(places[:, None] - places[fits], axis=2) < 0.12).sum(0)
        crowd = np.linalg.norm(places[:, None] - places[fits], axis=2).sum(0)
        for name, score in {"x": x, "y": y, "neighbours": near + 1e-3 * x, "crowd": crowd, "first": -fits}.items():
            guesses[name] += fits[score.argmax()] == episode.referent
    for name, right in guesses.items():
        assert 0.43 < right / count < 0.57, name  # three and a half standard deviations


@pytest.mark.slow
def test_the_ray_observed_is_that_of_the_persons_fingertip_and_goes_through_what_is_meant(shown):
    ray, goal = rows(shown, "gesture").astype(float), rows(shown, ("privileged", "goal"))
    assert (ray[:, 6] == 1).all()
    np.testing.assert_allclose(np.linalg.norm(ray[:, 3:6], axis=1), 1.0, atol=1e-6)
    angle = ray_offsets(ray[:, :3], ray[:, 3:6], goal[:, None]).angle
    assert np.rad2deg(angle).max() < 0.5
    assert (ray[:, 2] > 0.05).all()  # above the table
    assert (ray[:, 0] > 0.6).all()  # on the person's side of the objects


@pytest.mark.slow
def test_referent_and_aiming_error_are_privileged(shown):
    pointing = rows(shown, ("privileged", "pointing"))
    assert np.rad2deg(pointing[:, 0]).max() < 0.5
    distance = np.linalg.norm(rows(shown, ("privileged", "goal")) - rows(shown, "gesture")[:, :3], axis=1)
    np.testing.assert_allclose(pointing[:, 2], distance, atol=1e-5)
    assert (pointing[:, 1] > 0.02).all()


@pytest.mark.slow
@pytest.mark.parametrize("noise", [2.0, 6.0])
def test_the_aiming_error_has_the_configured_deviation(noise):
    env = make("kuka", "step", "nl_reach_gesture", f"gesture.noise_deg={noise}", worlds=10)
    angles = np.concatenate([env.reset()["privileged", "pointing"][:, 0].numpy() for _ in range(30)])
    env.close()
    spread = np.rad2deg(np.sqrt((angles**2).mean() / 2))  # of each of the two directions across
    assert spread == pytest.approx(noise, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("style", ["finger", "wrist", "eye"])
def test_every_style_puts_its_own_line_through_what_is_meant(style):
    env = make("kuka", "step", "nl_reach_gesture", "gesture.noise_deg=0", f"gesture.style={style}", worlds=20)
    assert np.rad2deg(env.reset()["privileged", "pointing"].numpy()[:, 0]).max() < 0.5
    env.close()


@pytest.mark.slow
def test_without_a_gesture_no_public_observation_identifies_the_referent():
    env = make("kuka", "step", "nl_reach_gesture", "gesture.dropout=1", worlds=2)
    for seed in range(5):
        td = env.start(env.task.each_in_turn(np.random.default_rng(seed)), seed)
        assert td["privileged", "referent"][0] != td["privileged", "referent"][1]
        assert (td["gesture"] == 0).all()
        for _ in range(5):
            one, other = (td.select(*PUBLIC)[i] for i in range(2))
            assert differences(one, other) == []
            td = act(env, td, torch.zeros(2, 3))
    env.close()


@pytest.mark.slow
def test_dropout_is_the_share_of_episodes_without_a_gesture():
    env = make("kuka", "step", "reach_gesture", "gesture.dropout=0.3", worlds=10)
    without = np.concatenate([env.reset()["gesture"][:, 6].numpy() == 0 for _ in range(40)])
    env.close()
    assert 0.2 < without.mean() < 0.4


@pytest.mark.slow
def test_a_gesture_switch_moves_the_arm_and_changes_the_goal():
    env = make("kuka", "step", "nl_reach_gesture", "gesture.switch=1", "gesture.frames=30", worlds=8)
    td = env.reset()
    rays, referents = [td["gesture"].numpy()], [td["privileged", "referent"].numpy()]
    for _ in range(20):
        td = act(env, td, torch.zeros(8, 3))
        rays.append(td["gesture"].numpy())
        referents.append(td["privileged", "referent"].numpy())
    rays, referents = np.array(rays), np.array(referents)
    assert ((referents[1:] != referents[:-1]).sum(0) == 1).all()
    moved = (np.abs(np.diff(rays, axis=0)) > 1e-5).any(-1)
    assert (moved.sum(0) >= 3).all()  # 30 physics steps are two and a half control steps
    for i in range(8):
        first = np.flatnonzero(referents[1:, i] != referents[:-1, i])[0]
        assert not moved[:first, i].any()
        assert not moved[first + 4 :, i].any()
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize("task", GESTURE_TASKS)
def test_after_a_gesture_switch_only_the_new_referent_is_a_success(task):
    env = make("kuka", "step", task, "gesture.switch=1", worlds=16)
    assert run_to_end(env, Oracle(env), env.reset()).all()
    expert = ReachExpert(env)
    stubborn = lambda td: td.set("action", env.towards(expert.over(first)))  # noqa: E731
    env.set_seed(0)
    td = env.reset()
    first = td["privileged", "goal"].numpy().astype(np.float64)
    assert run_to_end(env, stubborn, td).float().mean() <= 0.125  # who was there before it moved on
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize("task", GESTURE_TASKS)
def test_each_object_pointed_at_in_turn_is_reached(task):
    env = make("kuka", "step", task, "gesture.noise_deg=0", worlds=3)
    for seed in range(3):
        episodes = env.task.each_in_turn(np.random.default_rng(seed))
        td = env.start(episodes, seed)
        meant = td["privileged", "referent"][: len(episodes)].tolist()
        assert len(set(meant)) == len(episodes)
        assert run_to_end(env, Oracle(env), td)[: len(episodes)].all()
    env.close()


@pytest.mark.slow
def test_words_and_a_finger_go_together_in_any_task():
    env = make("kuka", "step", "nl_reach", "workspace=collabtable", "gesture=ray", worlds=16)
    td = env.reset()
    assert np.rad2deg(td["privileged", "pointing"].numpy()[:, 0]).max() < 0.5
    assert run_to_end(env, Oracle(env), td).all()
    env.close()


def test_drawn_scenes_hold_the_gesture_that_episodes_would_show():
    env = make("kuka", "step", "reach_gesture", worlds=2)
    scenes = env.draw_scenes(50, seed=3)
    ray = scenes["gesture"].double().numpy()
    found = pointed_object(ray[:, :3], ray[:, 3:6], scenes["objects"].double().numpy()[..., :3])
    assert found.tolist() == scenes["privileged", "referent"].tolist()
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize("task", GESTURE_TASKS)
def test_the_same_seed_gives_the_same_bits_whatever_the_number_of_worlds(task):
    ends = []
    for worlds in (1, 3):
        env = make("kuka", "step", task, "gesture.switch=1", worlds=worlds, seed=5)
        td = env.reset()
        kept = [td.clone()]
        for _ in range(40):
            td = act(env, td, env.towards(td["privileged", "goal"].double().numpy() - [0, 0, 0.02]))
            kept.append(td.exclude("reward").clone())
            if td["done"][0]:
                td = env.reset(td.exclude("reward", "action").set("_reset", torch.eye(worlds, 1, dtype=torch.bool)))
                kept.append(td.clone())
        ends.append(torch.stack([each.exclude("action")[0] for each in kept]))
        env.close()
    assert differences(*ends) == []


@pytest.mark.slow
@pytest.mark.parametrize("task", GESTURE_TASKS)
def test_rendering_does_not_change_the_bits(task):
    """With rendering the person has a body in Bullet; without it, only an arm in NumPy."""
    seen = []
    for render in (True, False):
        env = make("kuka", "step", task, "gesture.switch=1", worlds=2, seed=5, render=render)
        seen.append(rollout(env, 60, Poker(env)))
        env.close()
    assert differences(*seen) == []


@pytest.mark.slow
def test_a_seed_gives_the_same_bits_after_the_robot_met_the_person():
    near = "workspace.human.position=[1.2,-0.15,-0.74]"
    env = make("kuka", "joints", "reach_gesture", near, "gesture.switch=1", worlds=2, seed=5, render=True)
    fresh = rollout(env, 40, Poker(env))
    env.set_seed(6)
    td, forward = env.reset(), torch.tensor([[0.0, 0.8, 0.0, -0.2, 0.0, 0.0, 0.0]]).expand(2, -1)
    tip = td["gesture"][:, :3]
    for _ in range(60):
        td = act(env, td, forward)
    assert env.gripper[:, 0].max() > tip[:, 0].min()  # else the test would show little
    env.set_seed(5)
    assert differences(rollout(env, 40, Poker(env)), fresh) == []
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["task=reach_gesture", "workspace=table"], r"gesture.source=ray needs a person.*workspace=collabtable"),
        (["task=nl_reach", "gesture=ray"], r"gesture.source=ray needs a person.*workspace=collabtable"),
        (["task=reach_gesture", "gesture=none"], r"task.name=reach_gesture needs a person who points: gesture=ray"),
        (["task=reach_gesture", "gesture.noise_deg=-1"], r"gesture.noise_deg=-1.*\[0, 45\]"),
        (["task=reach_gesture", "gesture.style=fist"], r"gesture.style=fist is not known; did you mean"),
        (["task=reach_gesture", "gesture.dropout=1.5"], r"gesture.dropout=1.5.*\[0, 1\]"),
        (["task=reach_gesture", "gesture.frames=0"], r"gesture.frames=0.*\[1, "),
        (["task=nl_reach_gesture", "task.kinds=[relation]"], r"task.kinds=relation is not said in nl_reach_gesture"),
        (["task=nl_reach_gesture", "task.kinds=[]"], r"needs task.kinds of color, shape, color_shape"),
        (["task=nl_reach_gesture", "task.min_objects=1"], r"min_objects=1"),
        (["task=nl_reach_gesture", "task.spacing=0.2"], r"do not fit in two groups"),
    ],
)
def test_unreachable_pointing_targets_are_refused_in_one_line(words, message):
    with pytest.raises(ConfigError, match=message) as caught:
        make_env(words)
    assert "\n" not in str(caught.value)
