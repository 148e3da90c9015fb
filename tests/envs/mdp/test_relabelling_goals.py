"""A relabelled episode equals what the environment would have recorded with the new goal."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from envs.experts import expert
from envs.mdp.object_rows import OBJECT_WIDTH
from language import parse
from tests.helpers.env_cases import act, leaves, make

WORLDS, SEED = 6, 11
TASKS = ("nl_reach", "nl_push", "nl_pick_and_place", "nl_stack")
# No curriculum: an arm that begins at the referent would begin elsewhere with another goal.
REST = ("task.curriculum.near=0", "task.curriculum.placed=0", "task.curriculum.held=0")


@pytest.fixture(scope="module", params=TASKS)
def env(request):
    made = make("kuka", "step", request.param, *REST, worlds=WORLDS, seed=3)
    yield made
    made.close()


def drawn(env, seed):
    rng = np.random.default_rng(seed)
    return [env.task.draw(rng) for _ in range(WORLDS)]


def recorded(env, episodes, driver):
    """Each world's frames (T,) up to where its episode ends, under actions driver(td, t) (N, A)."""
    td, steps = env.start(episodes, SEED), []
    for t in range(env.config.task.max_steps):
        td = td.exclude("reward", "action").clone()
        action = driver(td, t)
        after = act(env, td, action)
        steps.append(td.set("action", action).set("next", after.exclude("action")).clone())
        td = after
    frames = torch.stack(steps, 1)
    ends = frames["next", "done"][..., 0].int().argmax(1)
    return [frames[i, : int(end) + 1] for i, end in enumerate(ends)]


def others(td, targets, *slots):
    """(N,) for each world another of its targets, or of its real objects, than those in slots (N,) each."""
    fits = td["objects_mask"].numpy() & ((td["objects"][..., OBJECT_WIDTH - 1] > 0.5).numpy() == targets)
    for those in slots:
        fits[np.arange(WORLDS), those] = False
    return np.where(fits.any(1), fits.argmax(1), slots[0])


def moves(td):
    return "held" in td["privileged"].keys()


def at_another(env):
    """Does all that is asked, but with another object, and at another target."""
    guide = expert(env)

    def drive(td, t):
        if not t:
            drive.referent = drive.target = others(td, False, td["privileged", "referent"].numpy())
            if moves(td):
                target = td["privileged", "target"].numpy()
                drive.target = others(td, not env.task.traits.real_goals, target, drive.referent)
        return guide.act(drive.referent, drive.target)

    return drive


def on_another_base(env):
    """Does what is asked, but on another base."""
    guide = expert(env)

    def drive(td, t):
        if not t:
            drive.referent, target = (td["privileged", name].numpy() for name in ("referent", "target"))
            drive.target = others(td, False, target, drive.referent)
        return guide.act(drive.referent, drive.target)

    return drive


def let_go_on_the_way(env):
    """Does what is asked, but stops and lets go before it is there."""
    guide = expert(env)

    def drive(td, t):
        slots = [td["privileged", name].numpy() for name in ("referent", "target")]
        action, place = guide.act(*slots), td["objects"][range(WORLDS), slots[0], :3]
        drive.begun = place.clone() if not t else drive.begun
        drive.left = torch.zeros(WORLDS, dtype=torch.bool) if not t else drive.left
        drive.left |= (place - drive.begun)[:, :2].norm(dim=1) > 0.06
        stop = td["hold"].clone()
        stop[:, 3:] = -1.0
        return torch.where(drive.left[:, None], stop, action)

    return drive


def drivers(env):
    if env.task.traits.real_goals:
        return [at_another, on_another_base]
    return [at_another, let_go_on_the_way] if env.task.traits.moves else [at_another]


@pytest.fixture(scope="module")
def relabelled_episodes(env):
    """(original episode, its frames, the relabelled frames) of every episode that can be relabelled."""
    kept = []
    for count, driver in enumerate(drivers(env)):
        episodes = drawn(env, count)
        for episode, frames in zip(episodes, recorded(env, episodes, driver(env)), strict=True):
            for relabelled in env.hindsight([frames], count):
                kept.append((episode, frames, relabelled))
    return kept


def sentence(relabelled):
    return bytes(relabelled["privileged", "sentence"][0].tolist()).rstrip(b"\0").decode()


def as_asked(episode, frames, relabelled):
    """The episode with the relabelled goal, its targets where the relabelled frames have them."""
    seen, now = frames["objects"][0, :, :3].numpy(), relabelled["objects"][0, :, :3].numpy()
    slots = [int(np.linalg.norm(seen - place, axis=1).argmin()) for place in episode.scene.positions]
    places = np.where(episode.scene.targets[:, None], now[slots], episode.scene.positions)
    meant = {
        name: slots.index(int(relabelled["privileged", name][0]))
        for name in ("referent", "target")
        if name in relabelled["privileged"].keys()
    }
    return replace(
        episode,
        scene=episode.scene.moved(places),
        sentence=sentence(relabelled),
        kind=int(relabelled["privileged", "kind"][0]),
        **meant,
    )


@pytest.mark.slow
def test_a_relabelled_episode_equals_a_recording_with_that_goal(env, relabelled_episodes):
    assert len(relabelled_episodes) >= WORLDS
    assert sum(bool(relabelled["next", "success"].any()) for _, _, relabelled in relabelled_episodes) >= WORLDS / 2
    for first in range(0, len(relabelled_episodes), WORLDS):
        check_recording(env, relabelled_episodes[first : first + WORLDS])


def check_recording(env, episodes):
    """Records the relabelled episodes, each in its own world, and compares them."""
    td, wanted = env.start([as_asked(*each) for each in episodes], SEED), [relabelled for *_, relabelled in episodes]
    before, after = [], []
    for t in range(max(map(len, wanted))):
        actions = [relabelled["action"][min(t, len(relabelled) - 1)] for relabelled in wanted]
        actions += actions[-1:] * (WORLDS - len(actions))
        before.append(td.exclude("reward", "action").clone())
        td = act(env, before[-1], torch.stack(actions))
        after.append(td.exclude("action").clone())
    before, after = torch.stack(before, 1), torch.stack(after, 1)
    for i, relabelled in enumerate(wanted):
        real = after[i, : len(relabelled)]
        check(before[i, : len(relabelled)], relabelled)
        check(real, relabelled["next"])
        torch.testing.assert_close(real["reward"], relabelled["next", "reward"], atol=1e-5, rtol=0)
        assert bool(real["terminated"][-1]) == bool(relabelled["next", "terminated"][-1])


def check(real, relabelled):
    """The recording equals the relabelled frames but for rounding, and except for the truncation at their end."""
    of_the_policy = ("action", "next", "reward", "done", "truncated")
    real, relabelled = leaves(real.exclude(*of_the_policy)), leaves(relabelled.exclude(*of_the_policy))
    assert set(relabelled) == set(real)
    for key, value in relabelled.items():
        torch.testing.assert_close(value, real[key], atol=1e-5, rtol=0, msg=lambda text, key=key: f"{key}: {text}")


@pytest.mark.slow
def test_the_new_sentence_names_the_new_objects_in_the_new_scene(env, relabelled_episodes):
    for episode, frames, relabelled in relabelled_episodes:
        asked = as_asked(episode, frames, relabelled)
        step = parse(asked.sentence, asked.scene).steps[-1]
        assert asked.sentence != episode.sentence or asked.scene is not episode.scene
        assert (relabelled["instruction"] == torch.tensor(env.tokenizer.encode(asked.sentence).tolist())).all()
        if env.task.traits.moves:
            assert (step.init, step.goal) == (asked.referent, asked.target)
        else:
            assert step.goal == asked.referent


@pytest.mark.slow
def test_a_relabelled_episode_is_cut_at_its_success(relabelled_episodes):
    for _, _, relabelled in relabelled_episodes:
        after = relabelled["next"]
        assert after["done"].flatten().tolist() == [False] * (len(relabelled) - 1) + [True]
        assert not after["terminated"][:-1].any()
        assert torch.equal(after["terminated"], after["success"] | after["wrong_object"] | after["wrong_target"])
        assert torch.equal(after["truncated"], after["done"] & ~after["terminated"])
        torch.testing.assert_close(after["reward"], after["reward_terms"].sum(-1, keepdim=True))


@pytest.mark.slow
def test_an_episode_that_reached_its_goal_is_not_relabelled(env):
    guide = expert(env)
    for frames in recorded(env, drawn(env, 5), lambda td, t: guide(td)["action"]):
        if frames["next", "success"].any():
            assert env.hindsight([frames], 0) == []


@pytest.mark.slow
def test_a_seed_gives_the_same_relabelled_episodes_in_any_batch(env):
    episodes = recorded(env, drawn(env, 0), drivers(env)[0](env))
    many = [*episodes] * 4
    first, second = env.hindsight(many, 1), env.hindsight(many, 1)
    assert len(first) == len(second) > 16  # more than are relabelled at once
    for one, other in zip(first, second, strict=True):
        assert (one == other).all()


@pytest.mark.parametrize("task", ["reach", "reach_gesture"])
def test_tasks_with_gestures_or_without_words_are_not_relabelled(task):
    env = make("kuka", "step", task, worlds=1)
    frames = env.rollout(5)[0]
    assert env.hindsight([frames], 0) == []
    env.close()
