"""Common logic of the tasks in which a device that is operated stands among other devices and loose objects."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from conf.schema import ConfigError
from envs.sim.devices import DEVICES, facing, turned
from envs.tasks.device_motion import MOTIONS
from envs.tasks.manipulation import Manipulation
from envs.tasks.operate import Operate
from envs.tasks.types import Array, Column, EpisodeSpec, State, TaskConfig
from human import Person
from language import COLORS, NOUNS, LanguageError, ObjectSpec, Placed, Scene, from_all

WIDTHS = 1.4  # width of a device, in widths of a loose object
ALIKE, OTHERS = 2, 1  # devices of the verb's noun in a scene, and of another noun
MARGIN = 0.065  # metres from the border of the object area to where devices stand, so that a gripper reaches them
NUMBERS = np.array([list(NOUNS).index(noun) for noun in DEVICES])
COLUMNS = (*(Column(f"is a {noun}", 0.0, 1.0) for noun in DEVICES), *Operate.columns)


class OperateAmong(Operate):
    """Two devices of the verb's noun, another device, and loose objects, which are never the referent.

    `num_objects` counts the devices, too. A loose object that is moved is the wrong object, like another device that
    is operated. The gripper can hold things, although nothing is to be held.
    """

    fixtures = tuple(DEVICES)
    grips = True
    columns = COLUMNS

    def __init__(
        self, config: TaskConfig, object_area: Sequence[float], num_worlds: int, person: Person | None = None
    ) -> None:
        if config.min_objects < ALIKE + OTHERS:
            raise ConfigError(
                f"task.min_objects={config.min_objects} must be at least {ALIKE + OTHERS} in task.name={config.name}: "
                f"{ALIKE + OTHERS} devices are among them"
            )
        super().__init__(config, object_area, num_worlds, person)
        self._grips = np.zeros((len(NOUNS), 3))  # of a device of each noun, from where it stands to its handle
        self._grips[NUMBERS] = [device.grip(self.device_width) for device in DEVICES.values()]

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
        return tuple(noun for noun in DEVICES if noun != self.noun)

    # ---- evaluating

    def _of_each_noun(self, nouns: NDArray[np.int64], values: Callable[[str, NDArray[np.bool_]], Array]) -> Array:
        """(...) values(noun, which) for the devices of each noun, which `which` (...) marks; 0 for other objects."""
        found = np.zeros(nouns.shape)
        for noun, number in zip(DEVICES, NUMBERS, strict=True):
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
        return columns_of(state.nouns, facing(state.quaternions), self.travel(state))

    def described(self, episode: EpisodeSpec) -> Array:
        scene = episode.scene
        yaw = np.zeros(len(scene)) if episode.yaw is None else episode.yaw
        return columns_of(scene.nouns, np.column_stack((np.cos(yaw), np.sin(yaw))), np.zeros(len(scene)))

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
        return placed.scene.positions + turned(self._grips[placed.scene.nouns], placed.yaw)

    def _specs(self, rng: Generator) -> list[ObjectSpec]:
        """Devices with random yaw, and loose objects, all in random colours."""
        config = self.config
        count = int(rng.integers(config.min_objects, config.num_objects + 1))
        nouns = [self.noun] * ALIKE + rng.choice(self._other_nouns(), OTHERS).tolist()
        nouns += rng.choice(config.nouns, count - len(nouns)).tolist()
        return [self._spec(noun, color) for noun, color in zip(nouns, rng.choice(list(COLORS), count), strict=True)]

    def _spec(self, noun: str, color: str) -> ObjectSpec:
        """A device or a loose object of this noun and colour."""
        x0, x1, y0, y1 = self._area
        if noun in DEVICES:
            stand = [x0 + MARGIN, x1 - MARGIN, y0 + MARGIN, y1 - MARGIN, 0.0, 0.0]
            return ObjectSpec(noun, str(color), stand, self.device_width, random_rotation=True)
        size = self.config.object_size
        return ObjectSpec(noun, str(color), [x0, x1, y0, y1, size / 2, size / 2], size)

    def _movable(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) which objects the verb applies to."""
        return placed.scene.nouns == list(NOUNS).index(self.noun)

    def _held_scene(self, scene: Scene, referent: int, target: int | None, rng: Generator) -> Scene | None:
        """None: devices are not held."""
        return None


def columns_of(nouns: NDArray[np.int64], ahead: Array, travel: Array) -> Array:
    """(..., C) the values of `COLUMNS`. nouns, travel: (...). ahead: (..., 2) where devices face."""
    marks = nouns[..., None] == NUMBERS
    return np.concatenate((marks, np.where(marks.any(-1)[..., None], ahead, 0.0), travel[..., None]), axis=-1)
