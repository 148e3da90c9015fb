"""Which conditions and scenes a participant has, in which order, and the stages that follow from it."""

from __future__ import annotations

from dataclasses import dataclass

from demo.study.study_config import QuestionConfig, StudyConfig


@dataclass(frozen=True)
class Stage:
    """One part of a participant's way through a study.

    kind: consent, trial, questions or thanks. condition, scene: names. after: what its questions are about: scene,
    condition or study. trial: number of the trial, from 1; that of the latest one in later stages.
    """

    kind: str
    condition: str = ""
    scene: str = ""
    after: str = ""
    trial: int = 0


def latin_square(count: int) -> list[list[int]]:
    """Orders of `count` things, each of which is at each place equally often and follows each other one equally often.

    It has `count` rows, or twice as many for odd numbers (Williams, 1949).
    """
    first = [(-(at // 2) - 1) % count if at % 2 else at // 2 for at in range(count)]
    rows = [[(each + shift) % count for each in first] for shift in range(count)]
    return rows + [row[::-1] for row in rows] if count % 2 and count > 1 else rows


def condition_orders(study: StudyConfig) -> list[list[str]]:
    """The orders of conditions that participants get in turn."""
    names = list(study.conditions)
    if study.design == "between":
        return [[name] for name in names]
    return [[names[each] for each in row] for row in latin_square(len(names))]


def scene_order(study: StudyConfig, number: int, cycle: int) -> list[str]:
    """The order of scenes of a participant.

    Args:
        study: the study.
        number: of the participant, from 0.
        cycle: how often all orders of conditions have been given before.
    """
    names = list(study.scenes)
    if study.scene_order == "given":
        return names
    rows = latin_square(len(names))
    return [names[each] for each in rows[(number + cycle) % len(rows)]]


def stages(study: StudyConfig, number: int) -> list[Stage]:
    """The stages of a participant, in order. number: of the participant, from 0, in the order of consent."""
    orders = condition_orders(study)
    conditions = orders[number % len(orders)]
    scenes = scene_order(study, number, number // len(orders))
    share = study.scenes_per_condition or len(scenes)
    found, trial = [Stage("consent")], 0
    for block, condition in enumerate(conditions):
        for at in range(share):
            scene, trial = scenes[(block * share + at) % len(scenes)], trial + 1
            found.append(Stage("trial", condition, scene, trial=trial))
            if study.questions_after("scene"):
                found.append(Stage("questions", condition, scene, "scene", trial))
        if study.questions_after("condition"):
            found.append(Stage("questions", condition, "", "condition", trial))
    if study.questions_after("study"):
        found.append(Stage("questions", "", "", "study", trial))
    return [*found, Stage("thanks", trial=trial)]


def questions_of(study: StudyConfig, stage: Stage) -> dict[str, QuestionConfig]:
    """The questions of a stage, by name."""
    return study.questions_after(stage.after) if stage.kind == "questions" else {}
