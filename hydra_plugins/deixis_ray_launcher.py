"""Hydra's plugin for `hydra/launcher=ray`, which runs `trainers.cluster.ray_sweep`.

Hydra accepts launchers from this package only, and imports all of it at each start.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from hydra.core.hydra_config import HydraConfig
from hydra.core.utils import JobReturn, JobStatus
from hydra.plugins.launcher import Launcher
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig, open_dict

from core.errors import ConfigError, RunError


class RayLauncher(Launcher):
    """Each job of a sweep is a task of a Ray cluster, with cores and GPUs of its own.

    Args:
        address: HOST:PORT of the cluster; None for that of this machine, or a Ray that is started here.
    """

    def __init__(self, address: str | None = None) -> None:
        self.address = address

    def setup(self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig) -> None:
        """Keep what Hydra passes before `launch`."""
        self.hydra_context, self.config = hydra_context, config

    def launch(self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int) -> list[JobReturn]:
        """Run the jobs that have not finished. Exits with one line for bad input."""
        from trainers.cluster.ray_sweep import make_job, run_jobs

        numbered = enumerate(job_overrides, initial_job_idx)
        try:
            run_jobs(self.address, [make_job(self._config(words, number), words) for number, words in numbered])
        except ConfigError as error:
            sys.exit(f"error: {error}")
        except RunError as error:
            sys.exit(f"error: {error}; go on with sweep.resume={self.config.hydra.sweep.dir} hydra/launcher=ray")
        return [JobReturn(status=JobStatus.COMPLETED, _return_value=None) for _ in job_overrides]

    def _config(self, overrides: Sequence[str], number: int) -> DictConfig:
        """Compose the config of a job, with Hydra's own settings."""
        config = self.hydra_context.config_loader.load_sweep_config(self.config, list(overrides))
        with open_dict(config):
            config.hydra.job.id, config.hydra.job.num = f"{config.hydra.job.name}_{number}", number
        HydraConfig.instance().set_config(config)  # the name of the job's folder refers to it
        return config
