"""Training that begins with the policy of another run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from trainers.models.policy import Policy
from trainers.run import checkpoint
from trainers.run.vocabulary import extend_vocabulary


def start_from(path: Path, policy: Policy, vocabulary: Sequence[str], widths: dict[str, list[int]]) -> None:
    """Give a policy the networks of a checkpoint or of a published policy. It keeps its own exploration noise.

    Args:
        path: of the file.
        policy: of the new run.
        vocabulary: of its tokenizer.
        widths: of its environment, from `checkpoint.widths`.

    Raises:
        CheckpointError: the networks are others, or were trained for other observations or actions.
    """
    payload = extend_vocabulary(checkpoint.load(path), vocabulary)
    try:
        checkpoint.check_fits(payload, list(vocabulary), widths)
    except checkpoint.CheckpointError as error:
        raise checkpoint.CheckpointError(f"init={path} cannot be begun with: {error}") from None
    noise = {name: value for name, value in policy.state_dict().items() if name.endswith("log_std")}
    try:
        policy.load_state_dict(payload["algorithm"]["policy"] | noise)
    except RuntimeError as error:
        text = str(error).splitlines()[-1].strip()
        raise checkpoint.CheckpointError(
            f"init={path} has other networks than this run: {text}; take the values of policy that it was trained with"
        ) from None
