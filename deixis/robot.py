"""Robots of your own: `deixis robot add arm.urdf` writes the YAML of an arm, `deixis robot check` tests one.

    deixis robot add <urdf>      find arm, gripper, base and rest pose, write <out>/robot/<name>.yaml, and try it
    deixis robot check <robot>   try a robot: the name of an option, or the path of a YAML

    name=<name>         of the robot; default: from the file's name, or its folder's
    out=conf            folder of the YAML; with --config-dir <folder>, that folder
    packages=<folder>   that holds the packages of package:// in the URDF; several: packages=[<one>,<other>]
    arm=0               which one, where the URDF has several arms
    episodes=100        of the scripted expert, for each task
    tasks=[nl_reach]    that the expert carries out
    force=false         true: replace a robot of this name in that folder
    ask=true            false: take the best guess where there is a choice, also in a terminal
    tip=tool0 joints=[a,b,c] base=[-0.3,0,0] gain=0.2 ...   any key of a robot's YAML, in place of the guess

The exit code is 0 if every expert succeeds in at least 95 % of its episodes. docs/robots.md describes what is guessed.
"""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from core.errors import ConfigError, RunError, did_you_mean
from core.program import run_program

OWN = ("name", "out", "packages", "arm", "episodes", "tasks", "force", "ask")  # the program's keys
MAX_URDF = 16 * 2**20  # bytes
MOST_EPISODES = 100_000
ENOUGH = 0.95  # success of an expert with which a robot works
SHOWN = 6  # pairs of links that are named


@dataclass(frozen=True)
class Wishes:
    """What the command line says. fields: keys of the robot's YAML. name: None for that of the file."""

    name: str | None
    out: Path
    packages: tuple[Path, ...]
    arm: int
    episodes: int
    tasks: tuple[str, ...]
    force: bool
    ask: bool
    fields: dict[str, Any]


def cli() -> None:
    """Run the program with the words of this process."""
    run_program(main, __file__)


def main(words: Sequence[str]) -> None:
    """Run the program. Raises ConfigError, and RunError for a robot that does not work."""
    actions = {"add": add, "check": check}
    action, *rest = [*words, ""]
    if action not in actions:
        raise ConfigError(
            f"{action or 'an action'} is missing or not known: deixis robot add <urdf>, or deixis robot check <robot>"
            + (did_you_mean(action, actions) if action else "")
        )
    place, others = rest[0], rest[1:-1]
    if not place or ("=" in place and not Path(place).exists()):
        wanted = "arm.urdf" if action == "add" else "kuka"
        raise ConfigError(f"deixis robot {action} needs what to {action} first, like deixis robot {action} {wanted}")
    actions[action](place, wishes(others))


def wishes(words: Sequence[str]) -> Wishes:
    """Read key=value words. Raises ConfigError."""
    given: dict[str, Any] = {}
    for word in words:
        key, equals, value = word.partition("=")
        if not equals or not value:
            raise ConfigError(f"{word}: arguments are written key=value, like tip=tool0")
        if key in given:
            raise ConfigError(f"{word}: {key} is given twice; give it once")
        given[key] = _value(word, value)
    own = {key: given.pop(key) for key in OWN if key in given}
    return Wishes(
        name=_name(own.get("name")),
        out=_out(own.get("out")),
        packages=_packages(own.get("packages", [])),
        arm=_whole("arm", own.get("arm", 0), 0, 100),
        episodes=_whole("episodes", own.get("episodes", 100), 1, MOST_EPISODES),
        tasks=_tasks(own.get("tasks", ["nl_reach"])),
        force=_flag("force", own.get("force", False)),
        ask=_flag("ask", own.get("ask", True)) and sys.stdin.isatty() and sys.stdout.isatty(),
        fields={key: _field(key, value) for key, value in given.items()},
    )


def _value(word: str, text: str) -> Any:
    from core.safe_files import FileError, parse_yaml

    if word.startswith(("name=", "out=", "tip=", "packages=")) and not text.startswith("["):
        return text
    try:
        return parse_yaml(text.encode("utf-8", "replace"))
    except FileError as error:
        raise ConfigError(f"{word}: the value {error}") from None


def _name(value: Any) -> str | None:
    if value is not None and not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]{0,60}", str(value)):
        raise ConfigError(f"name={value} must begin with a letter, and have letters, digits, _ and - only")
    return value


def _out(value: Any) -> Path:
    import os

    from core.plugins import VARIABLE

    return Path(str(value) if value is not None else os.environ.get(VARIABLE, "conf"))


def _packages(value: Any) -> tuple[Path, ...]:
    folders = tuple(Path(str(each)) for each in (value if isinstance(value, list) else [value]))
    for folder in folders:
        if not folder.is_dir():
            raise ConfigError(f"packages={folder} is not a folder; it holds the packages that the URDF names")
    return folders


def _tasks(value: Any) -> tuple[str, ...]:
    return tuple(map(str, value if isinstance(value, list) else [value]))


def _whole(key: str, value: Any, low: int, high: int) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        raise ConfigError(f"{key}={value} must be a whole number from {low} to {high}")
    return value


def _flag(key: str, value: Any) -> bool:
    if not isinstance(value, bool):
        raise ConfigError(f"{key}={value} must be true or false")
    return value


def _field(key: str, value: Any) -> Any:
    """Return a value of a robot's YAML. Raises ConfigError for an unknown key and for another type."""
    import dataclasses
    from typing import get_type_hints

    from envs.sim.robot_config import RobotConfig

    fields = {each.name: each for each in dataclasses.fields(RobotConfig)}
    hints = get_type_hints(RobotConfig)
    known = [name for name in fields if name not in ("name", "package", "urdf", "hinge")]
    if key not in known:
        raise ConfigError(f"{key}={value}: {key} is not a key of a robot" + did_you_mean(key, [*known, *OWN]))
    kind = str(hints[key])
    items = value if isinstance(value, list) else [value]
    numbers = all(isinstance(each, int | float) and not isinstance(each, bool) for each in items)
    fits = {
        "list[float]": isinstance(value, list) and numbers,
        "list[str]": isinstance(value, list) and all(isinstance(each, str) for each in items),
        str(float): not isinstance(value, list) and numbers,
        str(bool): isinstance(value, bool),
        str(str): isinstance(value, str),
    }
    wanted = {"list[float]": "a list of numbers, like [0.1,0.2,0.3]", "list[str]": "a list of names, like [a,b]"}
    wanted |= {str(float): "a number", str(bool): "true or false", str(str): "a name"}
    count = fields[key].metadata.get("count")
    if not fits[kind] or (count is not None and len(items) != count):
        raise ConfigError(f"{key}={value} must be {wanted[kind]}" + (f" of length {count}" if count else ""))
    return [float(each) for each in value] if kind == "list[float]" else value


# ---- add


@dataclass(frozen=True)
class AddedRobot:
    """A robot whose YAML was written.

    Attributes:
        values: of the YAML, but where its URDF is.
        share: of the places over the table that it gets to.
        touching: pairs of links that are in each other at rest.
        results: of each task's expert.
        files: written ones, the YAML first.
    """

    values: dict[str, Any]
    share: float
    touching: tuple[str, ...]
    results: dict[str, Any]
    files: tuple[Path, ...]


def add(place: str, wished: Wishes) -> None:
    """Write a robot's YAML from its URDF, and try it. Raises ConfigError, and RunError if it does not work."""
    robot = added(Path(place), wished, lambda note: print(f"- {note}", flush=True))
    _describe(robot.values, robot.share, robot.touching)
    print("wrote " + " and ".join(map(str, robot.files)))
    name = robot.values["name"]
    flag = _flag_of(wished.out)
    wrong = _tell_results(robot.results, wished.episodes)
    if wrong:
        look = f"look at it with `deixis play {flag}robot={name} driver=expert`"
        raise RunError(
            f"{robot.files[0]} was written, but robot={name} does not work yet: {wrong}. {look}; give efforts and "
            "masses in the URDF, or other values of gain, max_speed, base, rest and reach"
        )
    print(f"deixis train {flag}robot={name} task={wished.tasks[0]}")


def added(urdf: Path, wished: Wishes, tell: Callable[[str], None]) -> AddedRobot:
    """Write a robot's YAML from its URDF, and return what it achieves. Raises ConfigError; then nothing is written.

    Args:
        urdf: the file.
        wished: what the command line says.
        tell: gets what was mended, guessed or chosen, one sentence each.
    """
    from deixis.robot_trial import files_of, write_files

    name = wished.name or _name_of(urdf)
    target = wished.out / "robot" / f"{name}.yaml"
    _check_target(name, target, wished.force)
    _check_urdf(urdf)
    guess, values, results = _tried(urdf, name, _asked(urdf, name, wished), tell)
    files = files_of(guess, urdf, target)
    write_files(files, values, target, urdf)
    return AddedRobot(values, guess.share, guess.touching, results, (target, *files))


def _tried(urdf: Path, name: str, wished: Wishes, tell: Callable[[str], None]) -> tuple[Any, dict[str, Any], Any]:
    """Return the robot that is guessed, its values once it was tried, and the experts' results.

    Joints that slide are fixed where the expert fails with them: a slow torso holds the whole arm back.
    """
    from deixis.robot_trial import Trial, worst

    found: list[tuple[float, Any, Any, Any, tuple[str, ...]]] = []
    for still in (False, True):
        try:
            with tempfile.TemporaryDirectory() as folder:
                guess = _guess(urdf, name, wished, Path(folder), still)
                trial = Trial(guess, urdf, Path(folder), fixed=tuple(wished.fields))
                values, results = trial.tune(wished.tasks, wished.episodes)
        except ConfigError:
            if found and found[0][0] > 0:
                break
            raise  # it says why the arm does not move
        found.append((worst(results), guess, values, results, (*guess.notes, *trial.told)))
        if worst(results) >= ENOUGH or not guess.slides or "joints" in wished.fields:
            break
    _, guess, values, results, notes = max(found, key=lambda each: each[0])
    for note in notes:
        tell(note)
    return guess, values, results


def _guess(urdf: Path, name: str, wished: Wishes, folder: Path, still: bool = False) -> Any:
    """Return the robot that is guessed, its slides fixed if it is to be still. Raises ConfigError."""
    from envs.sim.robot_import.guess import Given, RobotGuess
    from envs.sim.urdf_file import URDFError

    try:
        given = Given(name=name, fields=wished.fields, packages=wished.packages, arm=wished.arm, still=still)
        found = RobotGuess(urdf, given, folder)
        if wished.arm >= len(found.arms):
            raise ConfigError(f"arm={wished.arm}: the URDF has {len(found.arms)} arms, counted from 0")
        return found.make(*workspaces())
    except URDFError as error:
        raise ConfigError(f"{urdf} {error}") from None


def _asked(urdf: Path, name: str, wished: Wishes) -> Wishes:
    """Return what is wished, with the user's choices where the URDF leaves one. Raises ConfigError."""
    from envs.sim.robot_import.guess import Given, RobotGuess
    from envs.sim.urdf_file import URDFError

    if not wished.ask:
        return wished
    try:
        found = RobotGuess(urdf, Given(name=name, fields=wished.fields, packages=wished.packages), Path())
    except URDFError as error:
        raise ConfigError(f"{urdf} {error}") from None
    arms = [f"{arm.joints[0].name} to {arm.joints[-1].name}" for arm in found.arms]
    if len(arms) > 1:
        wished = replace(wished, arm=choose("Which arm?", arms))
    tips = found.tips(min(wished.arm, len(arms) - 1))
    if "tip" not in wished.fields and len(tips) > 1:
        tip = tips[choose("Which link carries the gripper?", tips)]
        wished = replace(wished, fields={**wished.fields, "tip": tip})
    return wished


def choose(question: str, choices: Sequence[str]) -> int:
    """Return the number of the choice that the user makes in a terminal; the first one for an empty answer."""
    print(question)
    for number, choice in enumerate(choices, 1):
        print(f"  {number}  {choice}" + "  (default)" * (number == 1))
    while True:
        try:
            answer = input("> ").strip()
        except EOFError:
            return 0
        if not answer:
            return 0
        if answer in choices:
            return list(choices).index(answer)
        if answer.isdigit() and 1 <= int(answer) <= len(choices):
            return int(answer) - 1
        print(f"{answer} is none of them: give a number from 1 to {len(choices)}")


def workspaces() -> tuple[Any, list[list[float]]]:
    """Return the table, and the gripper_box of every workspace of the project."""
    from core.composition import compose, groups
    from core.schema import read
    from envs.sim.workspace import WorkspaceConfig

    every = {
        name: read(WorkspaceConfig, compose([f"workspace={name}"])["workspace"], "workspace")
        for name in groups()["workspace"]
    }
    boxes = {tuple(each.gripper_box) for each in every.values() if not each.fittings}
    return every["table"], [list(box) for box in sorted(boxes)]


def _name_of(urdf: Path) -> str:
    name = re.sub(r"[^A-Za-z0-9]+", "_", urdf.name.partition(".")[0]).strip("_").lower()
    if name in ("", "robot", "model", "urdf", "main") or not name[0].isalpha():
        parents = [re.sub(r"[^A-Za-z0-9]+", "_", each.name).strip("_").lower() for each in urdf.absolute().parents]
        parents = [each for each in parents if each and each[0].isalpha() and each not in ("urdf", "robots", "robot")]
        name = parents[0] if parents else "my_arm"
    return name[:60]


def _check_target(name: str, target: Path, force: bool) -> None:
    """Raise ConfigError unless a robot of this name can be written there."""
    from core.command_line import check_file
    from core.plugins import ROOT

    if (ROOT / "robot" / f"{name}.yaml").exists() and not (force and target.resolve().parent == ROOT / "robot"):
        raise ConfigError(f"name={name} is the name of one of this project's robots; give name=<another one>")
    if target.exists() and not force:
        raise ConfigError(f"{target} exists already; give force=true to replace it, or name=<another one>")
    check_file("out", target, (".yaml",))


def _check_urdf(urdf: Path) -> None:
    from core.safe_files import FileError, check_size

    try:
        check_size(urdf, MAX_URDF)
    except FileError as error:
        raise ConfigError(f"{urdf} {error}") from None


def _describe(values: dict[str, Any], share: float, touching: Sequence[str]) -> None:
    """Print what a robot is, and what is odd about it, in sentences."""
    joints, gripper = values["joints"], " and ".join(values["fingers"]) or "a magnet"
    print(f"{values['name']}: {len(joints)} joints, {joints[0]} to {joints[-1]}; {gripper} on {values['tip']}")
    print(f"- its base stands at {values['base']} m, and it rests at {values['rest']}")
    reach = values["reach"] or "all of every workspace"
    print(f"- it gets to {share:.0%} of the places over the table, pointing down as at rest; reach: {reach}")
    if touching:
        pairs = "; ".join(touching[:SHOWN]) + ("; ..." if len(touching) > SHOWN else "")
        print(f"- at rest, shapes of links are in each other: {pairs}. The simulation ignores this, an arm would not")


def _tell_results(results: dict[str, Any], episodes: int) -> str:
    """Print the experts' success, and return what is wrong, or nothing."""
    wrong = []
    for task, result in results.items():
        success, (low, high) = result["success_at_end"], result["ci95"]
        print(
            f"- the expert of {task} succeeds in {success:.2f} of {episodes} episodes (95 %: {low:.2f} to {high:.2f})"
        )
        if result["disturbed"]:
            share = result["disturbed"]
            print(f"- it pushes other objects in {share:.2f} of them: with a greater clearance it stays higher")
        if success < ENOUGH:
            wrong.append(f"the expert of {task} succeeds in {success:.2f} of its episodes, and {ENOUGH} are enough")
    return "; ".join(wrong)


def _flag_of(out: Path) -> str:
    """Return the words by which a command finds robots in this folder."""
    from core.plugins import ROOT

    return "" if out.resolve() == ROOT else f"--config-dir {out} "


# ---- check


def check(place: str, wished: Wishes) -> None:
    """Try a robot that has a YAML. Raises ConfigError, and RunError if it does not work."""
    from deixis.robot_trial import config_of, measure, surveyed

    values = config_of(place, wished.fields)
    found = surveyed(values, wished.packages, workspaces())
    results = measure(values, wished.tasks, wished.episodes)
    _describe(values, found.share, found.touching)
    wrong = _tell_results(results, wished.episodes)
    if wrong:
        raise RunError(f"robot={values['name']} does not work: {wrong}")
    print(f"robot={values['name']} works")
