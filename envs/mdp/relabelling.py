"""Episodes told again: as if what they came to had been asked for, in words too.

A see-through target touches nothing, and words touch nothing either. So a recorded episode would have gone just the
same, had its target stood where the object came to be, or had another object been named. `Task.retold` says what could
have been asked; the sentence is said anew for the changed scene; and the task itself judges what was recorded, so
that rewards and ends are written once, and those that depend on what came before are right as well.
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
from envs.mdp.observation_spec import COLUMNS, OBJECT_WIDTH, OFFSET, Bounds, clipped, offsets, seen_scene
from envs.mdp.observations import asked
from envs.mdp.rewards import judge, weights
from envs.sim.object_pool import PARKED
from envs.tasks import NOTHING, Episode, State, Task
from language import LanguageError, Placed, Tokenizer

NAMES = [field.name for field in fields(State)]


@dataclass(frozen=True)
class Tale:
    """One episode of T control steps as it is told again.

    frames: (T,) as recorded. moments: the T + 1 states, a world each, as they would have been. rows: (T + 1, K, D) the
    objects as they would have been seen. episode: what is asked.
    """

    frames: TensorDictBase
    moments: State
    rows: NDArray[np.float32]
    episode: Episode


class Hindsight:
    """task: one of its own, whose N worlds are N episodes. bounds: of what is observed. joints: of the arm."""

    def __init__(self, task: Task, worlds: int, tokenizer: Tokenizer, bounds: Bounds, joints: int) -> None:
        self._task, self._worlds, self._tokenizer, self._bounds = task, worlds, tokenizer, bounds
        self._weights = weights(task)
        self._gripper = slice(2 * joints, 2 * joints + 3)  # in the robot's row

    def __call__(self, episodes: Sequence[TensorDictBase], seed: int) -> list[TensorDictBase]:
        """The episodes, (T,) each with all that is observed, that have another tale to tell, up to where it ends."""
        if self._task.points:
            return []  # the finger points at what was meant
        rng = np.random.default_rng(seed)
        tales = [tale for frames in episodes if (tale := self._tale(frames, rng)) is not None]
        count = self._worlds
        return [told for i in range(0, len(tales), count) for told in self._judged(tales[i : i + count])]

    def _tale(self, frames: TensorDictBase, rng: Generator) -> Tale | None:
        rows = np.concatenate((frames["objects"][:1].numpy(), frames["next", "objects"].numpy()))
        moments = self._moments(frames, rows)
        shown = np.flatnonzero(moments.shown[0])
        scene = seen_scene(rows[0, shown], self._task.config.viewpoint)
        fixed = ~scene.targets if not self._task.moves else ~scene.targets & ~moments.movable[0, shown]
        try:
            episode = self._task.retold(Placed(scene, np.zeros(len(scene)), fixed), _among(moments, shown), rng)
        except LanguageError:
            return None
        if episode is None:
            return None
        moved = (episode.scene.positions != scene.positions).any(1)
        slots, places = shown[moved], episode.scene.positions[moved]
        moments.objects[:, slots] = rows[:, slots, :3] = places
        if self._task.moves:
            rows[:, slots, OFFSET] = offsets(moments.objects[:, slots], moments.gripper[:, None])
        target = episode.referent if episode.target is None else episode.target
        meant = {"referent": shown[episode.referent], "target": shown[target]}
        meant = {name: np.full(len(rows), slot) for name, slot in meant.items()}
        return Tale(frames, replace(moments, **meant), rows, episode)

    def _moments(self, frames: TensorDictBase, rows: NDArray[np.float32]) -> State:
        """What the task saw of an episode, from its beginning on."""
        shown = self._history(frames, "objects_mask")
        places = np.where(shown[..., None], rows[..., :3], PARKED)
        gripper = self._history(frames, "robot")[:, self._gripper].astype(np.float64)
        referent = self._history(frames, "privileged", "referent")
        if not self._task.moves:
            return State(gripper, places, shown, referent)
        movable, held = (self._history(frames, "privileged", name) for name in ("movable", "held"))
        target = self._history(frames, "privileged", "target") if self._task.places else referent
        targets = shown & (rows[..., OBJECT_WIDTH - 1] > 0.5)
        return State(gripper, places, shown, referent, target, movable, targets, rows[..., 3:7].astype(float), held)

    @staticmethod
    def _history(frames: TensorDictBase, *key: str) -> Any:
        """(T + 1, ...) what was observed at the beginning and after each step."""
        return torch.cat((frames[key][:1], frames[("next", *key)])).numpy()

    def _judged(self, tales: Sequence[Tale]) -> list[TensorDictBase]:
        """So many tales at once, up to where they end."""
        spans = [len(tale.frames) for tale in tales]
        states = self._side_by_side([tale.moments for tale in tales], max(spans))
        self._task.reset(np.arange(self._worlds), states[0])
        seen = [self._seen(states[0])]
        came_to = []
        for state in states[1:]:
            came_to.append(TensorDict(judge(self._task, state, self._weights), [self._worlds]))
            seen.append(self._seen(state))
        each = zip(tales, torch.stack(seen, 1), torch.stack(came_to, 1), strict=False)
        return [self._frames(tale, after, ends[: len(tale.frames)]) for tale, after, ends in each]

    def _seen(self, state: State) -> TensorDictBase:
        columns = np.where(state.shown[..., None], self._task.seen(state), 0.0)
        seen = asked(self._task, state, self._bounds) | {"columns": torch.from_numpy(columns)}
        return TensorDict(seen, [self._worlds])

    def _side_by_side(self, tales: Sequence[State], span: int) -> list[State]:
        """Moment by moment, the tales as worlds. Those that are over stay as they are; the first fills up."""
        tales = [*tales, *[tales[0]] * (self._worlds - len(tales))]
        at = [np.minimum(np.arange(span + 1), len(tale.gripper) - 1) for tale in tales]
        names = NAMES if self._task.moves else NAMES[:4]
        whole = {name: [getattr(tale, name)[when] for tale, when in zip(tales, at, strict=True)] for name in names}
        arrays = {name: np.stack(each, axis=1) for name, each in whole.items()}
        return [State(**{name: array[t] for name, array in arrays.items()}) for t in range(span + 1)]

    def _frames(self, tale: Tale, seen: TensorDictBase, ends: TensorDictBase) -> TensorDictBase:
        """(T,) what would have been recorded. seen: (T + 1 or more,). ends: (T,) what each step came to."""
        over = ends["terminated"].flatten().nonzero()
        count = int(over[0]) + 1 if len(over) else len(ends)
        seen, ends = self._told(tale, seen, count + 1), ends[:count].clone()
        done = torch.zeros(count, 1, dtype=torch.bool)
        done[-1] = True
        ends = ends.update({"done": done, "truncated": done & ~ends["terminated"]})
        frames = tale.frames[:count].clone()
        frames.update(seen[:-1]).update(_a_step_later(ends.exclude("reward")))
        frames["next"].update(seen[1:]).update(ends)
        return frames

    def _told(self, tale: Tale, seen: TensorDictBase, count: int) -> TensorDictBase:
        """(count,) all that is seen and heard of the tale that may differ from what was recorded."""
        episode, seen = tale.episode, seen[:count].clone()
        words = torch.from_numpy(tokens(episode, self._tokenizer).copy())
        sentence = torch.from_numpy(in_bytes(episode.sentence).copy())
        privileged = {"kind": torch.tensor(episode.kind).expand(count), "sentence": sentence.expand(count, -1)}
        rows = tale.rows[:count].astype(np.float64)
        rows[..., COLUMNS] = seen.pop("columns").numpy()
        objects = clipped(rows, self._bounds.objects)
        return seen.update({"objects": objects, "instruction": words.expand(count, -1), "privileged": privileged})


def _a_step_later(ends: TensorDictBase) -> TensorDictBase:
    """(T,) what is known of the steps before; of none, at first."""
    return torch.cat((torch.zeros_like(ends[:1]), ends[:-1]))


def _among(moments: State, slots: NDArray[np.int64]) -> State:
    """The same with these slots alone, numbered anew."""
    few: dict[str, Any] = {"objects": moments.objects[:, slots], "shown": moments.shown[:, slots]}
    few["referent"] = np.searchsorted(slots, moments.referent)
    if len(moments.held):
        few["target"] = np.searchsorted(slots, moments.target)
        few |= {name: getattr(moments, name)[:, slots] for name in ("movable", "targets", "turns")}
        few["held"] = np.where(moments.held == NOTHING, NOTHING, np.searchsorted(slots, moments.held))
    return replace(moments, **few)
