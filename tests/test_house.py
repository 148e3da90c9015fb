"""The house keeps to its plan: who may import whom, what stays light, and how long a file may be."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
ROOMS = {  # room -> the rooms that it may import beside itself
    "conf": set(),
    "language": set(),
    "human": {"conf", "language"},
    "envs": {"conf", "language", "human"},
    "trainers": {"conf"},
    "demo": {"conf", "language", "human", "envs", "trainers"},
}
OUTSIDE = {"build", "dist", "outputs", "multirun"}  # folders that are made, not written
LONGEST = 350  # lines


def sources(folder):
    return sorted((ROOT / folder).rglob("*.py"))


def written():
    """Every Python file of the project."""
    files = ROOT.rglob("*.py")
    relative = {path: path.relative_to(ROOT).parts for path in files}
    return sorted(p for p, parts in relative.items() if parts[0] not in OUTSIDE and not parts[0].startswith("."))


def imported(path):
    """Top-level names that a file imports anywhere in it, in functions too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (name.name.split(".")[0] for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports say the whole name"
            yield (node.module or "").split(".")[0]


def programs():
    return {path.stem for path in ROOT.glob("*.py")} | {"benchmarks", "tests"}


@pytest.mark.parametrize("room", [room for room in ROOMS if (ROOT / room).is_dir()])
def test_a_room_imports_only_the_rooms_it_may(room):
    assert sources(room)
    barred = (set(ROOMS) | programs()) - ROOMS[room] - {room}
    for path in sources(room):
        assert not barred & set(imported(path)), path


def test_every_room_is_known_here():
    rooms = {path.parent.name for path in ROOT.glob("*/__init__.py")} - {"benchmarks"}
    assert rooms <= set(ROOMS)


def test_tasks_controls_and_environments_know_no_pybullet():
    users = {path.relative_to(ROOT).as_posix() for path in written() if "pybullet" in imported(path)}
    users = {user for user in users if not user.startswith(("tests/", "benchmarks/"))}
    assert users <= {path.relative_to(ROOT).as_posix() for room in ("envs", "human") for path in sources(room)}
    above = ("controls", "kinematics", "workspace", "workspace_env", "gym_env", "config", "gestures")
    assert not users & {f"envs/{name}.py" for name in above}
    numbers = ("pointing", "meaning", "chain", "arm", "by_hand", "person", "model", "shapes", "config")
    assert not users & {f"human/{name}.py" for name in numbers}
    assert not any(user.startswith(("envs/tasks/", "envs/experts/")) for user in users)


@pytest.mark.parametrize(
    ("module", "heavy"),
    [
        ("language", {"torch", "tensordict", "torchrl", "pybullet", "hydra", "matplotlib"}),
        ("conf.schema", {"torch", "pybullet", "hydra", "omegaconf", "numpy"}),
        ("conf.overrides", {"torch", "pybullet", "hydra"}),
    ],
)
def test_what_is_light_loads_nothing_heavy(module, heavy):
    code = f"import sys, {module}; print(*set({sorted(heavy)}) & set(sys.modules))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert found.stdout.split() == []


def test_no_file_is_too_long():
    lengths = {path.relative_to(ROOT).as_posix(): len(path.read_text("utf-8").splitlines()) for path in written()}
    assert {name: lines for name, lines in lengths.items() if lines > LONGEST} == {}


def test_test_files_have_names_of_their_own_and_no_packages():
    names = [path.name for path in sources("tests")]
    assert len(names) == len(set(names))
    assert "__init__.py" not in names
