"""`python -m language`: the command line as a process. It ends without a traceback on Ctrl-C and on a closed pipe."""

from __future__ import annotations

import io
import sys

from core.program import program
from language.cli import INVALID_INPUT, main


def run() -> int:
    """Run the command and returns the exit code of the process."""
    with program(failed=INVALID_INPUT):
        for stream, errors in ((sys.stdin, "replace"), (sys.stdout, "backslashreplace")):
            if isinstance(stream, io.TextIOWrapper):  # undecodable characters are replaced
                stream.reconfigure(errors=errors)
        return main()


if __name__ == "__main__":
    sys.exit(run())
