"""A policy as one function of plain tensors, in files of other libraries: ONNX and TorchScript."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import torch
from tensordict import NestedKey, TensorDictBase
from torch import Tensor, nn

from core.errors import ConfigError
from core.system import import_optional
from trainers.models.grounding import NEAR, SCENE_KEYS, GroundingEncoder
from trainers.models.policy import Policy
from trainers.models.sentence_encoder import SentenceWords

MOST_ROWS, MOST_SLOTS = 2**16, 2**8  # of the sizes that an ONNX file leaves open


class Frames(dict[NestedKey, Tensor]):
    """The entries of a batch of observations, with the two methods of a TensorDict that policies call."""

    def set(self, key: NestedKey, value: Tensor) -> Frames:
        """Write an entry."""
        self[key] = value
        return self


class ExportedPolicy(nn.Module):
    """The mean action of a policy, as `PolicyAct` computes it, without TensorDicts.

    keys: of the observations that `forward` takes, in its order.

    Raises:
        ConfigError: the policy reads words through a network that is not part of it.
    """

    def __init__(self, policy: Policy) -> None:
        super().__init__()
        if any(isinstance(module, SentenceWords) for module in policy.modules()):
            raise ConfigError(
                "policy.encoder=sentence cannot be exported: its words go through MiniLM, which is no part of the "
                "policy; train with policy.encoder=tokens"
            )
        self.policy = policy
        self.keys = tuple(policy.act.in_keys)

    def forward(self, *observations: Tensor) -> Tensor:
        """Return the action (N, A), in [-1, 1], for observations (N, ...)."""
        frames = Frames(zip(self.keys, observations, strict=True))
        encoder = self.policy.encoder
        words = encoder.encode_all_words(frames["instruction"])
        values = encoder.attend(words, *(frames[key] for key in encoder.scene_keys))
        frames.update(zip(encoder.out_keys, values, strict=True))
        encoder.select_likeliest(frames)  # type: ignore[arg-type]
        loc, _ = self.policy.move_parameters(frames)  # type: ignore[arg-type]
        move = self.policy.sample_move(loc, torch.zeros_like(loc), torch.zeros_like(loc))
        return (frames["hold"] + self.policy.action_unit * move).clamp(-1.0, 1.0)

    def inputs(self, frames: TensorDictBase) -> tuple[Tensor, ...]:
        """Return what `forward` takes of observations (N,)."""
        return tuple(frames[key] for key in self.keys)


def write_onnx(policy: ExportedPolicy, frames: TensorDictBase, path: Path) -> None:
    """Write an ONNX file that takes any number of rows and, for a policy with attention, of object slots.

    Args:
        policy: to export.
        frames: (N,) observations to trace it with, N > 1.
        path: of the file.

    Raises:
        ConfigError: a library is missing, or the policy has a part that ONNX cannot express.
    """
    import_optional("onnx", "onnxscript", extra="export", what="ONNX files")
    rows = torch.export.Dim("rows", min=1, max=MOST_ROWS)
    slots = torch.export.Dim("slots", min=1, max=MOST_SLOTS)
    by_slot = (*SCENE_KEYS, NEAR) if isinstance(policy.policy.encoder, GroundingEncoder) else ()
    inputs = policy.inputs(frames)
    shapes = tuple(
        {0: rows, 1: slots} if key in by_slot and value.shape[1] > 1 else {0: rows}
        for key, value in zip(policy.keys, inputs, strict=True)
    )
    with _quiet(), _as_config_error("onnx"):
        program = torch.onnx.export(
            policy,
            inputs,
            input_names=names(policy.keys),
            output_names=["action"],
            dynamic_shapes=(shapes,),
            dynamo=True,
            verbose=False,
        )
        assert program is not None
        program.save(path, external_data=False)


def write_torchscript(policy: ExportedPolicy, frames: TensorDictBase, path: Path) -> None:
    """Write a TorchScript file that takes any number of rows. Its arguments have the order of `ExportedPolicy.keys`.

    Args:
        policy: to export.
        frames: (N,) observations to trace it with.
        path: of the file.

    Raises:
        ConfigError: the policy has a part that cannot be traced.
    """
    with _quiet(), _as_config_error("torchscript"):
        torch.jit.trace(policy, policy.inputs(frames), check_trace=False).save(str(path))


def names(keys: Sequence[NestedKey]) -> list[str]:
    """Return the names of these inputs in files: the parts of a nested key, joined by dots."""
    return [key if isinstance(key, str) else ".".join(map(str, key)) for key in keys]


@contextmanager
def _quiet() -> Iterator[None]:
    """Hide what torch says while it exports: that TorchScript is old, and which libraries it does not find."""
    logger = logging.getLogger("torch.onnx")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)


@contextmanager
def _as_config_error(form: str) -> Iterator[None]:
    """Turn the error of an exporter, of which there are many kinds, into a ConfigError; an own policy may cause it."""
    try:
        yield
    except OSError:
        raise
    except Exception as error:
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0][:200]
        raise ConfigError(f"format={form}: torch cannot express this policy: {reason}") from error
