"""A run on a Ray cluster in a process of its own: Ray ends the process that it is connected to when its node fails.

It does so from C++, without an exception, so that nothing can be saved there. The process that the user started only
waits. If the run's process ends like that, it starts another one, which goes on from the last checkpoint.
"""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from traceback import walk_tb
from types import FrameType

from core.errors import ConfigError, RunError
from core.stored_config import place_overrides
from core.system import STOP_SIGNALS, signal_at_parent_death

FINISHED = "DEIXIS_RUN_ENDED_PIPE"  # environment variable: the descriptor that an orderly end is written to
PAUSE_SECONDS = 1.0  # before the next start


def is_supervised() -> bool:
    """Whether this process is one that `supervise` started."""
    return FINISHED in os.environ


@contextmanager
def ray_errors() -> Iterator[None]:
    """Within this block, an error that Ray raises itself, such as of a head that has died, is one line.

    The supervising process then starts the run again.
    """
    try:
        yield
    except (ConfigError, RunError):
        raise
    except Exception as error:
        if not _is_of_ray(error):
            raise
        os.environ.pop(FINISHED, None)  # this is no orderly end
        raise RunError(f"Ray has ended: {' '.join(str(error).split())[:300]}") from None


def _is_of_ray(error: BaseException) -> bool:
    """Whether an error was raised in Ray's code."""
    frames = walk_tb(error.__traceback__)
    return any(str(frame.f_globals.get("__name__")).partition(".")[0] == "ray" for frame, _ in frames)


def report_end() -> None:
    """Tell the supervising process that this one ends by itself, whatever its exit code."""
    with suppress(OSError, KeyError, ValueError):
        os.write(int(os.environ[FINISHED]), b"1")


class RunWords:
    """The words after train.py at each start of a run.

    Args:
        words: the user's overrides, without Hydra's own.
        folder: of the run.
    """

    def __init__(self, words: Sequence[str], folder: Path) -> None:
        self.words, self.folder = words, folder
        self.last = folder / "checkpoints" / "last.pt"
        self._since = time.time()

    @property
    def saved(self) -> bool:
        """Whether the run has written a checkpoint; one of an earlier run in this folder does not count."""
        return self.last.is_file() and self.last.stat().st_mtime >= self._since

    def __call__(self) -> list[str]:
        """Return the words that begin the run, or that resume it once it has a checkpoint."""
        place = [f"hydra.run.dir={self.folder}"]
        if not self.saved:
            return [*self.words, *place]
        others = [word for word in self.words if not word.startswith("resume=")]
        resumed = len(others) < len(self.words)  # then the words change the checkpoint's config
        return [f"resume={self.folder}", *(others if resumed else place_overrides(others)), *place]


def supervise(program: Path, words: RunWords, restarts: int) -> int:
    """Run the program until it ends by itself, and return its exit code.

    Args:
        program: path of train.py.
        words: its command-line words.
        restarts: how often it is started again.

    Raises:
        ConfigError: this system has no groups of processes.
        RunError: Ray ended it more often.
    """
    _check_system()
    with _Forwarding() as forwarding:
        for attempt in range(restarts + 1):
            code, orderly = _run([sys.executable, str(program), *words()], forwarding)
            if orderly or forwarding.received:
                return 128 - code if code < 0 else code
            if attempt < restarts:
                again = f"the run is started again ({attempt + 1} of at most {restarts} times)"
                print(f"warning: Ray, or a node of it, has ended the run; {again}", file=sys.stderr, flush=True)
                time.sleep(PAUSE_SECONDS)
    saved = f"{words.last} is its last checkpoint" if words.saved else "it has no checkpoint"
    raise RunError(
        f"Ray, or a node of it, has ended the run; collector.restarts={restarts} allows no more restarts; {saved}; go "
        f"on with: {shlex.join(['python', 'train.py', *words()])}"
    )


def run_apart(main: Callable[[], object], program: Path, words: Sequence[str], ended: str) -> None:
    """Do the work of a program that uses a Ray cluster in a process of its own; exit with its code if that is not 0.

    Args:
        main: the work, which is called in the other process.
        program: path of the program, which calls this function.
        words: its command-line words.
        ended: the message for the case that Ray, or a node of it, has ended that process.

    Raises:
        ConfigError: this system has no groups of processes.
        RunError: Ray has ended it.
    """
    _check_system()
    if is_supervised():
        with _apart():
            main()
        return
    with _Forwarding() as forwarding:
        code, orderly = _run([sys.executable, str(program), *words], forwarding)
    if not (orderly or forwarding.received):
        raise RunError(f"Ray, or a node of it, has ended the {ended}")
    if code:
        raise SystemExit(128 - code if code < 0 else code)


@contextmanager
def _apart() -> Iterator[None]:
    """Within this block a process tells the one that waits for it that it ended by itself.

    Processes that it starts do not inherit the pipe's number: a job of a sweep would take another file for it.
    """
    pipe = int(os.environ.pop(FINISHED))
    try:
        with ray_errors():
            yield
    finally:
        with suppress(OSError):
            os.write(pipe, b"1")


def _check_system() -> None:
    """Raise ConfigError on Windows, where nothing ends all processes that Ray has started."""
    if not hasattr(os, "killpg"):
        raise ConfigError("a Ray cluster is used from Linux or macOS only; here, take collector=local")


def _run(command: Sequence[str], forwarding: _Forwarding) -> tuple[int, bool]:
    """Return the exit code of a command, and whether it ended by itself."""
    read, write = os.pipe()
    try:
        process = subprocess.Popen(
            command,
            env={**os.environ, FINISHED: str(write)},
            pass_fds=[write],
            start_new_session=True,
            preexec_fn=_end_with_parent,
        )
        os.close(write)
        forwarding.to(process)
        code = process.wait()
        _kill_session(process.pid)  # what Ray has left of it
        os.set_blocking(read, False)
        with suppress(BlockingIOError):
            return code, bool(os.read(read, 1))
        return code, False
    finally:
        os.close(read)


def _kill_session(leader: int) -> None:
    """Kill the processes of a session: Ray's workers have process groups of their own, and may outlive the raylet."""
    for entry in Path("/proc").glob("[0-9]*"):
        with suppress(OSError, ValueError):  # it has ended
            if os.getsid(int(entry.name)) == leader:
                os.kill(int(entry.name), signal.SIGKILL)
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(leader, signal.SIGKILL)  # where there is no /proc


def _end_with_parent() -> None:
    signal_at_parent_death(signal.SIGTERM)


class _Forwarding:
    """Within the block, signals that ask this process to stop are sent on to the run's process instead.

    received: whether there was one.
    """

    def __init__(self) -> None:
        self.received = False
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> _Forwarding:
        self._previous = {number: signal.signal(number, self._forward) for number in STOP_SIGNALS}
        return self

    def __exit__(self, *error: object) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)

    def to(self, process: subprocess.Popen[bytes]) -> None:
        """Send signals to this process from now on."""
        self._process = process

    def _forward(self, number: int, _frame: FrameType | None) -> None:
        self.received = True
        if self._process is not None:
            self._process.send_signal(number)
