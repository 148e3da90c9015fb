"""Scenes of a room with fittings, loose objects, devices and the open hand of a person, and their observations."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.errors import ConfigError
from envs.sim.devices import DEVICES, facing, turned
from envs.sim.workspace import WorkspaceConfig
from envs.tasks.shared.base import Task
from envs.tasks.shared.device_motion import DEVICE_COLUMNS, DEVICE_NUMBERS, WIDTHS, device_columns, moved
from envs.tasks.shared.feasible import PLAIN_VERBS, Room
from envs.tasks.shared.fittings import FITTING_COLUMNS, FITTING_NUMBERS, FittingStarts, SceneFittings
from envs.tasks.shared.free_places import FINE_COLUMNS, FREE_COLUMNS, FreeTable
from envs.tasks.shared.geometry import scatter
from envs.tasks.shared.manipulation import STAGES, carrying_stage, check_counts, traits_by_counts
from envs.tasks.shared.open_hand import HAND_COLUMN, HAND_NUMBER, palm_region, with_hand
from envs.tasks.shared.task_config import TaskConfig
from envs.tasks.shared.types import Array, Column, EpisodeSpec, State, TaskTraits
from human import Person
from language import COLORS, FITTINGS, HAND, NOUNS, Placed, Scene
from language.verbs import DEVICE_VERBS, HANDING

MOST_ALIKE = 2  # devices of one noun, at most
JITTER = 0.01  # greatest offset of a device along the row from the middle of its section, metres
SIDEWAYS = 0.8  # greatest angle between the way of a lever and the row, radians: arms reach both ends of the way
TURNED = 1.0  # share of its way by which a wheel is turned as an episode begins, at most
STORED, STACKED = 0.3, 0.5  # chances that an object lies in each fitting, and that one stands on another
AT_AN_OBJECT = 0.5  # of the episodes that the curriculum begins elsewhere, the share that begins over another object
ABOVE = 0.12  # metres over an object up to which a gripper begins there
HIGH = (0.2, 0.4)  # metres over the table between which a gripper begins anywhere
OVER_DEVICE = 0.04  # metres over a device from which on a gripper begins there
LEAST_ON_TABLE = 2  # loose objects that stand on the table, at least
MOVED_COLUMNS = (*DEVICE_COLUMNS, Column("share of its way from its start", -1.0, 1.0))


class RoomScenes(Task):
    """Scenes of a room, their observations, and the state that decides what is feasible.

    Fittings are open or shut, with an object in them or without, and an object may stand on another one. With
    `task.devices`, that many devices stand behind the loose objects; the task then has verbs and columns for them, and
    with `task.hand` also for the open hand of a person, whose place is drawn anew for each episode.
    """

    traits = TaskTraits(speaks=True, moves=True, grips=True)
    stages = STAGES
    fixtures: tuple[str, ...] = FITTINGS
    columns: tuple[Column, ...] = (*FITTING_COLUMNS, *FREE_COLUMNS)
    fitting_starts = FittingStarts(wide=(0.85, 1.0))
    fittings: SceneFittings
    verbs: tuple[str, ...] = PLAIN_VERBS

    def _configure(self, config: TaskConfig, person: Person | None) -> None:
        self.traits = traits_by_counts(self.traits, config)
        if config.devices:
            hands, handing = ((HAND,), (HANDING,)) if config.hand else ((), ())
            self.verbs, self.fixtures = (*PLAIN_VERBS, *DEVICE_VERBS, *handing), (*FITTINGS, *DEVICES, *hands)
            (is_fitting, how_open), (is_device, how_moved) = _split(FITTING_COLUMNS), _split(MOVED_COLUMNS)
            is_hand = (HAND_COLUMN,) if config.hand else ()
            marks = *is_fitting, *is_device, *is_hand  # they come first
            self.columns = (*marks, *how_moved, *how_open, *FINE_COLUMNS)
        self.kind_names = self.verbs
        super()._configure(config, person)
        check_counts(config, self.traits, self.verb)

    def prepare(self, workspace: WorkspaceConfig) -> None:
        self._device_area = workspace.device_area
        if self.config.devices and not self._device_area:
            raise ConfigError(
                f"task.devices={self.config.devices} needs a workspace with a device_area: choose workspace=studio"
            )
        if self.config.hand:
            self._palms = palm_region(self.config, workspace, "studio")

    @property
    def bodies(self) -> tuple[int, int, int]:
        free, fixed, targets = super().bodies
        return free - self.config.devices - self.config.hand, fixed, targets

    @property
    def devices(self) -> tuple[str, ...]:
        return most_devices(self.config.devices)

    @property
    def device_width(self) -> float:
        return WIDTHS * self.config.object_size

    # ---- evaluating

    def _allocate(self, worlds: int) -> None:
        self._table = FreeTable(self._area, self.config.object_size, worlds, self.config.slots)

    def reset(self, worlds: NDArray[np.int64], state: State) -> None:
        """Begin new episodes in these worlds, or continue with another instruction."""
        self._table.note(worlds, state)

    def stage(self, state: State) -> NDArray[np.int64]:
        return carrying_stage(state, self.traits.grips, self.config.radius)

    @abstractmethod
    def travel(self, state: State) -> Array:
        """(N, K) how far devices have been moved since the instruction was given, in shares of their way."""

    def moved(self, state: State) -> Array:
        """(N, K) how far devices are from their start, in shares of their way; 0 for other objects."""
        return moved(state, self.device_width) if self.config.devices else np.zeros(state.shown.shape)

    def seen(self, state: State) -> Array:
        devices = np.zeros((*state.shown.shape, 0))
        if self.config.devices:
            ahead, travel = facing(state.quaternions), self.travel(state)
            devices = moved_columns(state.nouns, ahead, travel, self.moved(state))
        return self._joined(state.nouns, super().seen(state), devices, self._table.offsets(state))

    def described(self, episode: EpisodeSpec) -> Array:
        nouns, devices = episode.scene.nouns, np.zeros((len(episode.scene), 0))
        if self.config.devices:
            assert episode.yaw is not None
            assert episode.shares is not None
            gone = moved_by(nouns, episode.shares)
            ahead = directions(nouns, episode.yaw, gone)
            devices = moved_columns(nouns, ahead, np.zeros(len(nouns)), gone)
        return self._joined(nouns, super().described(episode), devices, self._table.described(episode))

    def _joined(self, nouns: NDArray[np.int64], fittings: Array, devices: Array, free: Array) -> Array:
        """(..., C) the values of `columns`. free: (..., 3) metres to where the table is free for each object."""
        if not self.config.devices:
            return np.concatenate((fittings, free[..., :2]), axis=-1)
        hands = [nouns[..., None] == HAND_NUMBER] if self.config.hand else []
        kinds, marks = len(FITTINGS), len(DEVICES)
        is_each = fittings[..., :kinds], devices[..., :marks], *hands
        return np.concatenate((*is_each, devices[..., marks:], fittings[..., kinds:], free, free), axis=-1)

    # ---- drawing

    def room(self, scene: Scene, moved: Array | None = None) -> Room:
        """Return the state of the scene that decides what is feasible.

        moved: (K,) how far devices are from their start, in shares of their way; None: they are there.
        """
        nouns, places = scene.nouns, scene.positions
        return Room(
            scene,
            shares=self.fittings.shares(nouns, places),
            inside=self.fittings.inside(nouns, places),
            fits=np.isin(nouns, FITTING_NUMBERS),
            area=self._area,
            moved=moved,
        )

    def _draw_room(self, rng: Generator) -> tuple[Placed, Room]:
        """Draw a scene with its devices and the hand, and the state that decides what is feasible."""
        placed, count = self._placed(rng), self.config.devices
        if not count:
            return placed, self.room(placed.scene)
        placed, gone = draw_devices(placed, count, area=self._device_area, width=self.device_width, rng=rng)
        if self.config.hand:
            placed, gone = with_hand(placed, rng.uniform(self._palms[0], self._palms[1])), np.append(gone, 0.0)
        return placed, self.room(placed.scene, gone)

    def _scene(self, rng: Generator) -> Scene:
        """Draw loose objects, targets and fittings. The first objects may lie in fittings, the next one on the last."""
        config = self.config
        count = self._draw_count(rng) - len(FITTINGS) - config.devices - config.hand
        places = np.array(
            scatter(
                rng, count + config.num_targets, area=self._area, spacing=config.spacing, height=config.object_size / 2
            )
        )
        fitting_nouns, handles = list(self.fittings.by_noun), self.fittings.draw_handles(rng)
        stored = np.flatnonzero(rng.random(len(handles)) < STORED)[: max(count - LEAST_ON_TABLE, 0)]
        places[: len(stored)] = self.fittings.middles(np.array(fitting_nouns)[stored], handles[stored])
        if rng.random() < STACKED and count - len(stored) > 1:
            places[len(stored)] = places[count - 1] + [0.0, 0.0, config.object_size]
        nouns = np.concatenate((self._nouns[rng.integers(len(self._nouns), size=len(places))], fitting_nouns))
        targets = (np.arange(len(nouns)) >= count) & (np.arange(len(nouns)) < len(places))
        places = np.concatenate((places, handles))
        colors = rng.integers(len(COLORS), size=len(nouns))
        return Scene.from_arrays(nouns, colors, places, config.object_size, targets=targets, viewpoint=config.viewpoint)

    def _elsewhere_offset(self, room: Room, referent: int, rng: Generator) -> Array:
        """(3,) metres from where the gripper would hold the referent to where it begins: over another object, as if
        something had been done there, or anywhere in the air."""
        scene, at = room.scene, room.scene.positions[referent]
        if rng.random() < AT_AN_OBJECT:
            anchors = np.flatnonzero(room.ready | room.fits | room.devices)
            anchor = anchors[rng.integers(len(anchors))]
            least = OVER_DEVICE if room.devices[anchor] else 0.0
            place = scene.positions[anchor] + [0.0, 0.0, rng.uniform(least, ABOVE)]
        else:
            low, high = scene.positions[:, :2].min(0), scene.positions[:, :2].max(0)
            place = np.append(rng.uniform(low, high), rng.uniform(*HIGH))
        return place - at


# ---- devices of a scene


def most_devices(count: int) -> tuple[str, ...]:
    """Return the nouns of all devices that scenes with `count` devices can show."""
    return tuple(noun for noun in DEVICES for _ in range(min(MOST_ALIKE, count)))


def draw_devices(
    placed: Placed, count: int, *, area: Sequence[float], width: float, rng: Generator
) -> tuple[Placed, Array]:
    """Add devices behind the other objects, and (K,) how far each is moved, in shares of its way.

    They stand in a row along y. Levers are on or off, and wheels anywhere.

    Args:
        placed: the scene so far.
        count: how many devices.
        area: x0, x1, y0, y1 where they stand, metres.
        width: of a device, metres.
    """
    scene = placed.scene
    nouns = rng.permutation([noun for noun in DEVICES for _ in range(MOST_ALIKE)])[:count].tolist()
    x0, x1, y0, y1 = area
    stand = np.stack((rng.uniform(x0, x1, count), np.linspace(y0, y1, 2 * count + 1)[1::2], np.zeros(count)), axis=1)
    stand[:, 1] += rng.uniform(-JITTER, JITTER, count)
    yaw = np.array([_yaw(noun, rng) for noun in nouns])
    moved = np.array([_moved(noun, rng) for noun in nouns])
    handles = stand + turned(np.array([_grip(*each, width) for each in zip(nouns, moved, strict=True)]), yaw)
    joined = Scene.from_arrays(
        nouns=np.concatenate((scene.nouns, [list(NOUNS).index(noun) for noun in nouns])),
        colors=np.concatenate((scene.colors, rng.integers(len(COLORS), size=count))),
        positions=np.concatenate((scene.positions, handles)),
        size=np.concatenate((scene.sizes, np.full(count, width))),
        targets=np.concatenate((scene.targets, np.zeros(count, bool))),
        viewpoint=scene.viewpoint,
    )
    still = np.zeros(len(scene))
    fixed = np.concatenate((placed.fixed, np.zeros(count, bool)))
    return Placed(joined, np.concatenate((placed.yaw, yaw)), fixed), np.concatenate((still, moved))


def _yaw(noun: str, rng: Generator) -> float:
    if noun == "lever":
        return float(rng.choice((-1, 1)) * np.pi / 2 + rng.uniform(-SIDEWAYS, SIDEWAYS))
    return float(rng.uniform(-np.pi, np.pi))


def _moved(noun: str, rng: Generator) -> float:
    if noun == "lever":
        return float(rng.integers(2))
    return float(rng.uniform(-TURNED, TURNED)) if noun == "wheel" else 0.0


def _grip(noun: str, moved: float, width: float) -> Array:
    """(3,) metres from where a device stands that faces along x to its handle."""
    device = DEVICES[noun]
    return device.grip(width, device.start + moved * device.way)


def shares_of(nouns: NDArray[np.int64], moved: Array) -> Array:
    """(...) the shares of their joints' ranges, low to high, at which devices are; 0 for other objects.

    moved: (...) in shares of their way from their start.
    """
    shares = np.zeros(nouns.shape)
    for number, device in zip(DEVICE_NUMBERS, DEVICES.values(), strict=True):
        which = nouns == number
        shares[which] = (device.start + moved[which] * device.way - device.low) / (device.high - device.low)
    return np.clip(shares, 0.0, 1.0)


def moved_by(nouns: NDArray[np.int64], shares: Array) -> Array:
    """(...) how far devices are moved whose joints are at these shares (...) of their ranges: see `shares_of`."""
    moved = np.zeros(nouns.shape)
    for number, device in zip(DEVICE_NUMBERS, DEVICES.values(), strict=True):
        which = nouns == number
        moved[which] = (device.value(shares[which]) - device.start) / device.way
    return moved


def moved_columns(nouns: NDArray[np.int64], ahead: Array, travel: Array, moved: Array) -> Array:
    """(..., C) the values of `MOVED_COLUMNS`. nouns, travel, moved: (...). ahead: (..., 2) where devices face."""
    return np.concatenate((device_columns(nouns, ahead, travel), moved[..., None]), axis=-1)


def directions(nouns: NDArray[np.int64], yaw: Array, moved: Array) -> Array:
    """(..., 2) unit vectors over the table to where devices face. Arguments: (...)."""
    wheels = nouns == list(NOUNS).index("wheel")
    angle = yaw + np.where(wheels, moved * DEVICES["wheel"].way, 0.0)
    return np.stack((np.cos(angle), np.sin(angle)), axis=-1)


def _split(columns: tuple[Column, ...]) -> tuple[tuple[Column, ...], tuple[Column, ...]]:
    """Return the columns that mark what an object is, and the others."""
    marks = tuple(column for column in columns if column.name.startswith("is a "))
    return marks, columns[len(marks) :]
