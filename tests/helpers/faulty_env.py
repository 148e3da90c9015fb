"""An environment that fails on request, in a worker process."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

from envs.config import EnvConfig
from envs.workspace_env import WorkspaceEnv


class FaultyEnv(WorkspaceEnv):
    """An environment that fails at its next step as the file `trigger` says, and removes it: one worker fails, once.

    The file is looked for in worker processes alone.
    """

    trigger: Path | None = None

    def _step(self, tensordict: Any) -> Any:
        if self.trigger is not None and self.trigger.exists():
            fault = self.trigger.read_text()
            try:
                self.trigger.rename(self.trigger.with_suffix(".taken"))
            except FileNotFoundError:  # another worker was faster
                return super()._step(tensordict)
            fail(fault)
        return super()._step(tensordict)


def fail(fault: str) -> None:
    """Fail in this way."""
    if fault == "raise":
        raise ArithmeticError("planted")
    if fault == "segfault":
        os.kill(os.getpid(), signal.SIGSEGV)
    while True:
        pass


def make_env(config: EnvConfig, trigger: Path, main: int, worlds: int, seed: int) -> WorkspaceEnv:
    """Return a module-level function, so that worker processes can unpickle it."""
    env = FaultyEnv(config, worlds, seed)
    env.trigger = trigger if os.getpid() != main else None
    return env
