"""What Gymnasium reads of a WorkspaceEnv: spaces, observations and infos of its worlds, as arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from gymnasium.vector.utils import create_shared_memory
from numpy.typing import ArrayLike, NDArray
from tensordict import TensorDict, TensorDictBase

from core.errors import UseError
from core.spaces import action_space, space_of
from envs.mdp.observations import OBSERVATIONS, PICTURE_OBSERVATIONS
from envs.workspace_env import WorkspaceEnv

RENDER_MODES = ("rgb_array", "human")
FLAGS = {"is_success": "success", "wrong_object": "wrong_object", "at_goal": "at_goal"}  # names of an info


class ObservationSpace(spaces.Dict):
    """The Dict of one world's observations. Worker processes of Gymnasium that get it know the ids of this project."""


class SharedObservations(dict):
    """Memory that workers share. A process that unpickles it imports `envs`, which registers the Gymnasium ids."""


@create_shared_memory.register(ObservationSpace)
def _share(space: ObservationSpace, n: int = 1, ctx: Any = torch.multiprocessing) -> SharedObservations:
    return SharedObservations({key: create_shared_memory(part, n=n, ctx=ctx) for key, part in space.items()})


class GymInterface:
    """Reads observations (N, ...) and infos (N,) from the TensorDicts of an environment, and writes its actions.

    observation_space: of one world, a Dict of `OBSERVATIONS` with `gymnasium`. action_space: a Box in [-1, 1].
    """

    def __init__(self, env: WorkspaceEnv) -> None:
        spec = env.observation_spec
        terms = (*OBSERVATIONS, *PICTURE_OBSERVATIONS)
        self._keys = [term.key for term in terms if term.gymnasium and term.key in spec.keys()]
        boxes: dict[str, Any] = {key: space_of(spec[key]) for key in self._keys if spec[key].dtype == torch.float32}
        others: dict[str, Any] = {key: space_of(spec[key]) for key in self._keys if key not in boxes}
        self.observation_space = ObservationSpace(boxes, **others)
        self.action_space = action_space(env.action_spec)

    def observations(self, values: TensorDictBase) -> dict[str, NDArray]:
        """Return the observations (N, ...) by name. They are copies."""
        arrays = {key: values[key].numpy() for key in self._keys}
        return {key: array.astype(np.int8) if array.dtype == bool else array.copy() for key, array in arrays.items()}

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


def group_words(task: str, robot: str, control: str, overrides: Any) -> list[str]:
    """Return the overrides of an environment whose config groups are given by name."""
    return [f"task={task}", f"robot={robot}", f"control={control}", *overrides]
