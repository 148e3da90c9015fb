"""What Gymnasium reads of a WorkspaceEnv: spaces, observations and infos of its worlds, as arrays."""

from __future__ import annotations

import string
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from gymnasium.vector.utils import create_shared_memory
from numpy.typing import ArrayLike, NDArray
from tensordict import TensorDict, TensorDictBase

from core.errors import ConfigError, UseError, did_you_mean
from core.spaces import action_space, space_of
from envs.mdp.goals import sentence_bytes
from envs.mdp.object_rows import OBJECT_WIDTH, OFFSET
from envs.mdp.observations import OBSERVATIONS, PICTURE_OBSERVATIONS
from envs.workspace_env import WorkspaceEnv
from language import SentenceEmbedding

RENDER_MODES = ("rgb_array", "human")
INSTRUCTIONS = ("tokens", "embedding", "text")  # how observations have the sentence
FLAGS = {"is_success": "success", "wrong_object": "wrong_object", "at_goal": "at_goal"}  # names of an info
MOTION = (*range(7), *range(OFFSET.start, OFFSET.stop))  # columns of a row: pose, and offset from the gripper


class ObservationSpace(spaces.Dict):
    """The Dict of one world's observations. Worker processes of Gymnasium that get it know the ids of this project."""


class SharedObservations(dict):
    """Memory that workers share. A process that unpickles it imports `envs`, which registers the Gymnasium ids."""


@create_shared_memory.register(ObservationSpace)
def _share(space: ObservationSpace, n: int = 1, ctx: Any = torch.multiprocessing) -> SharedObservations:
    return SharedObservations({key: create_shared_memory(part, n=n, ctx=ctx) for key, part in space.items()})


class GymInterface:
    """Reads observations (N, ...), rewards, ends and infos (N,) from the TensorDicts of an environment.

    It also writes its actions. observation_space: of one world, a Dict of `OBSERVATIONS` with `gymnasium`.
    action_space: a Box in [-1, 1].

    Args:
        env: the environment.
        instruction: one of `INSTRUCTIONS`: token ids (L,), a `SentenceEmbedding`, or the sentence itself.

    Raises:
        ConfigError: for another `instruction`.
    """

    def __init__(self, env: WorkspaceEnv, instruction: str = "tokens") -> None:
        if instruction not in INSTRUCTIONS:
            raise ConfigError(
                f"instruction={instruction!r} must be one of {', '.join(INSTRUCTIONS)}"
                + did_you_mean(str(instruction), INSTRUCTIONS)
            )
        spec = env.observation_spec
        terms = (*OBSERVATIONS, *PICTURE_OBSERVATIONS)
        self._env, self._mode = env, instruction
        self._embed = SentenceEmbedding(env.tokenizer)
        keys = [term.key for term in terms if term.gymnasium and term.key in spec.keys()]
        parts = {key: space_of(spec[key]) for key in keys} | self._instruction_space()
        boxes: dict[str, Any] = {key: part for key, part in parts.items() if part.dtype == np.float32}
        others: dict[str, Any] = {key: part for key, part in parts.items() if key not in boxes}
        self._keys = keys
        self.observation_space = ObservationSpace(boxes, **others)
        self.action_space = action_space(env.action_spec)

    def _instruction_space(self) -> dict[str, spaces.Space]:
        if self._mode == "embedding":
            return {"instruction": spaces.Box(0.0, 1.0, (self._embed.width,), np.float32)}
        if self._mode == "text":
            longest = sentence_bytes(self._env.tokenizer)
            return {"instruction": spaces.Text(longest, min_length=0, charset=string.printable)}
        return {}

    def observations(self, values: TensorDictBase) -> dict[str, Any]:
        """Return the observations (N, ...) by name. They are copies; sentences are a tuple of N."""
        arrays = {key: values[key].numpy() for key in self._keys}
        found = {key: array.astype(np.int8) if array.dtype == bool else array.copy() for key, array in arrays.items()}
        if self._mode == "embedding":
            found["instruction"] = self._embed(found["instruction"])
        elif self._mode == "text":
            found["instruction"] = tuple(map(self._env.sentence, range(len(values))))
        return found

    def outcome(self, values: TensorDictBase) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_]]:
        """Return rewards, terminated and truncated of the last step, (N,) each."""
        terminated, truncated = (values[name][:, 0].numpy().copy() for name in ("terminated", "truncated"))
        return values["reward"][:, 0].numpy().astype(np.float64), terminated, truncated

    def compute_reward(self, achieved_goal: NDArray, desired_goal: NDArray, info: Any) -> Any:
        """Return the reward of `GoalInterface`. Raises UseError: this interface has no goals."""
        raise UseError("compute_reward needs an environment with goals: make it with goal=True")

    def infos(self, values: TensorDictBase) -> dict[str, NDArray]:
        """Return the flags (N,) and the weighted reward terms (N, T) of the last step."""
        infos = {name: values[key][:, 0].numpy().copy() for name, key in FLAGS.items()}
        return infos | {"reward_terms": values["reward_terms"].numpy().copy()}

    def action(self, given: ArrayLike, *worlds: int) -> TensorDict:
        """Return an action as the environment takes it. worlds: N of a batch, or nothing. Raises UseError."""
        try:
            values = np.asarray(given)
        except ValueError:  # lists of different lengths
            values = np.empty(0, object)
        shape = (*worlds, *self.action_space.shape)
        if values.shape != shape or values.dtype.kind != "f":
            raise UseError(
                f"step got an action of shape {values.shape} and {values.dtype}; it must be an array of shape {shape} "
                "and float32"
            )
        action = torch.as_tensor(values, dtype=torch.float32).reshape(-1, shape[-1])
        return TensorDict({"action": action}, [len(action)])


class GoalInterface(GymInterface):
    """Goal positions in place of words, as hindsight experience replay (HER) needs them.

    Observations, float32 each:

    achieved_goal: (3,) the gripper centre; where the task moves objects, the referent's position. Metres.
    desired_goal: (3,) the referent's position; where the task moves objects, its target's.
    observation: (O,) the numbers of `robot`; where the task moves objects, also pose and offset from the gripper of
        each object that is no target, the referent first, 0 for one that is not shown.

    The reward is 0 where both goals are within `task.radius` of each other, else -1; `is_success` says the same. No
    episode terminates: where the task ends one, it is truncated, so that failing early does not pay.

    Raises:
        ConfigError: for a task whose goal is not a position.
    """

    def __init__(self, env: WorkspaceEnv) -> None:
        super().__init__(env)
        task, spec = env.task, env.observation_spec
        self._moves, self._radius = task.traits.moves, task.config.radius
        if self._moves and (not task.traits.places or task.traits.real_goals or task.traits.continues):
            raise ConfigError(f"goal=True needs a task whose goal is a position, and task={task.config.name} has none")
        free, fixed, _ = task.bodies
        self._count = free + fixed
        goal, robot = space_of(spec["privileged", "goal"]), space_of(spec["robot"])
        assert isinstance(goal, spaces.Box)
        assert isinstance(robot, spaces.Box)
        low, high = goal.low[:3], goal.high[:3]
        least, greatest = [robot.low], [robot.high]
        if self._moves:
            rows = space_of(spec["objects"])
            assert isinstance(rows, spaces.Box)
            least.append(np.tile(rows.low[0, MOTION], self._count))
            greatest.append(np.tile(rows.high[0, MOTION], self._count))
        self.observation_space = ObservationSpace(
            achieved_goal=spaces.Box(low, high),
            desired_goal=spaces.Box(low, high),
            observation=spaces.Box(np.concatenate(least), np.concatenate(greatest)),
        )

    def observations(self, values: TensorDictBase) -> dict[str, Any]:
        """Return the observations (N, ...) by name. They are copies."""
        goal, robot = values["privileged", "goal"].numpy(), values["robot"].numpy()
        parts = [robot, self._motions(values).reshape(len(robot), -1)] if self._moves else [robot]
        return {
            "achieved_goal": goal[:, :3].copy() if self._moves else self._env.gripper.astype(np.float32),
            "desired_goal": goal[:, 3:6].copy() if self._moves else goal[:, :3].copy(),
            "observation": np.concatenate(parts, axis=1),
        }

    def _motions(self, values: TensorDictBase) -> NDArray[np.float32]:
        """(N, O, M) the columns `MOTION` of the objects that are no targets, the referent first."""
        rows, worlds = values["objects"].numpy(), np.arange(len(values))
        rank = np.where(rows[..., OBJECT_WIDTH - 1] > 0.5, 3, np.where(values["objects_mask"].numpy(), 1, 2))
        rank[worlds, values["privileged", "referent"].numpy()] = 0
        order = rank.argsort(axis=1, kind="stable")[:, : self._count]
        return rows[worlds[:, None], order][..., MOTION]

    def outcome(self, values: TensorDictBase) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_]]:
        """Return rewards, terminated and truncated of the last step, (N,) each."""
        _, terminated, truncated = super().outcome(values)
        return self._rewards(values), np.zeros_like(terminated), terminated | truncated

    def infos(self, values: TensorDictBase) -> dict[str, NDArray]:
        """Return the infos of all environments, where `is_success` is whether the goal is achieved."""
        return super().infos(values) | {"is_success": self._rewards(values) == 0.0}

    def _rewards(self, values: TensorDictBase) -> NDArray[np.float64]:
        observed = self.observations(values)
        return self.compute_reward(observed["achieved_goal"], observed["desired_goal"], {})

    def compute_reward(self, achieved_goal: NDArray, desired_goal: NDArray, info: Any) -> Any:
        """Return -1 or 0 for goals (..., 3): a float64, or an array of them. `info` does not matter."""
        apart = np.linalg.norm(np.asarray(achieved_goal) - np.asarray(desired_goal), axis=-1)
        return np.where(apart <= self._radius, 0.0, -1.0)[()]


def make_interface(env: WorkspaceEnv, instruction: str, goal: bool) -> GymInterface:
    """Return what reads the environment. Raises ConfigError for arguments that do not fit it, or each other."""
    if goal and instruction != "tokens":
        raise ConfigError(f"instruction={instruction!r} has no effect with goal=True, which takes the place of words")
    return GoalInterface(env) if goal else GymInterface(env, instruction)


def group_words(task: str, robot: str, control: str, overrides: Any) -> list[str]:
    """Return the overrides of an environment whose config groups are given by name."""
    return [f"task={task}", f"robot={robot}", f"control={control}", *overrides]
