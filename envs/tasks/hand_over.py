"""Hand over: bring an object to the open hand of the person who asks for it."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.errors import ConfigError
from envs.sim.furniture import SIZE
from envs.sim.workspace import WorkspaceConfig
from envs.tasks.pick_and_place import PickAndPlace
from envs.tasks.shared.base import register_task
from envs.tasks.shared.geometry import length, scatter
from envs.tasks.shared.types import Array, Column, EpisodeSpec, State, TaskConfig
from human import HumanConfig, Unreachable, read_arm
from human.arms import OFFERING_JOINTS, OfferingArm
from language import COLORS, HAND, NOUNS, Instruction, Placed, Scene

NUMBER = list(NOUNS).index(HAND)
COLOR = "pink"  # of the hand's row: the named colour that is nearest to skin
PUSHED = 0.02  # metres that the hand may be pushed down
LEVEL = 0.015  # metres over or under its place on the palm at which an object lies on it
AROUND = 0.19  # metres between the middles of hand and objects: a gripper goes down to them beside the hand
OVER = 0.15  # metres over the palm that a gripper needs to bring an object
HALF = np.array(SIZE[:2]) / 2  # metres from the middle of the palm to its edges


@register_task("nl_hand_over", verb="hand_over")
class HandOver(PickAndPlace):
    """ "hand me the red cube": the hand is an object among the others, which `num_objects` counts, and the goal.

    No words name it, since there is one. Its place is drawn anew for each episode, and it stands still unless it is
    pressed.

    Success: the referent has been picked up and lies on the palm, released and at rest, for `hold_steps` steps. The
    episode fails once the hand has been pushed down by `PUSHED`.
    Potentials: those of pick and place.
    """

    fixtures = (HAND,)
    columns = (Column("is the hand", 0.0, 1.0),)
    potentials = PickAndPlace.potentials
    real_goals = True
    fails = True

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
        return (state.nouns == NUMBER).astype(np.float64)[..., None]

    def described(self, episode: EpisodeSpec) -> Array:
        return (episode.scene.nouns == NUMBER).astype(np.float64)[..., None]

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
        """None: the hand does not move to where an object was brought."""
        return None

    # ---- drawing

    def _scene(self, rng: Generator) -> Scene:
        """Loose objects, and the hand as the last one."""
        config = self.config
        count = int(rng.integers(config.min_objects, config.num_objects + 1)) - 1
        loose = scatter(rng, count, self._area, config.spacing, config.object_size / 2)
        nouns = np.append(self._nouns[rng.integers(len(self._nouns), size=count)], NUMBER)
        colors = np.append(rng.integers(len(COLORS), size=count), list(COLORS).index(COLOR))
        places = np.concatenate((np.reshape(loose, (-1, 3)), rng.uniform(self._region[0], self._region[1])[None]))
        return Scene.from_arrays(nouns, colors, places, config.object_size, viewpoint=config.viewpoint)

    def _placed(self, rng: Generator) -> Placed:
        """The hand is not among what can be moved."""
        placed = super()._placed(rng)
        return placed._replace(fixed=placed.scene.nouns == NUMBER)

    def _is_feasible(self, placed: Placed) -> bool:
        hand = placed.scene.nouns == NUMBER
        places = placed.scene.positions[:, :2]
        return bool((length(places[~hand] - places[hand]) >= AROUND).all())

    def _possible_goals(self, placed: Placed) -> NDArray[np.bool_]:
        return placed.scene.nouns == NUMBER

    def _goal_place(self, scene: Scene, target: int) -> Array:
        return self.on_palm(scene.positions[target])

    def _sentence(
        self, verb: str, scene: Scene, referent: int, target: int | None, rng: Generator
    ) -> tuple[str, Instruction]:
        """As in other tasks, without words for the hand."""
        return super()._sentence(verb, scene, referent, None, rng)


def lies_on_palm(offset: Array) -> NDArray[np.bool_]:
    """(...) whether objects lie on a palm. offset: (..., 3) metres from where they lie on its middle."""
    return np.all(np.abs(offset[..., :2]) <= HALF, axis=-1) & (np.abs(offset[..., 2]) <= LEVEL)


def with_hand(placed: Placed, place: Array) -> Placed:
    """The scene with a hand as its last object, which nothing moves. place: (3,) of its palm, metres."""
    scene = placed.scene
    joined = Scene.from_arrays(
        nouns=np.append(scene.nouns, NUMBER),
        colors=np.append(scene.colors, list(COLORS).index(COLOR)),
        positions=np.concatenate((scene.positions, place[None])),
        size=np.append(scene.sizes, scene.sizes[0]),
        targets=np.append(scene.targets, False),
        viewpoint=scene.viewpoint,
    )
    return Placed(joined, np.append(placed.yaw, 0.0), np.append(placed.fixed, True))


def palm_region(config: TaskConfig, workspace: WorkspaceConfig, better: str) -> Array:
    """(2, 3) lowest and highest corner of where the workspace's person holds an open hand, metres.

    Args:
        config: of the task.
        workspace: with a person or without.
        better: a workspace that has one, for the message.

    Raises:
        ConfigError: nobody holds out a hand, or gripper or arm do not reach it everywhere.
    """
    human = workspace.human
    if human is None or not human.palm:
        raise ConfigError(
            f"task.name={config.name} needs a person who holds out an open hand, and "
            f"workspace.name={workspace.name} has none: choose workspace={better}"
        )
    region = np.reshape(human.palm, (3, 2)).T
    low, high = np.reshape(workspace.gripper_box, (3, 2)).T
    if (region[0] < low).any() or (region[1] + [0.0, 0.0, OVER] > high).any():
        raise ConfigError(
            f"workspace.human.palm={human.palm} must lie in workspace.gripper_box={list(workspace.gripper_box)}, "
            f"{OVER} below its top: choose another robot, or another palm"
        )
    _check_arm(human, region)
    return region


def _check_arm(human: HumanConfig, region: Array) -> None:
    """Raises ConfigError unless this person can hold an open hand at all corners of region (2, 3), metres."""
    arm = read_arm(human).model.other
    if arm is None:
        raise ConfigError(
            f"workspace.human.urdf={human.urdf} has no left arm with the joints {', '.join(OFFERING_JOINTS)}"
        )
    try:
        for corner in np.stack(np.meshgrid(*region.T), axis=-1).reshape(-1, 3):
            OfferingArm(arm).solve(corner)
    except Unreachable as error:
        raise ConfigError(f"workspace.human.palm={human.palm}: {error}") from None
