"""Our trainers in goal-conditioned Gymnasium environments of others, such as those of panda-gym.

    pip install panda-gym
    python examples/goal_env.py PandaReach-v3 algo=sac total_frames=20_000
    python examples/goal_env.py PandaPush-v3 algo=tqc total_frames=400_000 --folder outputs/push

The environment's dictionary of observation, achieved_goal and desired_goal becomes what `TrainingEnv` asks for, so that
`trainers.run.train_loop.fit` trains in it with any algorithm, worker processes, hindsight and evaluations. Words beyond
the environment's name are overrides of the config's parts for training: algo, policy, collector, eval, seed, ... A run
that was stopped goes on where the same command is given again.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import Binary, Bounded, Categorical, Composite, TensorSpec, Unbounded

from core.overrides import compose
from core.program import program
from envs.episode_replay import EpisodeReplayEnv
from train import choose_compilation
from trainers.config import read_training
from trainers.run.progress import Progress
from trainers.run.train_loop import fit

Array = NDArray[np.float64]
Bounds = dict[str, tuple[Array, Array]]  # by the key of an observation, the least and greatest value of each number
GOALS = ("achieved_goal", "desired_goal")
MEASURED_EPISODES = 40  # whose first observations, and so goals, the bounds of observations contain
MOVED_EPISODES = 10  # those of them in which random actions move the arm
LEAST_RANGE = 0.3  # of a number, where random actions hardly change it
MARGIN = 0.5  # by which these bounds are widened, in shares of their range


class GoalWorlds(EpisodeReplayEnv):
    """N copies of a Gymnasium environment with goals, batch_size (N,), as `trainers.environment.TrainingEnv`.

    "robot" (N, D) is the environment's observation with its achieved goal; the only row of "objects" (N, 1, G) is the
    desired goal, filled up with zeros to three numbers. There is one word, which says nothing. Success is the info's
    `is_success`.

    Args:
        name: id of the environment.
        bounds: of its observations, as of `measure_bounds`.
        num_worlds: N.
        seed: of the worlds.
    """

    batch_locked = True
    reward_names, kind_names, moves_referent = ("reward",), ("none",), False
    tokenizer = argparse.Namespace(vocabulary=("",))

    def __init__(self, name: str, bounds: Bounds, num_worlds: int = 1, seed: int = 0) -> None:
        super().__init__(batch_size=[num_worlds])
        self.is_closed = False  # TorchRL's collectors close an env only if it has this attribute
        self._envs = [make(name) for _ in range(num_worlds)]
        self.action_unit = (1.0,) * self._envs[0].action_space.shape[0]
        self._make_specs(bounds)
        self._seen: list[dict[str, Array]] = [{} for _ in range(num_worlds)]
        self._set_seed(seed)

    def _make_specs(self, bounds: Bounds) -> None:
        n, actions = self.batch_size[0], len(self.action_unit)

        def bounded(name: str) -> TensorSpec:
            low, high = (torch.tensor(bound, dtype=torch.float32) for bound in bounds[name])
            return Bounded(low.expand(n, *low.shape), high.expand(n, *high.shape), dtype=torch.float32)

        flag = Binary(1, shape=(n, 1), dtype=torch.bool)
        number = Categorical(1, shape=(n,), dtype=torch.int64)
        privileged = {"referent": number, "kind": number.clone(), "goal": bounded("goal")}
        self.observation_spec = Composite(
            robot=bounded("robot"),
            objects=bounded("objects"),
            objects_mask=flag.clone(),
            instruction=Categorical(1, shape=(n, 1), dtype=torch.int64),
            hold=Unbounded((n, actions), dtype=torch.float32),
            reward_terms=Unbounded((n, 1), dtype=torch.float32),
            privileged=Composite(privileged, shape=(n,)),
            **{key: flag.clone() for key in ("success", "wrong_object", "wrong_target", "at_goal")},
            shape=(n,),
        )
        self.action_spec = Bounded(-1, 1, shape=(n, actions), dtype=torch.float32)
        self.reward_spec = Unbounded(shape=(n, 1), dtype=torch.float32)
        ends = {name: flag.clone() for name in ("terminated", "truncated", "done")}
        self.full_done_spec = Composite(ends, shape=(n,))

    def _begin_episodes(self, worlds: NDArray[np.int64]) -> TensorDictBase:
        for i in worlds.tolist():
            self._seen[i], _ = self._envs[i].reset(seed=int(self._generators[i].integers(2**31)))
        none = torch.zeros(self.batch_size[0], 1, dtype=torch.bool)
        first = outcome(none.float(), none, none, none)
        del first["reward"]  # which only a step has
        return TensorDict(observe(self._seen, len(self.action_unit)) | first, self.batch_size)

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        self._remember(tensordict["action"])
        actions = tensordict["action"].clamp(-1, 1).numpy()
        results = [env.step(action) for env, action in zip(self._envs, actions, strict=True)]
        self._seen = [seen for seen, *_ in results]
        reward = torch.tensor([[each] for _, each, *_ in results], dtype=torch.float32)
        terminated, truncated = (torch.tensor([[bool(each[k])] for each in results]) for k in (2, 3))
        success = torch.tensor([[bool(info["is_success"])] for *_, info in results])
        return TensorDict(
            observe(self._seen, len(self.action_unit)) | outcome(reward, success, terminated, truncated),
            self.batch_size,
        )

    def hindsight(self, episodes: Sequence[TensorDictBase], seed: int) -> list[TensorDictBase]:
        """Return episodes (T,) with a goal that they achieved later, cut where it is achieved.

        Those that had achieved it as they began are left out.
        """
        rng = np.random.default_rng(seed)
        return [each for frames in episodes if (each := self._relabel(frames, rng)) is not None]

    def _relabel(self, frames: TensorDictBase, rng: np.random.Generator) -> TensorDictBase | None:
        width = frames["privileged", "goal"].shape[-1]
        achieved = torch.cat((frames["robot"][:1], frames["next", "robot"]))[:, -width:].double().numpy()
        goal = np.broadcast_to(achieved[rng.integers(1, len(achieved))], achieved.shape)
        world = self._envs[0].unwrapped
        reached = is_success(world, achieved, goal)
        if reached[0]:
            return None
        count = int(reached.argmax()) if reached.any() else len(frames)
        rewards = np.asarray(world.compute_reward(achieved[1:], goal[1:], {}))[:count]
        ended = torch.arange(count)[:, None] == count - 1
        relabelled = frames[:count].clone()
        objects, places = (torch.tensor(rows(goal)[0], dtype=torch.float32), torch.tensor(goal[0], dtype=torch.float32))
        for end in (relabelled, relabelled["next"]):
            end["objects"] = objects.expand(count, *objects.shape)
            end["privileged", "goal"] = places.expand(count, -1)
        after = outcome(torch.tensor(rewards, dtype=torch.float32)[:, None], ended, ended, torch.zeros_like(ended))
        relabelled["next"].update(after)
        return relabelled

    def draw_scenes(self, count: int, seed: int) -> TensorDictBase:
        """Raises NotImplementedError: there are no words to learn from scenes."""
        raise NotImplementedError("a Gymnasium environment has no scenes with words")

    def is_reachable(self, place: Tensor) -> bool:
        """Return True: the environment draws reachable goals."""
        return True

    def close(self, *, raise_if_closed: bool = True) -> None:
        for env in self._envs:
            env.close()
        self.is_closed, self._envs = True, []


def make(name: str) -> Any:
    """Return the Gymnasium environment. Raises SystemExit for one that is not known, or has no goals."""
    if name.startswith("Panda"):
        if find_spec("panda_gym") is None:
            raise SystemExit(f"{name} is an environment of panda-gym, which is not installed: pip install panda-gym")
        import panda_gym  # noqa: F401  registers its environments
    import envs  # noqa: F401  registers ours

    try:
        with silenced():
            env = gymnasium.make(name, **({"goal": True} if name.startswith("Deixis/") else {}))
    except gymnasium.error.Error as error:
        raise SystemExit(f"{name} is not known to Gymnasium: {error}") from None
    spaces = getattr(env.observation_space, "spaces", {})
    if not {"observation", *GOALS} <= set(spaces):
        raise SystemExit(f"{name} has no observations with achieved_goal and desired_goal")
    return env


@contextmanager
def silenced() -> Iterator[None]:
    """Write nothing to standard output meanwhile: PyBullet prints the options by which panda-gym connects."""
    sys.stdout.flush()
    kept = os.dup(1)
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def measure_bounds(name: str) -> Bounds:
    """Return the least and greatest value of each number of observations, from random actions, widened.

    The environment's own bounds are no use for normalising: panda-gym's are -10 and 10 for all.
    """
    env, rng, seen = make(name), np.random.default_rng(0), []
    for episode in range(MEASURED_EPISODES):
        seen.append(env.reset(seed=episode)[0])
        ended = episode >= MOVED_EPISODES
        while not ended:
            action = rng.uniform(-1, 1, env.action_space.shape).astype(np.float32)
            observation, _, terminated, truncated, _ = env.step(action)
            seen.append(observation)
            ended = terminated or truncated
    env.close()
    values = {key: value.double().numpy() for key, value in numbers(seen).items()}
    return {key: _widened(value.min(0), value.max(0)) for key, value in values.items()}


def _widened(low: Array, high: Array) -> tuple[Array, Array]:
    middle, half = (low + high) / 2, np.maximum(high - low, LEAST_RANGE) * (0.5 + MARGIN)
    return middle - half, middle + half


def is_success(world: Any, achieved: Array, goal: Array) -> NDArray[np.bool_]:
    """Return where (T,) a goal is achieved, by panda-gym's test, or else where the reward of a step is not negative."""
    if hasattr(world, "task") and hasattr(world.task, "is_success"):
        return np.asarray(world.task.is_success(achieved, goal), bool)
    return np.asarray(world.compute_reward(achieved, goal, {})) >= 0


def rows(goals: Array) -> Array:
    """Return the rows (N, 1, G) of goals (N, g), of three numbers at least."""
    return np.pad(goals, ((0, 0), (0, max(0, 3 - goals.shape[1]))))[:, None]


def numbers(seen: Sequence[dict[str, Array]]) -> dict[str, Tensor]:
    """Return the numbers of the observations of N worlds."""
    state, achieved, goal = (np.stack([each[key] for each in seen]) for key in ("observation", *GOALS))
    values = {"robot": np.concatenate((state, achieved), 1), "objects": rows(goal), "goal": goal}
    return {key: torch.from_numpy(value.astype(np.float32)) for key, value in values.items()}


def observe(seen: Sequence[dict[str, Array]], actions: int) -> dict[str, Any]:
    """Return the observations of N worlds that do not tell an outcome. actions: numbers of an action."""
    n, values = len(seen), numbers(seen)
    number = torch.zeros(n, dtype=torch.int64)
    privileged = TensorDict({"referent": number, "kind": number.clone(), "goal": values.pop("goal")}, [n])
    words = {
        "hold": torch.zeros(n, actions),
        "objects_mask": torch.ones(n, 1, dtype=torch.bool),
        "instruction": number[:, None].clone(),
    }
    return values | words | {"privileged": privileged}


def outcome(reward: Tensor, success: Tensor, terminated: Tensor, truncated: Tensor) -> dict[str, Tensor]:
    """Return the entries of a step that tell its outcome, (N, 1) each."""
    missed = torch.zeros_like(success)
    ends = {"terminated": terminated, "truncated": truncated & ~terminated, "done": terminated | truncated}
    flags = {"success": success, "at_goal": success.clone(), "wrong_object": missed, "wrong_target": missed.clone()}
    return {"reward": reward, "reward_terms": reward.clone()} | flags | ends


def main(words: list[str] | None = None) -> dict[str, Any]:
    """Train, print the result, and return the values of eval.json."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("env", help="id of a Gymnasium environment with goals, such as PandaReach-v3")
    parser.add_argument("overrides", nargs="*", help="overrides of the config's parts for training")
    parser.add_argument("--folder", type=Path, default=Path("outputs/goal_env"))
    args = parser.parse_intermixed_args(words)
    config = compose(["task=reach", "policy=mlp", "eval.video_episodes=0", *args.overrides])
    training = choose_compilation(config, read_training(config))
    last = args.folder / "checkpoints" / "last.pt"
    with Progress(training.run.total_frames) as progress:
        result = fit(
            training,
            make_env=partial(GoalWorlds, args.env, measure_bounds(args.env)),
            folder=args.folder,
            config={},
            vocabulary=[""],
            resume=last if last.exists() else None,
            progress=progress,
        )
    print(json.dumps({key: result[key] for key in ("success_rate", "success_at_end") if key in result}))
    return result


if __name__ == "__main__":
    with program():
        main()
