"""Hand over: bring an object to the open hand of the person who asks for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.errors import ConfigError
from envs.sim.workspace import WorkspaceConfig
from envs.tasks.pick_and_place import PickAndPlace
from envs.tasks.shared.base import register_task
from envs.tasks.shared.geometry import length, scatter
from envs.tasks.shared.open_hand import HAND_COLOR, HAND_COLUMN, HAND_NUMBER, lies_on_palm, palm_region
from envs.tasks.shared.types import Array, EpisodeSpec, State
from language import COLORS, HAND, Instruction, Placed, Scene

PUSHED = 0.02  # metres that the hand may be pushed down
AROUND = 0.19  # metres between the middles of hand and objects: a gripper goes down to them beside the hand


@register_task("nl_hand_over", verb="hand_over")
class HandOver(PickAndPlace):
    """Bring an object to the open hand of the person who asks for it.

    The hand is an object among the others, which `num_objects` counts, and the goal. No words name it, since there is
    one. Its place is drawn anew for each episode, and it stands still unless it is pressed.

    Instruction: "hand me the red cube".
    Success: the referent has been picked up and lies on the palm, released and at rest, for `hold_steps` steps.
    Failure: wrong_object, once another object has been moved; failed, once the hand has been pushed down by `PUSHED`.
    Reward terms: approach, grasp, lift, transport and release as of `PickAndPlace`; success, wrong_object,
        wrong_target, failed and time.
    Config keys: num_objects counts the hand; needs workspace=handover.
    """

    traits = replace(PickAndPlace.traits, real_goals=True, fails=True)
    fixtures = (HAND,)
    columns = (HAND_COLUMN,)

    def prepare(self, workspace: WorkspaceConfig) -> None:
        if len(self.config.objects):
            raise ConfigError(f"task.objects must be empty in task.name={self.config.name}: its objects are drawn")
        self._region = palm_region(self.config, workspace, "handover")

    @property
    def bodies(self) -> tuple[int, int, int]:
        free, fixed, targets = super().bodies
        return free - 1, fixed, targets

    # ---- evaluating

    def seen(self, state: State) -> Array:
        return (state.nouns == HAND_NUMBER).astype(np.float64)[..., None]

    def described(self, episode: EpisodeSpec) -> Array:
        return (episode.scene.nouns == HAND_NUMBER).astype(np.float64)[..., None]

    def _goal(self, state: State) -> Array:
        return self.on_palm(state.objects[self._rows, state.target])

    def on_palm(self, palms: Array) -> Array:
        """(..., 3) where an object lies on the middle of each palm, metres. palms: (..., 3)."""
        return palms + [0.0, 0.0, self.config.object_size / 2]

    def _is_near_goal(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether the referent lies on the palm."""
        return lies_on_palm(self._referent(state) - self._goal(state))

    def _failed(self, state: State) -> NDArray[np.bool_]:
        each = self._rows, state.target
        return self._begun[each][:, 2] - state.objects[each][:, 2] > PUSHED

    def relabel(self, placed: Placed, moments: State, rng: Generator) -> EpisodeSpec | None:
        """Return None: the hand does not move to where an object was brought."""
        return None

    # ---- drawing

    def _scene(self, rng: Generator) -> Scene:
        """Draw loose objects, and the hand as the last one."""
        config = self.config
        count = self._draw_count(rng) - 1
        loose = scatter(rng, count, area=self._area, spacing=config.spacing, height=config.object_size / 2)
        nouns = np.append(self._nouns[rng.integers(len(self._nouns), size=count)], HAND_NUMBER)
        colors = np.append(rng.integers(len(COLORS), size=count), HAND_COLOR)
        places = np.concatenate((np.reshape(loose, (-1, 3)), rng.uniform(self._region[0], self._region[1])[None]))
        return Scene.from_arrays(nouns, colors, places, config.object_size, viewpoint=config.viewpoint)

    def _placed(self, rng: Generator) -> Placed:
        """Draw a scene whose hand is not among what can be moved."""
        placed = super()._placed(rng)
        return placed._replace(fixed=placed.scene.nouns == HAND_NUMBER)

    def _is_feasible(self, placed: Placed) -> bool:
        hand = placed.scene.nouns == HAND_NUMBER
        places = placed.scene.positions[:, :2]
        return bool((length(places[~hand] - places[hand]) >= AROUND).all())

    def possible_goals(self, placed: Placed) -> NDArray[np.bool_]:
        return placed.scene.nouns == HAND_NUMBER

    def _goal_place(self, scene: Scene, target: int) -> Array:
        return self.on_palm(scene.positions[target])

    def _sentence(self, scene: Scene, referent: int, target: int | None, rng: Generator) -> tuple[str, Instruction]:
        """Return a sentence as in other tasks, without words for the hand."""
        return super()._sentence(scene, referent, None, rng)
