"""The sentences of tasks that move objects name the task, the referent and its target."""

import numpy as np
import pytest
import yaml

from envs.experts import Oracle
from envs.tasks import TASKS as CLASSES
from envs.tasks.shared.manipulation import Manipulation
from language import parse
from tests.helpers.env_cases import CONF, TASKS, act, make, partial_reset, task_of


def moves_what_a_sentence_names(name):
    """Whether a task does, read without Hydra, which takes long."""
    values = yaml.safe_load((CONF / "task" / f"{name}.yaml").read_text("utf-8"))
    return bool(values.get("kinds")) and issubclass(CLASSES.get(values.get("name"), object), Manipulation)


SPOKEN = [name for name in TASKS if moves_what_a_sentence_names(name)]
SAID = {
    "nl_grasp": "grasp the ",
    "nl_lift": "lift the ",
    "nl_pick_and_place": "pick the ",
    "nl_push": "push the ",
    "pick_and_rotate": "pick the ",
    "poke": "poke the ",
    "swipe": "swipe the ",
    "throw": "throw the ",
}
TOLD = {
    "nl_pick_and_place": " and place it to the same position as the ",
    "nl_push": " to the same position as the ",
    "pick_and_rotate": " and rotate it",
    "swipe": " along the line to the ",
    "throw": " to the same position as the ",
}


@pytest.mark.slow
@pytest.mark.parametrize("more", [(), ("task.varied=true",)], ids=["ours", "varied"])
@pytest.mark.parametrize("name", SPOKEN)
def test_each_sentence_names_the_task_what_is_moved_and_where_to(name, more):
    task, rng = task_of(name, *more), np.random.default_rng(0)
    for _ in range(40):
        episode = task.draw(rng)
        said = episode.heard if task.traits.stepwise else episode.sentence
        step = parse(said, episode.scene).steps[-1]
        assert step.task == (task.verbs[episode.kind] if task.verbs else task.verb)
        assert [index for index in (step.init, step.goal) if index is not None] == [
            index for index in (episode.referent, episode.target) if index is not None
        ]


@pytest.mark.slow
@pytest.mark.parametrize("name", SAID)
def test_the_words_are_those_of_the_language(name):
    task, rng = task_of(name), np.random.default_rng(1)
    sentences = {task.draw(rng).sentence for _ in range(20)}
    assert len(sentences) > 10
    assert all(each.startswith(SAID[name]) and TOLD.get(name, "") in each for each in sentences)


@pytest.mark.slow
@pytest.mark.parametrize("name", SPOKEN)
def test_the_oracle_succeeds_from_public_observations(name):
    env = make(
        "kuka",
        "step",
        name,
        "task.curriculum={near: 0, held: 0, placed: 0}",
        worlds=4,
        seed=31,
    )
    oracle, td, ended, solved = Oracle(env), env.reset(), np.zeros(4, bool), []
    while not ended.all():
        seen = td.clone().exclude("privileged")
        td = act(env, td, oracle(seen)["action"])
        over = td["done"][:, 0].numpy()
        solved += td["success"][over & ~ended, 0].tolist()
        ended |= over
        if over.any():
            td = partial_reset(env, td, np.flatnonzero(over))
    env.close()
    assert np.mean(solved) >= 3 / 4
