"""The episodes of a session, and their export as a dataset: what people asked for, and what the robot did."""

from __future__ import annotations

import io
import tempfile
import zipfile
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tensordict import TensorDictBase
from torch import Tensor

from core.errors import ConfigError
from envs.config import dataset_facts
from envs.interactive.interactive_env import InteractiveEnv
from trainers.datasets.demonstrations import Demonstration, demonstration_of

MOST_STEPS = 6000  # control steps that are kept, about 15 MB; the oldest episodes go first
NOTHING = "there is nothing to export yet: say something, and let the robot finish it"


class SessionEpisodes:
    """The episodes of an environment that have ended, the oldest first. actors: who carried them out."""

    def __init__(self, env: InteractiveEnv) -> None:
        self._env = env
        self._episodes: deque[Demonstration] = deque()
        self.actors: set[str] = set()
        self._states: list[TensorDictBase] = []  # of the running episode; [] while there is none
        self._sentence, self._seed = "", 0

    def __len__(self) -> int:
        return len(self._episodes)

    def begin(self, state: TensorDictBase, sentence: str, seed: int) -> None:
        """Begin an episode with its first state. sentence: what was asked for. seed: of the scene."""
        self._states, self._sentence, self._seed = [state.clone(False)], sentence, seed

    def add(self, action: Tensor, after: TensorDictBase) -> None:
        """Add a control step: the action (1, A), and the state that it led to."""
        if self._states:
            self._states.append(after.clone(False).set("action", action.clamp(-1.0, 1.0)))

    def end(self, success: bool, actor: str) -> None:
        """Keep the running episode, if there is one."""
        if len(self._states) < 2:
            return
        episode = demonstration_of(self._env, self._seed, self._sentence, self._states)
        for name, value in (("success", success), ("terminated", success), ("truncated", not success)):
            episode.outcomes[name][-1] = value  # moves of the scripted expert end without the task's saying so
        self._episodes.append(episode)
        self.actors.add(actor)
        while sum(map(len, self._episodes)) > MOST_STEPS and len(self._episodes) > 1:
            self._episodes.popleft()
        self._states = []

    def drop(self) -> None:
        """Leave out the running episode: it was stopped."""
        self._states = []

    def export(self, kind: str) -> Export:
        """Return what a dataset of a kind, "lerobot" or "minari", is made of. Raises ConfigError for nothing."""
        if not self._episodes:
            raise ConfigError(NOTHING)
        env = self._env.config
        about = {
            **dataset_facts(env, self._env.task.traits.grips),
            "actor": " and ".join(sorted(self.actors)),
            "instruction": f"what people asked for on the page: {env.task.name} with {env.robot.name}",
            "gym": None,  # episodes begin where the one before has ended
        }
        return Export(kind, self._env, about, tuple(self._episodes))


class Export:
    """Episodes that are ready to be written, in another thread as well. name: of the file."""

    def __init__(
        self, kind: str, env: InteractiveEnv, about: dict[str, Any], episodes: Sequence[Demonstration]
    ) -> None:
        self._kind, self._env, self._about, self._episodes = kind, env, about, episodes
        self.name = f"deixis-{env.config.task.name}-{env.config.robot.name}-{kind}-v0.zip"

    def packed(self) -> bytes:
        """Return a zip file with the dataset in a folder. Raises ConfigError if a library is missing."""
        from trainers.datasets.dataset import write  # slow to import

        with tempfile.TemporaryDirectory(prefix="deixis-export-") as parent:
            folder = Path(parent) / self.name.removesuffix(".zip")
            seed, count = self._episodes[0].seed, len(self._episodes)
            write(folder, self._kind, self._env, iter(self._episodes), count, seed, self._about)
            file = io.BytesIO()
            with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
                for path in sorted(folder.rglob("*")):
                    archive.write(path, path.relative_to(parent))
        return file.getvalue()
