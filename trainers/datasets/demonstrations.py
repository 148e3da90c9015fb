"""Episodes to be kept: what was seen, done and rewarded at each step, and the seed that brings the episode back."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from torchrl.envs import EnvBase
from torchrl.envs.utils import ExplorationType, set_exploration_type

from trainers.rollout.collection import derive_seed
from trainers.rollout.video import said

SEEN = ("robot", "objects", "objects_mask", "objects_near", "instruction", "gesture", "stage", "hold")
MEANT = ("referent", "target")  # slots; no policy is shown them
CAME_TO = ("reward", "success", "terminated", "truncated")
FIRST = 2**29  # of the seeds' indices: no evaluation of evaluate.py or of a run has one of them

Actor = Callable[[TensorDictBase], TensorDictBase]


@dataclass
class Demonstration:
    """One episode of T steps.

    seen: what the policy may see, by its key, (T+1, ...) each: before every action, and after the last one.
    meant: the slots of the object that is meant, and of its target where there are any, (T+1,) each.
    actions: (T, A) float32 in [-1, 1]. came_to: reward (float32), success, terminated and truncated, (T,) each.
    seed: the environment, of one world, given it and reset, begins with this episode. sentence: "" without words.
    pictures: (T+1, H, W, 3) uint8, or nothing.
    """

    seed: int
    sentence: str
    seen: dict[str, NDArray]
    meant: dict[str, NDArray]
    actions: NDArray[np.float32]
    came_to: dict[str, NDArray]
    pictures: list[NDArray[np.uint8]] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.actions)

    @property
    def success(self) -> bool:
        return bool(self.came_to["success"][-1])


def demonstrate(
    env: EnvBase, actor: Actor, episodes: int, seed: int, pictures: bool = False
) -> Iterator[Demonstration]:
    """So many episodes of the deterministic actor, one after another.

    env: of one world; it must have been made for rendering where pictures are wanted. actor: writes "action"; it is
    shown nothing privileged. seed: of all.
    """
    for index in range(episodes):
        own = derive_seed(seed, FIRST + index, evaluation=True)
        yield _episode(env, lambda state: actor(state.exclude("privileged"))["action"], own, pictures)


def again(env: EnvBase, kept: Demonstration) -> Demonstration:
    """The episode that comes of the same seed and actions."""
    actions = iter(torch.from_numpy(kept.actions))
    return _episode(env, lambda _: next(actions)[None], kept.seed, False, len(kept))


@torch.no_grad()
def _episode(
    env: EnvBase,
    act: Callable[[TensorDictBase], torch.Tensor],
    seed: int,
    pictures: bool,
    most: int | None = None,
) -> Demonstration:
    """most: steps after which it ends whatever happens."""
    env.set_seed(seed)
    state = env.reset()
    sentence, frames = said(state), [env.render()] if pictures else []
    states, steps = [state], list[TensorDictBase]()
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        while not steps or not (steps[-1]["done"].item() or len(steps) == most):
            action = act(state).clamp(-1.0, 1.0)
            state = env.step(TensorDict({"action": action}, env.batch_size))["next"]
            state["did"] = action
            states.append(state)
            steps.append(state)
            frames += [env.render()] if pictures else []
    return Demonstration(
        seed=seed,
        sentence=sentence,
        seen={key: _stack(states, key) for key in SEEN if key in env.observation_spec.keys()},
        meant={key: _stack(states, ("privileged", key)) for key in MEANT if key in state["privileged"].keys()},
        actions=_stack(steps, "did"),
        came_to={key: _stack(steps, key)[:, 0] for key in CAME_TO},
        pictures=frames,
    )


def _stack(states: list[TensorDictBase], key: str | tuple[str, str]) -> NDArray:
    return np.stack([state[key][0].numpy() for state in states])
