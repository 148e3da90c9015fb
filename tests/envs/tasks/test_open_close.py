"""Drawer and fridge: they are named, held by the handle, moved, observed, and stay where they are left."""

import re

import numpy as np
import pytest

from core.errors import ConfigError
from core.overrides import compose
from envs import read_env
from envs.experts.furniture import OpenCloseExpert
from envs.mdp.object_rows import COLUMNS, nouns_of_rows
from envs.tasks.shared.fittings import OPEN, SHUT
from language import FITTINGS, NOUNS, ground, parse
from tests.helpers.env_cases import act, begun, check_same_bits, make, partial_reset, task_of

WORLDS = 4
TASKS = ("nl_open", "nl_close")
PLAIN = "task.curriculum={near: 0, held: 0, placed: 0}"
KINDS = slice(COLUMNS.start, COLUMNS.start + 2)  # the columns that mark drawer and fridge
SHARE = -1  # the column of how far a fitting is open
ROOM = read_env(compose(["workspace=room"])).workspace.fittings


@pytest.fixture(scope="module", params=[("kuka", "nl_open"), ("panda", "nl_close")], ids="-".join)
def env(request):
    made = make(request.param[0], "step", request.param[1], PLAIN, "task.hold_steps=30", worlds=WORLDS)
    yield made
    made.close()


def shares(env):
    """(N, 2) by which share each fitting is open, by the joints."""
    return np.stack([(env.fittings[name] - ROOM[name].low) / (ROOM[name].high - ROOM[name].low) for name in ROOM], 1)


def meant(env):
    """(N,) the number of the fitting that the instruction names."""
    nouns = env.state.nouns[np.arange(WORLDS), env.state.referent]
    return np.array([list(ROOM).index(list(NOUNS)[noun]) for noun in nouns])


def moved(env, td, slots=None, steps=75):
    """The expert moves the referents, or these slots. Returns the last "next", and which worlds ended wrongly."""
    guide, wrong = OpenCloseExpert(env), np.zeros(WORLDS, bool)
    for _ in range(steps):
        wanted = env.state.referent if slots is None else slots
        td = act(env, td, guide.act(wanted, wanted))
        wrong |= td["wrong_object"][:, 0].numpy()
    return td, wrong


@pytest.mark.parametrize("name", ROOM)
def test_the_share_by_which_a_fitting_is_open_follows_from_the_place_of_its_handle(name):
    fitting, wanted = ROOM[name], np.linspace(0, 1, 11)
    places = fitting.handle_at(fitting.value(wanted))
    np.testing.assert_allclose(fitting.share(places), wanted, atol=1e-9)
    np.testing.assert_allclose(places[0], fitting.parts["handle"].position)
    assert (np.diff(places[:, 0] if name == "drawer" else places[:, 2])[:9] * (-1) ** (name == "drawer") > 0).all()


@pytest.mark.parametrize("name", TASKS)
def test_a_sentence_names_the_verb_and_a_fitting_that_is_not_yet_so(name):
    task, rng, named = task_of(name), np.random.default_rng(0), []
    for _ in range(60):
        episode = task.draw(rng)
        instruction = parse(episode.sentence)
        assert f"nl_{instruction.task}" == name
        assert ground(instruction, episode.scene) == episode.referent
        named.append(episode.scene[episode.referent].noun)
        share = episode.shares[episode.referent]
        assert share < SHUT if name == "nl_open" else share > OPEN
    assert {*named} == {*FITTINGS}


def test_rows_say_which_fixture_an_object_is_and_how_far_it_is_open(env):
    td = begun(env)
    rows, nouns = td["objects"].numpy(), env.state.nouns
    for i in range(WORLDS):
        assert (nouns_of_rows(rows[i], fixtures=FITTINGS) == nouns[i]).all()
        assert len({*nouns[i].tolist()} & {*map(list(NOUNS).index, FITTINGS)}) == 2
    fits = rows[..., KINDS].any(-1)
    assert (fits == np.isin(nouns, [list(NOUNS).index(noun) for noun in FITTINGS])).all()
    assert (rows[~fits][:, SHARE] == 0).all()
    each = np.arange(WORLDS)
    np.testing.assert_allclose(rows[each, env.state.referent, SHARE], shares(env)[each, meant(env)], atol=1e-5)
    scenes = env.draw_scenes(20, seed=0)
    assert (scenes["objects"][..., KINDS].sum((1, 2)) == 2).all()
    assert scenes["objects"][..., SHARE].max() > OPEN
    assert scenes["objects"].shape[2] == rows.shape[2]


@pytest.mark.slow
def test_the_expert_moves_what_is_meant_and_nothing_else_and_it_stays(env):
    td = begun(env)
    before, things = shares(env), env.state.objects.copy()
    td, wrong = moved(env, td)
    assert not wrong.any()
    each, other = np.arange(WORLDS), 1 - meant(env)
    after = shares(env)
    done = after[each, meant(env)]
    assert (done > OPEN).all() if env.config.task.name == "nl_open" else (done < SHUT).all()
    assert (env.state.held == env.state.referent).all()
    np.testing.assert_allclose(after[each, other], before[each, other], atol=1e-3)
    loose = ~np.isin(env.state.nouns, list(env.task.fittings.by_noun))
    np.testing.assert_allclose(env.state.objects[loose], things[loose], atol=1e-3)
    for step in range(14):  # let go, and away
        up = env.gripper + [0.0, 0.0, 0.03 * (step > 3)]
        td = act(env, td, env.towards(up, np.zeros(WORLDS, bool)))
    assert (env.state.held != env.state.referent).all()
    np.testing.assert_allclose(shares(env), after, atol=0.03)
    assert (env.gripper[:, 2] > 0.2).all()
    again = partial_reset(env, td, [1])  # puts back what was moved in that world alone
    assert again["objects"][..., SHARE].isfinite().all()
    np.testing.assert_allclose(shares(env)[[0, 2, 3]], after[[0, 2, 3]], atol=0.03)


@pytest.mark.slow
def test_another_fitting_ends_the_episode_as_the_wrong_object(env):
    td = begun(env, seed=5)
    rows = np.arange(WORLDS)
    fits = np.isin(env.state.nouns, list(env.task.fittings.by_noun))
    fits[rows, env.state.referent] = False
    end = env.config.task.name == "nl_open"
    alike = np.abs(shares(env)[rows, 1 - meant(env)] - (not end)) < 0.2  # worlds where the other one can be moved, too
    assert alike.any()
    _, wrong = moved(env, td, fits.argmax(1))
    assert wrong[alike].all()


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["kuka", "panda"])
def test_a_seed_gives_the_same_bits_after_a_fitting_was_moved_and_for_any_number_of_worlds(robot):
    def acting(env):
        guide = OpenCloseExpert(env)
        return lambda td: guide(td)["action"]

    seen = check_same_bits(lambda worlds: make(robot, "step", "nl_open", PLAIN, worlds=worlds, seed=5), acting)
    assert seen["objects"][..., SHARE].unique().numel() > 20  # else the test would show little


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["workspace=table"], "task.name=nl_open needs a workspace whose fittings are drawer and fridge"),
        (["workspace=drawer"], "choose workspace=room"),
        (["task.min_objects=1"], "task.min_objects=1 must be at least 2 in task.name=nl_open"),
        (["task.num_targets=1"], "task.num_targets=1 must be 0"),
    ],
)
def test_an_impossible_setting_is_an_error(overrides, message):
    with pytest.raises(ConfigError, match=re.escape(message)):
        task_of("nl_open", *overrides)


def test_the_gym_environment_of_a_task_with_fittings_shows_their_columns():
    import gymnasium

    env = gymnasium.make("Deixis/NLOpen-v0", robot="kuka")
    observed, _ = env.reset(seed=1)
    assert observed["objects"][:, KINDS].sum() == 2
    env.close()
