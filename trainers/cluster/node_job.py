"""One job of a sweep on a node of a cluster: `train.py` in a process of its own. This code runs in a Ray task."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import tarfile
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from omegaconf import DictConfig

from trainers.sweeps.job import ENVIRONMENT, failure_message, job_command
from trainers.utils.parent_death import signal_at_parent_death

PROGRAM = Path(__file__).parents[2] / "train.py"
TOKEN = ".token"  # file in a job's folder, which shows a node that it sees the same folder
LEFT_OUT = (".lock", ".stderr", TOKEN)
POLL_SECONDS = 0.2
STOP_SECONDS = 60.0  # for a run to save a checkpoint after SIGTERM


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
    """Whether this node sees the folder of the job."""
    try:
        return (job.place / TOKEN).read_text() == job.token
    except OSError:
        return False


def _run(job: NodeJob, place: Path) -> str | None:
    """The error message of the run; None if it has finished."""
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
    """The exit status. A run whose task is cancelled is asked to save a checkpoint and to end."""
    try:
        while process.poll() is None:
            time.sleep(POLL_SECONDS)  # Ray's cancellation interrupts no system call
    except KeyboardInterrupt:
        process.terminate()
        process.wait(STOP_SECONDS)
    return process.returncode


def _end_with_parent() -> None:
    """The run ends with the task's process: a lost job is started again elsewhere, and must not be run twice."""
    signal_at_parent_death(signal.SIGKILL)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())  # Ray blocks some


def pack(folder: Path) -> bytes:
    """An archive of the files in a folder."""
    with tarfile.open(fileobj=(file := io.BytesIO()), mode="w:gz") as archive:
        for path in sorted(folder.rglob("*")):
            if path.is_file() and not path.is_symlink() and path.name not in LEFT_OUT:
                archive.add(path, path.relative_to(folder).as_posix(), recursive=False)
    return file.getvalue()


def unpack(files: bytes, folder: Path) -> None:
    """Write the files of an archive into a folder."""
    with tarfile.open(fileobj=io.BytesIO(files), mode="r:gz") as archive:
        archive.extractall(folder, filter="data")
