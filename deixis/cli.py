"""The console command `deixis`: one sub-command for each program of the project."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module

from core.errors import ConfigError, did_you_mean
from core.plugins import load_plugins
from core.program import program
from deixis import __version__
from deixis.origins import ForeignPackageError, check_origins

WRONG = 2  # exit code for an unknown sub-command


@dataclass(frozen=True)
class Program:
    """A sub-command. entry: its module and function. about: one line of the help."""

    entry: str
    about: str

    def load(self) -> Callable[[], int | None]:
        """Return the function, which reads `sys.argv`. Raises ForeignPackageError as `check_origins` does."""
        module, _, function = self.entry.partition(":")
        check_origins(module.split(".")[0])
        return getattr(import_module(module), function)


PROGRAMS = {
    "train": Program("train:cli", "train a policy: deixis train robot=panda task=nl_reach"),
    "warm": Program("deixis.warm:cli", "compile gradient steps before a run needs them: deixis warm algo=sac"),
    "evaluate": Program(
        "evaluate:cli", "success of a policy on fresh episodes: deixis evaluate checkpoint=nl_reach_kuka"
    ),
    "play": Program("play:cli", "talk to a robot and point, in the browser: deixis play"),
    "deploy": Program(
        "deploy:cli", 'a policy on an arm: deixis deploy checkpoint=nl_reach_kuka arm=sim instruction="reach ..."'
    ),
    "record": Program("record:cli", "demonstrations for LeRobot or Minari: deixis record checkpoint=nl_reach_kuka"),
    "export": Program(
        "deixis.export:cli", "a policy for programs without Deixis: deixis export checkpoint=nl_reach_kuka format=onnx"
    ),
    "robot": Program("deixis.robot:cli", "your own arm, from its URDF: deixis robot add arm.urdf"),
    "calibrate": Program(
        "deixis.calibrate:cli", "where a camera is, from a printed board or the gripper: deixis calibrate board"
    ),
    "look": Program("deixis.look:cli", "what a camera sees: deixis look picture.png --camera front.yaml"),
    "study": Program("demo.study.export:cli", "the data of a study as CSV and JSON: deixis study export study.sqlite"),
    "report": Program("trainers.reports.report:cli", "tables and figures of finished runs: deixis report outputs"),
    "parse": Program("language.__main__:run", 'what a sentence asks for: deixis parse "reach the red cube"'),
    "describe": Program(
        "language.__main__:run", "a name for each object of a scene: deixis describe --scene scene.yaml"
    ),
    "hear": Program("language.__main__:run", "the words of a spoken sentence: deixis hear said.wav --scene scene.yaml"),
}
SHARED = ("parse", "describe", "hear")  # sub-commands of `python -m language`, which reads their names itself


def main() -> int:
    """Run the sub-command that `sys.argv` names, and return the exit code."""
    with program():
        return _main()


def _main() -> int:
    words = sys.argv[1:]
    if not words or words[0] in ("-h", "--help"):
        print(usage())
        return 0
    if words[0] in ("-V", "--version"):
        print(f"deixis {__version__}")
        return 0
    name, *rest = words
    if name not in PROGRAMS:
        print(f"error: {name} is not a command of deixis{did_you_mean(name, PROGRAMS)}", file=sys.stderr)
        return WRONG
    sys.argv = ["deixis", *words] if name in SHARED else [f"deixis {name}", *rest]
    if name in SHARED:
        load_plugins()  # verbs and relations of own packages; the other programs import them with `envs`
    try:
        return PROGRAMS[name].load()() or 0
    except ForeignPackageError as error:
        raise ConfigError(str(error)) from None


def usage() -> str:
    """Return the text of `deixis --help`."""
    width = max(map(len, PROGRAMS))
    lines = [f"  {name:{width}}  {program.about}" for name, program in PROGRAMS.items()]
    return "\n".join(
        [
            "usage: deixis <command> [key=value ...]",
            "",
            "Robot arms that do what a sentence and a pointing finger ask, trained by reinforcement learning.",
            "",
            "commands:",
            *lines,
            "",
            "deixis <command> --help lists what a command takes; deixis --version prints the version.",
        ]
    )
