"""Let a policy drive an arm: `python deploy.py checkpoint=nl_reach_kuka arm=sim instruction="reach the red cube"`.

    checkpoint=...     a run directory, a checkpoint file, or a pretrained policy by name: with its robot, task, control
    arm=sim            which arm: sim is the twin, the simulated world in another process; others: docs/deployment.md
    arm.<key>=...      its settings: arm.latency=0.06 arm.gains=0.2
    instruction=...    one sentence, which is carried out; with arm=sim, episodes=200 evaluates the policy instead
    episodes=1         number of episodes of the twin, judged by where things really are there
    scene=<file>       a YAML file that says where the objects are, for an arm that sees none
    safety.<key>=...   the rules that every target passes: safety.speed=0.5 safety.deadman=1 safety.dry_run=true
    predict=true       show the policy where the arm will be once it has done what it was sent; false: where it was seen
    log=<file>         every command, as JSON lines; default: deploy_<date>.jsonl in outputs/ with an instruction
    seed=0             of the twin's episodes
    out=<file>         file of the result of the episodes, as JSON
    task.num_objects=6 ...   any key of the config

In a terminal, space and Ctrl-C stop the arm and end the program. With safety.deadman=1 another key must be held down,
or the arm holds.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from core.command_line import check_file, split
from core.errors import ConfigError, RunError
from core.machine_limits import require_docstrings
from core.overrides import apply
from core.program import run_program
from core.schema import Checked, any_path, checked_by, read, within

if TYPE_CHECKING:
    from deployment.connecting import ArmChoice
    from deployment.mirror import MirrorEnv
    from deployment.terminal import Terminal

MOST_STEPS = 2400  # control steps of an instruction: two minutes at 20 Hz


@dataclass(frozen=True, kw_only=True)
class DeployConfig(Checked):
    """The program's own keys; see the top of this file."""

    checkpoint: str = any_path()
    instruction: str | None = checked_by("the session", default=None)
    episodes: int = within(1, 1_000_000, default=1)
    seed: int = within(0, 2**31 - 1, default=0)
    out: str | None = any_path(default=None)


def parse(arguments: list[str]) -> tuple[DeployConfig, ArmChoice, list[str]]:
    """Read the program's own keys and the arm; return them and the overrides of the config. Raises ConfigError."""
    from deployment.connecting import split_arm

    choice, others = split_arm(arguments)
    own, overrides = split(others, [field.name for field in fields(DeployConfig)], "checkpoint=<run dir>")
    if "checkpoint" not in own:
        raise ConfigError("checkpoint=<run dir or file> is missing")
    if choice is None:
        raise ConfigError("arm=<name> is missing: arm=sim is the simulated twin")
    config = read(DeployConfig, own, "")
    if config.instruction is None and choice.name != "sim":
        raise ConfigError(f'arm={choice.name} needs instruction="...": only the twin, arm=sim, has episodes')
    if config.instruction is not None and (config.episodes != 1 or config.out):
        raise ConfigError("episodes and out need no instruction: each episode of the twin has its own")
    if config.instruction is None and choice.scene is not None:
        raise ConfigError(f'scene={choice.scene} needs instruction="...": episodes of the twin draw their own scenes')
    return config, choice, overrides


def main(arguments: list[str]) -> dict[str, Any]:
    """Drive the arm, and return the result of episodes.

    Raises:
        ConfigError: for bad input.
        RunError: the arm does not answer, was stopped, or did not do what it was told.
    """
    require_docstrings()
    config, choice, overrides = parse(arguments)
    import torch

    from core.system import StopSignal
    from deployment.arm import ArmError
    from deployment.connecting import about
    from deployment.terminal import HELP, Terminal

    torch.set_num_threads(1)  # threads that wait for each other are late where another process is busy
    print(about(choice), flush=True)
    with StopSignal() as stop, Terminal(stop) as terminal:
        if terminal.is_there:
            print(HELP, flush=True)
        elif float(choice.rules.get("deadman", 0)):
            raise ConfigError(f"safety.deadman={choice.rules['deadman']} needs a terminal: its keys are read there")
        try:
            if config.instruction is not None:
                return _instruct(config, choice, overrides, terminal)
            return _episodes(config, choice, overrides, terminal)
        except ArmError as error:
            raise RunError(str(error)) from None


# ---- one instruction


def _instruct(config: DeployConfig, choice: ArmChoice, overrides: list[str], terminal: Terminal) -> dict[str, Any]:
    """Carry out one sentence. Raises ConfigError for words that are not understood."""
    from demo.session import Session
    from demo.session_config import make_config
    from deployment.connecting import in_force
    from language import Plan
    from trainers.run import checkpoint

    path = checkpoint.find(Path(config.checkpoint))
    saved = checkpoint.load(path, given=overrides)["config"]
    chosen = {group: saved[group]["name"] for group in ("task", "robot", "control", "workspace")}
    if choice.log is None:
        choice = replace(choice, log=f"outputs/deploy_{time.strftime('%Y-%m-%d_%H-%M-%S')}.jsonl")
    session_config = make_config(**chosen, checkpoint=str(path), overrides=overrides)
    with closing(Session(session_config, config.seed, arm=choice, person=terminal)) as session:
        print(in_force(choice, session.env.config), flush=True)
        print(f"objects: {', '.join(session.object_names())}", flush=True)
        outcome = session.say(str(config.instruction))
        if not isinstance(outcome, Plan):
            raise ConfigError(f"instruction={config.instruction}: {outcome.message}")
        steps = _carry_out(session)
        if not session.view.status.startswith("Done"):
            raise RunError(f"{session.view.status} Commands: {choice.log}")
        print(f"{session.view.status} Commands: {choice.log}")
        return {"status": session.view.status, "steps": steps, "log": choice.log}


def _carry_out(session: Any) -> int:
    """Step until the instruction is done. Returns the control steps. Raises RunError if the arm was stopped."""
    told: set[str] = set()
    for step in range(MOST_STEPS):
        if session.arm.safety.stopped:
            raise RunError(f"the arm was stopped: {session.arm.safety.stopped}")
        if not session.busy:
            return step
        session.step()
        for reason in session.env.world.decision.reasons:
            if (kind := _without_numbers(reason)) not in told:
                print(reason, flush=True)
                told.add(kind)
    raise RunError(f"the instruction was not done within {MOST_STEPS * session.period:.0f} s")


# ---- episodes of the twin


def _episodes(config: DeployConfig, choice: ArmChoice, overrides: list[str], terminal: Terminal) -> dict[str, Any]:
    """Evaluate the policy over episodes of the twin, print the result and save it."""
    from deployment.connecting import connect, in_force
    from envs.config import read_env
    from trainers.evaluation.evaluation import wilson
    from trainers.run import checkpoint
    from trainers.utils.files import write_json

    out = None if config.out is None else check_file("out", config.out)
    saved = checkpoint.load(checkpoint.find(Path(config.checkpoint)), given=overrides)
    composed = apply(saved["config"], overrides)
    started = time.monotonic()
    setup = read_env(composed).without_curriculum()
    print(in_force(choice, setup), flush=True)
    with closing(connect(choice, setup, terminal, config.seed)) as env:
        policy = checkpoint.fitted_policy(saved, composed, env).act
        result = run_twin(env, policy, config.episodes, config.seed, lambda: terminal.ended)
    low, high = wilson(result["successes"], result["episodes"])
    result |= {"checkpoint": config.checkpoint, "seed": config.seed, "arm": choice.settings, "rules": choice.rules}
    result |= {"success": result["successes"] / max(1, result["episodes"]), "ci95": [low, high]}
    each = result["steps"] / max(1, result["episodes"])
    print(
        f"success {result['success']:.3f} (95 %: {low:.3f}-{high:.3f}) of {result['episodes']} episodes, {each:.0f} "
        f"control steps each; stopped {sum(result['stops'].values())}; {time.monotonic() - started:.0f} s"
    )
    for name in ("stops", "reasons"):
        for reason, count in Counter(result[name]).most_common(8):
            print(f"  {count} x {reason}")
    if out is not None:
        out.parent.mkdir(parents=True, exist_ok=True)
        write_json(out, result)
        print(f"saved in {out}")
    return result


def run_twin(env: MirrorEnv, policy: Any, episodes: int, seed: int, stop: Any = lambda: False) -> dict[str, Any]:
    """Run episodes with the deterministic policy, each until the twin has judged it or the arm was stopped.

    A twin to which nothing is sent judges nothing: a dry run's episodes end with the task's time.

    Args:
        env: of a twin.
        policy: writes "action"; it does not receive the privileged keys.
        episodes: their number.
        seed: of the episodes.
        stop: called at each step; True ends the run early.

    Returns:
        episodes, successes, wrong_objects, steps: numbers. stops, reasons: how often each was the reason for a stop
        of the arm, or for another target than was wanted.
    """
    import torch
    from torchrl.envs.utils import ExplorationType, set_exploration_type

    arm: Any = env.arm.arm
    dry = env.arm.safety.config.dry_run
    totals, stops, reasons = Counter[str](), Counter[str](), Counter[str]()
    env.set_seed(seed)
    with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
        while totals["episodes"] < episodes and not stop():
            state = env.reset()
            while arm.verdict is None and not env.arm.safety.stopped and not (dry and bool(state["done"].any())):
                state["action"] = policy(state.exclude("privileged"))["action"]
                state = env.step(state)["next"]
                totals["steps"] += 1
                if env.world.decision is not None:
                    reasons.update(_without_numbers(reason) for reason in env.world.decision.reasons)
            totals["episodes"] += 1
            if env.arm.safety.stopped:
                stops[_without_numbers(env.arm.safety.stopped)] += 1
                env.arm.safety.release()
            elif arm.verdict is not None:
                totals["successes"] += arm.verdict.success
                totals["wrong_objects"] += arm.verdict.wrong_object
    counted = {name: totals[name] for name in ("episodes", "successes", "wrong_objects", "steps")}
    return counted | {"stops": dict(stops), "reasons": dict(reasons)}


def _without_numbers(reason: str) -> str:
    """Return a reason without what differs from one time to the next, so that it can be counted."""
    return " ".join("..." if word[:1] in "-0123456789" and word[-1:].isdigit() else word for word in reason.split())


def cli(words: Sequence[str] | None = None) -> None:
    """Run `main` with `words`, by default those of this process. Exits with one line for bad input."""
    run_program(main, __file__, words)


if __name__ == "__main__":
    cli()
