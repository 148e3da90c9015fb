"""The declaration of one observation: its spec, its computation, who may see it, and which network reads it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor
from torchrl.data import Bounded, Composite, TensorSpec

from envs.mdp.controls import Control
from envs.mdp.gestures import Gestures
from envs.mdp.grip_controller import GripController
from envs.mdp.perceived_worlds import PerceivedWorlds
from envs.mdp.pictures import Photographer
from envs.mdp.pictures_config import PicturesConfig
from envs.mdp.randomization import Perturbations
from envs.mdp.world_state import WorldState
from envs.sim.kinematics import Kinematics
from envs.sim.robot_config import RobotConfig
from envs.sim.workspace import WorkspaceConfig
from envs.tasks import State, Task
from language import Tokenizer

READERS = ("scene", "actor", "critic", None)


@dataclass(frozen=True, kw_only=True)
class SpecSettings:
    """The settings on which specs depend.

    action_width: how many numbers an action has. pictures: which pictures policies see; None: none.
    """

    workspace: WorkspaceConfig
    robot: RobotConfig
    kinematics: Kinematics
    task: Task
    tokenizer: Tokenizer
    action_width: int
    pictures: PicturesConfig | None = None


class Sight(Protocol):
    """N episodes as policies may know them: a task whose memory follows from it, and the state."""

    @property
    def task(self) -> Task: ...

    @property
    def state(self) -> State: ...


@dataclass(frozen=True, kw_only=True)
class GoalSource:
    """The inputs of observations that depend on the goal: N episodes as the task sees them."""

    task: Task
    state: State

    @property
    def sight(self) -> Sight:
        """What policies may know of the world."""
        return self


@dataclass(frozen=True, kw_only=True)
class Source(GoalSource):
    """The inputs of all other observations, beside those of `GoalSource`.

    perceived: what cameras see; None: policies observe the state itself. photographer: None without pictures.
    """

    worlds: WorldState
    perceived: PerceivedWorlds | None = None
    grip_controller: GripController
    gestures: Gestures
    control: Control
    perturbations: Perturbations
    photographer: Photographer | None = None

    @property
    def sight(self) -> Sight:
        return self if self.perceived is None else self.perceived

    @property
    def rows(self) -> NDArray[np.float64]:
        """(N, K, D) the rows of objects, but for those that are not shown."""
        return self.worlds.rows if self.perceived is None else self.perceived.rows

    def hold(self) -> NDArray[np.float32]:
        """(N, A) the action that keeps the arm where it is; 0 for the gripper, whose command is absolute."""
        arm = self.control.hold(self.worlds.angles, self.worlds.pose.position)
        return np.concatenate((arm, np.zeros((len(arm), self.grip_controller.width))), axis=1).astype(np.float32)


def always(task: Task) -> bool:
    """An observation that every task has."""
    return True


@dataclass(frozen=True)
class ObservationTerm:
    """One observation. Its key begins with "privileged/" where policies must not see it.

    Its reader is the network that has it as an input:

    * "scene": the encoder of words and scene. An observation of shape (K, F) adds F columns to the rows of the slots;
      one of shape (F,) is repeated in each row. It is 0 in drawn scenes, unless `SceneSampler` knows it.
    * "actor": the actor, and the critics too.
    * "critic": the critics alone. A privileged one is read with `policy.privileged_critic` only.
    * None: no network.

    Everything else follows from the list of terms: the specs of TorchRL and Gymnasium, recordings (every public key is
    recorded), checkpoints (which store the shapes of public keys), checks for finite values, and docs/reference.

    Attributes:
        key: "name" or "privileged/name".
        description: its content with units, for the documentation.
        spec: of one world.
        compute: gives (N, ...) numbers of N worlds from a `Source`. Floats are clipped to the spec's bounds.
        present: whether a task has it.
        goal: whether it depends on the goal of the episode. It is then computed from a `GoalSource` alone, and again
            where an episode is relabelled.
        gymnasium: whether the Gymnasium environment shows it.
        reader: "scene", "actor", "critic" or None.

    Raises:
        ValueError: the reader is none of these, or a policy that may not see the observation.
    """

    key: str
    description: str
    spec: Callable[[SpecSettings], TensorSpec]
    compute: Callable[[Any], NDArray]
    present: Callable[[Task], bool] = always
    goal: bool = False
    gymnasium: bool = False
    reader: str | None = None

    def __post_init__(self) -> None:
        if self.reader not in READERS:
            raise ValueError(f"observation {self.key}: reader={self.reader!r} must be one of {READERS}")
        if self.reader in ("scene", "actor") and len(self.path) > 1:
            raise ValueError(f"observation {self.key}: reader={self.reader!r} may not see what is privileged")

    @property
    def path(self) -> tuple[str, ...]:
        """The key as TensorDicts take it."""
        return tuple(self.key.split("/"))


class Observer:
    """Makes the specs of observations, and tensors that are within them.

    terms: those that the task has.
    """

    def __init__(self, terms: Iterable[ObservationTerm], setup: SpecSettings) -> None:
        self.terms = [term for term in terms if term.present(setup.task)]
        self._specs = {term.key: term.spec(setup) for term in self.terms}
        self._bounds = {
            key: (spec.space.low.numpy(), spec.space.high.numpy())
            for key, spec in self._specs.items()
            if isinstance(spec, Bounded) and spec.dtype == torch.float32
        }

    def spec(self, num_worlds: int) -> Composite:
        """The spec of all terms for N worlds."""
        spec = Composite(privileged=Composite(shape=(num_worlds,)), shape=(num_worlds,))
        for term in self.terms:
            one = self._specs[term.key]
            spec[term.path] = one.expand(num_worlds, *one.shape)
        return spec

    @property
    def readers(self) -> dict[str | tuple[str, ...], str]:
        """The network that reads each observation which has one, by its key as TensorDicts take it."""
        keys = {term.path if len(term.path) > 1 else term.key: term.reader for term in self.terms}
        return {key: reader for key, reader in keys.items() if reader is not None}

    def shape(self, key: str) -> torch.Size:
        """The shape of one world's values."""
        return self._specs[key].shape

    def bounds(self, key: str) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """The least and greatest values of one world's floats."""
        return self._bounds[key]

    def tensor(self, key: str, values: ArrayLike) -> Tensor:
        """A fresh tensor: floats as float32 within their bounds; NaN stays NaN, for checks to find."""
        if key in self._bounds:
            return torch.from_numpy(np.clip(np.asarray(values, np.float32), *self._bounds[key]))
        return torch.from_numpy(np.array(values))

    def observe(self, source: GoalSource, goal: bool | None = None) -> dict[str, Any]:
        """The observations of N worlds, those under "privileged" as a dict of their own.

        goal: only the terms that do, or do not, depend on the goal; None: all terms.
        """
        observed: dict[str, Any] = {"privileged": {}}
        for term in self.terms:
            if goal is None or term.goal == goal:
                part = observed["privileged"] if len(term.path) > 1 else observed
                part[term.path[-1]] = self.tensor(term.key, term.compute(source))
        return observed


def bounded(least: Sequence[ArrayLike], greatest: Sequence[ArrayLike], *batch: int) -> Bounded:
    """float32 (*batch, width) between these values, given in parts to concatenate."""
    low, high = (torch.tensor(np.concatenate(parts).astype(np.float32)) for parts in (least, greatest))
    shape = (*batch, len(low))
    return Bounded(low.expand(shape), high.expand(shape), shape, dtype=torch.float32)
