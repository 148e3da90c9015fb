"""Objects that a task's YAML lists: where they stand, what holds them in place, and what is refused."""

import re

import numpy as np
import pytest
import torch
from torchrl.envs.utils import check_env_specs

from core.errors import ConfigError
from envs.tasks import EpisodeSpec
from envs.tasks.shared.geometry import scatter
from language import COLORS, SHAPES, Object, Scene, rgba
from tests.helpers.env_cases import TOUCHING, Poker, act, differences, hold, make, rollout, task_of

CUBE = "{noun: cube, color: red, area: [0.35, 0.45, -0.3, -0.1, 0.025, 0.025], random_rotation: true}"
POST = "{noun: cylinder, color: blue, area: [0.35, 0.5, 0.1, 0.3, 0.025, 0.025], fixed: true}"
MARK = "{color: green, area: [0.35, 0.55, -0.3, 0.3, 0.05, 0.2]}"
LONG = (TOUCHING, "task.hold_steps=1000", "task.max_steps=1000")
INTO = 28  # steps of `swept` until a gripper that nothing stops is in the middle of the cube
FREE, FIXED, TARGET = "free", "fixed", "target"


def listed(init=(), goal=()):
    return f"task.objects.init=[{', '.join(init)}]", f"task.objects.goal=[{', '.join(goal)}]"


def three(*more, **kwargs):
    """A free cube, a fixed cylinder and a see-through target."""
    return make("kuka", "step", "nl_reach", *listed([CUBE, POST], [MARK]), *more, **kwargs)


def row(td, color, world=0):
    """The row of the object of this colour."""
    rows = td["objects"][world]
    return rows[(rows[:, 7:10] == torch.tensor(rgba(color)[:3])).all(1).nonzero().item()]


# ---- where they stand ---------------------------------------------------------------------------------------------


def test_objects_stand_in_their_areas_turned_where_asked():
    env, seen = three(worlds=2), []
    for _ in range(20):
        td = env.reset()
        for world in (0, 1):
            cube, post, mark = (row(td, color, world).tolist() for color in ("red", "blue", "green"))
            assert 0.35 <= cube[0] <= 0.45
            assert -0.3 <= cube[1] <= -0.1
            assert 0.1 <= post[1] <= 0.3
            assert 0.05 <= mark[2] <= 0.2
            assert post[3:7] == mark[3:7] == [0, 0, 0, 1]
            seen.append(2 * np.arctan2(cube[5], cube[6]))
    assert len(set(seen)) == 40
    assert np.cos(seen).std() > 0.4
    env.close()


def test_a_target_is_observed_see_through():
    env = three()
    td = env.reset()
    assert [row(td, color)[10].item() for color in ("red", "blue", "green")] == [1.0, 1.0, 0.5]
    assert [row(td, color)[-1].item() for color in ("red", "blue", "green")] == [0.0, 0.0, 1.0]
    env.close()


@pytest.mark.slow
def test_a_target_is_drawn_see_through():
    mark = "{noun: cube, color: green, area: [0.45, 0.45, 0, 0, 0.1, 0.1], role: target}"
    pictures = []
    for role, x in (("target", 0.45), ("real", 0.45), ("real", 0.7)):
        overrides = listed(goal=[mark.replace("0.45", str(x)).replace("target", role)])
        env = make("kuka", "step", "reach", *overrides, "task.reset_noise=0", render=True)
        env.reset()
        pictures.append(env.render().astype(int)[120:230, 190:300])
        assert (env.render().astype(int)[120:230, 190:300] == pictures[-1]).all()
        env.close()
    see_through, solid, without = pictures
    greener = (solid - without)[..., 0] < -60  # the table is redder than the cube
    assert greener.sum() > 50
    assert np.abs(see_through - (solid + without) / 2)[greener].max() <= 1


def test_torchrl_finds_no_fault_with_listed_objects():
    env = three(worlds=2)
    check_env_specs(env, seed=0)
    env.close()


@pytest.mark.slow
def test_one_listed_object_may_be_reached_without_words():
    for overrides in (listed([CUBE]), listed(goal=[MARK])):
        env = make("kuka", "step", "reach", *overrides)
        td = env.reset()
        assert td["objects"].shape == (1, 1, 16)
        assert torch.equal(td["privileged", "goal"][0], td["objects"][0, 0, :3])
        env.close()


@pytest.mark.slow
def test_only_the_words_identify_a_listed_referent():
    task = task_of("nl_reach", *listed([CUBE, POST], [MARK]))
    rng = np.random.default_rng(0)
    referents = np.bincount([task.draw(rng).referent for _ in range(900)])
    assert referents.min() > 240


def test_without_listed_objects_the_draws_are_unchanged():
    task = task_of("nl_reach", "task.num_objects=5", "task.min_objects=2")
    one, other = np.random.default_rng(3), np.random.default_rng(3)
    for _ in range(20):
        scene = task._placed(one).scene
        count = int(other.integers(2, 6))
        places = scatter(other, count, area=task._area, spacing=task.config.spacing, height=task.config.object_size / 2)
        nouns, colors = other.integers(len(SHAPES), size=count), other.integers(len(COLORS), size=count)
        assert tuple(scene) == tuple(Scene.from_arrays(nouns, colors, places, size=task.config.object_size))
        assert one.bit_generator.state == other.bit_generator.state


# ---- what holds them ----------------------------------------------------------------------------------------------


def only(env, kind, height=0.025):
    """Begin an episode of one cube in front of the gripper, of this kind."""
    scene = Scene([Object("cube", "red", (0.45, 0.0, height), role="target" if kind == TARGET else "real")])
    env.task.draw = lambda rng: EpisodeSpec(scene=scene, referent=0, fixed=np.array([kind == FIXED]))
    return env.reset()


def swept(env, td):
    """The gripper goes down beside the place of the cube, and through it: all "next"."""
    kept = []
    for place, steps in (((0.45, -0.12, 0.15), 15), ((0.45, -0.12, 0.03), 10), ((0.45, 0.1, 0.03), 20)):
        for _ in range(steps):
            td = act(env, td, env.towards(np.array([place])))
            kept.append(td.exclude("reward", "action").clone())
    return torch.stack(kept)


def cube_in(td):
    return td["objects"][td["objects_mask"]][..., :7]


@pytest.mark.slow
@pytest.mark.parametrize("sleeping", [True, False])
def test_free_cubes_are_pushed_fixed_ones_stay_and_targets_do_not_collide(sleeping):
    env = three(f"physics.sleeping={sleeping}", *LONG)
    reached = {}
    for kind in (FREE, FIXED, TARGET, FREE):
        td = only(env, kind)
        put = cube_in(td)
        history = swept(env, td)
        end, reached[kind] = history[-1], history["robot"][INTO, 0, 2 * 7 + 1]  # y of the gripper, after 7 joints
        if kind == FREE:
            assert (cube_in(end) - put)[0, 1] > 0.05
        else:
            assert torch.equal(cube_in(end), put)
    assert reached[FIXED] < -0.04
    assert min(reached[FREE], reached[TARGET]) > -0.01
    env.close()


@pytest.mark.slow
def test_a_fixed_cube_and_a_target_hang_where_a_free_cube_falls():
    env = three(*LONG)
    for kind in (FREE, FIXED, TARGET):
        td = put = only(env, kind, height=0.1)
        for _ in range(30):
            td = act(env, td, hold(env, td))
        height = cube_in(td)[0, 2].item()
        assert height == (pytest.approx(0.025, abs=0.002) if kind == FREE else cube_in(put)[0, 2].item())
    env.close()


@pytest.mark.slow
def test_a_seed_gives_the_same_bits_after_every_kind_of_episode():
    fresh = {}
    for kind in (FREE, FIXED, TARGET):
        env = three(*LONG)
        env.set_seed(4)
        fresh[kind] = swept(env, only(env, kind))
        env.close()
    env = three(*LONG)
    for kind in (TARGET, FREE, FIXED, FREE, TARGET, FIXED):
        env.set_seed(4)
        assert differences(swept(env, only(env, kind)), fresh[kind]) == []
    env.close()


@pytest.mark.slow
def test_listed_objects_give_the_same_bits_whatever_the_number_of_worlds_and_their_past():
    histories = []
    for worlds, past in ((2, 0), (1, 0), (2, 25)):
        env = three(*LONG, worlds=worlds)
        if past:
            env.set_seed(8)
            rollout(env, past, Poker(env))
        env.set_seed(6)
        histories.append(rollout(env, 60, Poker(env), lambda t, i: t % 25 == 24))
        env.close()
    two, one, later = histories
    moved = two["objects"][1:24] - two["objects"][:1]
    assert moved[..., :3].abs().max() > 0.005
    assert differences(later, two) == []
    assert differences(one[:, 0], two[:, 0]) == []


# ---- what is refused ----------------------------------------------------------------------------------------------


def anywhere(words):
    """An entry with these words and a good area."""
    return "{" + words + ", area: [0.4, 0.5, 0, 0.1, 0.025, 0.025]}"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("init", "message"),
    [
        ([anywhere("noun: cub")], "task.objects.init.0.noun=cub: 'cub' is not a known noun; did you mean 'cube'?"),
        ([CUBE, anywhere("color: mauve")], "task.objects.init.1.color=mauve: 'mauve' is not a known color"),
        (["{noun: cube}"], "task.objects.init.0.area has no value; give task.objects.init.0.area=..."),
        (["{noun: cube, area: [1, 2]}"], "task.objects.init.0.area=[1.0, 2.0] must be 6 finite numbers"),
        (
            ["{noun: cube, area: [0.5, 0.4, 0, 0.1, 0, 0]}"],
            "task.objects.init.0.area=[0.5, 0.4, 0.0, 0.1, 0.0, 0.0]: x0=0.5 must be at most x1=0.4",
        ),
        (
            ["{noun: cube, area: [0.5, 1.4, 0, 0.1, 0, 0]}"],
            "task.objects.init.0.area=[0.5, 1.4, 0.0, 0.1, 0.0, 0.0] must lie in workspace.bounds=[0.0, 0.9, -0.6, ",
        ),
        (
            [anywhere("noun: cube, fixed: maybe")],
            "task.objects.init.0.fixed=maybe: Value 'maybe' is not a valid bool",
        ),
        ([anywhere("nuon: cube")], "task.objects.init.0.nuon is not a known key; did you mean 'noun'?"),
        ([anywhere("role: target")], "task.objects.init: object 0 is an init with role=target: it must be real"),
        (["cube"], "task.objects.init.0=cube must be a group of keys: noun, color, area"),
        ([CUBE] * 9, "task.objects.init and goal list 9 objects: at most 8 can be shown"),
        ([anywhere("noun: cube")] * 4, "task.objects: object 1 found no place in its area="),
    ],
)
def test_a_bad_list_is_named(init, message):
    with pytest.raises(ConfigError, match=re.escape(message)) as caught:
        make("kuka", "step", "nl_reach", *listed(init))
    assert "\n" not in str(caught.value)


def test_a_value_that_is_not_a_list_is_named():
    with pytest.raises(ConfigError, match=r"task.objects.init=cube must be a list of groups"):
        make("kuka", "step", "nl_reach", "task.objects.init=cube")


def test_several_listed_objects_need_words():
    with pytest.raises(ConfigError, match=r"task.num_objects=2 must be 1 in a task without words"):
        make("kuka", "step", "reach", *listed([CUBE], [MARK]))
