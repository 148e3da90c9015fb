"""A point in a box and an instruction that names a colour: the contract of the real environments, without physics."""

from __future__ import annotations

import time
from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Binary, Bounded, Categorical, Composite, Unbounded

from envs.episode_replay import EpisodeReplayEnv
from envs.mdp.actions import read_action

SLOTS, ROW, LENGTH = 3, 13, 6
COLOURS = torch.tensor([[1.0, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1]])
WORDS = ["<pad>", "touch", "the", "red", "green", "blue"]
SENTENCES = ["touch the red", "touch the green", "touch the blue"]
NEAR, MOVE, MAX_STEPS = 0.25, 0.2, 20


class FakeEnv(EpisodeReplayEnv):
    """poison: the reward, or this observation, becomes NaN after so many steps. nap: seconds each step takes."""

    kind_names = ("odd", "even")
    reward_names = ("there", "near")
    action_unit = (1.0, 1.0, 1.0)
    moves_referent = False
    tokenizer = SimpleNamespace(vocabulary=WORDS)
    config = SimpleNamespace(task=SimpleNamespace(whose_left="left is y"))

    def __init__(self, worlds: int, seed: int, poison: int = 0, nap: float = 0.0, poisoned: str = "reward") -> None:
        super().__init__(batch_size=[worlds])
        self.poison, self.poisoned, self.nap, self.steps = poison, poisoned, nap, 0
        self.observation_spec = _observations(worlds)
        self.action_spec = Bounded(-torch.ones(worlds, 3), torch.ones(worlds, 3))
        self.reward_spec = Unbounded((worlds, 1))
        flag = Categorical(2, (worlds, 1), dtype=torch.bool)
        self.done_spec = Composite(done=flag, terminated=flag.clone(), truncated=flag.clone(), shape=[worlds])
        self.set_seed(seed)
        self.world = {
            "hand": torch.zeros(worlds, 3),
            "places": torch.zeros(worlds, SLOTS, 3),
            "order": torch.zeros(worlds, SLOTS, dtype=torch.int64),
            "referent": torch.zeros(worlds, dtype=torch.int64),
            "step": torch.zeros(worlds, dtype=torch.int64),
        }

    def draw_scenes(self, count: int, seed: int) -> TensorDictBase:
        scenes = FakeEnv(count, seed).reset()  # a world for each scene
        return scenes.select("objects", "objects_mask", "instruction", ("privileged", "referent"))

    def _begin_episodes(self, worlds: NDArray[np.int64]) -> TensorDictBase:
        for i in worlds.tolist():
            draw, world = self._generators[i], self.world
            world["hand"][i] = torch.from_numpy(draw.uniform(-0.2, 0.2, 3))
            world["places"][i] = torch.from_numpy(draw.uniform(-0.8, 0.8, (SLOTS, 3)))
            world["order"][i] = torch.from_numpy(draw.permutation(SLOTS))
            world["referent"][i], world["step"][i] = int(draw.integers(SLOTS)), 0
        none = torch.zeros(*self.batch_size, 1, dtype=torch.bool)
        out = self._observe(none, none, none, none.float())
        return out.update({name: none.clone() for name in ("done", "terminated", "truncated")})

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        if self.nap:
            time.sleep(self.nap)
        self.steps += 1
        world = self.world
        action = torch.from_numpy(read_action(tensordict, tuple(self.action_spec.shape))).float()
        assert tensordict["action"].abs().max() <= 1
        world["hand"] = (world["hand"] + MOVE * action).clamp(-1, 1)
        world["step"] = world["step"] + 1
        success, wrong, reward = judged(world["places"], world["hand"], world["referent"])
        truncated = (world["step"] >= MAX_STEPS).unsqueeze(-1) & ~success & ~wrong
        poisoned = self.poison and self.steps >= self.poison
        if poisoned and self.poisoned == "reward":
            reward = reward * float("nan")
        out = self._observe(success, wrong, success, reward)
        if poisoned and self.poisoned != "reward":
            out[self.poisoned] *= float("nan")
        ends = {"terminated": success | wrong, "truncated": truncated, "done": success | wrong | truncated}
        return out.update(ends).set("reward", reward)

    def is_reachable(self, place: torch.Tensor) -> bool:
        return bool(place.abs().max() <= 1)

    def hindsight(self, episodes: Sequence[TensorDictBase], seed: int) -> list[TensorDictBase]:
        """Relabels episodes with the colour whose place they came nearest to, if it is another one than was named."""
        relabelled = []
        for frames in episodes:
            places, hand = frames["objects"][..., :3], frames["next", "robot"][:, :3]
            nearest = (places[-1] - hand[-1]).norm(dim=-1).argmin()
            if nearest != frames["privileged", "referent"][0]:
                relabelled.append(_relabelled(frames, *judged(places, hand, nearest.expand(len(frames))), nearest))
        return relabelled

    def _observe(
        self, success: torch.Tensor, wrong: torch.Tensor, at_goal: torch.Tensor, reward: torch.Tensor
    ) -> TensorDictBase:
        world, n = self.world, self.batch_size[0]
        rows = torch.arange(n)
        extra = torch.zeros(n, SLOTS, ROW - 7)
        colour = world["order"][rows, world["referent"]]
        words = torch.zeros(n, LENGTH, dtype=torch.int64)
        words[:, 0], words[:, 1], words[:, 2] = 1, 2, 3 + colour
        sentence = torch.zeros(n, 24, dtype=torch.uint8)
        for i, c in enumerate(colour.tolist()):
            text = SENTENCES[c].encode()
            sentence[i, : len(text)] = torch.tensor(list(text), dtype=torch.uint8)
        return TensorDict(
            {
                "robot": torch.cat([world["hand"], torch.zeros(n, 1)], -1),
                "objects": torch.cat([world["places"], COLOURS[world["order"]], extra], -1),
                "objects_mask": torch.ones(n, SLOTS, dtype=torch.bool),
                "instruction": words,
                "hold": torch.zeros(n, 3),
                "privileged": {
                    "referent": world["referent"].clone(),
                    "goal": world["places"][rows, world["referent"]].clone(),
                    "kind": colour % 2,
                    "sentence": sentence,
                },
                "success": success.clone(),
                "wrong_object": wrong.clone(),
                "at_goal": at_goal.clone(),
                "reward_terms": torch.cat([success.float(), reward - success.float()], -1),
            },
            self.batch_size,
        )

    def film(self) -> torch.Tensor:
        return np.full((96, 128, 3), 200, np.uint8)  # type: ignore[return-value]


def judged(places: torch.Tensor, hand: torch.Tensor, referent: torch.Tensor) -> tuple[torch.Tensor, ...]:
    """Success, wrong object and reward, (N, 1) each, of hands (N, 3) at places (N, SLOTS, 3)."""
    distance = (places - hand.unsqueeze(1)).norm(dim=-1)
    wanted = distance[torch.arange(len(hand)), referent].unsqueeze(-1)
    success, nearest = wanted < NEAR, distance.argmin(-1)
    wrong = (distance.min(-1).values < NEAR / 2).unsqueeze(-1) & (nearest != referent).unsqueeze(-1) & ~success
    return success, wrong, success.float() - 0.1 * wanted


def _relabelled(frames, success, wrong, reward, referent) -> TensorDictBase:
    """The frames (T,) with another referent, up to where they end."""
    over = (success | wrong).flatten().nonzero()
    count = int(over[0]) + 1 if len(over) else len(frames)
    frames = frames[:count].clone()
    row = frames["objects"][0, referent]
    frames["next"].update({"success": success[:count], "wrong_object": wrong[:count], "reward": reward[:count]})
    frames["next", "terminated"] = (success | wrong)[:count]
    for part in (frames, frames["next"]):
        part["instruction"][:, 2] = 3 + row[3:6].argmax()
        part["privileged", "referent"][:], part["privileged", "goal"][:] = referent, row[:3]
    return frames


def _observations(n: int) -> Composite:
    flag = Categorical(2, (n, 1), dtype=torch.bool)
    box = Bounded(-torch.ones(n, 3), torch.ones(n, 3))
    return Composite(
        robot=Bounded(-torch.ones(n, 4), torch.ones(n, 4)),
        objects=Bounded(-torch.ones(n, SLOTS, ROW), torch.ones(n, SLOTS, ROW)),
        objects_mask=Binary(SLOTS, (n, SLOTS), dtype=torch.bool),
        hold=Bounded(-torch.ones(n, 3), torch.ones(n, 3)),
        instruction=Categorical(len(WORDS), (n, LENGTH)),
        privileged=Composite(
            referent=Categorical(SLOTS, (n,)),
            goal=box,
            kind=Categorical(2, (n,)),
            sentence=Bounded(0, 255, (n, 24), dtype=torch.uint8),
            shape=[n],
        ),
        success=flag,
        wrong_object=flag.clone(),
        at_goal=flag.clone(),
        reward_terms=Unbounded((n, 2)),
        shape=[n],
    )


def make_env(worlds: int, seed: int) -> FakeEnv:
    return FakeEnv(worlds, seed)


class Crashing(FakeEnv):
    """Raises in its sixth step, in whatever process it runs."""

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        if self.steps == 5:
            raise ArithmeticError("the arm is on fire")
        return super()._step(tensordict)


def make_crashing(worlds: int, seed: int) -> Crashing:
    """A module-level function, so that workers can unpickle it."""
    return Crashing(worlds, seed)


def same(one: TensorDictBase, other: TensorDictBase) -> bool:
    """Whether two batches are bit-equal, apart from the numbers that TorchRL gives to trajectories."""
    keys = one.exclude("collector").keys(include_nested=True, leaves_only=True)
    return all(torch.equal(one[key], other[key]) for key in keys)
