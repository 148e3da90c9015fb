"""A trained policy of Deixis as a policy of LeRobot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from lerobot.configs import PreTrainedConfig
from lerobot.policies.pretrained import PreTrainedPolicy
from tensordict import TensorDict
from torch import Tensor

from core.errors import ConfigError, UseError
from deixis import load_policy
from language import Tokenizer
from lerobot_policy_deixis.configuration_deixis import NOT_TRAINED, DeixisConfig
from trainers.export import policy_file
from trainers.run import checkpoint

RENAMED = {"robot": "observation.state", "objects": "observation.environment_state"}  # the others: observation.<key>
WEIGHTS = "model.safetensors"  # LeRobot's name of the file, here a published policy of Deixis


class DeixisPolicy(PreTrainedPolicy):
    """Takes the mean action of a trained policy of Deixis.

    It reads the state of the arm, the rows of the objects and the words: `observation.instruction`, or where an
    environment has none, `task`, the sentence itself.

    Args:
        config: with `checkpoint`, or with `pretrained_path`, a directory that `save_pretrained` wrote.
        dataset_stats, dataset_meta: of a dataset; not used.

    Raises:
        ConfigError: there is no such policy, or it is of another version.
    """

    config_class = DeixisConfig
    name = "deixis"

    def __init__(self, config: DeixisConfig, dataset_stats: Any = None, dataset_meta: Any = None) -> None:
        super().__init__(config)
        if not (config.checkpoint or config.pretrained_path):
            raise ConfigError("policy.checkpoint is missing: a run, a file, or the name of a pretrained policy")
        source = config.checkpoint or Path(config.pretrained_path) / WEIGHTS
        self.acting = load_policy(source)
        env = self.acting.make_env()
        self._tokenizer: Tokenizer = env.tokenizer
        spec = env.observation_spec
        self._forms = {key: (spec[key].dtype, tuple(spec[key].shape[1:])) for key in self.acting.in_keys}
        env.close()

    @classmethod
    def from_pretrained(
        cls,
        pretrained_name_or_path: str | Path,
        *,
        config: PreTrainedConfig | None = None,
        revision: str | None = None,
        **kwargs: Any,
    ) -> DeixisPolicy:
        """Load a directory that `save_pretrained` wrote. Raises ConfigError."""
        folder = Path(pretrained_name_or_path)
        if not (folder / WEIGHTS).is_file():
            raise ConfigError(f"policy.path={folder} has no {WEIGHTS}; write one: python -m lerobot_policy_deixis")
        config = config or PreTrainedConfig.from_pretrained(folder)
        config.checkpoint, config.pretrained_path = None, folder
        return cls(config).eval()

    def _save_pretrained(self, save_directory: Path, state_dict: dict[str, Tensor] | None = None) -> None:
        """Write the config and the policy, which then needs no other file."""
        payload = checkpoint.load(self.acting.path, given=None)
        (save_directory / WEIGHTS).write_bytes(policy_file.pack(payload, checkpoint.FORMAT))
        source, self.config.checkpoint = self.config.checkpoint, None
        try:
            self.config._save_pretrained(save_directory)
        finally:
            self.config.checkpoint = source

    def reset(self) -> None:
        """Nothing: it has no memory."""

    @torch.no_grad()
    def select_action(self, batch: dict[str, Any], noise: Tensor | None = None) -> Tensor:
        """Return the action (B, A), in [-1, 1]. Raises UseError if the environment lacks what the policy reads."""
        worlds = len(batch[RENAMED["robot"]])
        frame = {key: self._value(key, batch, worlds) for key in self._forms}
        return self.acting(TensorDict(frame, [worlds]))["action"]

    def _value(self, key: str, batch: dict[str, Any], worlds: int) -> Tensor:
        """Return an observation in the form in which the policy reads it."""
        dtype, shape = self._forms[key]
        name = RENAMED.get(key, f"observation.{key}")
        if key == "instruction" and name not in batch and "task" in batch:
            return torch.stack([torch.from_numpy(self._tokenizer.encode(words).copy()) for words in batch["task"]])
        if name not in batch:
            raise UseError(f"the policy reads {name}, which the environment does not give: --env.objects=true")
        # The number of objects may be another than in training.
        form = (-1, *shape[1:]) if key.startswith("objects") else shape
        try:
            return batch[name].to(dtype).reshape(worlds, *form)
        except RuntimeError:
            raise UseError(
                f"{name} has {batch[name][0].numel()} numbers, but {self.acting.path} was trained with {list(shape)}: "
                "use the task, robot and control that it was trained with"
            ) from None

    def predict_action_chunk(self, batch: dict[str, Any], noise: Tensor | None = None) -> Tensor:
        """Return the action as a chunk of one (B, 1, A)."""
        return self.select_action(batch)[:, None]

    def forward(self, batch: dict[str, Tensor]) -> tuple[Tensor, dict | None]:
        """Raise ConfigError."""
        raise ConfigError(NOT_TRAINED)

    def get_optim_params(self) -> dict:
        """Raise ConfigError."""
        raise ConfigError(NOT_TRAINED)
