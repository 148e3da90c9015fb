"""A check of environments: `check_env(make)` lists every rule that an environment breaks.

TorchRL's `check_env_specs` compares keys, shapes and types. This check also finds faults that silently spoil training:
randomness that the seed does not fix, worlds that disturb each other, observations that change afterwards, rewards and
episode ends that contradict each other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from typing import Any

import torch
from tensordict import TensorDictBase
from torchrl.envs import EnvBase

MakeEnv = Callable[[int, int], EnvBase]  # (worlds, seed)
WORLDS, SEED, SHORT = 3, 11, 12  # SHORT: steps of the rollouts that are compared
FLAGS = ("success", "wrong_object", "wrong_target", "at_goal")
ENDS = ("done", "terminated", "truncated")
MOVED = 1e-6  # the least change of an observation that counts


class EnvError(AssertionError):
    """An environment that breaks a rule. The text has one line for each broken rule."""


def check_env(make: MakeEnv, max_steps: int = 400) -> None:
    """Check an environment.

    Args:
        make: `make(worlds, seed)` builds it, such as `lambda worlds, seed: make_env(["task=mine"], worlds, seed)`.
        max_steps: control steps within which every episode must end.

    Raises:
        EnvError: it breaks rules; the text lists all that were found.
    """
    with closing(make(WORLDS, SEED)) as env, closing(make(1, SEED)) as alone:
        problems = list(dict.fromkeys([*_check_all(env, alone, max_steps)]))
    if problems:
        raise EnvError("\n".join(problems))


def _check_all(env: EnvBase, alone: EnvBase, max_steps: int) -> Iterator[str]:
    actions = _actions(env, SHORT)
    first = list(_rollout(env, actions))
    for frame in first:
        yield from _check_frame(env, frame)
    if problems := [*_check_keys(env, first[0], "reset"), *_check_keys(env, first[1], "step")]:
        yield from problems
        return  # comparisons of keys that are missing would say nothing
    yield from _check_start(first[0])
    yield from _check_seeds(env, alone, actions, first)
    yield from _check_actions(env, actions)
    yield from _check_buffers(env, actions)
    yield from _check_partial_reset(env, actions)
    yield from _check_ends(env, max_steps)


def _check_frame(env: EnvBase, frame: TensorDictBase) -> Iterator[str]:
    """Yield what is wrong in a frame: values beyond their specs, and inconsistent ends, rewards and words."""
    for key, value in _leaves(frame):
        if value.is_floating_point() and not value.isfinite().all():
            yield f"{key}: not all numbers are finite"
    for key, spec in env.observation_spec.items(True, True):
        value = frame.get(key, None)
        if value is not None and value.shape == spec.shape and value.dtype == spec.dtype and not spec.is_in(value):
            yield f"{_name(key)}: values lie outside of its spec"
    if all(name in frame.keys() for name in ENDS):
        if (frame["terminated"] & frame["truncated"]).any():
            yield "terminated and truncated are both true"
        if not torch.equal(frame["done"], frame["terminated"] | frame["truncated"]):
            yield "done is not terminated or truncated"
        if "success" in frame.keys() and (frame["success"] & ~frame["terminated"]).any():
            yield "success does not terminate the episode"
    success, wrong = frame.get("success", None), frame.get("wrong_object", None)
    if success is not None and wrong is not None and (success & wrong).any():
        yield "success and wrong_object are both true"
    reward, terms = frame.get("reward", None), frame.get("reward_terms", None)
    if reward is not None and terms is not None and not torch.allclose(reward, terms.sum(-1, keepdim=True), atol=1e-4):
        yield "reward is not the sum of reward_terms"
    yield from _check_scene(env, frame)


def _is_reworded(env: EnvBase) -> bool:
    """Return whether a policy reads other words than a person says."""
    task = getattr(env, "task", None)
    return task is not None and (task.config.rephrased or task.traits.stepwise)


def _check_scene(env: EnvBase, frame: TensorDictBase) -> Iterator[str]:
    if "objects_mask" not in frame.keys():
        return
    mask, referent = frame["objects_mask"], frame.get(("privileged", "referent"), None)
    if (frame["objects"][~mask] != 0).any():
        yield "objects: the row of a slot that shows nothing is not 0"
    if referent is not None and not mask.gather(1, referent.reshape(-1, 1)).all():
        yield "privileged/referent: the slot of the referent shows nothing"
    sentence = frame.get(("privileged", "sentence"), None)
    if sentence is not None and hasattr(env, "tokenizer") and not _is_reworded(env):
        for row, tokens in zip(sentence, frame["instruction"], strict=True):
            text = bytes(row.tolist()).rstrip(b"\0").decode("utf-8", errors="replace")
            if env.tokenizer.encode(text).tolist() != tokens.tolist():
                yield "instruction: the tokens are not those of privileged/sentence"


def _check_keys(env: EnvBase, frame: TensorDictBase, when: str) -> Iterator[str]:
    """Return the keys, shapes and types that the specs declare."""
    specs = {_name(key): spec for key, spec in env.observation_spec.items(True, True)}
    specs |= {_name(key): spec for key, spec in env.full_done_spec.items(True, True)}
    if when == "step":
        specs["reward"] = env.reward_spec
    found = dict(_leaves(frame))
    for key, spec in specs.items():
        if key not in found:
            yield f"{key}: missing after {when}"
        elif found[key].shape != spec.shape or found[key].dtype != spec.dtype:
            value = found[key]
            yield f"{key}: {value.dtype} {list(value.shape)} after {when}; declared {spec.dtype} {list(spec.shape)}"


def _check_start(frame: TensorDictBase) -> Iterator[str]:
    for name in (*ENDS, *FLAGS):
        if name in frame.keys() and frame[name].any():
            yield f"{name}: true after a reset, before any action"
    names = [key for key, value in _leaves(frame) if len(value) > 1 and not torch.equal(value[0], value[1])]
    if not names:
        yield "all worlds begin with the same episode"


def _check_seeds(env: EnvBase, alone: EnvBase, actions: torch.Tensor, first: list[TensorDictBase]) -> Iterator[str]:
    """Yield where a seed gives other bits after other episodes or with other worlds, or two seeds the same."""
    again = list(_rollout(env, actions))
    yield from _compare(first, again, "the same seed and actions give other values the second time")
    single = list(_rollout(alone, actions[:, :1]))
    world = [frame[:1] for frame in first]
    yield from _compare(world, single, "world 0 depends on the number of worlds")
    other = next(_rollout(env, actions, SEED + 1))
    if not _differences(first[0], other):
        yield "another seed begins with the same episodes"


def _check_actions(env: EnvBase, actions: torch.Tensor) -> Iterator[str]:
    ends = [list(_rollout(env, each))[1:] for each in (actions, -actions, 3 * actions, (3 * actions).clamp(-1, 1))]
    if not torch.equal(actions, _actions(env, SHORT)):
        yield "action: changed by a step"
    if not any(_differences(one, other) for one, other in zip(ends[0], ends[1], strict=True)):
        yield "action: has no effect"
    yield from _compare(ends[2], ends[3], "action: numbers beyond [-1, 1] are not clipped")
    state = env.reset()
    try:
        env.step(state.set("action", torch.full_like(actions[0], float("nan"))))
    except ValueError:
        pass
    else:
        yield "action: NaN is accepted; raise ValueError"


def _check_buffers(env: EnvBase, actions: torch.Tensor) -> Iterator[str]:
    """Yield the keys of frames that change after they were returned."""
    env.set_seed(SEED)
    kept = [env.reset()]
    copies = [kept[0].clone()]
    for action in actions[:4]:
        kept.append(_step(env, kept[-1], action))
        copies.append(kept[-1].clone())
    env.reset()
    for frame, copy in zip(kept, copies, strict=True):
        for key in _differences(frame.select(*copy.keys()), copy):
            yield f"{key}: a returned value changes with later steps; return a copy"


def _check_partial_reset(env: EnvBase, actions: torch.Tensor) -> Iterator[str]:
    """A reset of world 1 leaves the others as they are, and begins another episode there."""
    env.set_seed(SEED)
    before = env.reset()
    for action in actions[:3]:
        before = _step(env, before, action)
    mask = torch.zeros(*env.batch_size, 1, dtype=torch.bool)
    mask[1] = True
    after = env.reset(before.clone().set("_reset", mask))
    names = [name for name in ("robot", "objects", "instruction", "hold") if name in after.keys()]
    for name in names:
        if not torch.equal(before[name][[0, 2]], after[name][[0, 2]]):
            yield f"{name}: a reset of one world changes the others"
    if all(torch.equal(before[name][1], after[name][1]) for name in names):
        yield "_reset: the world that is reset stays as it is"
    for name in (*ENDS, *FLAGS):
        if name in after.keys() and after[name][1].any():
            yield f"{name}: true after a reset, before any action"
    undisturbed = list(_rollout(env, actions[:4]))[-1]
    env.set_seed(SEED)
    state = env.reset()
    for action in actions[:3]:
        state = _step(env, state, action)
    disturbed = _step(env, env.reset(state.clone().set("_reset", mask)), actions[3])
    for name in names:
        if not torch.equal(undisturbed[name][[0, 2]], disturbed[name][[0, 2]]):
            yield f"{name}: a reset of one world changes the others"
    one, other = env.reset().clone(), env.reset()
    if all(torch.equal(one[name], other[name]) for name in names):
        yield "every reset begins the same episode"


def _check_ends(env: EnvBase, max_steps: int) -> Iterator[str]:
    """Episodes end, and later frames meet the conditions on every frame."""
    env.set_seed(SEED)
    state, over = env.reset(), torch.zeros(*env.batch_size, 1, dtype=torch.bool)
    for _ in range(max_steps):
        state = _step(env, state, state["hold"] if "hold" in state.keys() else torch.zeros_like(env.action_spec.zero()))
        yield from _check_frame(env, state)
        over |= state["done"]
        if over.all():
            return
    yield f"done: an episode has not ended after {max_steps} steps"


def _actions(env: EnvBase, steps: int) -> torch.Tensor:
    generator = torch.Generator().manual_seed(SEED)
    return torch.rand(steps, *env.action_spec.shape, generator=generator) * 2 - 1


def _rollout(env: EnvBase, actions: torch.Tensor, seed: int = SEED) -> Iterator[TensorDictBase]:
    """Return the frames after a reset and after each action; ended episodes are not begun again."""
    env.set_seed(seed)
    state = env.reset()
    yield state
    for action in actions:
        state = _step(env, state, action)
        yield state


def _step(env: EnvBase, state: TensorDictBase, action: torch.Tensor) -> TensorDictBase:
    return env.step(state.clone(recurse=False).set("action", action))["next"]


def _compare(one: list[TensorDictBase], other: list[TensorDictBase], problem: str) -> Iterator[str]:
    for step, (left, right) in enumerate(zip(one, other, strict=True)):
        names = _differences(left, right)
        if names:
            yield f"{problem}: {', '.join(names[:3])} at step {step}"
            return


def _differences(one: TensorDictBase, other: TensorDictBase) -> list[str]:
    """Return the names of the values that differ in a bit, or that only one of them has; NaN equals itself."""
    a, b = dict(_leaves(one)), dict(_leaves(other))
    names = [key for key in a if key in b and not _same(a[key], b[key])]
    return [*names, *sorted(set(a) ^ set(b))]


def _same(one: torch.Tensor, other: torch.Tensor) -> bool:
    if one.is_floating_point():
        one, other = one.nan_to_num(7.5), other.nan_to_num(7.5)
    return torch.equal(one, other)


def _leaves(frame: TensorDictBase) -> Iterator[tuple[str, torch.Tensor]]:
    for key, value in frame.items(include_nested=True, leaves_only=True):
        if key not in ("action", "_reset"):
            yield _name(key), value


def _name(key: Any) -> str:
    return key if isinstance(key, str) else "/".join(key)
