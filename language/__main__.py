"""`python -m language`: the command line as a process. It ends without a traceback on Ctrl-C and on a closed pipe."""

from __future__ import annotations

import io
import os
import sys

from language.cli import INVALID_INPUT, main

INTERRUPTED, PIPE_CLOSED = 130, 141  # a shell's exit codes for the signals SIGINT and SIGPIPE


def run() -> int:
    """Runs the command and returns the exit code of the process."""
    for stream, errors in ((sys.stdin, "replace"), (sys.stdout, "backslashreplace")):
        if isinstance(stream, io.TextIOWrapper):  # undecodable characters are replaced
            stream.reconfigure(errors=errors)
    try:
        status = main()
        if sys.stdout is not None:
            sys.stdout.flush()
    except KeyboardInterrupt:
        return INTERRUPTED
    except OSError as error:
        # Discards buffered output; otherwise the flush at exit fails again with a message.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        if isinstance(error, BrokenPipeError):
            return PIPE_CLOSED
        print(f"error: {error}", file=sys.stderr)
        return INVALID_INPUT
    return status


if __name__ == "__main__":
    sys.exit(run())
