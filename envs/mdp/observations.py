"""The observations of the environment. Each is declared here, and nowhere else.

To add one, add an `ObservationTerm` to `OBSERVATIONS`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Binary, Bounded, Categorical, Composite, Unbounded

from envs.mdp.gestures import RAY_WIDTH, ray_of
from envs.mdp.goals import Goal, sentence_bytes, tokens
from envs.mdp.object_rows import CLOSE, COLUMNS, FACING, NEAR, OBJECT_WIDTH, OFFSET, offsets, row_bounds, static_rows
from envs.mdp.observation_terms import GoalSource, ObservationTerm, Observer, Source, SpecSettings, bounded
from envs.mdp.pictures import MARGIN, Photographer
from envs.sim.devices import facing
from envs.sim.kinematics import Array
from envs.tasks import State, Task

MAX_TIP_DISTANCE = 3.0  # metres from the origin that a fingertip may be
NEAR_OFFSET = np.repeat((NEAR, CLOSE), 3)
OUTCOMES = {  # results of a control step, (N, 1) bool each
    "success": "whether the episode ended in success at this step",
    "wrong_object": "whether it ended so because of another object",
    "wrong_target": "whether it ended so because of another target",
    "at_goal": "whether the gripper is at the referent, or the referent where it is to go",
}
REWARD_TERMS = "(T,): the weighted reward terms, by `reward_names`; their sum is the reward"


def robot_names(joints: Sequence[str], grips: bool) -> list[str]:
    """Return the name of each number of the observation "robot". grips: whether the task's gripper holds objects."""
    of_joints = [f"{joint}.{of}" for of in ("angle", "speed") for joint in joints]
    position = [f"gripper.{axis}" for axis in "xyz"]
    orientation = [f"gripper.{column}.{axis}" for column in "xy" for axis in "xyz"]
    return [*of_joints, *position, *orientation, "opening", *(["shut", "holds"] if grips else [])]


def observation_spec(observer: Observer, num_worlds: int, task: Task) -> Composite:
    """The spec of all observations and outcomes of N worlds, without rewards and ends of episodes."""
    spec = observer.spec(num_worlds)
    for name in OUTCOMES:
        spec[name] = Binary(1, shape=(num_worlds, 1), dtype=torch.bool)
    spec["reward_terms"] = Unbounded(shape=(num_worlds, len(task.terms)), dtype=torch.float32)
    return spec


def descriptions() -> dict[str, str]:
    """The content of each key, for the documentation."""
    terms = (*OBSERVATIONS, *PICTURE_OBSERVATIONS)
    return {term.key: term.description for term in terms} | OUTCOMES | {"reward_terms": REWARD_TERMS}


# ---- specs of one world


def _workspace(setup: SpecSettings) -> tuple[Array, Array]:
    """Lowest and highest corner of where anything may be, (3,) metres each."""
    low, high = np.reshape(setup.workspace.bounds, (3, 2)).T
    return low, high


def _robot_spec(setup: SpecSettings) -> Bounded:
    low, high = _workspace(setup)
    speed, ones = 2 * np.array(setup.robot.max_speed), np.ones(6)  # a joint that is struck can exceed its own speed
    gripper = 3 if setup.task.traits.grips else 1
    return bounded(
        [setup.kinematics.low - 0.1, -speed, low, -ones, np.zeros(gripper)],
        [setup.kinematics.high + 0.1, speed, high, ones, np.ones(gripper)],
    )


def _objects_spec(setup: SpecSettings) -> Bounded:
    return bounded(*row_bounds(setup.task, *_workspace(setup)), setup.task.config.slots)


def _gesture_spec(setup: SpecSettings) -> Bounded:
    tip, direction = np.full(3, MAX_TIP_DISTANCE), np.ones(3)
    return bounded([-tip, -direction, [0.0]], [tip, direction, [1.0]])


def _goal_spec(setup: SpecSettings) -> Bounded:
    low, high = _workspace(setup)
    if not setup.task.traits.moves:
        return bounded([low], [high])
    memory, offset = setup.task.memory[0], NEAR_OFFSET
    return bounded(
        [low, low, -offset, -offset, -offset, np.zeros(1), np.zeros_like(memory)],
        [high, high, offset, offset, offset, np.ones(1), np.ones_like(memory)],
    )


def _flag_each_slot(setup: SpecSettings) -> Binary:
    slots = setup.task.config.slots
    return Binary(slots, shape=(slots,), dtype=torch.bool)


def _slot(setup: SpecSettings) -> Categorical:
    return Categorical(setup.task.config.slots, shape=(), dtype=torch.int64)


# ---- values of N worlds


def _robot(source: Source) -> Array:
    worlds = source.worlds
    pose, count = worlds.pose, worlds.angles.shape[1]
    speeds, rotation = worlds.joints[:, :count, 1], pose.rotation
    gripper = source.grip_controller.observation(worlds.joints[..., 0])
    parts = worlds.angles, speeds, pose.position, rotation[:, :, 0], rotation[:, :, 1], gripper
    return np.concatenate(parts, axis=1)


def _objects(source: Source) -> Array:
    task, state = source.sight.task, source.sight.state
    rows = source.perturbations.seen(source.rows, source.worlds.steps)
    if task.traits.moves:
        offset = offsets(rows[..., :3], source.worlds.pose.position[:, None])
        rows = np.concatenate((rows, offset, task.seen(state)), axis=2)
    return np.where(state.shown[..., None], rows, 0.0)


def _goal(source: GoalSource) -> Array:
    state = source.state
    each = np.arange(len(state.referent))
    referent = state.objects[each, state.referent]
    if not source.task.traits.moves:
        return referent
    target = state.objects[each, state.target]
    near = _nearness(state)
    near[each, state.referent] = 0.0
    other = state.objects[each, near.argmax(1)]
    to_referent, to_target = offsets(referent, state.gripper), offsets(target, referent)
    to_other = offsets(other, state.gripper)
    parts = referent, target, to_referent, to_target, to_other, near.max(1, keepdims=True), source.task.memory
    return np.concatenate(parts, axis=1)


def _nearness(state: State) -> Array:
    """(N, K) how near each movable object is: 1 at the gripper, 0 from `NEAR` on."""
    offset = state.objects - state.gripper[:, None]
    return state.movable * np.maximum(1.0 - np.sqrt((offset * offset).sum(-1)) / NEAR, 0.0)


def _pointing(source: Source) -> Array:
    state = source.state
    return source.gestures.measures(state.objects, state.shown, state.referent)


# ---- the table

OBSERVATIONS = (
    ObservationTerm(
        "robot",
        "(R,): joint angles (rad) and speeds (rad/s), gripper centre (m), the first two columns of its rotation "
        "matrix (Zhou et al. 2019: continuous, where quaternions jump), and how far the fingers are open, in [0, 1]. "
        "Where the task grips: also how far they are commanded to be closed, and whether anything is held",
        spec=_robot_spec,
        compute=_robot,
        gymnasium=True,
        reader="actor",
    ),
    ObservationTerm(
        "objects",
        "(K, D), a row for each slot: position (m), quaternion (x, y, z, w), RGBA (A of a target: 0.5), shape one-hot "
        "(of devices: their kind, and the pose of their handle), size (m), role (1: target). Where the task moves "
        f"objects: the offset from the gripper clipped at {NEAR} m, again clipped at {CLOSE} m (grasping and releasing "
        "need centimetre accuracy), and the task's own columns. 0 for a slot that is not shown",
        spec=_objects_spec,
        compute=_objects,
        gymnasium=True,
        reader="scene",
    ),
    ObservationTerm(
        "objects_mask",
        "(K,) bool: which slots show an object",
        spec=_flag_each_slot,
        compute=lambda source: source.sight.state.shown,
        gymnasium=True,
        reader="scene",
    ),
    ObservationTerm(
        "objects_near",
        f"(K,), where objects are moved: how near each object is that can be knocked over, 1 at the gripper and 0 from "
        f"{NEAR} m on; 0 for all others",
        spec=lambda setup: Bounded(0, 1, shape=(setup.task.config.slots,), dtype=torch.float32),
        compute=lambda source: _nearness(source.sight.state),
        present=lambda task: task.traits.moves,
        reader="actor",
    ),
    ObservationTerm(
        "instruction",
        "(L,) int64: the tokens of the sentence, 0 for padding",
        spec=lambda setup: Categorical(
            len(setup.tokenizer.vocabulary), shape=(setup.tokenizer.length,), dtype=torch.int64
        ),
        compute=lambda source: source.worlds.instruction,
        gymnasium=True,
        reader="scene",
    ),
    ObservationTerm(
        "gesture",
        "(7,), where a person points: the fingertip (m), the unit direction of its ray, and 1 where a gesture is "
        "shown; 0 throughout where none is",
        spec=_gesture_spec,
        compute=lambda source: source.gestures.rays,
        present=lambda task: task.points,
        gymnasium=True,
        reader="scene",
    ),
    ObservationTerm(
        "stage",
        "() int64, where objects are moved: 0 before, 1 while something is held (or near, where nothing is gripped), "
        "2 beside a target with it",
        spec=lambda setup: Categorical(setup.task.stages, shape=(), dtype=torch.int64),
        compute=lambda source: source.sight.task.stage(source.sight.state),
        present=lambda task: task.stages > 1,
        goal=True,
        reader="actor",
    ),
    ObservationTerm(
        "hold",
        "(A,): the action that keeps the arm where it is",
        spec=lambda setup: Bounded(-1, 1, shape=(setup.action_width,), dtype=torch.float32),
        compute=lambda source: source.hold(),
    ),
    ObservationTerm(
        "privileged/referent",
        "() int64: the slot of the referent",
        spec=_slot,
        compute=lambda source: source.state.referent,
        goal=True,
    ),
    ObservationTerm(
        "privileged/target",
        "() int64, where there are targets: the slot of the target",
        spec=_slot,
        compute=lambda source: source.state.target,
        present=lambda task: task.traits.places,
        goal=True,
    ),
    ObservationTerm(
        "privileged/verb",
        "() int64, where the words name one of several verbs: which one, an index into the task's `verbs`",
        spec=lambda setup: Categorical(len(setup.task.verbs), shape=(), dtype=torch.int64),
        compute=lambda source: source.state.kind,
        present=lambda task: bool(task.verbs),
        goal=True,
    ),
    ObservationTerm(
        "privileged/goal",
        "(G,): the referent's position (m). Where objects are moved: also the target's (without one, the referent's), "
        "the offsets (clipped twice, as in `objects`) from gripper to referent, from referent to target, and from "
        "gripper to the nearest other movable object, how near that one is, and what the task remembers, in [0, 1]",
        spec=_goal_spec,
        compute=_goal,
        goal=True,
        reader="critic",
    ),
    ObservationTerm(
        "privileged/kind",
        "() int64: the kind of sentence, an index into `kind_names`",
        spec=lambda setup: Categorical(len(setup.task.kind_names), shape=(), dtype=torch.int64),
        compute=lambda source: source.worlds.kind,
    ),
    ObservationTerm(
        "privileged/sentence",
        "(B,) uint8: the sentence in UTF-8, filled up with zeros",
        spec=lambda setup: Bounded(0, 255, shape=(sentence_bytes(setup.tokenizer),), dtype=torch.uint8),
        compute=lambda source: source.worlds.sentence,
    ),
    ObservationTerm(
        "privileged/held",
        "() int64, where objects are moved: the slot of the object that is held, -1 for none",
        spec=lambda setup: Bounded(-1, setup.task.config.slots - 1, shape=(), dtype=torch.int64),
        compute=lambda source: source.state.held,
        present=lambda task: task.traits.moves,
    ),
    ObservationTerm(
        "privileged/movable",
        "(K,) bool, where objects are moved: which slots show an object that can be moved",
        spec=_flag_each_slot,
        compute=lambda source: source.state.movable,
        present=lambda task: task.traits.moves,
    ),
    ObservationTerm(
        "privileged/places",
        "(K, 3), where positions are observed with noise (`task.randomize.observation_noise`) or by cameras "
        "(`perception=camera`): the true ones (m)",
        spec=lambda setup: bounded([_workspace(setup)[0]], [_workspace(setup)[1]], setup.task.config.slots),
        compute=lambda source: np.where(source.state.shown[..., None], source.state.objects, 0.0),
        present=lambda task: task.perceived or task.config.randomize.observation_noise > 0,
    ),
    ObservationTerm(
        "privileged/pointing",
        "(3,), where a person points: radians from the ray to the referent, radians between the referent and the "
        "object nearest to it as seen from the fingertip, and metres from the fingertip to the referent; 0 where no "
        "gesture is shown",
        spec=lambda setup: bounded([np.zeros(3)], [[np.pi, np.pi, 2 * MAX_TIP_DISTANCE]]),
        compute=_pointing,
        present=lambda task: task.points,
    ),
)


# ---- pictures, where `policy.pictures` asks for them


def _pixels_spec(setup: SpecSettings) -> Bounded:
    assert setup.pictures is not None
    cameras, size = len(setup.pictures.cameras), setup.pictures.size
    return Bounded(0, 255, shape=(cameras, size, size, 3), dtype=torch.uint8)


def _tip_spec(setup: SpecSettings) -> Bounded:
    low, high = _workspace(setup)
    return bounded([low], [high])


def _seen_spec(setup: SpecSettings) -> Bounded:
    assert setup.pictures is not None
    slots, cameras = setup.task.config.slots, len(setup.pictures.cameras)
    return Bounded(-MARGIN, 1 + MARGIN, shape=(slots, cameras, 2), dtype=torch.float32)


def _photographer(source: Source) -> Photographer:
    assert source.photographer is not None
    return source.photographer


def _seen(source: Source) -> Array:
    state = source.state
    return _photographer(source).seen_at(np.where(state.shown[..., None], state.objects, 0.0))


PICTURE_OBSERVATIONS = (
    ObservationTerm(
        "pixels",
        "(C, H, W, 3) uint8, with `policy=pixels`: the pictures of the cameras of `policy.pictures`",
        spec=_pixels_spec,
        compute=lambda source: _photographer(source).pixels(),
        gymnasium=True,
        reader="scene",
    ),
    ObservationTerm(
        "tip",
        "(3,), with `policy=pixels`: the gripper centre (m), as in `robot`",
        spec=_tip_spec,
        compute=lambda source: source.state.gripper,
        reader="scene",
    ),
    ObservationTerm(
        "privileged/seen_at",
        "(K, C, 2), with `policy=pixels`: where the centre of each slot's object is in each picture, shares of its "
        "width and height from the upper left corner; whether or not something hides it",
        spec=_seen_spec,
        compute=_seen,
    ),
)


class SceneSampler:
    """Draws episodes and observes what can be observed without a simulator.

    Offsets are relative to random gripper positions in the workspace. The gesture is the finger's own ray, even where
    episodes show the ray that a camera reads.

    Args:
        setup: its task draws the episodes, and decides on the shapes and bounds of the observations.
    """

    def __init__(self, setup: SpecSettings) -> None:
        self._setup, self._observer = setup, Observer(OBSERVATIONS, setup)

    def __call__(self, count: int, seed: int) -> TensorDictBase:
        """Draws `count` scenes.

        Args:
            count: number of scenes.
            seed: of all randomness.

        Returns:
            (count,) objects, objects_mask, instruction, privileged/referent; where there are targets,
            privileged/target; where there are several verbs, privileged/verb; where a person points, gesture. Other
            observations of the scene are 0.
        """
        task, rng = self._setup.task, np.random.default_rng(seed)
        slots, width = self._observer.shape("objects")
        rows, shown = np.zeros((count, slots, width)), np.zeros((count, slots), bool)
        instructions, goals = np.zeros((count, self._setup.tokenizer.length), np.int64), np.zeros((count, 3), np.int64)
        low, high = np.reshape(self._setup.workspace.bounds, (3, 2)).T.astype(np.float32)
        grippers = rng.uniform(low, high, (count, 3)) if task.traits.moves else None
        rays = np.zeros((count, RAY_WIDTH))
        columns = np.zeros((count, slots, len(task.columns)))
        for i in range(count):
            episode = task.draw(rng)
            order = rng.permutation(slots)[: len(episode.scene)]
            rows[i, order, :OBJECT_WIDTH], shown[i, order] = static_rows(episode.scene, episode.yaw), True
            instructions[i] = tokens(episode, self._setup.tokenizer)
            goal = Goal.of(episode, order)
            goals[i] = goal.referent, goal.target, goal.kind
            rays[i] = ray_of(episode.gesture)
            described = task.described(episode)
            columns[i, order, : described.shape[1]] = described  # what only a simulation tells stays 0
        if grippers is not None:
            rows[..., OFFSET] = offsets(rows[..., :3], grippers[:, None])
            rows[..., COLUMNS] = columns
        if task.traits.marks and not task.traits.speaks:
            rows[np.arange(count), goals[:, 0], COLUMNS.start] = 1.0
        if task.traits.operates:
            rows[..., FACING] = np.where(shown[..., None], facing(rows[..., 3:7]), 0.0)
        values = {"objects": rows, "objects_mask": shown, "instruction": instructions}
        if task.points:
            values["gesture"] = rays
        for term in self._observer.terms:
            if term.reader == "scene" and term.key not in values:  # what only a simulation tells stays 0
                values[term.key] = np.zeros((count, *self._observer.shape(term.key)))
        tensors = {key: self._observer.tensor(key, value) for key, value in values.items()}
        referents, targets, kinds = (torch.from_numpy(numbers.copy()) for numbers in goals.T)
        privileged = {"referent": referents} | ({"target": targets} if task.traits.places else {})
        privileged |= {"verb": kinds} if task.verbs else {}
        return TensorDict(tensors | {"privileged": TensorDict(privileged, [count])}, [count])
