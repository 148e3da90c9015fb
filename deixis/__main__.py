"""`python -m deixis`, which is the command `deixis`."""

import sys

from deixis.cli import main

if __name__ == "__main__":
    sys.exit(main())
