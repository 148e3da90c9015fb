"""Devices in a room: what is drawn and observed of them, what is feasible, and whose rules count."""

import re
from collections import Counter
from itertools import pairwise

import numpy as np
import pytest

from core.errors import ConfigError
from envs import make_env
from envs.experts import expert
from envs.mdp.object_rows import COLUMNS
from envs.tasks.shared.feasible import PLAIN_VERBS as VERBS
from envs.tasks.shared.types import NOTHING
from language import DEVICES, NOUNS
from language.verbs import DEVICE_VERBS
from tests.helpers.env_cases import act, begun, config_of, make, task_of

WORLDS, LENGTH = 4, 3
PLAIN = "task.curriculum={near: 0, held: 0, placed: 0}"
OPERATING = "task.verbs=[press,switch,turn]"
WITHOUT = ("task.devices=0", "task.hand=false", "workspace=room", "task.num_objects=7", "task.min_objects=5")
NUMBERS = [list(NOUNS).index(noun) for noun in DEVICES]
LEVER = list(NOUNS).index("lever")


@pytest.fixture(scope="module", params=["kuka", "panda"])
def env(request):
    made = make(request.param, "step", "anything", PLAIN, OPERATING, f"task.instructions={LENGTH}", worlds=WORLDS)
    yield made
    made.close()


def column(env, td, name):
    """(N, K) the values of one of the task's own columns."""
    at = [each.name for each in env.task.columns].index(name)
    return td["objects"][..., COLUMNS.start + at].numpy()


def test_devices_stand_apart_in_a_row_behind_the_loose_objects():
    task, rng, nouns = task_of("anything"), np.random.default_rng(0), Counter()
    area = config_of("task=anything").workspace.device_area
    for _ in range(60):
        scene = task.draw(rng).scene
        which = np.isin(scene.nouns, NUMBERS)
        places = scene.positions[which]
        assert which.sum() == 3
        assert max(Counter(scene.nouns[which].tolist()).values()) <= 2
        assert (np.diff(np.sort(places[:, 1])) > 0.05).all()
        assert (np.abs(places[:, 0] - np.mean(area[:2])) < 0.08).all()
        room = task.room(scene)
        assert scene.positions[~which & ~room.fits & ~room.inside.any(1) & ~room.hands, 0].max() < 0.5
        nouns.update(scene.nouns[which].tolist())
    assert min(nouns[number] for number in NUMBERS) > 40


@pytest.mark.slow
def test_observed_devices_are_as_the_episode_and_scenes_without_a_simulator_have_them(env):
    td = begun(env, seed=2)
    moved, nouns = env.task.moved(env.state), env.state.nouns
    levers = env.state.shown & (nouns == LEVER)
    assert (np.minimum(np.abs(moved), np.abs(moved - 1))[levers] < 0.02).all()
    assert np.allclose(column(env, td, "share of its way from its start"), moved, atol=1e-6)
    assert (column(env, td, "share of its way since the instruction was given") == 0).all()
    scenes = env.draw_scenes(60, seed=0)
    over = column(env, scenes, "share of its way from its start")[column(env, scenes, "is a lever") > 0.5]
    assert set(over.tolist()) == {0.0, 1.0}
    ahead = np.hypot(column(env, scenes, "faces x"), column(env, scenes, "faces y"))
    devices = sum(column(env, scenes, f"is a {noun}") for noun in DEVICES)
    assert np.allclose(ahead, devices, atol=1e-6)


def test_the_offset_to_where_the_table_is_free_is_observed_twice(env):
    td = begun(env, seed=2)
    columns = td["objects"][..., COLUMNS]
    coarse, close = columns[..., -6:-3], columns[..., -3:]
    assert np.allclose(coarse.clamp(-0.04, 0.04), close, atol=1e-6)
    on_table = td["objects_mask"] & (td["objects"][..., 17] > 0.5)  # the see-through target
    assert np.allclose((td["objects"][..., 2] + coarse[..., 2])[on_table], 0.025, atol=1e-3)


@pytest.mark.slow
def test_the_expert_operates_one_device_after_another_from_where_it_was_left(env):
    td, guide, wins = begun(env, seed=1), expert(env), 0
    done = np.zeros(WORLDS, bool)
    for _ in range(LENGTH * 90):
        before = env.task.moved(env.state)
        referents = env.state.referent.copy()
        td = act(env, td, guide(td.clone())["action"])
        ended = td["done"][:, 0].numpy() & ~done
        assert td["success"][:, 0].numpy()[ended].all()
        for i in np.flatnonzero(td["success"][:, 0].numpy() & ~done):
            wins += 1
            after = env.task.moved(env.state)[i]
            assert abs(after - before[i])[referents[i]] < 0.5  # nothing is put back
            if not ended[i]:
                assert (column(env, td, "share of its way since the instruction was given")[i] == 0).all()
        done |= ended
        if done.all():
            break
    assert done.all()
    assert wins > 2 * WORLDS


@pytest.mark.slow
def test_a_lever_is_switched_there_and_back():
    env = make("kuka", "step", "anything", PLAIN, "task.verbs=[switch]", "task.instructions=4", worlds=6)
    td, guide, said = begun(env, seed=4), expert(env), [[] for _ in range(6)]
    ends = [[] for _ in range(6)]
    done = np.zeros(6, bool)
    for _ in range(400):
        referents = env.state.referent.copy()
        td = act(env, td, guide(td.clone())["action"])
        for i in np.flatnonzero(td["success"][:, 0].numpy() & ~done):
            said[i].append(int(referents[i]))
            ends[i].append(round(float(env.task.moved(env.state)[i, referents[i]])))
        done |= td["done"][:, 0].numpy()
        if done.all():
            break
    again = [
        ends[i][k] != ends[i][k + 1]
        for i in range(6)
        for k, (one, other) in enumerate(pairwise(said[i]))
        if one == other
    ]
    assert len(again) > 2
    assert all(again)
    env.close()


@pytest.mark.slow
def test_another_device_that_is_operated_is_the_wrong_object(env):
    td, guide = begun(env, seed=3), expert(env)
    operated = env.state.referent.copy()
    for i in range(WORLDS):
        others = env.state.shown[i] & np.isin(env.state.nouns[i], NUMBERS)
        others[operated[i]] = False
        env.state.referent[i] = np.flatnonzero(others)[0]
    env.task.reset(np.arange(WORLDS), env.state)
    wrong = np.zeros(WORLDS, bool)
    for _ in range(90):
        td = act(env, td, guide.act(operated, operated))
        assert not td["success"].any()
        wrong |= td["wrong_object"][:, 0].numpy()
    assert wrong.all()


def test_what_can_be_done_to_a_device_follows_from_where_it_is():
    task, rng = task_of("anything"), np.random.default_rng(1)
    scene = task.draw(rng).scene
    devices = np.isin(scene.nouns, NUMBERS)

    def sayable(moved):
        return {
            (DEVICE_VERBS[verb], int(one))
            for verb in DEVICE_VERBS
            for one in np.flatnonzero(task.room(scene, np.where(devices, moved, 0.0)).operable(verb))
        }

    named = {(list(NOUNS)[scene.nouns[one]], int(one)) for one in np.flatnonzero(devices)}
    assert sayable(0.0) == named
    assert sayable(1.0) == {each for each in named if each[0] != "button"}  # until it has sprung back
    assert sayable(0.5) == {each for each in named if each[0] == "wheel"}


def test_without_devices_there_are_ten_verbs_and_the_columns_of_before():
    task = task_of("anything", *WITHOUT)
    assert task.verbs == task.kind_names == VERBS
    assert len(task.columns) == 5
    assert task.devices == ()
    assert task.next_instruction(task.draw(np.random.default_rng(0)).scene, NOTHING, np.random.default_rng(0))


@pytest.mark.slow
def test_devices_need_a_place_a_task_that_has_them_and_slots():
    with pytest.raises(ConfigError, match=re.escape("task.devices=3 needs a workspace with a device_area: choose")):
        make_env(["task=anything", "workspace=room"])
    with pytest.raises(ConfigError, match=re.escape("task.devices=2 must be 0 in task.name=nl_lift: take task=any")):
        make_env(["task=nl_lift", "task.devices=2"])
    with pytest.raises(ConfigError, match="at most 12 can be shown"):
        make_env(["task=anything", "task.hand=false", "task.num_objects=12"])
