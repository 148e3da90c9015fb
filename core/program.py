"""How a program begins and ends: standard streams that are there, and one line for what its user or machine refuses."""

from __future__ import annotations

import argparse
import ast
import errno
import io
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NoReturn

from core.errors import ConfigError, RunError
from core.plugins import take_config_dir

FAILED, INTERRUPTED, PIPE_CLOSED = 1, 130, 141  # exit codes; the latter two as a shell has them for SIGINT and SIGPIPE
STREAMS = (("stdin", "r"), ("stdout", "w"), ("stderr", "w"))
REFUSALS = {  # errno of what the machine refuses -> what helps
    errno.ENOSPC: "free some space, or choose another place",
    errno.EDQUOT: "free some space, or choose another place",
    errno.EFBIG: "raise the limit of a file's size (ulimit -f)",
    errno.EROFS: "choose another place",
    errno.EMFILE: "raise the limit of open files (ulimit -n)",
    errno.ENFILE: "close other programs: the machine has too many open files",
    errno.EAGAIN: "raise the limit of processes (ulimit -u), or close other programs",
    errno.ENOMEM: "close other programs, or give fewer worlds and workers",
    errno.EIO: "the disk or stream is damaged or gone",
}
# Texts of errors that have no errno, as libraries raise them, with the errno that they stand for.
TEXTS = {
    "can't start new thread": errno.EAGAIN,
    "Resource temporarily unavailable": errno.EAGAIN,
    "Too many open files": errno.EMFILE,
    "No space left on device": errno.ENOSPC,
    "Cannot allocate memory": errno.ENOMEM,
    "can't allocate memory": errno.ENOMEM,
    "Read-only file system": errno.EROFS,
    "CUDA out of memory": errno.ENOMEM,
}


@contextmanager
def program(failed: int = FAILED) -> Iterator[None]:
    """Run a program in this block. It exits with one line for bad input, a run that had to end and a machine's limits.

    Args:
        failed: exit code for these.
    """
    open_streams()
    try:
        with _flushed():
            yield
    except (ConfigError, RunError) as error:
        _end(str(error), failed)
    except KeyboardInterrupt:
        _discard_output()
        raise SystemExit(INTERRUPTED) from None
    except BrokenPipeError:
        _discard_output()
        raise SystemExit(PIPE_CLOSED) from None
    except (OSError, MemoryError, RuntimeError, ImportError) as error:
        reason = refusal(error)
        if reason is None:
            raise
        _end(reason, failed)


@contextmanager
def _flushed() -> Iterator[None]:
    """Write what is buffered at the end of the block, also where it exits with 0. Raises OSError."""
    try:
        yield
    except SystemExit as end:
        if end.code in (None, 0):
            sys.stdout.flush()
        raise
    sys.stdout.flush()


def open_streams() -> None:
    """Give the process the standard streams that its caller closed: they read and write nothing.

    Otherwise the next file that is opened takes a stream's place. Characters that a stream cannot encode are escaped.
    """
    for number, (name, mode) in enumerate(STREAMS):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free number, which is this one
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.open(os.devnull, os.O_RDWR), mode))  # noqa: SIM115
            setattr(sys, f"__{name}__", getattr(sys, name))
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors in ("strict", "surrogateescape"):
            stream.reconfigure(errors="backslashreplace")


def refusal(error: BaseException) -> str | None:
    """Why the machine refused something, and what helps, as one line; None for another error."""
    if isinstance(error, MemoryError):
        return f"the memory is used up; {REFUSALS[errno.ENOMEM]}"
    number = error.errno if isinstance(error, OSError) else None
    text = str(error)
    if number not in REFUSALS:
        number = next((number for part, number in TEXTS.items() if part in text), None)
    if number is None:
        return None
    if not isinstance(error, OSError):
        return f"{text.splitlines()[0]}; {REFUSALS[number]}"
    place = error.filename or ("" if _output_works() else "stdout")
    return f"{f'{place}: ' if place else ''}{error.strerror or text}; {REFUSALS[number]}"


class OptionParser(argparse.ArgumentParser):
    """A parser of options that raises ConfigError for bad ones, where argparse prints the usage and exits."""

    def error(self, message: str) -> NoReturn:
        """Raise ConfigError with what is wrong."""
        whole = re.fullmatch(r"argument (\S+): invalid int value: '(.*)'", message, re.DOTALL)
        text = f"{whole[1]}={whole[2]} must be a whole number" if whole else message.removeprefix("argument ")
        raise ConfigError(f"{text}; see {self.prog} --help")


def help_text(file: str) -> str:
    """Return the docstring at the top of a program's file, which `python -OO` does not load."""
    return ast.get_docstring(ast.parse(Path(file).read_text(encoding="utf-8"))) or ""


def run_program(main: Callable[[list[str]], object], file: str, words: Sequence[str] | None = None) -> None:
    """Run a program: print its help for -h or --help; otherwise call `main`. Exits as `program` does.

    Args:
        main: takes the words; raises ConfigError for bad input.
        file: of the program, whose docstring is its help.
        words: command-line words; by default those of this process.
    """
    words = sys.argv[1:] if words is None else list(words)
    with program():
        if any(word in ("-h", "--help") for word in words):
            print(help_text(file))
        else:
            main(take_config_dir(words))


def _end(reason: str, code: int) -> None:
    """Exit with the reason on stderr, in one line. Control characters of a file's content do not reach the terminal."""
    reason = "".join(letter if letter.isprintable() else " " if letter == "\n" else "?" for letter in reason)
    if not _output_works():
        _discard_output()
    if code == FAILED:
        raise SystemExit(f"error: {reason}") from None  # printed by Python
    print(f"error: {reason}", file=sys.stderr)
    raise SystemExit(code) from None


def _output_works() -> bool:
    """Whether stdout takes what is buffered for it."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        return False
    return True


def _discard_output() -> None:
    """Have what is written to stdout go nowhere: otherwise the flush at exit fails with a message."""
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
