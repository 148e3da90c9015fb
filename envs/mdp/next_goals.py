"""Episodes of several instructions: after a success the next one is said, in the world as it is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from envs.mdp.goals import Goal
from envs.mdp.object_rows import scene_of_rows
from envs.mdp.world_state import WorldState
from envs.tasks import NOTHING, Task


def next_goals(
    arrays: WorldState, task: Task, success: NDArray[np.bool_], generators: Sequence[Generator]
) -> Iterator[tuple[int, Goal]]:
    """The worlds whose episodes go on after this control step, each with its next goal. Their steps count from 0.

    success: (N,). generators: of each world.
    """
    for i in np.flatnonzero(success & (arrays.said < task.most_instructions)).tolist():
        slots, held = np.sort(arrays.slots[i]), arrays.state.held[i]
        scene = scene_of_rows(arrays.rows[i, slots], task.config.viewpoint, arrays.state.nouns[i, slots])
        number = NOTHING if held == NOTHING else int(np.searchsorted(slots, held))
        last = arrays.goals[i].said(slots)
        said = task.next_instruction(scene, number, generators[i], task.moved(arrays.state)[i, slots], last)
        if said is not None:
            arrays.said[i] += 1
            arrays.steps[i] = 0
            yield i, Goal.of_said(said, slots)
