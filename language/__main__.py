"""`python -m language`: the command line as a process, which ends quietly when it is interrupted or no one reads on."""

from __future__ import annotations

import io
import os
import sys

from language.cli import WRONG, main

INTERRUPTED, NOT_READ = 130, 141  # what a shell gives for the signals SIGINT and SIGPIPE


def run() -> int:
    """Runs the command; gives the exit code of the process."""
    for stream, errors in ((sys.stdin, "replace"), (sys.stdout, "backslashreplace")):
        if isinstance(stream, io.TextIOWrapper):  # no letter is a reason to fail
            stream.reconfigure(errors=errors)
    try:
        status = main()
        if sys.stdout is not None:
            sys.stdout.flush()
    except KeyboardInterrupt:
        return INTERRUPTED
    except OSError as error:
        # What is still buffered can go nowhere: without this, the flush at exit fails again and says so.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        if isinstance(error, BrokenPipeError):
            return NOT_READ
        print(f"error: {error}", file=sys.stderr)
        return WRONG
    return status


if __name__ == "__main__":
    sys.exit(run())
