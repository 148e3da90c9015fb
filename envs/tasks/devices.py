"""How far devices have been moved, and from where a gripper moves them, by the poses of their handles."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.errors import ConfigError
from envs.sim.devices import DEVICES, facing, turned
from envs.tasks.shared.base import register_task
from envs.tasks.shared.geometry import length
from envs.tasks.shared.manipulation import Manipulation
from envs.tasks.shared.types import Array, Column, EpisodeSpec, State, TaskConfig
from human import Person
from language import COLORS, NOUNS, LanguageError, ObjectSpec, Placed, Scene, from_all

BEHIND = 0.035  # metres from a lever's knob to the middle of a gripper that is about to push it
BESIDE = 0.035  # metres from a wheel's peg to the middle of a gripper that is about to push it
OVER = 0.5  # share of its way from which a lever counts as switched, and is switched back
OFF_CENTRE = 0.15  # share of its way from which a wheel is turned back: the other way may be too short


class Motion(NamedTuple):
    """How devices of one noun move.

    measure: maps positions (..., 3), metres, and quaternions (..., 4) of handles to joint values (...), metres or
        radians, with an arbitrary zero.
    start: returns where a gripper begins to move each device, (N, 3) metres, given the positions (N, 3) and quaternions
        (N, 4) of handles, the grippers (N, 3), and how far the devices were moved before the instruction (N,).
    """

    measure: Callable[[Array, Array], Array]
    start: Callable[[Array, Array, Array, Array], Array]


def _depth(places: Array, quaternions: Array) -> Array:
    return -places[..., 2]


def _lean(places: Array, quaternions: Array) -> Array:
    """(...) radians by which levers lean in the direction that they face."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    return np.arctan2(2 * (y * w - x * z), 1 - 2 * (x * x + y * y))


def _direction(places: Array, quaternions: Array) -> Array:
    ahead = facing(quaternions)
    return np.arctan2(ahead[..., 1], ahead[..., 0])


def _on_top(places: Array, quaternions: Array, grippers: Array, before: Array) -> Array:
    return places


def _behind(places: Array, quaternions: Array, grippers: Array, before: Array) -> Array:
    """Behind the knob; in front of it where the lever is over."""
    ahead = facing(quaternions) * lever_way(before)[:, None]
    return places - BEHIND * np.column_stack((ahead, np.zeros(len(ahead))))


def _nearer_side(places: Array, quaternions: Array, grippers: Array, before: Array) -> Array:
    """The side of the peg nearer to the gripper; for a turned wheel, the side from which it is turned back."""
    out = facing(quaternions)
    along = BESIDE * np.stack((-out[:, 1], out[:, 0], np.zeros(len(out))), axis=1)
    nearer = length(places + along - grippers) < length(places - along - grippers)
    onward = wheel_way(before)
    nearer = np.where(onward == 0, nearer, onward < 0)
    return np.where(nearer[:, None], places + along, places - along)


def lever_way(before: Array) -> Array:
    """(N,) 1 or -1: the direction in which to switch levers, given the shares of their way moved before, (N,)."""
    return np.where(before > OVER, -1.0, 1.0)


def wheel_way(before: Array) -> Array:
    """(N,) the direction in which to turn wheels, given the shares of their way moved before, (N,); 0: either."""
    return np.where(np.abs(before) > OFF_CENTRE, -np.sign(before), 0.0)


def moved(state: State, width: float) -> Array:
    """(N, K) in [-1, 1]: how far devices are from their start, in shares of their way; 0 for other objects."""
    found = np.zeros(state.nouns.shape)
    for noun, device in DEVICES.items():
        which = state.shown & (state.nouns == list(NOUNS).index(noun))
        start = {"button": -device.grip(width)[2], "lever": 0.0, "wheel": state.yaw[which]}[noun]
        now = MOTIONS[noun].measure(state.objects[which], state.quaternions[which])
        found[which] = device.travelled(width, start, now)
    return found


MOTIONS = {
    "button": Motion(_depth, _on_top),
    "lever": Motion(_lean, _behind),
    "wheel": Motion(_direction, _nearer_side),
}


OPERATED = 0.8  # share of its range at which a device is operated
OTHER_OPERATED = 0.3  # share of its range at which another device counts as the wrong object
SPRUNG = [list(NOUNS).index(noun) for noun, device in DEVICES.items() if device.spring]
MARGIN = 0.05  # metres from the border of the object area to the handles, so that a gripper reaches every side


class Operate(Manipulation):
    """The referent is a device of one noun. The pose of a device is that of its handle.

    Success: the referent has travelled `OPERATED` of its range, for `hold_steps` steps. Another device that has
    travelled `OTHER_OPERATED` of its range ends the episode as `wrong_object`.
    Potentials: approach (metres from the gripper to where it operates the referent from, negative) and operate (the
    travelled share of what success requires).
    """

    noun: str
    columns: tuple[Column, ...] = (
        Column("faces x", -1.0, 1.0),
        Column("faces y", -1.0, 1.0),
        Column("share of its way since the instruction was given", -1.0, 1.0),
    )
    potentials = ("approach", "operate")

    def __init__(
        self, config: TaskConfig, object_area: Sequence[float], num_worlds: int, person: Person | None = None
    ) -> None:
        if len(config.objects):
            raise ConfigError(f"task.objects must be empty in task.name={config.name}: its devices are drawn")
        super().__init__(config, object_area, num_worlds, person)

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
        """None: an episode ends before another device is operated."""
        return None


class OperateAlone(Operate):
    """All objects are devices of that noun."""

    operates = True

    def __init__(
        self, config: TaskConfig, object_area: Sequence[float], num_worlds: int, person: Person | None = None
    ) -> None:
        self.nouns = (self.noun,)
        super().__init__(config, object_area, num_worlds, person)

    @property
    def bodies(self) -> tuple[int, int, int]:
        return 0, 0, 0

    @property
    def devices(self) -> tuple[str, ...]:
        return (self.noun,) * self.config.num_objects

    def _placed(self, rng: Generator) -> Placed:
        """Devices with random yaw."""
        placed = super()._placed(rng)
        positions = placed.scene.positions.copy()
        positions[:, 2] = DEVICES[self.noun].grip(self.device_width)[2]
        yaw = rng.uniform(-math.pi, math.pi, len(positions))
        return placed._replace(scene=placed.scene.moved(positions), yaw=yaw)

    def _is_feasible(self, placed: Placed) -> bool:
        x0, x1, y0, y1 = self._area
        places = placed.scene.positions[:, :2]
        return bool(((places >= [x0 + MARGIN, y0 + MARGIN]) & (places <= [x1 - MARGIN, y1 - MARGIN])).all())


WIDTHS = 1.4  # width of a device, in widths of a loose object
ALIKE, OTHERS = 2, 1  # devices of the verb's noun in a scene, and of another noun
AMONG_MARGIN = 0.065  # metres from the border of the object area to where devices stand, so that a gripper reaches them
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
            stand = [x0 + AMONG_MARGIN, x1 - AMONG_MARGIN, y0 + AMONG_MARGIN, y1 - AMONG_MARGIN, 0.0, 0.0]
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


@register_task("press", verb="press")
class PressButton(OperateAlone):
    """ "press the red button"."""

    noun = "button"


@register_task("nl_press", verb="press")
class PressButtonAmong(OperateAmong):
    """ "press the red button", among other objects."""

    noun = "button"


@register_task("switch", verb="switch")
class SwitchLever(OperateAlone):
    """ "switch the blue lever". It stays where it is left."""

    noun = "lever"


@register_task("nl_switch", verb="switch")
class SwitchLeverAmong(OperateAmong):
    """ "switch the blue lever", among other objects."""

    noun = "lever"


@register_task("turn", verb="turn")
class TurnWheel(OperateAlone):
    """ "turn the green wheel". It stays where it is left."""

    noun = "wheel"


@register_task("nl_turn", verb="turn")
class TurnWheelAmong(OperateAmong):
    """ "turn the green wheel", among other objects."""

    noun = "wheel"
