"""Recorded episodes: observations, actions and outcomes of each step, how they are recorded, replayed and compared."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from torchrl.envs import EnvBase
from torchrl.envs.utils import ExplorationType, set_exploration_type

from core.spaces import public_keys
from trainers.collect.worker import derive_seed
from trainers.evaluation.video import sentence_of

LABELS = ("referent", "target")  # privileged keys that are recorded: slots of the objects
OUTCOMES = ("reward", "success", "terminated", "truncated")
SEED_INDEX = 2**29  # first index of the seeds: no evaluation of a run or of evaluate.py uses one of them

Actor = Callable[[TensorDictBase], TensorDictBase]  # writes "action"


@dataclass
class Demonstration:
    """One episode of T steps.

    seed: an environment of one world with this seed begins with this episode after a reset.
    sentence: the instruction; "" without words.
    observations: by key, (T+1, ...) each: before every action, and after the last one.
    labels: the slots of the referent and of its target, if the environment has them, (T+1,) each.
    actions: (T, A) float32 in [-1, 1].
    outcomes: reward (float32), success, terminated and truncated, (T,) each.
    images: by camera, T+1 of shape (H, W, 3) uint8 each.
    """

    seed: int
    sentence: str
    observations: dict[str, NDArray]
    labels: dict[str, NDArray]
    actions: NDArray[np.float32]
    outcomes: dict[str, NDArray]
    images: dict[str, list[NDArray[np.uint8]]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.actions)

    @property
    def success(self) -> bool:
        """Whether the episode ended in success."""
        return bool(self.outcomes["success"][-1])


def demonstrate(
    env: EnvBase, actor: Actor, episodes: int, seed: int, cameras: Sequence[str] = (), first: int = 0
) -> Iterator[Demonstration]:
    """Run episodes with a deterministic actor, one after another.

    Args:
        env: of one world; built for rendering if cameras are recorded.
        actor: writes "action"; it does not receive the privileged keys.
        episodes: their number.
        seed: of the whole recording; each episode's seed is derived from it.
        cameras: the names of those that take a picture at each control step.
        first: number of the first episode, where the others are recorded elsewhere.
    """
    for index in range(first, first + episodes):
        episode_seed = derive_seed(seed, SEED_INDEX + index, evaluation=True)
        yield _run_episode(env, lambda state: actor(state.exclude("privileged"))["action"], episode_seed, cameras)


def replay_episode(env: EnvBase, recorded: Demonstration) -> Demonstration:
    """Run an episode with the seed and the actions of a recorded one."""
    actions = iter(torch.from_numpy(recorded.actions))
    return _run_episode(env, lambda _: next(actions)[None], recorded.seed, (), len(recorded))


@torch.no_grad()
def _run_episode(
    env: EnvBase,
    act: Callable[[TensorDictBase], torch.Tensor],
    seed: int,
    cameras: Sequence[str],
    max_steps: int | None = None,
) -> Demonstration:
    """act: the action (1, A) for a state. max_steps: the episode is cut after this number of steps."""
    env.set_seed(seed)
    state = env.reset()
    sentence, images = sentence_of(state), {name: [env.render(camera=name)] for name in cameras}
    states, steps = [state], list[TensorDictBase]()
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        while not steps or not (steps[-1]["done"].item() or len(steps) == max_steps):
            action = act(state).clamp(-1.0, 1.0)
            state = env.step(TensorDict({"action": action}, env.batch_size))["next"]
            state["action"] = action
            states.append(state)
            steps.append(state)
            for name in cameras:
                images[name].append(env.render(camera=name))
    return demonstration_of(env, seed, sentence, states, images)


def demonstration_of(
    env: EnvBase,
    seed: int,
    sentence: str,
    states: Sequence[TensorDictBase],
    images: dict[str, list[NDArray[np.uint8]]] | None = None,
) -> Demonstration:
    """Return the episode of T steps that these states are.

    Args:
        env: of one world, whose states they are.
        seed: of the episode.
        sentence: the instruction.
        states: T+1, as `env.reset` and `env.step` return them; all but the first with the "action" that led there.
        images: as in `Demonstration`.
    """
    steps, privileged = states[1:], states[-1]["privileged"].keys()
    return Demonstration(
        seed=seed,
        sentence=sentence,
        observations={key: _stack(states, key) for key in public_keys(env.observation_spec)},
        labels={key: _stack(states, ("privileged", key)) for key in LABELS if key in privileged},
        actions=_stack(steps, "action"),
        outcomes={key: _stack(steps, key)[:, 0] for key in OUTCOMES},
        images=images or {},
    )


def _stack(states: Sequence[TensorDictBase], key: str | tuple[str, str]) -> NDArray:
    """Return the values of a key in world 0, stacked over the steps."""
    return np.stack([state[key][0].numpy() for state in states])


@dataclass
class ReplayResult:
    """Comparison of recorded and replayed episodes.

    differing: number of episodes with any difference. max_difference: the greatest absolute difference of any recorded
    number; it is in `key` of `episode`.
    """

    episodes: int = 0
    steps: int = 0
    differing: int = 0
    max_difference: float = 0.0
    key: str = ""
    episode: int = -1


def verify_replay(env: EnvBase, recorded: Iterable[Demonstration]) -> ReplayResult:
    """Replay every episode and compare it with its recording. env: of one world, with the recorded config."""
    result = ReplayResult()
    for index, episode in enumerate(recorded):
        differences = _differences(episode, replay_episode(env, episode))
        key, difference = max(differences.items(), key=lambda item: item[1])
        if difference > result.max_difference:
            result.max_difference, result.key, result.episode = difference, key, index
        result.differing += difference > 0
        result.episodes, result.steps = result.episodes + 1, result.steps + len(episode)
    return result


def _differences(recorded: Demonstration, replayed: Demonstration) -> dict[str, float]:
    """Return the greatest difference of each key; infinite if the sentence or the number of values differs.

    A format may leave out the state after the last action; then that state is not compared.
    """
    out = {"sentence": 0.0 if recorded.sentence == replayed.sentence else float("inf")}
    for name in ("observations", "labels", "outcomes"):
        new = getattr(replayed, name)
        out |= {key: _difference(values, new[key][: len(values)]) for key, values in getattr(recorded, name).items()}
    return out


def _difference(recorded: NDArray, replayed: NDArray) -> float:
    """Return the greatest absolute difference, in whatever shape a format stores the values of a step."""
    if recorded.size != replayed.size:
        return float("inf")
    apart = np.abs(recorded.astype(np.float64).ravel() - replayed.astype(np.float64).ravel())
    return float(np.nan_to_num(apart, nan=np.inf).max())
