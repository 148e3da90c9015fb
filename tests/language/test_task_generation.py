"""Scenes after a task, and generated tasks of several steps."""

import numpy as np
import pytest

from language import (
    VERBS,
    Describer,
    HeldOut,
    LanguageError,
    Scene,
    Split,
    generate_tasks,
    parse,
    say,
    scene_after,
    understand,
)
from tests.helpers.language_cases import PLACES, random_scenes


@pytest.mark.parametrize("task", [task for task, known in VERBS.items() if known.effect == "goal"])
def test_a_moved_object_takes_the_place_of_the_goal(task):
    done = scene_after(task, 0, 3, PLACES)
    assert (done.positions[0] == PLACES.positions[3]).all()
    assert (done.positions[1:] == PLACES.positions[1:]).all()


def test_a_stacked_object_stands_on_its_base():
    done = scene_after("stack", 2, 1, PLACES)
    assert (done.positions - PLACES.positions)[[0, 1, 3, 4]].any() == np.False_
    assert done.positions[2].tolist() == [0.4, 0.0, 0.02 + (PLACES.sizes[2] + PLACES.sizes[1]) / 2]


def test_objects_are_only_stacked_on_real_ones():
    generated = generate_tasks(PLACES, width=40, depth=1, tasks=("stack",))
    assert {(step.init, step.goal) for each in generated for step in understand(each.command, PLACES).steps} == {
        (init, goal) for init in range(3) for goal in range(3) if init != goal
    }


def test_a_lifted_object_is_higher():
    done = scene_after("lift", 1, None, PLACES)
    assert (done.positions - PLACES.positions).nonzero()[0].tolist() == [1]
    assert done.positions[1, 2] > PLACES.positions[1, 2] + 0.1


@pytest.mark.parametrize(("task", "init", "goal"), [("reach", None, 2), ("grasp", None, 1), ("poke", 1, None)])
def test_tasks_without_effect_return_the_same_scene(task, init, goal):
    assert scene_after(task, init, goal, PLACES) is PLACES


def test_an_unknown_task_is_refused():
    with pytest.raises(LanguageError, match="did you mean 'lift'"):
        scene_after("lifts", 0, None, PLACES)


def tables():
    yield PLACES
    yield Scene(PLACES, viewpoint="human")
    yield from random_scenes(25, counts=[4, 6, 8], seed=2)


@pytest.mark.slow
@pytest.mark.parametrize("depth", [1, 2, 4])
def test_every_generated_step_is_feasible_and_understood_in_its_scene(depth):
    number = 0
    for table in tables():
        for generated in generate_tasks(table, width=4, depth=depth, seed=3):
            number += 1
            understood = parse(say(generated.command), table)
            assert understood.meaning == generated.command
            assert len(understood.steps) == depth
            check_each_step(table, generated, understood.steps)
    assert number > 40


def check_each_step(table, generated, steps):
    assert generated.scenes[0] is table
    for step, words, before, done in zip(
        steps, generated.command.steps, generated.scenes[:-1], generated.scenes[1:], strict=True
    ):
        alone = understand(words, before)
        assert alone.steps == (step,)
        assert (alone.result.positions == done.positions).all()
        if step.init is not None:
            assert not before.targets[step.init]
        if step.init is not None and step.goal is not None:
            distance = np.linalg.norm(before.positions - before.positions[step.goal], axis=1)
            assert before.targets[step.goal]
            assert not (distance[~before.targets] < 0.04).any()


def test_tasks_differ_and_repeat_with_the_seed():
    one, other = (generate_tasks(PLACES, width=20, depth=3, seed=7) for _ in range(2))
    assert len({task.command for task in one}) == 20
    assert [task.command for task in one] == [task.command for task in other]
    assert [task.command for task in generate_tasks(PLACES, 20, 3, seed=8)] != [task.command for task in one]


def test_only_the_requested_tasks_are_generated():
    for generated in generate_tasks(PLACES, width=10, depth=2, tasks=("push", "lift")):
        assert {step.task for step in generated.command.steps} <= {"push", "lift"}


def test_a_scene_without_a_feasible_task_returns_none():
    assert generate_tasks(Scene([]), width=3, depth=1) == []
    assert generate_tasks(Scene(list(PLACES)[3:]), width=3, depth=1, tasks=("push", "lift")) == []


def test_generated_tasks_stay_within_the_split():
    split = Split("train", HeldOut(color_noun=(("green", "cube"),)))
    describer = Describer(("color_shape", "relation"), split)
    for generated in generate_tasks(PLACES, width=20, depth=2, describer=describer):
        assert "green cube" not in say(generated.command)


@pytest.mark.parametrize("wrong", [{"width": 0}, {"depth": 0}, {"tasks": ("sing",)}])
def test_invalid_arguments_are_refused(wrong):
    with pytest.raises(LanguageError):
        generate_tasks(PLACES, **({"width": 1, "depth": 1} | wrong))
