"""How often does a checkpoint do what it is told: `python evaluate.py checkpoint=<run dir or file> episodes=500`.

    checkpoint=...    a run directory, a checkpoint file (best.pt, last.pt), or a published policy (pretrained/<name>)
    episodes=500      fresh episodes, deterministic policy
    seed=0            of the evaluation, apart from every training run's own episodes
    worlds=20         that run side by side
    splits=false      true: a row for each of train, test_composition, test_paraphrase and test_length
    words=said        blank, swapped: judge the policy with no words, or with another episode's
    reader=policy     oracle: the parser finds the object and a scripted arm goes there, on the same episodes
    in_turn=0         scenes in which each object is named in turn, all else the same; instead of episodes
    by_hand=false     true: a window opens in which you move the person's finger with keys and watch the robot;
                      Escape ends it, or episodes=3 does; noise_deg, dropout and switch of the gesture are left out
    video=0           episodes to film as well, with the sentence on the frame
    out=<file>        where the result goes; a numbered file otherwise, in the run directory, or for a published policy
                      in outputs/
    task.num_objects=6 ...   any key of the run's config, to judge it elsewhere than it was trained

Prints success with its 95 % Wilson interval, overall and by kind of instruction, and saves it as JSON. Where somebody
points, also by angle to the nearest rival, number of objects, distance, and how far the ray strays, in the bins of
`trainers.rollout.evaluation.BINS`, with a picture beside the JSON. For more objects: task.min_objects=2
task.num_objects=8.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any

from conf.arguments import run, split
from conf.overrides import apply
from conf.schema import Checked, ConfigError, one_of, read, within


@dataclass(frozen=True, kw_only=True)
class EvaluateConfig(Checked):
    checkpoint: str
    episodes: int = within(1, 10_000_000)
    seed: int = within(0, 2**31 - 1)
    worlds: int = within(1, 4096)
    video: int = within(0, 100)
    splits: bool
    words: str = one_of("said", "blank", "swapped")
    reader: str = one_of("policy", "oracle")
    in_turn: int = within(0, 100_000)
    by_hand: bool
    out: str | None


DEFAULTS = {
    "episodes": 500,
    "seed": 0,
    "worlds": 20,
    "video": 0,
    "out": None,
    "splits": False,
    "words": "said",
    "reader": "policy",
    "in_turn": 0,
    "by_hand": False,
}
SPLITS = ("train", "test_composition", "test_paraphrase", "test_length")


def parse(arguments: list[str]) -> tuple[EvaluateConfig, list[str]]:
    """Our own keys, and the overrides of the run's config that are left. Raises ConfigError."""
    names = [field.name for field in fields(EvaluateConfig)]
    own, overrides = split(arguments, names, "checkpoint=<run dir>")
    if "checkpoint" not in own:
        raise ConfigError("checkpoint=<run dir or file> is missing")
    config = read(EvaluateConfig, DEFAULTS | own, "")
    if config.by_hand and (config.splits or config.in_turn or config.video):
        raise ConfigError("by_hand=true needs splits=false, in_turn=0 and video=0: every episode is chosen by hand")
    return config, overrides


def main(arguments: list[str]) -> dict[str, Any]:
    """Evaluate, print, save. Raises ConfigError."""
    config, overrides = parse(arguments)

    from trainers.reports.plots import pointing_plot
    from trainers.run import checkpoint
    from trainers.utils.atomic_io import write_json

    path = checkpoint.find(Path(config.checkpoint))
    saved = checkpoint.load(path)
    out = Path(config.out) if config.out else _numbered(path)
    out.parent.mkdir(parents=True, exist_ok=True)
    named = {
        split: _judge(config, saved, [*overrides, f"task.split={split}"], None) for split in SPLITS * config.splits
    }
    result = named["train"] if named else _judge(config, saved, overrides, out)
    report: dict[str, Any] = {
        "checkpoint": str(path),
        "seed": config.seed,
        "words": config.words,
        "reader": config.reader,
    }
    report |= {"overrides": overrides, **result}
    if named:
        report["by_split"] = named
    write_json(out, report)
    if "by_pointing" in report:
        title = f"success of {report['episodes']} episodes by what they point at"
        pointing_plot(report["by_pointing"], out.with_suffix(".png"), title)
    print(describe(report, out))
    return report


def _judge(config: EvaluateConfig, saved: dict[str, Any], overrides: list[str], film: Path | None) -> dict[str, Any]:
    """One evaluation with these overrides, and a film beside `film` where there is one."""
    cfg = apply(saved["config"], overrides)

    from envs.config import read_env
    from envs.interactive.by_hand import ByHandEnv
    from train import build_env
    from trainers.algorithms.build import fitted_policy
    from trainers.rollout.collection import derive_seed
    from trainers.rollout.evaluation import evaluate
    from trainers.rollout.video import record

    config_of_env = read_env(cfg).judged()
    make = partial(build_env, config_of_env)
    seed = derive_seed(config.seed, 2**20, evaluation=True)
    worlds = (
        cfg["task"]["num_objects"] * max(1, cfg["task"].get("num_targets", 0))
        if config.in_turn
        else min(config.worlds, config.episodes)
    )
    env = ByHandEnv(config_of_env, seed) if config.by_hand else make(worlds, seed)
    try:
        policy = fitted_policy(saved, cfg, env).act
        actor = _actor(config, env, policy)
        if config.by_hand:
            return _by_hand(env, actor, config.episodes)
        if config.in_turn:
            return _in_turn(env, actor, config.in_turn, seed)
        result = evaluate(env, actor, config.episodes, seed).as_dict()
    finally:
        env.close()
    if config.video and film:
        stage = make(1, seed, render=True)
        record(stage, policy, film.with_suffix(".mp4"), config.video)
        stage.close()
    return result


def _actor(config: EvaluateConfig, env: Any, policy: Any) -> Any:
    """Who acts: the policy, the policy with other words, or the parser with a scripted arm."""
    from envs.experts import Oracle
    from trainers.rollout.instruction_ablations import Misheard

    if config.reader == "oracle":
        if not env.task.speaks:
            raise ConfigError(f"reader=oracle needs a task with words; {env.config.task.name} has none")
        return Oracle(env)
    if config.words == "swapped" and env.batch_size[0] < 2:
        raise ConfigError(f"words=swapped needs worlds of at least 2; worlds={env.batch_size[0]}")
    return policy if config.words == "said" else Misheard(policy, config.words)


def _by_hand(env: Any, actor: Any, episodes: int) -> dict[str, Any]:
    """What came of the episodes in which a person at the window chose what is meant."""
    from envs.interactive.by_hand import run_by_hand
    from human.suppress_stdout import suppress_stdout
    from trainers.rollout.evaluation import wilson

    with suppress_stdout():  # Bullet's window talks as it is closed
        played = run_by_hand(env, actor, episodes, *env.user_interface())
    successes = sum(each.success for each in played)
    return {
        "by_hand": True,
        "episodes": len(played),
        "success_at_end": successes / max(len(played), 1),
        "wrong_object": sum(each.wrong_object for each in played) / max(len(played), 1),
        "ci95": list(wilson(successes, len(played))),
        "played": [vars(each) for each in played],
    }


def _in_turn(env: Any, actor: Any, scenes: int, seed: int) -> dict[str, Any]:
    """The share of objects that the arm goes to when each object of a scene is named in turn, all else the same."""
    import numpy as np

    from trainers.rollout.evaluation import wilson
    from trainers.rollout.instruction_ablations import run_to_end

    if not env.task.speaks:
        raise ConfigError(f"in_turn needs a task with words; {env.config.task.name} has none")
    reached: list[bool] = []
    for scene in range(scenes):
        episodes = env.task.each_in_turn(np.random.default_rng([seed, scene]))
        success = run_to_end(env, actor, env.start(episodes, seed + scene))
        reached += success[: len(episodes)].tolist()
    return {
        "scenes": scenes,
        "episodes": len(reached),
        "success_at_end": sum(reached) / len(reached),
        "ci95": list(wilson(sum(reached), len(reached))),
    }


def describe(report: dict[str, Any], out: Path) -> str:
    """The result as a person reads it: overall, by kind of instruction, by what makes a gesture hard, and by split."""
    from trainers.reports.plots import bin_name

    lines = [_line(kind, part) for kind, part in report.get("by_kind", {}).items()]
    lines += [
        _line(f"{name} {bin_name(name, part['range'])}", part)
        for name, bins in report.get("by_pointing", {}).items()
        for part in bins
    ]
    whole = [_line(split, part) for split, part in report.get("by_split", {"all": report}).items()]
    return "\n".join([*lines, *whole, f"saved in {out}"])


def _line(name: str, part: dict[str, Any]) -> str:
    low, high = part["ci95"]
    others = [("success_once", "success_once"), ("wrong object", "wrong_object")]
    rest = [f"{words} {part[key]:.3f}" for words, key in others if key in part]
    return ", ".join(
        [
            f"{name:16} success_at_end {part['success_at_end']:.3f} (95 %: {low:.3f}-{high:.3f})",
            *rest,
            f"{part['episodes']} episodes",
        ]
    )


def _numbered(path: Path) -> Path:
    """A file that does not exist yet, in the run directory or else in outputs/: nothing is overwritten."""
    folder, name = path.parent, "evaluation"
    if path.suffix == ".safetensors":
        folder, name = Path("outputs"), f"evaluation_{path.resolve().parent.name}"
    elif folder.name == "checkpoints":
        folder = folder.parent
    names = (folder / f"{name}_{i}.json" for i in range(1, 10_000))
    return next(name for name in names if not name.exists())


def cli(words: Sequence[str] | None = None) -> None:
    """The program: `main` with `words`, by default those of this process. Exits with one line for bad input."""
    run(main, __doc__, words)


if __name__ == "__main__":
    cli()
