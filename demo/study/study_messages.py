"""What pages of a study can ask for: the messages of participants and of the experimenter."""

from __future__ import annotations

from typing import Annotated

import msgspec

Number = Annotated[int, msgspec.Meta(ge=0, le=2**31)]
Text = Annotated[str, msgspec.Meta(max_length=8000)]
Name = Annotated[str, msgspec.Meta(max_length=100)]


class StudyMessage(msgspec.Struct, tag_field="do", forbid_unknown_fields=True):
    """A message of a page. number: of the message, which its acknowledgement repeats."""

    number: Number


class StageMessage(StudyMessage):
    """A message of a participant. stage: where they are; it is ignored elsewhere, so that none counts twice."""

    stage: Number


class Consent(StageMessage, tag="consent"):
    """The participant agrees to take part."""


class Begin(StageMessage, tag="begin"):
    """The participant begins a trial."""


class EndTrial(StageMessage, tag="end"):
    """The participant ends a trial. gave_up: or gives it up."""

    gave_up: bool = False


class GiveAnswer(StageMessage, tag="answer"):
    """An answer of the questionnaire, as it is given or changed."""

    question: Name
    value: int | Text


class Submit(StageMessage, tag="submit"):
    """The questionnaire is done."""


class Withdraw(StudyMessage, tag="withdraw"):
    """Everything about the participant is to be deleted."""


class StopParticipant(StudyMessage, tag="stop"):
    """The experimenter stops a participant, or lets them go on."""

    code: Name
    stopped: bool


class DeleteParticipant(StudyMessage, tag="delete"):
    """The experimenter deletes a participant who has withdrawn."""

    code: Name


class CloseStudy(StudyMessage, tag="close"):
    """The experimenter stops the study, or opens it again."""

    closed: bool


PARTICIPANT = Consent | Begin | EndTrial | GiveAnswer | Submit | Withdraw
EXPERIMENTER = StopParticipant | DeleteParticipant | CloseStudy
