"""Press, switch and turn: operate the device that the words name, alone with its like or among other objects."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.errors import ConfigError
from envs.sim.devices import DEVICES, facing, turned
from envs.tasks.shared.base import register_task
from envs.tasks.shared.device_motion import (
    DEVICE_COLUMNS,
    DEVICE_NUMBERS,
    MOTION_COLUMNS,
    MOTIONS,
    SPRUNG,
    WIDTHS,
    device_columns,
    moved,
)
from envs.tasks.shared.feasible import DEVICE_VERBS
from envs.tasks.shared.geometry import length
from envs.tasks.shared.manipulation import Manipulation
from envs.tasks.shared.task_config import TaskConfig
from envs.tasks.shared.types import Array, Column, EpisodeSpec, State
from human import Person
from language import COLORS, NOUNS, LanguageError, ObjectSpec, Placed, Scene, from_all

OPERATED = 0.8  # share of its range at which a device is operated
OTHER_OPERATED = 0.3  # share of its range at which another device counts as the wrong object
MARGIN = 0.05  # metres from the border of the object area to the handles, so that a gripper reaches every side
AMONG_MARGIN = 0.065  # ... to where devices stand among other objects
ALIKE, OTHERS = 2, 1  # devices of the verb's noun among other objects, and of another noun


class OperateDevice(Manipulation):
    """The referent is a device of the verb's noun. The pose of a device is that of its handle.

    Success: the referent has travelled `OPERATED` of its range, for `hold_steps` steps. Another device that has
    travelled `OTHER_OPERATED` of its range ends the episode as `wrong_object`.
    """

    columns: tuple[Column, ...] = MOTION_COLUMNS
    potentials = ("approach", "operate")

    def _configure(self, config: TaskConfig, person: Person | None) -> None:
        if len(config.objects):
            raise ConfigError(f"task.objects must be empty in task.name={config.name}: its devices are drawn")
        super()._configure(config, person)

    @property
    def noun(self) -> str:
        """The noun of the devices that the verb operates."""
        return DEVICE_VERBS[self.verb]

    # ---- evaluating

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._zero = np.zeros((worlds, self.config.slots))  # joint values as the episode began
        self._before = np.zeros((worlds, self.config.slots))  # how far devices had been moved then

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        self._zero[worlds] = self._measure(state)[worlds]
        self._before[worlds] = moved(state, self.device_width)[worlds]

    def _measure(self, state: State) -> Array:
        """(N, K) the joint value of each device, metres or radians, from any zero."""
        return MOTIONS[self.noun].measure(state.objects, state.quaternions)

    def travel(self, state: State) -> Array:
        """(N, K) in [-1, 1]: the share of its range that each device has travelled; 0 for other objects."""
        gone = DEVICES[self.noun].travelled(self.device_width, self._zero, self._measure(state))
        return np.where(state.shown, gone, 0.0)

    def before(self, referent: NDArray[np.int64]) -> Array:
        """(N,) how far the referents (N,) had been moved as the episode began, in shares of their way."""
        return self._before[self._rows, referent]

    def seen(self, state: State) -> Array:
        return np.concatenate((facing(state.quaternions), self.travel(state)[..., None]), axis=2)

    def _gone(self, state: State) -> Array:
        """(N,) the share of its range that the referent has travelled, in either direction."""
        return np.abs(self.travel(state)[self._rows, state.referent])

    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        return self._gone(state) >= OPERATED

    def _disturbed(self, state: State) -> NDArray[np.bool_]:
        ways = self.travel(state)
        ways = np.where(np.isin(state.nouns, SPRUNG), ways, np.abs(ways))  # a button that is let go springs back
        ways[self._rows, state.referent] = 0.0
        return np.any(ways >= OTHER_OPERATED, axis=1)

    def _potentials(self, state: State) -> dict[str, Array]:
        turns = state.quaternions[self._rows, state.referent]
        before = self.before(state.referent)
        start = MOTIONS[self.noun].start(self._referent(state), turns, state.gripper, before)
        return {
            "approach": -length(start - state.gripper),
            "operate": np.minimum(self._gone(state) / OPERATED, 1.0),
        }

    def relabel(self, placed: Placed, moments: State, rng: Generator) -> EpisodeSpec | None:
        """Return None: an episode ends before another device is operated."""
        return None


@register_task("press", verb="press")
@register_task("switch", verb="switch")
@register_task("turn", verb="turn")
class DevicesAlone(OperateDevice):
    """Operate one of several devices of the same noun.

    Instruction: "press the red button", "switch the blue lever", "turn the green wheel".
    Success: the device has travelled `OPERATED` of its range, for `hold_steps` steps. A lever and a wheel stay where
        they are left; a button springs back.
    Failure: wrong_object, once another device has travelled `OTHER_OPERATED` of its range.
    Reward terms: approach (metres from the gripper to where it operates the device from, negative) and operate (the
        travelled share of what success requires); success, wrong_object, wrong_target (always 0) and time.
    Config keys: num_objects devices of task.nouns, object_size (metres across a device).
    """

    traits = replace(OperateDevice.traits, operates=True)

    def _configure(self, config: TaskConfig, person: Person | None) -> None:
        self.nouns = (self.noun,)
        super()._configure(config, person)

    @property
    def bodies(self) -> tuple[int, int, int]:
        return 0, 0, 0

    @property
    def devices(self) -> tuple[str, ...]:
        return (self.noun,) * self.config.num_objects

    def _placed(self, rng: Generator) -> Placed:
        """Draw devices with random yaw."""
        placed = super()._placed(rng)
        positions = placed.scene.positions.copy()
        positions[:, 2] = DEVICES[self.noun].grip(self.device_width)[2]
        yaw = rng.uniform(-math.pi, math.pi, len(positions))
        return placed._replace(scene=placed.scene.moved(positions), yaw=yaw)

    def _is_feasible(self, placed: Placed) -> bool:
        x0, x1, y0, y1 = self._area
        places = placed.scene.positions[:, :2]
        return bool(((places >= [x0 + MARGIN, y0 + MARGIN]) & (places <= [x1 - MARGIN, y1 - MARGIN])).all())


@register_task("nl_press", verb="press")
@register_task("nl_switch", verb="switch")
@register_task("nl_turn", verb="turn")
class DevicesAmongObjects(OperateDevice):
    """Operate one of two devices of the same noun, among another device and loose objects.

    The gripper can hold things, although nothing is to be held. Loose objects are never the referent.

    Instruction: "press the red button", "switch the blue lever", "turn the green wheel".
    Success: the device has travelled `OPERATED` of its range, for `hold_steps` steps.
    Failure: wrong_object, once another device has travelled `OTHER_OPERATED` of its range, or a loose object was moved.
    Reward terms: approach (metres from the gripper to where it operates the device from, negative) and operate (the
        travelled share of what success requires); success, wrong_object, wrong_target (always 0) and time.
    Config keys: num_objects and min_objects count the devices; spacing; object_size (of loose objects; devices are
        `WIDTHS` times as wide).
    """

    traits = replace(OperateDevice.traits, grips=True)
    fixtures = tuple(DEVICES)
    columns = DEVICE_COLUMNS

    def _configure(self, config: TaskConfig, person: Person | None) -> None:
        if config.min_objects < ALIKE + OTHERS:
            raise ConfigError(
                f"task.min_objects={config.min_objects} must be at least {ALIKE + OTHERS} in task.name={config.name}: "
                f"{ALIKE + OTHERS} devices are among them"
            )
        super()._configure(config, person)
        # metres from where a device of each noun stands to its handle
        self._handle_offsets = np.zeros((len(NOUNS), 3))
        self._handle_offsets[DEVICE_NUMBERS] = [device.grip(self.device_width) for device in DEVICES.values()]

    @property
    def device_width(self) -> float:
        return WIDTHS * self.config.object_size

    @property
    def bodies(self) -> tuple[int, int, int]:
        free, fixed, targets = super().bodies
        return free - ALIKE - OTHERS, fixed, targets

    @property
    def devices(self) -> tuple[str, ...]:
        return (*(self.noun,) * ALIKE, *self._other_nouns() * OTHERS)

    def _other_nouns(self) -> tuple[str, ...]:
        """Return the nouns of devices that the verb does not operate."""
        return tuple(noun for noun in DEVICES if noun != self.noun)

    # ---- evaluating

    def _of_each_noun(self, nouns: NDArray[np.int64], values: Callable[[str, NDArray[np.bool_]], Array]) -> Array:
        """(...) values(noun, which) for the devices of each noun, which `which` (...) marks; 0 for other objects."""
        found = np.zeros(nouns.shape)
        for noun, number in zip(DEVICES, DEVICE_NUMBERS, strict=True):
            which = nouns == number
            found[which] = values(noun, which)
        return found

    def _measure(self, state: State) -> Array:
        def measured(noun: str, which: NDArray[np.bool_]) -> Array:
            return MOTIONS[noun].measure(state.objects[which], state.quaternions[which])

        return self._of_each_noun(state.nouns, measured)

    def travel(self, state: State) -> Array:
        values, width = self._measure(state), self.device_width

        def travelled(noun: str, which: NDArray[np.bool_]) -> Array:
            return DEVICES[noun].travelled(width, self._zero[which], values[which])

        return np.where(state.shown, self._of_each_noun(state.nouns, travelled), 0.0)

    def _disturbed(self, state: State) -> NDArray[np.bool_]:
        return super()._disturbed(state) | Manipulation._disturbed(self, state)

    def seen(self, state: State) -> Array:
        return device_columns(state.nouns, facing(state.quaternions), self.travel(state))

    def described(self, episode: EpisodeSpec) -> Array:
        scene = episode.scene
        yaw = np.zeros(len(scene)) if episode.yaw is None else episode.yaw
        return device_columns(scene.nouns, np.column_stack((np.cos(yaw), np.sin(yaw))), np.zeros(len(scene)))

    # ---- drawing

    def _placed(self, rng: Generator) -> Placed:
        config = self.config
        try:
            drawn = from_all(self._specs(rng)).draw(rng, config.spacing)
        except LanguageError as error:
            raise ConfigError(f"task.num_objects={config.num_objects}: {error}") from None
        scene = drawn.scene
        arrays = scene.nouns, scene.colors, self._handles(drawn), scene.sizes
        return drawn._replace(scene=Scene.from_arrays(*arrays, viewpoint=config.viewpoint))

    def _handles(self, placed: Placed) -> Array:
        """(K, 3) metres: where the handles of devices are that stand at the scene's places, and other objects."""
        return placed.scene.positions + turned(self._handle_offsets[placed.scene.nouns], placed.yaw)

    def _specs(self, rng: Generator) -> list[ObjectSpec]:
        """Draw devices with random yaw, and loose objects, all in random colours."""
        count = self._draw_count(rng)
        nouns = [self.noun] * ALIKE + rng.choice(self._other_nouns(), OTHERS).tolist()
        nouns += rng.choice(self.config.nouns, count - len(nouns)).tolist()
        return [self._spec(noun, color) for noun, color in zip(nouns, rng.choice(list(COLORS), count), strict=True)]

    def _spec(self, noun: str, color: str) -> ObjectSpec:
        """Return a device or a loose object of this noun and colour."""
        x0, x1, y0, y1 = self._area
        if noun in DEVICES:
            stand = [x0 + AMONG_MARGIN, x1 - AMONG_MARGIN, y0 + AMONG_MARGIN, y1 - AMONG_MARGIN, 0.0, 0.0]
            return ObjectSpec(noun, str(color), stand, self.device_width, random_rotation=True)
        size = self.config.object_size
        return ObjectSpec(noun, str(color), [x0, x1, y0, y1, size / 2, size / 2], size)

    def _movable(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) which objects the verb applies to."""
        return placed.scene.nouns == list(NOUNS).index(self.noun)

    def _held_scene(self, scene: Scene, referent: int, target: int | None, rng: Generator) -> Scene | None:
        """Return None: devices are not held."""
        return None
