"""Study files: what is refused, with which message; orders of conditions and scenes."""

from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest
import yaml

from core.errors import ConfigError
from demo.study.orders import condition_orders, latin_square, stages
from demo.study.study_config import check_policies, read_study, study_of

EXAMPLE = Path(__file__).resolve().parents[2] / "docs/examples/study.yaml"
SMALL = {
    "title": "A study",
    "consent": "Do you agree?",
    "participants": 4,
    "conditions": {"a": {"driver": "expert"}, "b": {"driver": "expert", "answers": False}},
    "scenes": {"one": {"task": "nl_reach", "text": "reach something"}},
}
WRONG = [  # changes, and what the message has
    ({"participants": 0}, "participants=0 is out of range"),
    ({"participants": "many"}, "participants=many"),
    ({"title": None}, "title"),
    ({"title": " "}, "title is empty"),
    ({"consents": "x"}, "consents is not a known key; did you mean 'consent'"),
    ({"conditions": {}}, "conditions has 0 entries: it must have 1 to"),
    ({"conditions": {"a/b": {}}}, "conditions.a/b must be named by letters"),
    (
        {"conditions": {"a": {"input": "voice"}}},
        "conditions.a.input=voice is not known; choose from words, finger, both",
    ),
    (
        {"conditions": {"a": {"driver": "expert", "policy": "nl_reach_kuka"}}},
        "policy=nl_reach_kuka does not go with driver=expert",
    ),
    ({"conditions": {"a": {"driver": "hand"}}}, "conditions.a.driver=hand is not known"),
    ({"conditions": [1]}, "conditions=[1]"),
    ({"scenes": {"one": {"task": "nl_reach"}}}, "scenes.one.text has no value, and neither has goal"),
    ({"scenes": {"one": {"task": "nl_reach", "text": "x", "seconds": 1}}}, "scenes.one.seconds=1"),
    ({"scenes": {"one": {"task": "nl_reach", "text": "x", "seed": -1}}}, "scenes.one.seed=-1"),
    ({"scenes_per_condition": 2}, "scenes_per_condition=2 is more than there are scenes: 1"),
    ({"questions": {"q": {"text": "?", "kind": "stars"}}}, "questions.q.kind=stars is not known"),
    ({"questions": {"q": {"text": "?", "kind": "choice"}}}, "does not go with kind=choice, which has at least one"),
    ({"questions": {"q": {"text": "?", "points": 99}}}, "questions.q.points=99 is out of range"),
]
ROOM = {"one": {"task": "anything", "text": "x"}}
UNFIT = [
    ({"robot": "kuca"}, "robot=kuca is not known; did you mean 'kuka'"),
    ({"scenes": {"one": {"task": "nl_rech", "text": "x"}}}, "scenes.one.*nl_rech"),
    ({"scenes": ROOM, "conditions": {"a": {"input": "finger"}}}, "a.input=finger does not go with scenes.one.task"),
    ({"scenes": {"one": {"task": "nl_pick_and_place", "text": "x"}}, "conditions": {"a": {"input": "finger"}}},
     "a.input=finger does not go with scenes.one.task"),
    ({"conditions": {"a": {}}, "robot": "ur5"}, "finds no pretrained policy for scenes.one.task"),
    ({"conditions": {"a": {"policy": "nl_reach_panda"}}}, "nl_reach_panda"),
    ({"conditions": {"a": {"policy": "nowhere"}}}, "conditions.a: .*nowhere"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "message"), WRONG, ids=range(len(WRONG)))
def test_a_wrong_value_is_named_with_its_key_and_what_would_be_right(tmp_path, changes, message):
    path = tmp_path / "study.yaml"
    path.write_text(yaml.safe_dump(SMALL | changes))
    with pytest.raises(ConfigError) as error:
        read_study(path)
    assert str(error.value).startswith(f"study={path}")
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(("changes", "message"), UNFIT, ids=range(len(UNFIT)))
def test_robots_tasks_and_policies_that_do_not_fit_are_refused(changes, message):
    with pytest.raises(ConfigError, match=message):
        check_policies(study_of(SMALL | changes))


@pytest.mark.parametrize(
    "content", [b"", b"- 1", b"\xff\xfe", b"a: !!python/object:os.system x", b"title: ${oc.env:HOME}"]
)
def test_a_file_that_is_no_study_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "study.yaml"
    path.write_bytes(content)
    with pytest.raises(ConfigError, match="study="):
        read_study(path)
    with pytest.raises(ConfigError, match="cannot be read"):
        read_study(tmp_path / "missing.yaml")


def test_the_example_is_right():
    study = read_study(EXAMPLE)
    check_policies(study)
    assert [len([s for s in stages(study, number) if s.kind == "trial"]) for number in range(12)] == [6] * 12


@pytest.mark.parametrize("count", range(1, 8))
def test_in_a_balanced_square_each_is_everywhere_and_follows_each_other_equally_often(count):
    rows = latin_square(count)
    assert all(sorted(row) == list(range(count)) for row in rows)
    for place in range(count):
        assert len(set(Counter(row[place] for row in rows).values())) == 1
    if count > 1:
        follows = Counter(pair for row in rows for pair in pairwise(row))
        assert len(follows) == count * (count - 1)
        assert len(set(follows.values())) == 1


def test_participants_get_all_orders_in_turn_and_no_scene_twice_where_there_are_enough():
    study = read_study(EXAMPLE)
    orders = condition_orders(study)
    given = [tuple(dict.fromkeys(s.condition for s in stages(study, number) if s.condition)) for number in range(12)]
    assert set(Counter(given).values()) == {12 // len(orders)}
    for number in range(12):
        scenes = [stage.scene for stage in stages(study, number) if stage.kind == "trial"]
        assert len(set(scenes)) == 6
    assert len({tuple(s.scene for s in stages(study, n) if s.kind == "trial") for n in range(12)}) >= 6


def test_between_participants_each_has_one_condition():
    study = study_of(SMALL | {"design": "between"})
    assert [stages(study, number)[1].condition for number in range(4)] == ["a", "b", "a", "b"]
    assert [stage.kind for stage in stages(study, 0)] == ["consent", "trial", "thanks"]
