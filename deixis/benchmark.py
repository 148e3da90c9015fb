"""Deixis-14: a fixed protocol for policies of any origin. docs/benchmark.md is its card.

import deixis
report = deixis.evaluate(policy, suite="deixis-14", parts=["gestures"])
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from importlib.metadata import version
from platform import python_version
from typing import Any

import numpy as np
import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase

from core.errors import ConfigError, UseError, did_you_mean
from core.overrides import compose
from envs.config import read_env
from envs.gym_interface import GymInterface
from envs.mdp.object_rows import COLOR
from envs.workspace_env import WorkspaceEnv
from language import LanguageError
from trainers.collect.worker import derive_seed
from trainers.evaluation.chains import run_chains, summarize_chains
from trainers.evaluation.evaluation import Z95, run_episodes, summarize
from trainers.evaluation.instruction_ablations import AblatedInstructions

VERSION = 1  # of the protocol: figures of different versions do not compare
FIRST_INDEX = 2**24  # of `derive_seed`: no training, evaluation of a run or evaluate.py uses these
SEEDS = (0, 1, 2)
EPISODES = 2000  # of a row, over all seeds
CHAIN = 5  # instructions
HUE = 0.1  # by how much the colours of the audit differ from those of training
VERBS = (
    *("pick_and_place", "stack", "unstack", "put_in", "take_out", "open", "close"),
    *("grasp", "lift", "reach", "hand_over", "press", "switch", "turn"),
)
SPLITS = ("train", "test_composition", "test_paraphrase", "test_length")
CEILINGS = {0: 1.0, 2: 1.0, 5: 0.998, 10: 0.949}  # by degrees; docs/benchmark.md has the command


@dataclass(frozen=True)
class BenchmarkRow:
    """One row of the protocol.

    part: what kind of row it is; one policy serves all rows of a part. ceiling: success of an observer that knows the
    person and the noise, where words and finger leave doubt.
    """

    part: str
    name: str
    overrides: tuple[str, ...]
    ceiling: float | None = None
    ablation: str = "said"


ROWS = (
    *(BenchmarkRow("verbs", verb, ("task=anything", f"task.verbs=[{verb}]")) for verb in VERBS),
    BenchmarkRow("chains", f"{CHAIN} instructions", ("task=anything",)),
    *(BenchmarkRow("words", split, ("task=nl_reach_large", f"task.split={split}")) for split in SPLITS),
    *(
        BenchmarkRow("gestures", f"{noise} degrees", ("task=nl_reach_gesture", f"gesture.noise_deg={noise}"), ceiling)
        for noise, ceiling in CEILINGS.items()
    ),
)
SUITES = {"deixis-14": ROWS}
PARTS = tuple(dict.fromkeys(row.part for row in ROWS))
AUDITS: dict[str, tuple[str, tuple[str, ...]]] = {  # name: what is done to the observation, and overrides
    "no words": ("blank", ()),
    "words of another episode": ("swapped", ()),
    "no scene": ("unseen", ()),
    "start poses, 0.3 rad": ("said", ("task.reset_noise=0.3",)),
    "objects 0.8 x": ("said", ("task.object_size={small}",)),
    "objects 1.2 x": ("said", ("task.object_size={large}",)),
    "other shades": ("shaded", ()),
}
AUDITED = {"verbs": ("task=anything",), "words": ("task=nl_reach_large",), "gestures": ("task=nl_reach_gesture",)}


def evaluate(
    policy: Any,
    suite: str = "deixis-14",
    *,
    parts: Sequence[str] = PARTS,
    robot: str = "kuka",
    instruction: str = "tokens",
    episodes: int = EPISODES,
    seeds: Sequence[int] = SEEDS,
    worlds: int = 20,
    audits: bool = False,
    overrides: Sequence[str] = (),
) -> dict[str, Any]:
    """Evaluate a policy by a fixed protocol, and return plain values for JSON.

    Args:
        policy: maps observations to actions. Either a module of TensorDicts, such as `deixis.load_policy(...)`, or any
            callable: it gets the Dict of `gymnasium.make_vec`, arrays (N, ...) by name, and returns (N, A) in [-1, 1].
            If it has a method `reset`, that is called before each row. A Mapping has a policy for each of `parts`.
        suite: of `SUITES`.
        parts: the kinds of rows, of `PARTS`.
        robot: an option of that config group.
        instruction: how a callable gets the words: "tokens", "embedding" or "text".
        episodes: of a row, shared out over the seeds.
        seeds: of the rows; each row derives its own, which no training uses.
        worlds: that step together.
        audits: also measure success without words, with other words, without the scene, and in changed conditions.
        overrides: of every environment, such as "control=joints".

    Raises:
        ConfigError: for an unknown name, or numbers that do not fit.
        UseError: for actions of another form.
    """
    rows, results = _chosen(suite, parts, audits), []
    if not 1 <= len(seeds) <= episodes:
        raise ConfigError(f"episodes={episodes} must be at least one for each of seeds={list(seeds)}")
    if worlds < 2:
        raise ConfigError(f"worlds={worlds} must be at least 2")
    if isinstance(policy, str):
        raise ConfigError(f"policy={policy!r} is a name: give deixis.load_policy({policy!r})")
    for row in rows:
        actor = policy.get(row.part) if isinstance(policy, Mapping) else policy
        if actor is None:
            raise ConfigError(f"policy has none for the part {row.part!r}; leave it out of parts={list(parts)}")
        shares, common = _shares(episodes, seeds, worlds), [f"robot={robot}", *overrides]
        results.append(_measure(row, actor, common, instruction=instruction, shares=shares))
    libraries = {name: version(name) for name in ("deixis", "torch", "torchrl", "pybullet", "numpy")}
    told = {"suite": suite, "version": VERSION, "robot": robot, "seeds": list(seeds)}
    return told | {"versions": {"python": python_version(), **libraries}, "rows": results}


def _chosen(suite: str, parts: Sequence[str], audits: bool) -> list[BenchmarkRow]:
    """Return the rows that are asked for. Raises ConfigError for an unknown suite or part."""
    if suite not in SUITES:
        raise ConfigError(f"suite={suite!r} is unknown" + did_you_mean(suite, SUITES))
    for part in parts:
        if part not in PARTS:
            raise ConfigError(f"parts={list(parts)} has {part!r}" + did_you_mean(part, PARTS))
    if not parts:
        raise ConfigError(f"parts=[] has no part: give some of {list(PARTS)}")
    rows = [row for row in SUITES[suite] if row.part in parts]
    return rows + [row for part in parts for row in audit_rows(part)] * audits


def audit_rows(part: str) -> list[BenchmarkRow]:
    """Return the rows of the audits of a part; chains have those of the verbs."""
    if part not in AUDITED:
        return []
    size = compose(list(AUDITED[part]))["task"]["object_size"]
    sizes = {"small": f"{0.8 * size:g}", "large": f"{1.2 * size:g}"}
    return [
        BenchmarkRow(part, name, (*AUDITED[part], *(word.format(**sizes) for word in words)), ablation=ablation)
        for name, (ablation, words) in AUDITS.items()
    ]


def least_difference(success: float, episodes: int) -> float:
    """Return how far two success rates over this many episodes each must be apart to differ at 95 %.

    success: about where they are. Two policies on the same seeds differ by less than that only if paired.
    """
    return Z95 * math.sqrt(2 * max(success * (1 - success), 1 / episodes) / episodes)


def row_seed(row: BenchmarkRow, seed: int) -> int:
    """Return the seed of a row's episodes. Rows that differ in what is done to observations have the same episodes."""
    return derive_seed(seed, FIRST_INDEX + PARTS.index(row.part), evaluation=True)


def _shares(episodes: int, seeds: Sequence[int], worlds: int) -> list[tuple[int, int, int]]:
    """Return seed, episodes and worlds of each share of a row."""
    counts = [episodes // len(seeds) + (i < episodes % len(seeds)) for i in range(len(seeds))]
    return [(seed, count, max(2, min(worlds, count))) for seed, count in zip(seeds, counts, strict=True)]


def _measure(
    row: BenchmarkRow,
    policy: Any,
    common: Sequence[str],
    *,
    instruction: str,
    shares: Sequence[tuple[int, int, int]],
) -> dict[str, Any]:
    """Return success of a row, with its interval and the least difference that is significant."""
    config = read_env(compose([*row.overrides, *common])).without_curriculum()
    chains = row.part == "chains"
    config = config.with_instructions(CHAIN) if chains else config
    found: list[Any] = []
    for seed, count, worlds in shares:
        with closing(WorkspaceEnv(config, worlds, row_seed(row, seed))) as env:
            actor = _Actor.of(policy, env, instruction)
            actor = actor if row.ablation == "said" else _ablated(actor, row.ablation)
            run: Callable[..., list[Any]] = run_chains if chains else run_episodes
            found += run(env, actor, count, row_seed(row, seed))
            names = env.kind_names
    told: dict[str, Any] = {"part": row.part, "name": row.name}
    if chains:
        return told | summarize_chains(found, CHAIN, names)
    result = summarize(found, names)
    told |= {"episodes": result.episodes, "success": result.success_at_end, "ci95": list(result.ci95)}
    told |= {"least_difference": round(least_difference(result.success_at_end, result.episodes), 4)}
    return told if row.ceiling is None else told | {"bayes_optimal": row.ceiling}


# ---- policies


class _Actor(TensorDictModuleBase):
    """A callable of Gymnasium's observations as a module of TensorDicts."""

    def __init__(self, policy: Callable[[dict[str, Any]], Any], env: WorkspaceEnv, instruction: str) -> None:
        super().__init__()
        self._policy, self._env, self._text = policy, env, instruction == "text"
        self._interface = GymInterface(env, instruction)
        self.in_keys, self.out_keys = list(env.observation_spec.keys()), ["action"]

    @classmethod
    def of(cls, policy: Any, env: WorkspaceEnv, instruction: str) -> TensorDictModuleBase:
        """Return the policy itself if it is a module of TensorDicts. Raises UseError if it cannot be called."""
        if callable(getattr(policy, "reset", None)):
            policy.reset()
        if isinstance(policy, TensorDictModuleBase):
            return policy
        if not callable(policy):
            raise UseError(f"policy={policy!r} must be callable: observations (N, ...) to actions (N, A)")
        return cls(policy, env, instruction)

    def forward(self, frames: TensorDictBase) -> TensorDictBase:
        """Write `action` (N, A)."""
        observed = self._interface.observations(frames)
        if self._text:
            observed["instruction"] = tuple(map(self._said, observed["instruction"], frames["instruction"].numpy()))
        given = np.asarray(self._policy(observed), np.float32)
        return frames.set("action", self._interface.action(given, len(frames))["action"])

    def _said(self, sentence: str, tokens: np.ndarray) -> str:
        """Return the sentence, or the words of other tokens that an ablation put in its place."""
        try:
            same = np.array_equal(self._env.tokenizer.encode(sentence), tokens)
        except LanguageError:
            same = False
        return sentence if same else self._env.tokenizer.decode(tokens)


class _Changed(TensorDictModuleBase):
    """A policy that sees no objects, or all of them in other shades."""

    def __init__(self, policy: TensorDictModuleBase, ablation: str) -> None:
        super().__init__()
        self.policy, self._unseen = policy, ablation == "unseen"
        self.in_keys, self.out_keys = policy.in_keys, policy.out_keys

    def forward(self, frames: TensorDictBase) -> TensorDictBase:
        """Write `action` (N, A)."""
        changed = frames.copy()
        rows = frames["objects"].clone()
        if self._unseen:
            shown = frames["objects_mask"].clone()
            shown[:, 1:] = False  # one slot, without attributes, since attention needs one
            changed["objects"], changed["objects_mask"] = torch.zeros_like(rows), shown
        else:
            shade = torch.tensor([HUE, -HUE, HUE])
            rows[..., COLOR] = torch.where(frames["objects_mask"][..., None], rows[..., COLOR] + shade, 0).clamp(0, 1)
            changed["objects"] = rows
        return self.policy(changed)


def _ablated(policy: TensorDictModuleBase, ablation: str) -> TensorDictModuleBase:
    if ablation in ("blank", "swapped"):
        return AblatedInstructions(policy, ablation)
    return _Changed(policy, ablation)
