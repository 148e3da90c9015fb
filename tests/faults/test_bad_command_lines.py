"""Bad command lines of every program: one sentence that names the word and what would be right, no traceback."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from core.overrides import groups
from tools.forked import call
from trainers.export import policy_file

PROGRAMS = ("train", "evaluate", "play", "record", "deploy")
POLICY = "checkpoint=nl_reach_kuka"
FEW = ("episodes=1", "worlds=1")
BAD_VALUES = ("x", "-1", "1e99", "nan", "[1,2]", "{a: 1}", "null", "", "???", "${nosuch}", "${oc.env:HOME}")
NUMBER_KEYS = ("total_frames", "seed", "eval.episodes", "collector.worlds", "algo.lr", "algo.horizon", "task.max_steps")
BAD_FORMS = (
    "{key}",
    "{key}=",
    "={key}",
    "~{key}",
    "+{key}x=1",
    "{key}x=1",
    "{key}==1",
    "{key} =",
    "--{key}",
    "{key}@a=1",
)
FIXED = (
    ("train", "device=meta"),
    ("train", "device=abacus"),
    ("train", "task.objects=[1,2]"),
    ("train", "robot=kuka,panda"),
    ("train", "-m", "seed=range(0,0)"),
    ("train", "-m", "seed=1,2", "hydra.sweep.dir=/proc/x"),
    ("train", "-m", "seed=1,2", "resume=x"),
    ("train", "-m", "seed=1,2", "hydra.launcher.n_jobs=x"),
    ("train", "-m", "robot=kuka,pand"),
    ("train", "-m", "sweep.jobs=0", "seed=1,2"),
    ("train", "hydra/launcher=nosuch"),
    ("train", "hydra.run.dir=/proc/x"),
    ("train", "hydra.run.dir=/dev/null"),
    ("train", "hydra.nosuch=1"),
    ("train", "--config-dir=/nosuch"),
    ("train", "--config-name=x"),
    ("train", "--experimental-rerun", "x.pickle"),
    ("train", "--cfg"),
    ("train", "--cfg", "jobs"),
    ("train", "сид=1"),
    ("train", "种子=1"),
    ("train", "resume=/nowhere"),
    ("train", "resume=/proc"),
    ("train", "sweep.resume=/proc"),
    ("train", "sweep.resume=/nowhere"),
    ("train", "robot.urdf=/etc/passwd"),
    ("train", "robot.urdf=../../x"),
    ("train", "logger=[books]"),
    ("train", "algo.minibatch=100_000"),
    ("train", "policy.networks=3", "task=nl_reach"),
    ("train", "task=rearrange", "workspace=table"),
    ("evaluate",),
    ("evaluate", "checkpoint=/etc/passwd"),
    ("evaluate", POLICY, "robot=panda"),
    ("evaluate", POLICY, "out=/proc/x.json", *FEW),
    ("evaluate", POLICY, "out=/tmp", *FEW),
    ("evaluate", POLICY, "out=/dev/null/x.json", *FEW),
    ("evaluate", POLICY, "episodes=1", "episodes=2"),
    ("evaluate", POLICY, "task.objects=[1,2]", *FEW),
    ("evaluate", POLICY, "gesture=ray", *FEW),
    ("evaluate", POLICY, "words=loud", *FEW),
    ("evaluate", POLICY, "words=swapped", *FEW),
    ("evaluate", POLICY, "reader=parrot", *FEW),
    ("evaluate", POLICY, "splits=true", "by_hand=true"),
    ("evaluate", POLICY, "scenario=2", *FEW),
    ("play", "--headless", "/proc/x.mp4", "--say", "reach {0}"),
    ("play", "--headless", "/tmp", "--say", "reach {0}"),
    ("play", "--headless", "x.nosuch", "--say", "reach {0}"),
    ("play", "--headless", "x.mp4"),
    ("play", "--say", "reach {0}"),
    ("play", "--gui"),
    ("play", "--port", "0"),
    ("play", "--port", "x"),
    ("play", "--seed", "-1"),
    ("play", "--host", "no.such.host.invalid"),
    ("play", "checkpoint=pretrained/nl_reach_panda", "robot=kuka", "--headless", "x.mp4", "--say", "reach {0}"),
    ("play", "objects=9"),
    ("play", "driver=x"),
    ("play", "robot"),
    ("record",),
    ("record", "expert=true", "task=reach", "out=/proc/x", "episodes=1"),
    ("record", "expert=true", "task=reach", "out=/dev/null/x", "episodes=1"),
    ("record", "expert=true", "format=x"),
    ("record", "replay=/nosuch"),
    ("record", "replay=/proc"),
    ("record", "replay=x", "episodes=3"),
    ("deploy",),
    ("deploy", POLICY, "arm=nosuch"),
    ("deploy", POLICY, "arm=sim", "arm.nosuch=1"),
    ("deploy", POLICY, "arm=sim", "safety.nosuch=1"),
    ("deploy", POLICY, "arm=sim", "scene=/nosuch"),
    ("deploy", POLICY, "arm=sim", "scene=/proc"),
    ("deploy", POLICY, "arm=sim", "log=/proc/x"),
    ("deploy", POLICY, "arm=sim", "out=/proc/x"),
    ("deploy", "checkpoint=anything_kuka", "arm=sim"),
)


def bad_command_lines() -> Iterator[tuple[str, ...]]:
    """Yield programs, each with words that they must refuse."""
    yield from FIXED
    for key in NUMBER_KEYS:
        for value in BAD_VALUES:
            if (key, value) not in (("algo.lr", "null"), ("seed", "null")):
                yield "train", f"{key}={value}"
    for key in ("seed", "robot", "task.num_objects"):
        yield from (("train", form.format(key=key)) for form in BAD_FORMS)
    for group in groups():
        yield "train", f"{group}=nosuch"
        yield from ((program, POLICY, f"{group}=nosuch") for program in ("evaluate", "record"))
    for key in ("episodes", "seed", "worlds", "video", "in_turn"):
        yield from (("evaluate", POLICY, f"{key}={value}") for value in BAD_VALUES)
    for key in ("episodes", "seed", "predict", "arm.latency", "arm.seed", "safety.watchdog", "safety.dry_run"):
        yield from (("deploy", POLICY, "arm=sim", f"{key}={value}") for value in BAD_VALUES)
    for key in ("episodes", "seed", "expert", "tolerance"):
        yield from (
            ("record", POLICY, f"{key}={value}") for value in BAD_VALUES if (key, value) != ("tolerance", "1e99")
        )


def _failure(program: str, words: list[str], folder: Path) -> str:
    outcome = call(partial(_run, program, words), folder, timeout=60.0)
    line = f"{program} {' '.join(words)}: "
    if outcome.has_traceback:
        return line + "traceback: " + (outcome.err.strip().splitlines() or ["killed"])[-1][:150]
    if outcome.code == 0:
        return line + "exit code 0"
    if not outcome.message:
        return line + "no message of one line: " + outcome.err.strip()[:150]
    return "" if _names(outcome.message, words) else line + "the message names no word: " + outcome.message[:150]


def _names(message: str, words: list[str]) -> bool:
    """Return whether the message names the key of one of the words, and says more than that."""
    keys = [word.partition("=")[0].lstrip("+~-").partition("@")[0].strip() for word in words] or ["checkpoint"]
    return any(
        (key or word) in message and len(message) > len(word) for key, word in zip(keys, words or keys, strict=True)
    )


def _run(program: str, words: list[str]) -> None:
    import importlib

    sys.argv = [f"{program}.py", *words]
    run: Callable[[list[str]], None] = importlib.import_module(program).cli
    run(list(words))


@pytest.mark.slow
def test_a_bad_command_line_is_refused_in_one_line_that_names_the_word(row, tmp_path):
    """No traceback, no exit code 0. Each program runs in a fork."""
    import trainers.algorithms.algorithm  # noqa: F401  imported once, before the forks

    (tmp_path / "pretrained").symlink_to(policy_file.FOLDER)
    every = list(dict.fromkeys(bad_command_lines()))
    number = row.number(sample=10, thorough=len(every))
    for program, *words in every if number >= len(every) else row.rng.sample(every, number):
        row.count(_failure(program, words, tmp_path))
    row.check()
