"""The study file: what participants read and do, under which conditions, and what they are asked."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from core.errors import ConfigError
from core.safe_files import FileError, check_plain, read_yaml
from core.schema import WORD, Checked, checked_by, one_of, read, within, word
from core.schema import text as written

MOST_PARTICIPANTS, MOST_AT_ONCE = 500, 16
MOST_NAMED = 24  # conditions, scenes or questions
PROSE = r"[^\0]{1,8000}"
PROSE_NAME = "text of 1 to 8,000 characters"
INPUTS = ("words", "finger", "both")


@dataclass(frozen=True, kw_only=True)
class ConditionConfig(Checked):
    """What differs between the conditions of a study.

    input: what the participant can use: the box for sentences, the pointing finger, or both. driver: who drives the
    robot. policy: a pretrained policy by its name, or a run's folder; None: the pretrained policy that fits.
    answers: whether the page shows what is understood, answers, questions, refusals and results.
    suggestions: whether it offers sentences.
    """

    input: str = one_of(*INPUTS, default="both")
    driver: str = one_of("policy", "expert", default="policy")
    policy: str | None = written(
        r"[^\0]{1,1000}", "the name of a pretrained policy, or the folder of a run", default=None
    )
    answers: bool = True
    suggestions: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.policy is not None and self.driver != "policy":
            raise ConfigError(f"policy={self.policy} does not go with driver={self.driver}; leave one of them out")


@dataclass(frozen=True, kw_only=True)
class SceneConfig(Checked):
    """A scene, and what the participant is to reach in it.

    task, workspace, objects: as of `play.py`. seed: of the scene, which is the same for all participants. text: what
    the participant reads. goal: a sentence, which participants never see: the scripted expert carries it out
    before the study, and they see pictures of before and after. seconds: of the world's clock, after which it ends.
    """

    task: str = word()
    seed: int = within(0, 2**31 - 1, default=0)
    text: str = written(r"[^\0]{0,2000}", "text of at most 2,000 characters", default="")
    goal: str | None = written(r"[^\0]{1,300}", "a sentence of 1 to 300 characters", default=None)
    seconds: float = within(5, 3600, default=180)
    workspace: str | None = word(default=None)
    objects: int | None = within(1, 6, default=None)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.text and self.goal is None:
            raise ConfigError("text has no value, and neither has goal: give text, goal or both")


@dataclass(frozen=True, kw_only=True)
class QuestionConfig(Checked):
    """A question of the questionnaire.

    kind: a scale, free text, or one of some choices. points: of the scale, whose ends are named low and high. after:
    when it is asked. required: whether there must be an answer.
    """

    text: str = written(PROSE, PROSE_NAME)
    kind: str = one_of("likert", "text", "choice", default="likert")
    points: int = within(2, 11, default=7)
    low: str = written(r"[^\0]{1,80}", "text of 1 to 80 characters", default="strongly disagree")
    high: str = written(r"[^\0]{1,80}", "text of 1 to 80 characters", default="strongly agree")
    choices: list[str] = written(r"[^\0]{1,200}", "text of 1 to 200 characters", default=())
    after: str = one_of("scene", "condition", "study", default="condition")
    required: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.kind == "choice") != bool(self.choices):
            wanted = "at least one" if self.kind == "choice" else "none"
            raise ConfigError(f"choices={self.choices} does not go with kind={self.kind}, which has {wanted}")

    def refused(self, value: Any) -> str:
        """Why a value is no answer; "" if it is one."""
        if self.kind == "likert" and not (type(value) is int and 1 <= value <= self.points):
            return f"it must be a whole number from 1 to {self.points}"
        if self.kind == "choice" and value not in self.choices:
            return f"it must be one of {', '.join(self.choices)}"
        if self.kind == "text" and not isinstance(value, str):
            return "it must be text"
        return ""


@dataclass(frozen=True, kw_only=True)
class StudyConfig(Checked):
    """A study.

    title, consent, thanks: what participants read. participants: number of links. at_once: participants whose robots
    run at the same time. robot: of all scenes. design: whether a participant has all conditions, or one. scene_order:
    as given here, or balanced over participants. scenes_per_condition: None for all. idle_minutes: after which the
    robot of a participant who has left is freed. samples_per_second: of the world's state while the robot moves.
    """

    title: str = written(r"[^\0]{1,200}", "text of 1 to 200 characters")
    consent: str = written(PROSE, PROSE_NAME)
    thanks: str = written(PROSE, PROSE_NAME, default="That was all. Thank you.")
    participants: int = within(1, MOST_PARTICIPANTS)
    at_once: int = within(1, MOST_AT_ONCE, default=8)
    robot: str = word(default="kuka")
    design: str = one_of("within", "between", default="within")
    scene_order: str = one_of("given", "balanced", default="balanced")
    scenes_per_condition: int | None = within(1, MOST_NAMED, default=None)
    idle_minutes: float = within(0.1, 600, default=10)
    samples_per_second: float = within(0, 20, default=5)
    conditions: dict[str, ConditionConfig] = checked_by("read_study")
    scenes: dict[str, SceneConfig] = checked_by("read_study")
    questions: dict[str, QuestionConfig] = checked_by("read_study")

    def __post_init__(self) -> None:
        super().__post_init__()
        for group in ("conditions", "scenes", "questions"):
            _check_names(group, getattr(self, group), least=group != "questions")
        if self.scenes_per_condition is not None and self.scenes_per_condition > len(self.scenes):
            raise ConfigError(
                f"scenes_per_condition={self.scenes_per_condition} is more than there are scenes: {len(self.scenes)}"
            )
        for name in ("title", "consent", "thanks"):
            if not getattr(self, name).strip():
                raise ConfigError(f"{name} is empty: write what participants shall read")

    def questions_after(self, what: str) -> dict[str, QuestionConfig]:
        """The questions that are asked after a scene, a condition or the study."""
        return {name: question for name, question in self.questions.items() if question.after == what}


def _check_names(group: str, named: dict[str, Any], least: int) -> None:
    if not least <= len(named) <= MOST_NAMED:
        raise ConfigError(f"{group} has {len(named)} entries: it must have {int(least)} to {MOST_NAMED}")
    for name in named:
        if not WORD.fullmatch(name):
            raise ConfigError(f"{group}.{name} must be named by letters, digits and . _ + - or spaces")


def read_study(path: Path) -> StudyConfig:
    """Read a study file. Raises ConfigError, which names the file, the key, the value and what would be right.

    `check_policies` checks the rest, which loads more.
    """
    try:
        content = read_yaml(path)
        check_plain(content)
        if not isinstance(content, dict):
            raise FileError("must be a group of keys, such as title and scenes")
    except FileError as error:
        raise ConfigError(f"study={path} {error}") from None
    return study_of(content, f"study={path}: ")


def study_of(content: dict[str, Any], prefix: str = "") -> StudyConfig:
    """The study of a plain value. Raises ConfigError, which begins with `prefix`."""
    try:
        return read(StudyConfig, content | {"questions": content.get("questions") or {}}, "")
    except ConfigError as error:
        raise ConfigError(f"{prefix}{error}") from None


def check_policies(study: StudyConfig) -> None:
    """Raise ConfigError for a robot, task or policy that does not exist, or for what does not go together."""
    from demo.session_config import pretrained_policies
    from envs.tasks import TASKS

    for name, scene in study.scenes.items():
        session_config(study, None, scene, f"scenes.{name}")
    for name, condition in study.conditions.items():
        for scene_name, scene in study.scenes.items():
            key, traits = f"conditions.{name}", TASKS[scene.task].traits
            if condition.input == "finger" and traits.moves:
                raise ConfigError(
                    f"{key}.input=finger does not go with scenes.{scene_name}.task={scene.task}, which takes words; "
                    "choose a task that reaches, such as nl_reach, or input=both"
                )
            if condition.driver == "policy" and condition.policy is None:
                wanted = scene.task, study.robot, "step"
                if wanted not in {(each.task, each.robot, each.control) for each in pretrained_policies()}:
                    raise ConfigError(
                        f"{key}.driver=policy finds no pretrained policy for scenes.{scene_name}.task={scene.task} "
                        f"with robot={study.robot}; give {key}.policy=<run folder>, or driver=expert"
                    )
            if condition.policy is not None:
                session_config(study, condition, scene, key)


def session_config(study: StudyConfig, condition: ConditionConfig | None, scene: SceneConfig, key: str) -> Any:
    """The config of the session for a scene; without a condition the expert drives.

    Args:
        study: the study.
        condition: the participant's.
        scene: the scene.
        key: of the part of the study that would be wrong, for the message.

    Raises:
        ConfigError: a value is not known, or a policy is for something else.
    """
    from demo.session_config import check_choices, make_config, pretrained_policies

    values: dict[str, Any] = {"task": scene.task, "robot": study.robot, "control": "step"}
    if condition is not None and condition.policy is not None:
        paths = {each.name: str(each.path) for each in pretrained_policies()}
        values["checkpoint"] = paths.get(condition.policy, condition.policy)
    try:
        check_choices(values)
        driver = "expert" if condition is None else condition.driver
        return make_config(**values, driver=driver, workspace=scene.workspace, objects=scene.objects, second_try=False)
    except (ConfigError, OSError, LookupError) as error:
        raise ConfigError(f"{key}: {error}") from None
