"""Links to scenes, prepared scenes, and the export of what was asked for."""

import base64
import io
import json
import zipfile

import numpy as np
import pytest

from core.errors import ConfigError
from demo.session import Session
from demo.session_config import make_config
from demo.shared_scene import (
    DAMAGED,
    MOST_EVENTS,
    PAUSE,
    PREPARED,
    EventLog,
    EventReplay,
    Pointed,
    PutThere,
    Said,
    SharedScene,
    read_code,
    scene_of,
)
from language import Plan, Question
from tests.helpers.sessions import run_to_end, session_fixture

SCENE = SharedScene(
    task="nl_reach",
    seed=7,
    events=[
        Said(text="reach the 🟥", after=None),
        Pointed(place=(0.4, 0.1, 0.0), after=3),
        PutThere(object=1, place=(0.4, 0.1)),
    ],
)


session = session_fixture(driver="expert")


def as_code(value):
    return base64.urlsafe_b64encode(json.dumps(value).encode()).decode().rstrip("=")


def test_a_link_holds_what_happened():
    assert read_code(SCENE.code) == SCENE
    assert set(SCENE.code) <= set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_")


@pytest.mark.parametrize(
    "code",
    [
        *("", "é" * 40, "====", SCENE.code[:-9], SCENE.code + "AAAA", as_code([]), as_code({"task": "nl_reach"})),
        as_code({"task": "nl_reach", "seed": -1}),
        as_code({"task": "nl_reach", "seed": 1e300}),
        as_code({"task": "nl_reach", "seed": 1, "checkpoint": "/etc/passwd"}),
        as_code({"task": "x" * 1000, "seed": 1}),
        as_code({"task": "nl_reach", "seed": 1, "events": [{"do": "say", "text": "x" * 3000}]}),
        as_code({"task": "nl_reach", "seed": 1, "events": [{"do": "point", "place": [0, 0, 1e9]}]}),
        as_code({"task": "nl_reach", "seed": 1, "events": [{"do": "say", "text": "go"}] * (MOST_EVENTS + 1)}),
    ],
    ids=range(14),
)
def test_a_damaged_link_is_refused_in_one_sentence(code):
    with pytest.raises(ConfigError) as raised:
        read_code(code)
    assert str(raised.value) == DAMAGED


def test_an_unknown_name_is_told_with_the_known_ones():
    with pytest.raises(ConfigError, match=r"scene=drawers is not known.*drawer"):
        scene_of("drawers")


def test_of_a_drag_its_end_counts_and_sentences_keep_their_time():
    log = EventLog()
    log.add(Said(text="reach the ball"), 10, False)
    log.add(Said(text="no, the cube"), 14, True)
    for x in (0.1, 0.2, 0.3):
        log.add(PutThere(object=2, place=(x, 0.0)), 20, False)
    log.add(PutThere(object=1, place=(0.5, 0.0)), 20, False)
    assert [event.after for event in log.events] == [None, 4, None, None]
    assert log.events[2].place == (0.3, 0.0)


def test_events_happen_when_the_robot_rests_or_after_as_many_steps():
    replay = EventReplay([Said(text="one"), Said(text="two", after=3), Said(text="three")], 0)
    heard = {}
    for step in range(60):
        event = replay.next(step, busy=20 <= step < 30)
        if event is not None:
            heard[event.text] = step
    assert heard == {"one": PAUSE, "two": PAUSE + 3, "three": 30 + PAUSE}


def test_a_seed_draws_the_same_scene_again(session):
    session.shuffle()
    seed, places, names = session.seed, session.scene().positions, session.object_names()
    session.shuffle()
    assert not np.array_equal(session.scene().positions, places)
    session.shuffle(seed)
    assert np.array_equal(session.scene().positions, places)
    assert session.object_names() == names


@pytest.mark.slow
@pytest.mark.parametrize("name", PREPARED)
def test_what_can_be_clicked_in_a_prepared_scene_is_understood(name):
    prepared = PREPARED[name]
    session = Session(make_config(**prepared.scene.choices), prepared.scene.seed)
    try:
        session.set_viewpoint(prepared.scene.viewpoint)
        for event in prepared.scene.events:
            session.point_at(event.place)
        outcome = session.say(prepared.sentences[0])
        assert isinstance(outcome, Plan if name != "which" else Question)
        if name != "which":
            assert run_to_end(session, 400).startswith("Done")
        assert session.config.driver == prepared.scene.driver
    finally:
        session.close()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["lerobot", "minari"])
def test_what_people_asked_for_is_exported_as_a_dataset(session, kind, tmp_path):
    pytest.importorskip({"lerobot": "pyarrow", "minari": "minari"}[kind])
    from trainers.datasets.dataset import read

    session.episodes._episodes.clear()
    with pytest.raises(ConfigError, match="nothing to export yet"):
        session.episodes.export(kind)
    session.shuffle()
    sentence = f"pls reach {session.object_names()[0]}"
    session.say(sentence)
    run_to_end(session)
    session.say(f"reach {session.object_names()[1]}")
    session.step()
    session.stop()  # leaves it out
    export = session.episodes.export(kind)
    assert export.name.endswith(f"{kind}-v0.zip")
    zipfile.ZipFile(io.BytesIO(export.packed())).extractall(tmp_path)
    metadata, episodes = read(tmp_path / export.name.removesuffix(".zip"))
    (episode,) = episodes
    assert episode.sentence == sentence
    assert episode.success
    assert np.abs(episode.actions).max() <= 1
    assert metadata["actor"] == "expert"
