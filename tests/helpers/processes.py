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
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
            except (FileNotFoundError, ProcessLookupError):
                continue
            if int(fields[2]) == group and fields[0] != "Z":
                found.append(int(entry.name))
    return found


def left_over(group: int, seconds: float) -> list[int]:
    """The same, after the second or two that multiprocessing's own tracker takes to end."""
    deadline = time.monotonic() + seconds
    while (found := living(group)) and time.monotonic() < deadline:
        time.sleep(0.1)
    return found
