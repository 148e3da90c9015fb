"""What the tests of the worlds share: every combination that conf/ offers, and ways to drive an environment."""

from functools import lru_cache
from pathlib import Path

import numpy as np
import pybullet as bullet
import torch
import yaml
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra.errors import HydraException

import conf
from core.composition import compose, groups, parse
from envs import read_env
from envs.mdp.gestures import make_person
from envs.workspace_env import WorkspaceEnv, make_task

CONF = Path(conf.__file__).parent


def options(group):
    """Every option of a config group, as its YAML files say."""
    return sorted(path.stem for path in (CONF / group).glob("*.yaml"))


def workspace_of(task):
    """The workspace that a task's YAML chooses, read without Hydra, which takes long; None: it chooses none."""
    defaults = yaml.safe_load((CONF / "task" / f"{task}.yaml").read_text("utf-8"))["defaults"]
    chosen = [entry.get("override /workspace@_global_.workspace") for entry in defaults if isinstance(entry, dict)]
    return next(filter(None, chosen), None)


@lru_cache(maxsize=512)
def config_of(*overrides):
    """The config of Hydra overrides. Those that have the same options are composed once: each takes Hydra 0.1 s.

    Hydra itself sets the other keys, as it does after it has composed the options.
    """
    options = [word for word in overrides if word.partition("=")[0] in groups()]
    config = compose(options)
    try:
        ConfigLoaderImpl._apply_overrides_to_config(parse([each for each in overrides if each not in options]), config)
    except HydraException:
        compose(overrides)  # raises what a person is told
        raise
    return read_env(config)


ROBOTS, CONTROLS, TASKS = options("robot"), options("control"), options("task")
ARMS = {robot: config_of(f"robot={robot}").robot for robot in ROBOTS}
LONG_ARMS = [robot for robot in ROBOTS if not ARMS[robot].reach]  # reach all of every workspace
UPRIGHT = [robot for robot in ROBOTS if not ARMS[robot].position_first]  # point down all over their gripper box
TOUCHING = "task.radius=0.005"  # in reaching tasks the gripper stays over the objects, but for so small a radius
BARE_FLANGES = ("ur5", "xarm7")  # in reaching tasks, which add no magnet, nothing of theirs meets an object
EVERY_TASK = ["jaco", "kuka", "panda"]  # robots that are tested with every task; the others take turns
WITH_ALL = ("nl_reach", "nl_pick_and_place")  # tasks with every robot
IN_A_ROOM = [task for task in TASKS if workspace_of(task) in ("room", "studio")]
assert IN_A_ROOM
FEW_ROBOTS = ("kuka", "panda")  # reach the handles in a room
DEVICES_AMONG = ["nl_press", "nl_switch", "nl_turn"]
WITH_FEW = [
    *IN_A_ROOM,
    *DEVICES_AMONG,
    "nl_unstack",
    "nl_hand_over",
    "nl_sort",
]  # tasks that are tested with one of these in turn
# so_arm's area has no room for the way that pushed objects must leave free, and its gripper tilts, so that it reaches
# nothing between stacks; xarm7 moves too slowly to throw.
DOES_NOT_FIT = [("so_arm", "nl_push"), ("so_arm", "rearrange"), ("so_arm", "nl_rearrange"), ("xarm7", "throw")]


def covering(everywhere=TASKS):
    """(robot, control, task): the tasks of `everywhere` with EVERY_TASK and one more robot, others with one robot.

    Controls take turns.
    """
    combinations = [(FEW_ROBOTS[i % 2], CONTROLS[i % len(CONTROLS)], task) for i, task in enumerate(WITH_FEW)]
    for i, task in enumerate(task for task in TASKS if task not in WITH_FEW):
        more = [robot for robot in ROBOTS if robot not in EVERY_TASK and (robot, task) not in DOES_NOT_FIT]
        robots = [*EVERY_TASK, *(more if task in WITH_ALL else more[i % len(more) :][:1])]
        if task not in everywhere:
            robots = [EVERY_TASK[i % len(EVERY_TASK)]]
        combinations += [
            (robot, CONTROLS[(i // len(EVERY_TASK) + ROBOTS.index(robot)) % len(CONTROLS)], task) for robot in robots
        ]
    return combinations


COMBINATIONS = covering()
FEWER = covering(everywhere=("nl_reach", "nl_pick_and_place", "nl_push"))


def name_of(combination):
    return "-".join(combination)


def make(robot="kuka", control="step", task="nl_reach", *more, worlds=1, seed=0, render=False):
    config = config_of(f"robot={robot}", f"control={control}", f"task={task}", *more)
    return WorkspaceEnv(config, worlds, seed, render)


def task_of(name, *overrides, worlds=1):
    config = config_of(f"task={name}", *overrides)
    person = make_person(config.workspace.human, config.gesture)
    return make_task(config, worlds, person)


def act(env, td, action):
    """Takes one step with action (N, A). Returns its "next"."""
    return env.step(td.clone(recurse=False).set("action", torch.as_tensor(action, dtype=torch.float32)))["next"]


def succeed_in_all(env, td, guide):
    """td once the first episode of every world has ended with success, as a guide (td -> td with actions) moves."""
    solved = np.zeros(env.batch_size[0], bool)
    for _ in range(env.config.task.max_steps):
        td = act(env, td, guide(td.clone())["action"])
        over = td["done"][:, 0].numpy() & ~solved
        assert (td["success"][over, 0]).all()
        solved |= over
        if solved.all():
            break
    assert solved.all()
    return td


def partial_reset(env, td, worlds):
    """td with these worlds' episodes begun anew."""
    mask = torch.zeros(*env.batch_size, 1, dtype=torch.bool)
    mask[worlds] = True
    return env.reset(td.exclude("reward", "action").clone().set("_reset", mask))


def leaves(td):
    """Every tensor with its key."""
    return dict(td.items(include_nested=True, leaves_only=True))


def differences(one, other):
    """Keys of the leaves that are not bit-equal (NaN equals itself)."""
    a, b = leaves(one), leaves(other)
    assert set(a) == set(b)
    return [key for key in a if not torch.equal(a[key].nan_to_num(7.5), b[key].nan_to_num(7.5))]


def hold(env, td):
    """The action that keeps every gripper where it is."""
    return env.towards(env.gripper)


class Poker:
    """Drives each gripper into an object and on, with noise, the shown slots in turn: objects get touched.

    World i's actions come from what world i shows and its own generator, so they do not depend on N.
    """

    def __init__(self, env, seed=0):
        self._env, self._steps = env, 0
        self._noise = [np.random.default_rng((seed, i)) for i in range(env.batch_size[0])]

    def __call__(self, td):
        turn, self._steps = self._steps // 30, self._steps + 1
        shown = [np.flatnonzero(row) for row in td["objects_mask"].numpy()]
        slots = [int(row[turn % len(row)]) for row in shown]
        aim = td["objects"][range(len(slots)), slots, :3].double().numpy()
        noise = np.array([generator.uniform(-1, 1, 3) for generator in self._noise])
        return self._env.towards(aim + [0.0, 0.0, -0.02] + 0.08 * noise * [1, 1, 0.3])


def begun(env, seed=3):
    """The first observation after this seed was set."""
    env.set_seed(seed)
    return env.reset()


def rollout(env, steps, policy, resets=lambda t, i: False):
    """The "next" of every step, stacked (T, N): episodes that end, or that `resets` names, begin anew."""
    td = env.reset()
    kept = [td.clone()]
    for t in range(steps):
        td = act(env, td, policy(td))
        kept.append(td.exclude("reward", "action").clone())
        over = [i for i in range(env.batch_size[0]) if td["done"][i] or resets(t, i)]
        if over:
            td = partial_reset(env, td, over)
            kept.append(td.clone())
    return torch.stack(kept)


def paced(env, policy, steps=70):
    """What is observed (T, N) while each world is reset in its own time, without what is observed after resets.

    T does not depend on the number of worlds.
    """
    td, kept = env.reset(), []
    for t in range(steps):
        td = act(env, td, policy(td))
        kept.append(td.exclude("reward", "action").clone())
        over = [i for i in range(env.batch_size[0]) if td["done"][i] or t % (27 + 7 * i) == 24]
        td = partial_reset(env, td, over) if over else td
    return torch.stack(kept)


def check_same_bits(made, policy, between=None):
    """A seed gives the same bits after any history, and for any number of worlds.

    made: from a number of worlds to an environment with seed 5. policy: from an environment to what acts in it.
    between: what is done to the environment before it is seeded again. Returns what was observed (T, 2).
    """
    env, other = made(2), made(3)
    fresh = paced(env, policy(env))
    env.set_seed(6)
    if between is None:
        paced(env, policy(env), 45)
    else:
        between(env)
    env.set_seed(5)
    for again in (env, other):
        assert differences(paced(again, policy(again))[:, :2], fresh) == []
        again.close()
    return fresh


def clients():
    """How many of PyBullet's clients are connected: it numbers them from 0 and has room for 1024."""
    return sum(bullet.isConnected(i) for i in range(64))
