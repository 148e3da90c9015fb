"""How often scripted experts succeed, with every robot, control and task: no task is impossible.

    python -m benchmarks.experts --episodes 200
    python -m benchmarks.experts --episodes 200 --tasks nl_push,swipe --robots kuka --oracle
    python -m benchmarks.experts --episodes 200 --tasks nl_lift,nl_stack --robots so_arm --gripper hinge

Episodes begin at their start, without a curriculum. With `--oracle` each expert is given the words and the gesture
only, which it reads with the parser. The results are added to docs/experts.json.
"""

from __future__ import annotations

import argparse
import json
from contextlib import closing
from pathlib import Path
from typing import Any

from core.overrides import compose
from envs import read_env
from envs.experts import EXPERTS, Oracle, expert
from envs.workspace_env import WorkspaceEnv
from trainers.evaluation.evaluation import evaluate

ROOT = Path(__file__).resolve().parents[1]
ROBOTS, CONTROLS = ("kuka", "panda", "jaco"), ("step", "absolute", "joints")
WORLDS = 8
SHOWN = ("episodes", "success_at_end", "ci95", "wrong_object", "disturbed", "mean_length")
ENOUGH = 0.95


def measured(options: list[str], episodes: int, seed: int, oracle: bool) -> dict[str, Any]:
    """Return the result of one expert. options: of the config."""
    config = read_env(compose(options))
    with closing(WorkspaceEnv(config.without_curriculum(), WORLDS, seed)) as env:
        actor = Oracle(env) if oracle and env.task.traits.speaks else expert(env)
        result = evaluate(env, actor, episodes, seed).as_dict()  # type: ignore[arg-type]
    return {name: result[name] for name in SHOWN}


def written(path: Path, name: str, result: dict[str, Any]) -> None:
    """Add a result to the file."""
    known = json.loads(path.read_text()) if path.exists() else {}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(dict(sorted((known | {name: result}).items())), indent=1) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for option, default in (("tasks", tuple(EXPERTS)), ("robots", ROBOTS), ("controls", CONTROLS)):
        parser.add_argument(f"--{option}", default=",".join(default), help="separated by commas")
    parser.add_argument("--gripper", help="of conf/gripper/; by default the task's, or each robot's own")
    parser.add_argument("--episodes", type=int, default=200)
    parser.add_argument("--seed", type=int, default=100)
    parser.add_argument("--oracle", action="store_true", help="experts are given the words and the gesture only")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "experts.json")
    given = parser.parse_args()
    short = []
    for task in given.tasks.split(","):
        for robot in given.robots.split(","):
            for control in given.controls.split(","):
                options = [f"task={task}", f"robot={robot}", f"control={control}"]
                options += [f"gripper={given.gripper}"] if given.gripper else []
                name = f"{task} {robot} {control}" + f" {given.gripper}" * bool(given.gripper)
                name += " oracle" * given.oracle
                result = measured(options, given.episodes, given.seed, given.oracle)
                written(given.out, name, result)
                print(f"{name:40} {result['success_at_end']:.3f}  {result['mean_length']:5.1f} steps", flush=True)
                short += [name] * (result["success_at_end"] < ENOUGH)
    print("below", ENOUGH, ":", ", ".join(short) or "none")


if __name__ == "__main__":
    main()
