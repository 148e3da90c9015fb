"""Sweeps on a Ray cluster: each job is a task, which runs `train.py` in a process of its own on its node."""

from __future__ import annotations

import io
import os
import secrets
import signal
import subprocess
import tarfile
import tempfile
import time
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, open_dict

from core.errors import ConfigError
from core.schema import read
from core.system import signal_at_parent_death
from trainers.cluster.ray_session import RaySession
from trainers.config import SweepConfig
from trainers.sweeps.job import (
    ENVIRONMENT,
    begin_job,
    failure_message,
    find_job_folder,
    has_finished,
    job_command,
    job_overrides,
    record_failure,
)
from trainers.sweeps.sweep import SweepCallback

PROGRAM = Path(__file__).parents[2] / "train.py"
TOKEN = ".token"  # file in a job's folder, which shows a node that it sees the same folder
LEFT_OUT = (".lock", ".stderr", TOKEN)
POLL_SECONDS = 0.2
STOP_SECONDS = 60.0  # for a run to save a checkpoint after SIGTERM


SWEEP_POLL_SECONDS = 0.5


@dataclass(frozen=True)
class NodeJob:
    """A job as it is sent to a node.

    place: its folder, on the machine of the sweep. share: number of cores. token: in the folder's `TOKEN`. files: an
    archive of the folder as an earlier start has left it; None if it has no checkpoint. program: None for the
    train.py of the node.
    """

    config: DictConfig
    overrides: Sequence[str]
    place: Path
    share: int
    token: str = ""
    files: bytes | None = None
    program: Path | None = None


@dataclass(frozen=True)
class JobResult:
    """How a job ended. error: the message of one that failed. files: an archive of its folder, None if it is shared."""

    node: str
    error: str | None
    files: bytes | None


def make_job(config: DictConfig, overrides: Sequence[str]) -> NodeJob:
    """Return a job of a sweep, in the folder that Hydra would give it or that an earlier start of the sweep gave it.

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
        """Run the jobs, until all have ended or a signal stops the sweep. Raises RunError if Ray ends here."""
        for job in jobs:
            self._start(job)
        while self.running:
            if SweepCallback.received:
                self._stop()
                return
            self.session.check_own_node()
            for reference in self.ray.wait(list(self.running), num_returns=1, timeout=SWEEP_POLL_SECONDS)[0]:
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
    """Raise ConfigError if no node has the cores and GPUs of a job."""
    for key, name, wanted in (("sweep.cpus", "CPU", config.cpus), ("sweep.gpus", "GPU", config.gpus)):
        most = max((node["Resources"].get(name, 0.0) for node in session.ray.nodes() if node["Alive"]), default=0.0)
        if wanted > most:
            raise ConfigError(f"{key}={wanted:g} is more than any node of the Ray cluster has: {most:g}")


def run_on_node(job: NodeJob) -> JobResult:
    """Run a job in its folder where this node sees it, and otherwise in a temporary one, which is sent back."""
    import ray

    node = ray.util.get_node_ip_address()
    if _sees(job):
        return JobResult(node, _run(job, job.place), None)
    with tempfile.TemporaryDirectory(prefix="deixis-job-") as name:
        place = Path(name) / job.place.name
        place.mkdir()
        if job.files is not None:
            unpack(job.files, place)
        error = _run(job, place)
        return JobResult(node, error, pack(place))


def _sees(job: NodeJob) -> bool:
    """Return whether this node sees the folder of the job."""
    try:
        return (job.place / TOKEN).read_text() == job.token
    except OSError:
        return False


def _run(job: NodeJob, place: Path) -> str | None:
    """Return the error message of the run; None if it has finished."""
    with tempfile.TemporaryFile("w+") as errors:
        command = job_command(job.program or PROGRAM, job.config, job.overrides, place, job.share)
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=errors,
            env={**os.environ, **ENVIRONMENT},
            preexec_fn=_end_with_parent,
        )
        code = _wait(process)
        errors.seek(0)
        return failure_message(code, errors.read()) if code else None


def _wait(process: subprocess.Popen[bytes]) -> int:
    """Return the exit status. A run whose task is cancelled is asked to save a checkpoint and to end."""
    try:
        while process.poll() is None:
            time.sleep(POLL_SECONDS)  # Ray's cancellation interrupts no system call
    except KeyboardInterrupt:
        process.terminate()
        process.wait(STOP_SECONDS)
    return process.returncode


def _end_with_parent() -> None:
    """The run ends with the task's process: a lost job is started again elsewhere, and must not be run twice."""
    signal_at_parent_death()
    signal.pthread_sigmask(signal.SIG_SETMASK, ())  # Ray blocks some


def pack(folder: Path) -> bytes:
    """Return an archive of the files in a folder."""
    with tarfile.open(fileobj=(file := io.BytesIO()), mode="w:gz") as archive:
        for path in sorted(folder.rglob("*")):
            if path.is_file() and not path.is_symlink() and path.name not in LEFT_OUT:
                archive.add(path, path.relative_to(folder).as_posix(), recursive=False)
    return file.getvalue()


def unpack(files: bytes, folder: Path) -> None:
    """Write the files of an archive into a folder."""
    with tarfile.open(fileobj=io.BytesIO(files), mode="r:gz") as archive:
        archive.extractall(folder, filter="data")
