"""A sweep on a Ray cluster: each job is a task with cores and GPUs of its own.

A job that fails, or whose node is lost, is started again, on another node where there is one, and goes on from its
last checkpoint where the nodes share the sweep's folder. Other jobs go on meanwhile.
"""

from __future__ import annotations

import secrets
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, open_dict

from conf.schema import ConfigError, read
from trainers.cluster.node_job import TOKEN, JobResult, NodeJob, pack, run_on_node, unpack
from trainers.cluster.ray_session import RaySession
from trainers.config import SweepConfig
from trainers.sweeps.job import begin_job, find_job_folder, has_finished, job_overrides, record_failure
from trainers.sweeps.sweep import SweepCallback

POLL_SECONDS = 0.5


def make_job(config: DictConfig, overrides: Sequence[str]) -> NodeJob:
    """A job of a sweep, in the folder that Hydra would give it or that an earlier start of the sweep gave it.

    Args:
        config: of the job, with Hydra's own settings.
        overrides: of the job, as Hydra has them.
    """
    folder, own = Path(config.hydra.sweep.dir).absolute(), job_overrides(overrides)
    folder.mkdir(parents=True, exist_ok=True)
    place = find_job_folder(folder / config.hydra.sweep.subdir, own)
    with open_dict(config):
        del config["hydra"]
    return NodeJob(config, own, place, share=config.sweep.cpus)


def run_jobs(address: str | None, jobs: Sequence[NodeJob]) -> None:
    """Run the jobs that have not finished, as many at a time as the cluster has cores for.

    Args:
        address: of the cluster, as of `RaySession`.
        jobs: of one sweep.

    Raises:
        ConfigError: there is no such cluster, no node of it has enough cores, or a node has other versions.
    """
    sweep = read(SweepConfig, jobs[0].config.sweep, "sweep")
    with closing(RaySession(address)) as session:
        _check_resources(session, sweep)
        session.check_nodes()
        RaySweep(session, sweep).run([job for job in jobs if not has_finished(job.place)])


class RaySweep:
    """The jobs of a sweep on a cluster."""

    def __init__(self, session: RaySession, config: SweepConfig) -> None:
        self.session, self.ray, self.config = session, session.ray, config
        self.task = self.ray.remote(max_retries=0)(run_on_node)
        self.running: dict[Any, NodeJob] = {}  # by the reference to the result
        self.starts: dict[Path, int] = {}  # how often each job was started

    def run(self, jobs: Sequence[NodeJob]) -> None:
        """Run the jobs, until all have ended or a signal stops the sweep."""
        for job in jobs:
            self._start(job)
        while self.running:
            if SweepCallback.received:
                self._stop()
                return
            for reference in self.ray.wait(list(self.running), num_returns=1, timeout=POLL_SECONDS)[0]:
                self._end(reference, self.running.pop(reference))

    def _start(self, job: NodeJob) -> None:
        begin_job(job.place, list(job.overrides))
        has_checkpoint = any((job.place / "checkpoints").glob("*.pt"))
        files = pack(job.place) if has_checkpoint else None  # for nodes that do not see the folder
        self.starts[job.place] = self.starts.get(job.place, 0) + 1
        options = {"num_cpus": self.config.cpus, "num_gpus": self.config.gpus, "name": f"deixis {job.place.name}"}
        task = self.task.options(scheduling_strategy="SPREAD", **options)
        token = secrets.token_hex(8)
        (job.place / TOKEN).write_text(token)
        self.running[task.remote(replace(job, token=token, files=files))] = job

    def _end(self, reference: Any, job: NodeJob) -> None:
        """Take the files of a job that has ended, and start it again if it failed or was lost."""
        (job.place / TOKEN).unlink(missing_ok=True)
        try:
            result: JobResult = self.ray.get(reference)
        except self.ray.exceptions.RayError as error:
            message = f"the job was lost: {type(error).__name__}"
        else:
            if result.files is not None:
                unpack(result.files, job.place)
            if result.error is None:
                print(f"[{job.place.name}] has finished on node {result.node}", flush=True)
                return
            message = result.error
        retries = self.starts[job.place] - 1
        if retries < self.config.retries:
            reason = message.splitlines()[-1]
            again = f"it is started again ({retries + 1} of at most {self.config.retries} times)"
            print(f"[{job.place.name}] {reason}; {again}", flush=True)
            self._start(job)
        else:
            record_failure(job.place, message)

    def _stop(self) -> None:
        """Cancel all jobs, and wait for those that run to save their checkpoints and to send their files."""
        for reference, job in self.running.items():
            self.ray.cancel(reference, force=False)
            (job.place / TOKEN).unlink(missing_ok=True)
        for reference, job in self.running.items():
            try:
                result: JobResult = self.ray.get(reference)
            except self.ray.exceptions.RayError:
                continue  # it had not started, or was lost
            if result.files is not None:
                unpack(result.files, job.place)


def _check_resources(session: RaySession, config: SweepConfig) -> None:
    """Raises ConfigError if no node has the cores and GPUs of a job."""
    for key, name, wanted in (("sweep.cpus", "CPU", config.cpus), ("sweep.gpus", "GPU", config.gpus)):
        most = max((node["Resources"].get(name, 0.0) for node in session.ray.nodes() if node["Alive"]), default=0.0)
        if wanted > most:
            raise ConfigError(f"{key}={wanted:g} is more than any node of the Ray cluster has: {most:g}")
