"""Processes of train.py, each in a process group of its own, and what is left of them."""

import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]


def start_train(*words: str, stdout: int, stderr: int) -> subprocess.Popen[str]:
    """`python train.py <words>`. stdout, stderr: as of Popen."""
    command = [sys.executable, str(ROOT / "train.py"), *words]
    pipes = {"stdin": subprocess.DEVNULL, "stdout": stdout, "stderr": stderr}
    return subprocess.Popen(command, cwd=ROOT, text=True, start_new_session=True, **pipes)


def living(group: int) -> list[int]:
    """Living processes of a process group."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                state, _, its_group = _stat(int(entry.name))
            except (FileNotFoundError, ProcessLookupError):
                continue
            if int(its_group) == group and state != "Z":
                found.append(int(entry.name))
    return found


def parent_of(process: int) -> int:
    """The parent's id of a process."""
    return int(_stat(process)[1])


def wait_for_end(*processes: int, seconds: float = 10.0) -> None:
    """Wait until these processes run no more. Raises TimeoutError."""
    deadline = time.monotonic() + seconds
    while any(_runs(process) for process in processes):
        if time.monotonic() > deadline:
            raise TimeoutError(f"processes {processes} still run after {seconds:g} s")
        time.sleep(0.01)


def _runs(process: int) -> bool:
    try:
        return _stat(process)[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def workers_of(run: int) -> list[int]:
    """Collection workers of a run that leads a process group: their parent, the fork server, is the run's child."""
    return [process for process in living(run) if process != run and parent_of(process) != run]


def _stat(process: int) -> list[str]:
    """State, parent and group of a process."""
    return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[:3]


def left_over(group: int, seconds: float) -> list[int]:
    """The same, after the second or two that multiprocessing's own tracker takes to end."""
    deadline = time.monotonic() + seconds
    while (found := living(group)) and time.monotonic() < deadline:
        time.sleep(0.1)
    return found
