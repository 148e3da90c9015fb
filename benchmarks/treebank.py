"""The commands that strangers wrote for a block-stacking arm: the Robot Commands Treebank.

    python -m benchmarks.treebank --data FOLDER

FOLDER has `commands.txt` and `configuration.txt`. `--part develop` and `--part held_out` divide the scenes by a fixed
seed: the grammar is developed on the first and measured once on the second.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks.treebank_data import PARTS, read


def main() -> int:
    """Prints the size of the part."""
    options = _arguments().parse_args()
    data = read(options.data, options.part)
    print(f"{len(data.items)} commands, {len({item.scene for item in data.items})} scenes")
    if data.unreadable:
        print(f"{len(data.unreadable)} lines could not be read, the first: {data.unreadable[0]!r}", file=sys.stderr)
    return 0


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--data", type=Path, required=True, help="folder with commands.txt and configuration.txt")
    parser.add_argument("--part", choices=PARTS, default="all", help="which scenes (all)")
    return parser


if __name__ == "__main__":
    sys.exit(main())
