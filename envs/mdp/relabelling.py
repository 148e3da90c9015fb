"""Relabelling of episodes with the goal they achieved: hindsight experience replay, for places and for words.

See-through targets and sentences have no physical effect. So the recorded motion stays valid if the target stood where
the object ended up, or if another object was named. `Task.relabel` returns such a goal. A sentence is generated for the
changed scene, and the task evaluates the recorded states again: rewards and terminations are defined once, also those
that depend on earlier steps.

Source: Andrychowicz et al. 2017 (arXiv:1707.01495).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import torch
from numpy.random import Generator
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase

from envs.mdp.goals import in_bytes, tokens
from envs.mdp.object_rows import COLUMNS, OBJECT_WIDTH, OFFSET, nouns_of_rows, offsets, scene_of_rows
from envs.mdp.observation_terms import GoalSource, Observer
from envs.mdp.rewards import compute_outcome, reward_weights
from envs.sim.object_pool import PARKED
from envs.tasks import NOTHING, EpisodeSpec, State, Task
from language import LanguageError, Placed, Tokenizer

STATE_FIELDS = [field.name for field in fields(State)]
FIELDS_WITHOUT_MOVING = STATE_FIELDS[:4]  # the fields of tasks that move nothing


@dataclass(frozen=True, kw_only=True)
class RelabelledEpisode:
    """An episode of T control steps with another goal.

    frames: (T,) as recorded. states: the T + 1 states with the new goal, in the place of worlds. rows: (T + 1, K, D)
    the rows of `objects` with the new goal. episode: the new goal.
    """

    frames: TensorDictBase
    states: State
    rows: NDArray[np.float32]
    episode: EpisodeSpec


class Relabeller:
    """Relabels recorded episodes.

    Args:
        task: one of its own, whose N worlds are N episodes that are relabelled at once.
        num_episodes: N.
        tokenizer, observer: of the environment that the episodes were recorded in.
        joints: how many the arm has.
    """

    def __init__(self, task: Task, num_episodes: int, *, tokenizer: Tokenizer, observer: Observer, joints: int) -> None:
        self._task, self._num_episodes, self._tokenizer, self._observer = task, num_episodes, tokenizer, observer
        self._weights = reward_weights(task)
        self._gripper = slice(2 * joints, 2 * joints + 3)  # the gripper centre's columns in `robot`

    def __call__(self, episodes: Sequence[TensorDictBase], seed: int) -> list[TensorDictBase]:
        """Relabel the episodes that achieved another goal: (T,) each, all observations, cut where they now end."""
        if self._task.points:
            return []  # the finger points at the recorded goal
        rng = np.random.default_rng(seed)
        relabelled = [each for frames in episodes if (each := self._relabel(frames, rng)) is not None]
        count = self._num_episodes
        batches = [relabelled[i : i + count] for i in range(0, len(relabelled), count)]
        return [frames for batch in batches for frames in self._evaluate(batch)]

    def _relabel(self, frames: TensorDictBase, rng: Generator) -> RelabelledEpisode | None:
        """Return the episode with the goal that it achieved; None if that is no other one, or no sentence names it."""
        rows = np.concatenate((frames["objects"][:1].numpy(), frames["next", "objects"].numpy()))
        states = self._states(frames, rows)
        if self._task.perceived and (states.shown[0] != self._truly_shown(frames)).any():
            return None  # no sentence for a scene in which something is overlooked, or invented
        shown = np.flatnonzero(states.shown[0])
        nouns = nouns_of_rows(rows[0, shown], fixtures=self._task.fixtures)
        scene = scene_of_rows(rows[0, shown], self._task.config.viewpoint, nouns)
        if self._task.traits.moves:
            states.nouns[:, shown] = scene.nouns
        fixed = ~scene.targets if not self._task.traits.moves else ~scene.targets & ~states.movable[0, shown]
        try:
            episode = self._task.relabel(Placed(scene, np.zeros(len(scene)), fixed), _select_slots(states, shown), rng)
        except LanguageError:
            return None
        if episode is None:
            return None
        moved = (episode.scene.positions != scene.positions).any(1)
        slots, places = shown[moved], episode.scene.positions[moved]
        states.objects[:, slots] = rows[:, slots, :3] = places
        if self._task.traits.moves:
            rows[:, slots, OFFSET] = offsets(states.objects[:, slots], states.gripper[:, None])
        target = episode.referent if episode.target is None else episode.target
        referents, targets = (np.full(len(rows), shown[index]) for index in (episode.referent, target))
        states = replace(states, referent=referents, target=targets)
        return RelabelledEpisode(frames=frames, states=states, rows=rows, episode=episode)

    def _states(self, frames: TensorDictBase, rows: NDArray[np.float32]) -> State:
        """Return the T + 1 states of an episode, as the task saw them."""
        shown = self._history(frames, "objects_mask")
        observed = self._history(frames, "privileged", "places") if self._task.perceived else rows[..., :3]
        places = np.where(shown[..., None], observed, PARKED)
        gripper = self._history(frames, "robot")[:, self._gripper].astype(np.float64)
        referent = self._history(frames, "privileged", "referent")
        if not self._task.traits.moves:
            return State(gripper=gripper, objects=places, shown=shown, referent=referent)
        movable, held = (self._history(frames, "privileged", name) for name in ("movable", "held"))
        target = self._history(frames, "privileged", "target") if self._task.traits.places else referent
        goals = shown & ((rows[..., OBJECT_WIDTH - 1] > 0.5) != self._task.traits.real_goals)
        return State(
            gripper=gripper,
            objects=places,
            shown=shown,
            referent=referent,
            target=target,
            movable=movable,
            goals=goals,
            quaternions=rows[..., 3:7].astype(float),
            held=held,
            nouns=np.zeros(shown.shape, np.int64),
            kind=np.zeros_like(referent),
            yaw=np.zeros(shown.shape),  # no relabelled task reads the yaw of placed objects
        )

    @staticmethod
    def _truly_shown(frames: TensorDictBase) -> NDArray[np.bool_]:
        """(K,) in which slots something really is as the episode begins."""
        return (frames["privileged", "places"][0] != 0).any(-1).numpy()  # type: ignore[no-any-return]

    @staticmethod
    def _history(frames: TensorDictBase, *key: str) -> Any:
        """(T + 1, ...) what was observed at the beginning and after each step."""
        return torch.cat((frames[key][:1], frames[("next", *key)])).numpy()

    def _evaluate(self, batch: Sequence[RelabelledEpisode]) -> list[TensorDictBase]:
        """Return the frames of up to N episodes with the rewards and terminations of their new goals."""
        spans = [len(each.frames) for each in batch]
        steps = self._side_by_side([each.states for each in batch], max(spans))
        self._task.reset(np.arange(self._num_episodes), steps[0])
        observed = [self._observe(steps[0])]
        outcomes = []
        for state in steps[1:]:
            outcome = compute_outcome(self._task, state, self._weights)
            tensors = {name: torch.from_numpy(values) for name, values in outcome.items()}
            outcomes.append(TensorDict(tensors, [self._num_episodes]))
            observed.append(self._observe(state))
        each = zip(batch, torch.stack(observed, 1), torch.stack(outcomes, 1), strict=False)
        return [self._frames(one, after, ends[: len(one.frames)]) for one, after, ends in each]

    def _observe(self, state: State) -> TensorDictBase:
        """(N,) the observations that depend on the goal, and the task's own columns of objects (N, K, C)."""
        columns = np.where(state.shown[..., None], self._task.seen(state), 0.0)
        observed = self._observer.observe(GoalSource(task=self._task, state=state), goal=True)
        return TensorDict(observed | {"columns": torch.from_numpy(columns)}, [self._num_episodes])

    def _side_by_side(self, episodes: Sequence[State], span: int) -> list[State]:
        """For each step, the episodes as worlds. Ended ones keep their last state; the first fills unused worlds."""
        episodes = [*episodes, *[episodes[0]] * (self._num_episodes - len(episodes))]
        steps = [np.minimum(np.arange(span + 1), len(states.gripper) - 1) for states in episodes]
        names = STATE_FIELDS if self._task.traits.moves else FIELDS_WITHOUT_MOVING
        histories = {
            name: [getattr(states, name)[at] for states, at in zip(episodes, steps, strict=True)] for name in names
        }
        arrays = {name: np.stack(history, axis=1) for name, history in histories.items()}
        return [State(**{name: array[t] for name, array in arrays.items()}) for t in range(span + 1)]

    def _frames(
        self, relabelled: RelabelledEpisode, observed: TensorDictBase, outcomes: TensorDictBase
    ) -> TensorDictBase:
        """Return the frames as they would have been recorded. observed: (T + 1 or more,). outcomes: (T,)."""
        over = outcomes["terminated"].flatten().nonzero()
        count = int(over[0]) + 1 if len(over) else len(outcomes)
        observed, outcomes = self._observations(relabelled, observed, count + 1), outcomes[:count].clone()
        done = torch.zeros(count, 1, dtype=torch.bool)
        done[-1] = True
        outcomes = outcomes.update({"done": done, "truncated": done & ~outcomes["terminated"]})
        frames = relabelled.frames[:count].clone()
        frames.update(observed[:-1]).update(_one_step_later(outcomes.exclude("reward")))
        frames["next"].update(observed[1:]).update(outcomes)
        return frames

    def _observations(self, relabelled: RelabelledEpisode, observed: TensorDictBase, count: int) -> TensorDictBase:
        """(count,) all observations that may differ from the recorded ones."""
        episode, observed = relabelled.episode, observed[:count].clone()
        words = torch.from_numpy(tokens(episode, self._tokenizer).copy())
        sentence = torch.from_numpy(in_bytes(episode.sentence, self._observer.shape("privileged/sentence")[0]).copy())
        privileged = {"kind": torch.tensor(episode.kind).expand(count), "sentence": sentence.expand(count, -1)}
        rows = relabelled.rows[:count].astype(np.float64)
        rows[..., COLUMNS] = observed.pop("columns").numpy()
        objects = self._observer.tensor("objects", rows)
        return observed.update({"objects": objects, "instruction": words.expand(count, -1), "privileged": privileged})


def _one_step_later(outcomes: TensorDictBase) -> TensorDictBase:
    """(T,) the outcomes as the observation before each step shows them: all false at first."""
    return torch.cat((torch.zeros_like(outcomes[:1]), outcomes[:-1]))


def _select_slots(states: State, slots: NDArray[np.int64]) -> State:
    """Return the states with these slots alone, renumbered from 0."""
    selected: dict[str, Any] = {"objects": states.objects[:, slots], "shown": states.shown[:, slots]}
    selected["referent"] = np.searchsorted(slots, states.referent)
    if len(states.held):
        selected["target"] = np.searchsorted(slots, states.target)
        selected |= {name: getattr(states, name)[:, slots] for name in ("movable", "goals", "quaternions", "nouns")}
        selected["held"] = np.where(states.held == NOTHING, NOTHING, np.searchsorted(slots, states.held))
    return replace(states, **selected)
