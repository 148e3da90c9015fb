"""Anything: what is drawn and said, whose rules count, and one instruction after another in the same world."""

from collections import Counter
from contextlib import closing

import numpy as np
import pytest
import torch

from core.errors import ConfigError
from envs import make_env
from envs.experts import expert
from envs.mdp.object_rows import COLUMNS
from envs.tasks.reach import NLReach
from envs.tasks.shared.feasible import PLAIN_VERBS as VERBS
from envs.tasks.shared.feasible import options
from envs.tasks.shared.types import NOTHING
from language import parse
from language.verbs import DEVICE_VERBS, HANDING
from tests.helpers.env_cases import act, begun, config_of, differences, make, partial_reset, task_of

WORLDS, LENGTH = 6, 4
SAID = (*VERBS, *DEVICE_VERBS, HANDING)  # with devices and a hand
PLAIN = "task.curriculum={near: 0, held: 0, placed: 0}"


@pytest.fixture(scope="module", params=["kuka", "panda"])
def env(request):
    made = make(request.param, "step", "anything", PLAIN, f"task.instructions={LENGTH}", worlds=WORLDS)
    yield made
    made.close()


@pytest.mark.slow
def test_every_verb_is_drawn_as_often_and_its_sentence_names_what_the_episode_is_about():
    task, rng, verbs = task_of("anything"), np.random.default_rng(0), Counter()
    for _ in range(220):
        episode = task.draw(rng)
        understood = parse(episode.sentence, episode.scene).steps[-1]
        assert task.verbs[episode.kind] == understood.task == task.verbs[episode.kind]
        named = [index for index in (understood.init, understood.goal) if index is not None]
        assert named == [episode.referent, *([] if episode.target is None else [episode.target])]
        verbs[task.verbs[episode.kind]] += 1
    assert set(verbs) == set(task.verbs)
    assert max(verbs.values()) < 3 * min(verbs.values())


def test_only_the_verbs_that_are_asked_for_are_said_first_and_after_a_success():
    task, rng = task_of("anything", "task.verbs=[stack,lift]"), np.random.default_rng(3)
    episodes = [task.draw(rng) for _ in range(20)]
    assert {task.verbs[episode.kind] for episode in episodes} == {"stack", "lift"}
    following = [task.next_instruction(episode.scene, NOTHING, rng) for episode in episodes]
    assert {SAID[said.kind] for said in following if said is not None} <= {"stack", "lift"}
    assert task.kind_names == SAID  # the policy tells all verbs apart, whichever are said


def test_verbs_that_a_task_does_not_have_are_refused():
    with pytest.raises(ConfigError, match=r"task.verbs=\['stak'\] must be of reach, .*did you mean 'stack'"):
        task_of("anything", "task.verbs=[stak]")
    with pytest.raises(ConfigError, match=r"task.verbs=\['reach'\] must be empty in task.name=nl_reach"):
        task_of("nl_reach", "task.verbs=[reach]")


@pytest.mark.slow
def test_failures_of_verbs_are_counted_as_their_instructions_end():
    env = make("kuka", "step", "anything", PLAIN, "task.verbs=[grasp,stack]", "task.max_steps=25", worlds=6)
    td, guide = env.reset(), expert(env)
    assert set(env.task.draw_state.values()) == {1.0}
    for _ in range(60):
        succeeds = env.state.kind == SAID.index("grasp")  # the arm stands still where it is to stack
        action = torch.where(torch.from_numpy(succeeds)[:, None], guide(td.clone())["action"], td["hold"])
        td = env.step_and_maybe_reset(td.set("action", action))[1]
    assert env.task.draw_state["grasp"] < 0.9
    assert env.task.draw_state["stack"] == env.task.draw_state["reach"] == 1.0
    env.set_seed(0)
    assert env.task.draw_state["grasp"] == 1.0  # a seed gives the same episodes, whatever happened before
    env.close()


def test_a_task_with_one_verb_refuses_an_automatic_curriculum():
    with pytest.raises(
        ConfigError, match=r"task.curriculum.automatic=true needs several verbs, and task.name=nl_reach"
    ):
        task_of("nl_reach", "task.curriculum.automatic=true")


def test_one_scene_is_asked_for_all_that_is_feasible_and_nameable_in_it():
    task, rng = task_of("anything", "task.kinds=[color_shape, superlative, relation]"), np.random.default_rng(1)
    for _ in range(5):
        episodes = task.each_in_turn(rng)
        asked = {(SAID[each.kind], each.referent, each.target) for each in episodes}
        assert asked <= set(options(task.room(episodes[0].scene)))
        assert len(asked) == len(episodes) > 5


def test_the_curriculum_begins_with_the_object_held_or_with_the_gripper_elsewhere():
    task, rng = task_of("anything", "task.curriculum={near: 0.4, held: 0.4, placed: 0}"), np.random.default_rng(2)
    starts = [episode.start for episode in (task.draw(rng) for _ in range(120))]
    held = [start for start in starts if start is not None and start.held]
    elsewhere = [start for start in starts if start is not None and not start.held]
    assert 5 < len(held) < 40
    assert 25 < len(elsewhere) < 75
    assert all((start.offset == 0).all() for start in held)


@pytest.mark.slow
def test_the_expert_carries_out_one_instruction_after_another_and_the_world_goes_on(env):
    td, guide = begun(env, seed=5), expert(env)
    done, successes = np.zeros(WORLDS, bool), np.zeros(WORLDS, int)
    for _ in range(LENGTH * 80):
        said, places = [env.sentence(i) for i in range(WORLDS)], env.state.objects.copy()
        after = act(env, td, guide(td.clone())["action"])
        for i in np.flatnonzero(~done).tolist():
            if not after["success"][i]:
                continue
            successes[i] += 1
            ends = bool(after["done"][i])
            assert ends == (successes[i] == LENGTH)
            if not ends:
                assert env.elapsed[i] == 0
                assert env.sentence(i) != said[i] or SAID[env.state.kind[i]] == "reach"
                assert np.abs(env.state.objects[i] - places[i]).max() < 0.03  # nothing is put back
                assert (after["instruction"][i] == torch.tensor(env.tokenizer.encode(env.sentence(i)))).all()
                assert after["privileged", "verb"][i] == env.state.kind[i]
        done |= after["done"][:, 0].numpy()
        if done.all():
            break
        td = after
    assert (successes == LENGTH).mean() >= 0.8, successes


@pytest.mark.slow
def test_a_rollout_that_goes_on_is_continued_bit_for_bit():
    first = make("kuka", "step", "anything", "task.instructions=3", worlds=2, seed=4)
    second = make("kuka", "step", "anything", "task.instructions=3", worlds=2, seed=9)
    td, guide, actions, told = first.reset(), expert(first), [], set()
    beginnings = list(first.beginnings)
    left = np.inf  # steps after the second instruction of a world was given
    while left > 0:
        actions.append(guide(td.clone())["action"])
        td = act(first, td, actions[-1])
        assert not td["done"].any()
        told |= {first.sentence(i) for i in range(2)}
        left = min(left - 1, 5) if len(told) > 2 else left
    second.continue_episodes(beginnings, torch.stack(actions, 1), torch.full((2,), len(actions)))
    assert differences(second.reset(), td.exclude("reward")) == []
    first.close()
    second.close()


@pytest.mark.slow
def test_the_verb_that_is_said_decides_about_success():
    env = make("kuka", "step", "anything", PLAIN, "task.hold_steps=3", worlds=WORLDS, seed=1)
    td, guide, right = begun(env, 11), expert(env), np.zeros(WORLDS, bool)
    wrong = [SAID.index("reach") if kind != SAID.index("reach") else SAID.index("lift") for kind in env.state.kind]
    env.state.kind[:] = wrong  # another verb of the same objects
    env.task.reset(np.arange(WORLDS), env.state)
    for _ in range(25):
        td = act(env, td, guide(td.clone())["action"])
        right |= td["success"][:, 0].numpy()
    reached = np.array(wrong) == SAID.index("reach")
    assert right[reached].all()
    env.close()


def test_the_observed_place_is_free_for_each_object_and_scenes_without_a_simulator_show_the_same_columns(env):
    td = begun(env, seed=5)
    shown = td["objects_mask"]
    free = td["objects"][..., :2] + td["objects"][..., -6:-4]
    x0, x1, y0, y1 = env.config.workspace.object_area
    on_table = shown & (td["objects"][..., 1].abs() < y1) & (td["objects"][..., 0] < x1)
    assert ((free[..., 0] > x0 - 1e-5) & (free[..., 0] < x1 + 1e-5))[on_table].all()
    assert ((free[..., 1] > y0 - 1e-5) & (free[..., 1] < y1 + 1e-5))[on_table].all()
    scenes = env.draw_scenes(40, seed=0)
    assert set(scenes["privileged"].keys()) == {"referent", "target", "verb"}
    low, high = scenes["objects"][..., COLUMNS].amin((0, 1)), scenes["objects"][..., COLUMNS].amax((0, 1))
    assert (low[-6:-4] < -0.05).all()
    assert (high[-6:-4] > 0.05).all()


def test_a_new_episode_of_one_world_leaves_the_instructions_of_the_others(env):
    td = begun(env, seed=5)
    before = [env.sentence(i) for i in range(WORLDS)]
    partial_reset(env, td, [2])
    assert [env.sentence(i) for i in range(WORLDS) if i != 2] == [before[i] for i in range(WORLDS) if i != 2]


def test_only_a_task_that_goes_on_takes_several_instructions():
    with pytest.raises(ConfigError, match=r"task\.instructions=2 must be 1 in task\.name=nl_lift: take task=anything"):
        task_of("nl_lift", "task.instructions=2")


def test_evaluations_have_one_instruction_and_as_many_as_they_ask_for():
    config = config_of("task=anything", "task.instructions=3")
    assert config.without_curriculum().task.instructions == 1
    assert config.without_curriculum().with_instructions(5).task.instructions == 5


def test_anything_needs_fittings_with_handles():
    with pytest.raises(
        ConfigError, match=r"task\.name=anything needs a workspace whose fittings are drawer and fridge"
    ):
        make_env(["task=anything", "workspace=table"])


def test_a_term_that_another_task_gains_counts_nothing_here(monkeypatch):
    monkeypatch.setattr(NLReach, "terms", (*NLReach.terms, "low"))
    with closing(make_env(["task=anything"])) as env:
        assert "low" not in env.reward_names
        env.rollout(2)
    with pytest.raises(ConfigError, match=r"\+task\.reward\.low=0 switches it off, also for runs"):
        make_env(["task=nl_reach"])
