"""Evaluate a policy on fresh episodes: `python evaluate.py checkpoint=<run dir or file> episodes=500`.

    checkpoint=...    a run directory, a checkpoint file (best.pt, last.pt), or a pretrained policy by name
    episodes=500      number of episodes, with the deterministic policy
    seed=0            of the evaluation; its episodes are not those of a training run
    worlds=20         simulated in parallel
    splits=false      true: one row for each of train, test_composition, test_paraphrase and test_length
    words=said        instruction ablations: blank (no words) or swapped (those of another episode)
    reader=policy     oracle: the parser finds the object and a scripted arm goes there, on the same episodes;
                      expert: the scripted arm knows the referent and the target
    specialists=null  a sweep's directory with a run for each verb (task.verbs=[stack],[open],...): the run of the verb
                      that is said acts in place of the checkpoint; needs task=anything
    robustness=false  true: also with other start poses, sizes, masses, friction, numbers of objects, time steps and
                      workspaces, and with noise and delay; one row for each, and its success over the plain one
    in_turn=0         number of scenes in which each object is named in turn, with all else equal; replaces episodes
    by_hand=false     true: a window opens in which you move the person's finger with keys and watch the robot;
                      Escape or episodes=3 ends it; noise_deg, dropout and switch of the gesture are switched off
    chains=0          number of chains: instructions one after another in the same world, until one is not carried out;
                      replaces episodes, and needs task=anything
    length=5          instructions of a chain
    video=0           number of additional episodes to record, with the sentence below each frame
    shards=null       the episodes are shared out over so many seeds; null = 1, with collector=ray one for 500 episodes
    collector=local   ray: the shards are evaluated on a Ray cluster, with the same result: docs/cluster.md
    out=<file>        file of the result; default: a numbered file in the run directory, or in outputs/ for a
                      pretrained policy
    task.num_objects=6 ...   any key of the run's config, to evaluate under other conditions than in training

Prints the success rate with its 95 % Wilson interval, overall and by kind of instruction, and saves it as JSON. Beside
it stands `disturbed`: the share of successful episodes in which an object was moved by more than 1 cm that the task
does not move; the line "moved" says what was moved, and how far. With gestures it also prints success by angle to the
nearest rival, number of objects, distance, and angular error of the ray, in the bins of
`trainers.evaluation.evaluation.BINS`, and saves a figure beside the JSON. For more objects: task.min_objects=2
task.num_objects=8.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from core.command_line import check_file, split
from core.errors import ConfigError
from core.machine_limits import require_docstrings, require_threads
from core.overrides import apply
from core.program import run_program
from core.schema import Checked, any_path, one_of, read, within
from core.system import cores

if TYPE_CHECKING:
    from envs.tasks import RandomizeConfig
    from trainers.evaluation.evaluation import EpisodeOutcome


@dataclass(frozen=True, kw_only=True)
class EvaluateConfig(Checked):
    """The program's own keys; see the top of this file."""

    checkpoint: str = any_path()
    episodes: int = within(1, 10_000_000)
    seed: int = within(0, 2**31 - 1)
    worlds: int = within(1, 4096)
    video: int = within(0, 100)
    splits: bool
    words: str = one_of("said", "blank", "swapped")
    reader: str = one_of("policy", "oracle", "expert")
    specialists: str | None = any_path()
    robustness: bool
    in_turn: int = within(0, 100_000)
    chains: int = within(0, 1_000_000)
    length: int = within(1, 1000)
    by_hand: bool
    shards: int | None = within(1, 10_000)
    collector: str = one_of("local", "ray")
    out: str | None = any_path()


DEFAULTS = {
    "episodes": 500,
    "seed": 0,
    "worlds": 20,
    "video": 0,
    "out": None,
    "splits": False,
    "words": "said",
    "reader": "policy",
    "specialists": None,
    "robustness": False,
    "in_turn": 0,
    "chains": 0,
    "length": 5,
    "by_hand": False,
    "shards": None,
    "collector": "local",
}
ALONE = {  # modes other than plain episodes, with the keys that must keep their defaults
    "by_hand": ("splits", "in_turn", "video", "shards", "collector"),
    "in_turn": ("shards", "collector"),
    "chains": ("splits", "in_turn", "by_hand", "video", "shards", "collector"),
    "robustness": ("splits", "in_turn", "by_hand", "chains"),
}
SEED_INDEX = 2**20  # of the seed of the first shard: neither training nor its evaluations use it
SPLITS = ("train", "test_composition", "test_paraphrase", "test_length")


def parse(arguments: list[str]) -> tuple[EvaluateConfig, list[str]]:
    """Read the program's own keys, and return the other words: overrides of the run's config. Raises ConfigError."""
    names = [field.name for field in fields(EvaluateConfig)]
    own, overrides = split(arguments, names, "checkpoint=<run dir>")
    _refuse_keys_of_training(overrides)
    if "checkpoint" not in own:
        raise ConfigError("checkpoint=<run dir or file> is missing")
    config = read(EvaluateConfig, DEFAULTS | own, "")
    if config.specialists and config.reader != "policy":
        raise ConfigError(f"specialists={config.specialists} needs reader=policy; reader={config.reader}")
    for mode, others in ALONE.items():
        if getattr(config, mode) and any(getattr(config, other) != DEFAULTS[other] for other in others):
            needed = ", ".join(f"{other}={DEFAULTS[other]}".lower() for other in others)
            raise ConfigError(f"{mode}={getattr(config, mode)}".lower() + f" needs {needed}".replace("none", "null"))
    return config, overrides


def _refuse_keys_of_training(words: list[str]) -> None:
    """Raise ConfigError for a key of `eval`, which this program would read nowhere."""
    for word in words:
        group, _, name = word.partition("=")[0].partition(".")
        if group == "eval":
            own = {"video_episodes": "video"}.get(name, name)
            instead = f"give {own}=<number>" if own in DEFAULTS else "leave it out"
            raise ConfigError(f"{word}: eval.{name} is for the evaluations of train.py; {instead}")


def main(arguments: list[str]) -> dict[str, Any]:
    """Evaluate, print the result and save it as JSON.

    Returns:
        The values of the JSON file.

    Raises:
        ConfigError: for bad input.
    """
    require_docstrings()
    require_threads(2 * cores())
    config, overrides = parse(arguments)

    from trainers.reports.evaluation_text import describe
    from trainers.reports.plots import pointing_plot
    from trainers.run import checkpoint

    path = checkpoint.find(Path(config.checkpoint))
    saved = checkpoint.load(path, given=overrides)
    out = check_file("out", config.out or checkpoint.result_file(path), (".json",), new=True)
    if config.splits:
        _check_splits(saved["config"], overrides)
    if config.robustness:
        return _robustness(config, saved, overrides, path, out)
    by_split = {
        split: _evaluate(config, saved, [*overrides, f"task.split={split}"], None) for split in SPLITS * config.splits
    }
    result = by_split["train"] if by_split else _evaluate(config, saved, overrides, out)
    report: dict[str, Any] = {"checkpoint": str(path), "seed": config.seed, "words": config.words}
    report |= {"reader": config.reader, "specialists": config.specialists, "overrides": overrides, **result}
    report |= {"by_split": by_split} if by_split else {}
    _show_and_save(describe(report), report, out)
    if "by_pointing" in report:
        title = f"success of {report['episodes']} episodes by difficulty of the gesture"
        pointing_plot(report["by_pointing"], out.with_suffix(".png"), title)
    return report


def _check_splits(trained: dict[str, Any], overrides: list[str]) -> None:
    """Raise ConfigError, before the first split is evaluated, unless the task has all of them."""
    from envs.config import read_env

    for name in SPLITS:
        try:
            read_env(apply(trained, [*overrides, f"task.split={name}"]))
        except ConfigError as error:
            raise ConfigError(
                f"splits=true needs a task with held-out sentences, such as nl_reach_large: {error}"
            ) from None


def _show_and_save(text: str, report: dict[str, Any], out: Path) -> None:
    """Print the text, and save the report as JSON: in this order, so that a full disk loses no result."""
    from trainers.utils.files import write_json

    print(text, flush=True)
    out.parent.mkdir(parents=True, exist_ok=True)
    write_json(out, report)
    print(f"saved in {out}")


def _robustness(
    config: EvaluateConfig, saved: dict[str, Any], overrides: list[str], path: Path, out: Path
) -> dict[str, Any]:
    """Evaluate under each of the conditions, print the table and save the rows."""
    from envs.perturbed_conditions import Condition, each_condition
    from trainers.cluster.ray_map import evaluate_shards
    from trainers.reports.evaluation_text import table, with_ratios

    def success(condition: Condition) -> dict[str, Any]:
        function = partial(
            _evaluate_shard, config, saved, [*overrides, *condition.overrides], randomize=condition.randomize
        )
        return evaluate_shards(function, config.episodes, config.shards, config.collector == "ray")

    results, impossible = each_condition(apply(saved["config"], overrides), success)
    rows = with_ratios(results)
    text = "\n".join([table(rows), *(f"left out: {name}: {why}" for name, why in impossible.items())])
    report = {"checkpoint": str(path), "seed": config.seed, "reader": config.reader, "overrides": overrides}
    report |= {"robustness": rows, "impossible": impossible}
    _show_and_save(text, report, out)
    return report


def _evaluate(
    config: EvaluateConfig, saved: dict[str, Any], overrides: list[str], video: Path | None
) -> dict[str, Any]:
    """Evaluate with these overrides. video: a path whose suffix is replaced by .mp4; None for no video."""
    cfg = apply(saved["config"], overrides)

    from envs.config import read_env
    from train import build_env
    from trainers.cluster.ray_map import evaluate_shards
    from trainers.collect.worker import derive_seed
    from trainers.evaluation.video import record_video
    from trainers.run.checkpoint import fitted_policy
    from trainers.utils.files import atomic_path

    if config.by_hand or config.in_turn or config.chains:
        return _in_this_process(config, saved, cfg)
    function = partial(_evaluate_shard, config, saved, overrides)
    result = evaluate_shards(function, config.episodes, config.shards, config.collector == "ray")
    if config.video and video:
        video.parent.mkdir(parents=True, exist_ok=True)
        seed = derive_seed(config.seed, SEED_INDEX, evaluation=True)
        rendered = build_env(read_env(cfg).without_curriculum(), 1, seed, render=True)
        with closing(rendered), atomic_path(video.with_suffix(".mp4")) as file:
            record_video(rendered, fitted_policy(saved, cfg, rendered).act, file, config.video)
    return result


def _evaluate_shard(
    config: EvaluateConfig,
    saved: dict[str, Any],
    overrides: list[str],
    shard: tuple[int, int],
    randomize: RandomizeConfig | None = None,
) -> tuple[list[EpisodeOutcome], Sequence[str]]:
    """Run the episodes of a shard (its number, and how many) on any machine; return them and the names of the kinds."""
    from envs.config import read_env
    from train import build_env
    from trainers.collect.worker import derive_seed
    from trainers.evaluation.evaluation import run_episodes
    from trainers.run.checkpoint import fitted_policy

    cfg = apply(saved["config"], overrides)
    number, episodes = shard
    seed = derive_seed(config.seed, SEED_INDEX + number, evaluation=True)
    env_config = read_env(cfg).without_curriculum()
    env_config = env_config if randomize is None else env_config.randomized(randomize)
    env = build_env(env_config, min(config.worlds, episodes), seed)
    with closing(env):
        actor = _actor(config, env, fitted_policy(saved, cfg, env).act)
        return run_episodes(env, actor, episodes, seed), list(env.kind_names)


def _in_this_process(config: EvaluateConfig, saved: dict[str, Any], cfg: Any) -> dict[str, Any]:
    """Evaluate with by_hand, in_turn or chains."""
    from envs.config import read_env
    from envs.interactive.by_hand import ByHandEnv
    from train import build_env
    from trainers.collect.worker import derive_seed
    from trainers.evaluation.chains import run_chains, summarize_chains
    from trainers.evaluation.instruction_ablations import success_in_turn
    from trainers.run.checkpoint import fitted_policy

    env_config, seed = read_env(cfg).without_curriculum(), derive_seed(config.seed, SEED_INDEX, evaluation=True)
    worlds = cfg["task"]["num_objects"] * max(1, cfg["task"].get("num_targets", 0))
    if config.chains:
        env_config, worlds = env_config.with_instructions(config.length), min(config.worlds, config.chains)
    env = ByHandEnv(env_config, seed) if config.by_hand else build_env(env_config, worlds, seed)
    with closing(env):
        actor = _actor(config, env, fitted_policy(saved, cfg, env).act)
        if config.by_hand:
            return _by_hand(env, actor, config.episodes)
        if config.chains:
            return summarize_chains(run_chains(env, actor, config.chains, seed), config.length, env.kind_names)
        return success_in_turn(env, actor, config.in_turn, seed)


def _actor(config: EvaluateConfig, env: Any, policy: Any) -> Any:
    """Build the actor: policy or specialists, also with ablated instructions, oracle or expert. Raises ConfigError."""
    from envs.experts import Oracle, expert
    from trainers.evaluation.instruction_ablations import AblatedInstructions

    if config.reader == "oracle":
        if not env.task.traits.speaks:
            raise ConfigError(f"reader=oracle needs a task with words; {env.config.task.name} has none")
        return Oracle(env)
    if config.reader == "expert":
        return expert(env)
    if config.specialists:
        from trainers.evaluation.specialists import load_specialists

        policy = load_specialists(Path(config.specialists), env, lambda: env.state.kind)
    if config.words == "swapped" and env.batch_size[0] < 2:
        raise ConfigError(f"words=swapped needs worlds of at least 2; worlds={env.batch_size[0]}")
    return policy if config.words == "said" else AblatedInstructions(policy, config.words)


def _by_hand(env: Any, actor: Any, episodes: int) -> dict[str, Any]:
    """Evaluate episodes in which a person at the window chooses the referent."""
    from core.system import suppress_stdout
    from envs.interactive.by_hand import run_by_hand
    from trainers.evaluation.evaluation import summarize_by_hand

    keys, display = env.user_interface()
    with suppress_stdout():  # PyBullet prints when its window is closed
        return summarize_by_hand(run_by_hand(env, actor, episodes, keys=keys, display=display))


def cli(words: Sequence[str] | None = None) -> None:
    """Run `main` with `words`, by default those of this process. Exits with one line for bad input."""
    run_program(_main, __file__, words)


def _main(arguments: list[str]) -> None:
    if "collector=ray" not in arguments:
        main(arguments)
        return
    from trainers.cluster.supervised_run import run_apart

    run_apart(partial(main, arguments), Path(__file__), arguments, "evaluation: nothing is saved; start it again")


if __name__ == "__main__":
    cli()
