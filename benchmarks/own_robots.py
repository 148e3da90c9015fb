"""From drawings to robots: `deixis robot add` on URDFs, one row of a table each.

    python -m benchmarks.own_robots arm.urdf another.urdf
    python -m benchmarks.own_robots --list urdfs.txt --episodes 200     # a path in each line

Each robot is added to a folder that is deleted afterwards. The table is in Markdown: what was guessed, what was mended,
the success of the scripted expert of nl_reach, or the sentence with which the URDF was refused. The exit code is the
number of robots that neither work nor were refused with a sentence.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from core.errors import ConfigError
from deixis.robot import ENOUGH, added, wishes
from envs.sim.urdf_file import URDFError, path_of, read_urdf

HEADER = "| robot | in the URDF | guessed | mended | expert | s |\n|---|---|---|---|---|---|"
LONGEST = 160  # characters of a sentence


def traits(urdf: Path) -> str:
    """Return what a URDF has: kinds of joints, of meshes, and what is missing."""
    try:
        robot = read_urdf(urdf)
    except (URDFError, OSError):
        return "unreadable"
    joints = Counter(joint.get("type", "?") for joint in robot.findall("joint"))
    kinds = [f"{joints[kind]} {kind}" for kind in ("revolute", "continuous", "prismatic") if joints[kind]]
    mimics = sum(joint.find("mimic") is not None for joint in robot.findall("joint"))
    names = [path_of(mesh.get("filename", "")) for mesh in robot.iter("mesh")]
    formats = sorted({name.rpartition(".")[2].upper() for name in names})
    bare = sum(link.find("inertial") is None for link in robot.findall("link"))
    parts = [*kinds, *([f"{mimics} mimic"] if mimics else []), *formats]
    parts += ["package://"] * any(name.startswith("package://") for name in names)
    return ", ".join([*parts, *([f"{bare} links without mass"] if bare else [])])


def guessed(values: dict[str, Any]) -> str:
    """Return what was guessed, in a few words."""
    gripper = "fingers" if values["fingers"] else "magnet"
    tilts = ", tilts" if values["position_first"] else ""
    reach = values["reach"] or "all"
    return (
        f"{len(values['joints'])} joints, {gripper} on `{values['tip']}`{tilts}, base {values['base']}, reach {reach}"
    )


def row(urdf: Path, words: list[str]) -> tuple[str, bool]:
    """Return the row of a URDF, and whether it works or was refused with a sentence."""
    notes: list[str] = []
    began = time.perf_counter()
    cells = ["", "", ""]
    with TemporaryDirectory() as folder:
        try:
            name = f"added_{urdf.stem.lower()}".replace(".", "_")
            robot = added(urdf, wishes([f"name={name}", f"out={folder}", "ask=false", *words]), notes.append)
        except ConfigError as error:
            cells[2], fine = _short(str(error)), True
        else:
            success = min(result["success_at_end"] for result in robot.results.values())
            fine = success >= ENOUGH
            cells = [guessed(robot.values), "; ".join(_short(note) for note in notes) or "nothing", f"{success:.2f}"]
    seconds = time.perf_counter() - began
    return f"| {urdf.stem} | {traits(urdf)} | {' | '.join(cells)} | {seconds:.0f} |", fine


def _short(text: str) -> str:
    text = " ".join(text.split()).replace("|", "/")
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("urdfs", type=Path, nargs="*")
    parser.add_argument("--list", type=Path, help="a file with a path in each line, and overrides after it")
    parser.add_argument("--episodes", type=int, default=100)
    parser.add_argument("--tasks", default="nl_reach", help="separated by commas")
    given = parser.parse_args()
    lines = [str(urdf) for urdf in given.urdfs] + (given.list.read_text().splitlines() if given.list else [])
    print(HEADER, flush=True)
    failed = 0
    for line in filter(str.strip, lines):
        path, *overrides = line.split()
        own = [f"episodes={given.episodes}", f"tasks=[{given.tasks}]"]
        text, fine = row(Path(path), [*own, *overrides])
        print(text, flush=True)
        failed += not fine
    sys.exit(failed)


if __name__ == "__main__":
    main()
