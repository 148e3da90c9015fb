"""The things of one world over control steps: what is seen in single pictures becomes things that stay what they are.

Each detection is matched with the thing that explains it best, by place, noun, colour and role (an assignment of least
cost). Places are filtered (Kalman 1960); what pictures say of noun, colour and role adds up, older pictures counting
less. What the arm or another thing hides stays where it was seen last, what is held moves with the gripper, and a thing
is dropped only once its place was seen empty for several pictures.

Known beforehand, as on a real table: where the table is, the sizes of things, the furniture and its joints, the joints
of devices, and which nouns a task has. How many things there are, and where, only pictures tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from envs.perception.assignment import assignment
from envs.perception.config import PerceptionConfig
from envs.perception.detections import Array, Detections, probabilities, probability
from envs.perception.device_contact import TIP_RADIUS, pressed, pushed, within_devices
from envs.perception.fitting_track import JUMP, KEPT, LEAST, NEAR, NOISE, FollowedFitting, length
from envs.perception.poses import (
    BUTTON,
    CUBE,
    IS_DEVICE,
    LEVER,
    LOOSE,
    WHEEL,
    handles,
    heading,
    product,
    quaternion_of,
    quaternions_of,
    stands,
    upright,
    wheel_starts,
    wrapped,
)
from envs.sim.workspace import Fitting
from envs.tasks import NOTHING
from language import COLORS, HAND, NOUNS

HAND_NUMBER = list(NOUNS).index(HAND)
QUARTER = np.pi / 2  # radians: a cube looks the same after such a turn
JUMPED = 0.1  # metres of the way of a thing that has been moved whose square costs 1 more
WORST = 10.0  # cost from which a detection is not of a thing
RESTLESS = 8  # control steps after a motion in which a thing is expected to move on
ALIKE = 0.6  # widths between two detections of one thing, at most
ANYWHERE = 0.3  # metres by which things may have been moved by hand, standard deviation
LEVEL = 0.008  # metres from its height on the table within which a thing at rest stands on it
ARM = 0.09  # metres from the axis of an arm's links within which it hides things
HOLDS = 0.08  # metres from where a gripper holds to the middle of what it has taken hold of, at most
FOLLOWS = 0.8  # share of a measured turn that is taken at once while the gripper may be turning something
PUSHED = 0.06  # metres beside the gripper's centre within which it covers a handle
LOW = 0.04  # metres above the middle of a device's handle below which the gripper's tip may be moving it
COVERED = 0.2  # share of a measured turn that is taken at once of a handle that the gripper covers
TOLD = 1.0  # least logarithm of the odds of a role that follows from the number of things
SLIP = 0.03  # metres that a held thing may be seen from where the gripper has taken it
SAMPLES = 6  # points along each link


@dataclass(frozen=True, kw_only=True)
class KnownThings:
    """What is known of the things before any is seen.

    nouns: (len(NOUNS),) bool, which there may be. targets: whether some may be see-through. roles: how many
    loose things there are in every episode, and how many of these are see-through; None: not always as many. size: of
    loose things, metres. width: of devices, metres. fittings: by the number of their noun. most: how many things are
    observed. bounds: (2, 3) corners of where things may be, metres. grip_depth, tips: metres from the gripper's centre
    down to the middle of what it holds, and to its own lowest point.
    """

    nouns: NDArray[np.bool_]
    targets: bool
    roles: tuple[int, int] | None
    size: float
    width: float
    fittings: dict[int, Fitting]
    most: int
    bounds: Array
    grip_depth: float
    tips: float


@dataclass(frozen=True, kw_only=True)
class Moment:
    """The arm and the cameras while pictures are taken.

    arm: (J + 1, 3) the joints and the gripper's centre, metres. rotation: (3, 3) of the gripper. holds: whether it
    holds something. cameras: (C, 3) where they are, metres.
    """

    arm: Array
    rotation: Array
    holds: bool
    cameras: Array

    @property
    def gripper(self) -> Array:
        """(3,) the gripper's centre, metres."""
        return self.arm[-1]


@dataclass(kw_only=True)
class Things:
    """T things that are followed, by row.

    ids: never the same twice in an episode. nouns, colors: (T, ...) and targets: (T,) logarithms of the evidence.
    anchors: (T, 3) and covariances: (T, 3, 3) of what is filtered: the middle of a thing; of a device, where it stands.
    yaws: (T,) radians. shares: (T,) of a joint's range. turns: (T, 4) quaternions. hits, missed, strayed, restless:
    (T,) pictures in which it was seen, in which its place was seen empty, in which it was last seen elsewhere, and
    control steps in which it may yet move. starts: (T,) radians, how wheels were placed.
    """

    ids: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    nouns: Array = field(default_factory=lambda: np.zeros((0, len(NOUNS))))
    colors: Array = field(default_factory=lambda: np.zeros((0, len(COLORS))))
    targets: Array = field(default_factory=lambda: np.zeros(0))
    anchors: Array = field(default_factory=lambda: np.zeros((0, 3)))
    covariances: Array = field(default_factory=lambda: np.zeros((0, 3, 3)))
    yaws: Array = field(default_factory=lambda: np.zeros(0))
    shares: Array = field(default_factory=lambda: np.zeros(0))
    starts: Array = field(default_factory=lambda: np.zeros(0))
    turns: Array = field(default_factory=lambda: np.zeros((0, 4)))
    hits: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    missed: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    strayed: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    restless: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))

    def __len__(self) -> int:
        return len(self.ids)

    def keep(self, which: NDArray[np.bool_]) -> None:
        """Drop all rows but these (T,)."""
        if not which.all():
            for name, values in vars(self).items():
                setattr(self, name, values[which])

    def join(self, other: Things) -> None:
        """Add the rows of others."""
        for name, values in vars(self).items():
            setattr(self, name, np.concatenate((values, getattr(other, name))))


@dataclass(frozen=True, kw_only=True)
class Seen:
    """S things as they are observed, (S, ...) each; held: the row of what the gripper holds, or NOTHING.

    nouns, colors: indices. positions: metres; of devices and fittings, those of their handles. yaws: radians at which
    devices were placed. sizes: metres.
    """

    ids: NDArray[np.int64]
    nouns: NDArray[np.int64]
    colors: NDArray[np.int64]
    targets: NDArray[np.bool_]
    positions: Array
    quaternions: Array
    yaws: Array
    sizes: Array
    held: int


class SceneTracker:
    """Follows the things of one world.

    Args:
        config: of the perception.
        known: of the things.
    """

    def __init__(self, config: PerceptionConfig, known: KnownThings) -> None:
        self._config, self._known = config, known
        self._impossible = np.where(known.nouns, 0.0, np.log(LEAST))
        self._general = known.nouns.copy()
        self._general[list(known.fittings)] = False  # fittings are followed along their joints
        self.begin()

    def begin(self) -> None:
        """Forget all things: an episode begins."""
        self._things, self._next, self._pictures = Things(), 0, 0
        self._held, self._gripper = NOTHING, (np.zeros(3), np.eye(3))
        self._fittings = {number: FollowedFitting(each) for number, each in self._known.fittings.items()}

    def expect_motion(self) -> None:
        """Expect everything loose elsewhere in the next picture: somebody has moved something."""
        loose = LOOSE[self._things.nouns.argmax(1)]
        self._things.covariances[loose] += ANYWHERE**2 * np.eye(3)
        self._things.restless[loose] = RESTLESS

    # ---- a control step

    def update(self, detections: Detections, moment: Moment) -> None:
        """Take what is seen after a control step, or as an episode begins."""
        if not self._pictures:
            self._gripper = moment.gripper.copy(), moment.rotation.copy()
        contents = [(each, self._inside(each), each.handle) for each in self._fittings.values()]
        self._move(moment)
        seen = self._without_fittings(self._possible(detections), moment)
        self._enclosed = self._carry(contents)
        anchors = self._anchors_of(seen)
        rows, columns, jumps = self._matched(seen, anchors)
        self._correct(rows, columns, seen=seen, anchors=anchors, jumps=jumps, moment=moment)
        new = np.setdiff1d(np.arange(len(seen)), columns)
        self._miss(rows, moment)
        self._join(seen[new], anchors[new], moment)
        self._tell_roles()
        self._note_held(moment)
        self._operate(moment)
        self._level()
        self._gripper = moment.gripper.copy(), moment.rotation.copy()
        self._pictures += 1

    def _possible(self, detections: Detections) -> Detections:
        """Return the detections of what there can be, where it can be; nouns and roles that cannot be are ruled out."""
        low, high = self._known.bounds
        inside = ((detections.positions >= low) & (detections.positions <= high)).all(1)
        chosen = inside & (detections.presence >= self._config.presence / 2)
        seen = detections[chosen & (self._known.nouns | LOOSE | IS_DEVICE)[detections.nouns.argmax(1)]]
        nouns = np.where(self._known.nouns, np.maximum(seen.nouns, LEAST), 0.0)
        nouns /= nouns.sum(1, keepdims=True)
        targets = np.clip(seen.targets, LEAST, 1 - LEAST) if self._known.targets else np.full(len(seen), LEAST)
        return replace(seen, nouns=nouns, targets=np.where(LOOSE[nouns.argmax(1)], targets, LEAST))

    def _without_fittings(self, seen: Detections, moment: Moment) -> Detections:
        """Take what is seen of fittings, and return the other detections."""
        number = seen.nouns.argmax(1)
        for noun, fitting in self._fittings.items():
            held = self._held == _fitting_id(noun)
            fitting.update(seen[number == noun], moment.gripper, self._config, held=held)
        return seen[~np.isin(number, list(self._fittings))]

    def _inside(self, fitting: FollowedFitting) -> NDArray[np.bool_]:
        """(T,) which loose things are in a fitting, and not in the gripper."""
        things = self._things
        return fitting.holds(things.anchors) & LOOSE[things.nouns.argmax(1)] & (things.ids != self._held)

    def _carry(self, contents: Sequence[tuple[FollowedFitting, NDArray[np.bool_], Array]]) -> NDArray[np.bool_]:
        """Move what is in drawers with them. Returns which things (T,) are in any fitting.

        contents: each fitting, what was in it (T,), and where its handle was, metres.
        """
        enclosed = np.zeros(len(self._things), bool)
        for fitting, inside, handle in contents:
            enclosed |= inside
            if fitting.slides:
                self._things.anchors[inside] += fitting.handle - handle
        return enclosed

    def _motion(self, moment: Moment) -> tuple[Array, Array]:
        """Return where the gripper was, (3,) metres, and by which rotation (3, 3) it has turned since."""
        before, rotation = self._gripper
        return before, moment.rotation @ rotation.T

    def _move(self, moment: Moment) -> None:
        """Let time pass: what is held moves with the gripper, and what moves may be farther away."""
        things, config = self._things, self._config
        held, (before, turn) = np.flatnonzero(things.ids == self._held), self._motion(moment)
        if len(held):
            things.anchors[held] = moment.gripper + (things.anchors[held] - before) @ turn.T
            things.turns[held] = product(quaternion_of(turn), things.turns[held])
            things.yaws[held] = heading(things.turns[held])
        for noun, fitting in self._fittings.items():
            if self._held == _fitting_id(noun):
                fitting.carry(moment.gripper + turn @ (fitting.handle - before))
        noise = np.where(things.restless > 0, config.motion, config.drift)
        near = length(things.anchors - moment.gripper) < NEAR
        noise = np.where(near, np.maximum(noise, config.motion / 10), noise)
        noise[self._devices | (things.ids == self._held)] = config.drift
        things.covariances = things.covariances + (noise * noise)[:, None, None] * np.eye(3)
        things.restless = np.maximum(things.restless - 1, 0)

    @property
    def _devices(self) -> NDArray[np.bool_]:
        """(T,) which things are devices."""
        return IS_DEVICE[self._things.nouns.argmax(1)]

    def _places(self, which: NDArray) -> Array:
        """(W, 3) where these things are; of devices, their handles; metres."""
        things = self._things
        yaws, shares = things.yaws[which], things.shares[which]
        return handles(
            things.nouns[which].argmax(1), things.anchors[which], yaws=yaws, shares=shares, width=self._known.width
        )

    def _anchors_of(self, seen: Detections) -> Array:
        """(D, 3) what is filtered of each detection: its place, or where the device stands whose handle is seen."""
        return stands(seen.nouns.argmax(1), seen.positions, yaws=seen.yaws, shares=seen.shares, width=self._known.width)

    # ---- which detection is of which thing

    def _matched(self, seen: Detections, anchors: Array) -> tuple[NDArray, NDArray, NDArray[np.bool_]]:
        """Return rows of things, the detections of them, and whether the thing would have been moved there."""
        things = self._things
        if not len(things) or not len(seen):
            return np.zeros(0, int), np.zeros(0, int), np.zeros(0, bool)
        offset = anchors[None] - things.anchors[:, None]
        spread = things.covariances[:, None] + seen.covariances[None] + NOISE**2 * np.eye(3)
        near = 0.5 * (offset * np.linalg.solve(spread, offset[..., None])[..., 0]).sum(-1)
        moved = JUMP + (offset * offset).sum(-1) / JUMPED**2
        moved = np.where(self._devices[:, None], np.inf, moved)
        alike = -np.log(np.maximum(probabilities(things.nouns) @ seen.nouns.T, LEAST))
        alike -= np.log(np.maximum(probabilities(things.colors) @ np.maximum(seen.colors, LEAST).T, LEAST))
        target = probability(things.targets)[:, None]
        alike -= np.log(np.maximum(target * seen.targets + (1 - target) * (1 - seen.targets), LEAST))
        cost = np.minimum(near, moved) + alike
        rows, columns = assignment(np.minimum(cost, WORST))
        real = cost[rows, columns] < WORST
        rows, columns = rows[real], columns[real]
        return rows, columns, (near > moved)[rows, columns]

    def _correct(
        self,
        rows: NDArray,
        columns: NDArray,
        *,
        seen: Detections,
        anchors: Array,
        jumps: NDArray[np.bool_],
        moment: Moment,
    ) -> None:
        """Take what is seen of things that were there before."""
        things = self._things
        held = things.ids[rows] == self._held
        slips = length(anchors[columns] - things.anchors[rows])
        fits = ~held | (slips < SLIP)  # what is held cannot be elsewhere, whatever is seen of it between other things
        rows, columns, jumps = rows[fits], columns[fits], jumps[fits] & ~held[fits]
        near = length(self._places(rows) - moment.gripper) < NEAR
        may_move = near | (things.restless[rows] > 0) | (things.strayed[rows] > 0)
        taken = ~jumps | (may_move & ~self._enclosed[rows])  # the gripper would have to take it out of a fitting
        things.strayed[rows] = np.where(jumps & ~taken, 1, 0)
        things.restless[rows[jumps & taken]] = RESTLESS
        jump, go = rows[jumps & taken], columns[jumps & taken]
        things.anchors[jump], things.covariances[jump] = anchors[go], seen.covariances[go]
        step, of = rows[~jumps], columns[~jumps]
        measured = seen.covariances[of] + NOISE**2 * np.eye(3)
        prior = things.covariances[step]
        gain = prior @ np.linalg.inv(prior + measured)
        things.anchors[step] += (gain @ (anchors[of] - things.anchors[step])[..., None])[..., 0]
        things.covariances[step] = prior - gain @ prior
        things.hits[rows] += 1
        things.missed[rows] = 0
        # What is partly hidden is easily taken for something else.
        clear = ~self._hidden(rows, moment) | (things.hits[rows] <= self._config.confirmations)
        sure, of = rows[clear], columns[clear]
        things.nouns[sure] = KEPT * things.nouns[sure] + np.log(np.maximum(seen.nouns[of], LEAST))
        things.colors[sure] = KEPT * things.colors[sure] + np.log(np.maximum(seen.colors[of], LEAST))
        odds = np.log(seen.targets[of] / (1 - seen.targets[of]))
        things.targets[sure] = KEPT * things.targets[sure] + odds
        devices, low = self._devices[rows], self._tip(moment)[2] - self._places(rows)[:, 2] < LOW
        pushed = devices & (length((seen.positions[columns] - moment.gripper)[:, :2]) < PUSHED)
        self._turn(rows, columns, seen=seen, near=near & (low | ~devices), pushed=pushed)

    def _turn(
        self, rows: NDArray, columns: NDArray, *, seen: Detections, near: NDArray[np.bool_], pushed: NDArray[np.bool_]
    ) -> None:
        """Take how things are turned, and how far devices are moved.

        near: (M,) which the gripper may be moving. pushed: (M,) of which devices it covers the handle.
        """
        things = self._things
        nouns = things.nouns[rows].argmax(1)
        slow = 1.0 / np.clip(things.hits[rows], 1, 20)
        turns = (near & np.isin(nouns, (CUBE, WHEEL))) | (things.restless[rows] > 0)
        follows = np.where(pushed, COVERED, FOLLOWS)
        gain = np.where(things.ids[rows] == self._held, 0.0, np.where(turns, np.maximum(slow, follows), slow))
        apart = seen.yaws[columns] - things.yaws[rows]
        apart = np.where(nouns == CUBE, wrapped(apart, QUARTER), wrapped(apart, 2 * np.pi))
        turnable = (nouns == CUBE) | IS_DEVICE[nouns]
        things.yaws[rows] += np.where(turnable, gain * apart, 0.0)
        gain = np.where(near, np.maximum(slow, follows), slow)
        things.shares[rows] += gain * (seen.shares[columns] - things.shares[rows])
        # How a wheel was placed, its mark tells; it stays so.
        placed = wheel_starts(seen.yaws[columns], seen.shares[columns])
        things.starts[rows] += np.where(pushed, 0.0, slow) * wrapped(placed - things.starts[rows], 2 * np.pi)
        free = things.ids[rows] != self._held
        things.turns[rows[free]] = upright(things.yaws[rows[free]])

    # ---- what is not seen, and what is new

    def _miss(self, rows: NDArray, moment: Moment) -> None:
        """Drop things whose places were seen empty for long. rows: of the things that were seen."""
        things = self._things
        missing = np.ones(len(things), bool)
        missing[rows] = False
        missing &= things.ids != self._held
        if not missing.any():
            return
        empty = np.zeros(len(things), bool)
        empty[missing] = ~self._hidden(np.flatnonzero(missing), moment)
        things.missed += empty
        unsure = things.hits < self._config.confirmations
        things.keep((things.missed < self._config.patience) & ~(unsure & (things.missed > 0)))

    def _hidden(self, which: NDArray, moment: Moment) -> NDArray[np.bool_]:
        """(W,) whether the arm or another thing is between a camera and each of these things, or in its place."""
        things, places = self._things, self._places(which)
        sizes = np.full(len(things), self._known.size)
        hides = _between(things.anchors, sizes, places, moment.cameras)
        hides[:, np.arange(len(which)), which] = False
        return np.asarray(hides.any((0, 2)) | self._behind_arm(places, moment))

    def _behind_arm(self, places: Array, moment: Moment) -> NDArray[np.bool_]:
        """(W,) whether the arm is between a camera and each of places (W, 3), metres, or there."""
        share = np.linspace(0.0, 1.0, SAMPLES, endpoint=False)[:, None, None]
        links = (moment.arm[:-1] + share * (moment.arm[1:] - moment.arm[:-1])).reshape(-1, 3)
        screens = np.concatenate((links, moment.arm[-1:]))
        return np.asarray(_between(screens, np.full(len(screens), ARM), places, moment.cameras).any((0, 2)))

    def _believed(self, new: Detections, anchors: Array, moment: Moment) -> NDArray[np.bool_]:
        """(D,) which detections of no thing so far are believed.

        None is where another thing is. Later than in the first picture, none that the arm hides in part is.
        """
        things, known = self._things, self._known
        nouns = new.nouns.argmax(1)
        believed = (new.presence >= self._config.presence) & self._general[nouns]
        apart = length(anchors[:, None] - things.anchors[None])
        same = (new.targets[:, None] > 0.5) == (things.targets[None] > 0)
        believed &= ~((apart < ALIKE * known.size) & same).any(1)
        believed &= ~within_devices(
            nouns,
            anchors,
            nouns=things.nouns.argmax(1),
            anchors=things.anchors,
            size=known.size,
            width=known.width,
        )
        for fitting in self._fittings.values():
            believed &= length(anchors - fitting.handle) > known.size
        if self._pictures:
            believed &= ~self._behind_arm(new.positions, moment)
        if (things.nouns.argmax(1) == HAND_NUMBER).any():
            believed &= nouns != HAND_NUMBER  # there is one
        return believed

    def _join(self, new: Detections, anchors: Array, moment: Moment) -> None:
        """Begin to follow what is seen of no thing so far, where it is believed."""
        believed = self._believed(new, anchors, moment)
        new, anchors = new[believed], anchors[believed]
        count = len(new)
        if not count:
            return
        nouns = np.log(np.maximum(new.nouns, LEAST))
        yaws = np.where(nouns.argmax(1) == CUBE, wrapped(new.yaws, QUARTER), new.yaws)
        yaws = np.where(LOOSE[nouns.argmax(1)] & (nouns.argmax(1) != CUBE), 0.0, yaws)
        shown = self._config.confirmations if not self._pictures else 1  # the first picture is believed
        self._things.join(
            Things(
                ids=self._next + np.arange(count),
                nouns=nouns,
                colors=np.log(np.maximum(new.colors, LEAST)),
                targets=np.log(new.targets / (1 - new.targets)),
                anchors=anchors,
                covariances=new.covariances + NOISE**2 * np.eye(3),
                yaws=yaws,
                shares=new.shares.copy(),
                starts=wheel_starts(yaws, new.shares),
                turns=upright(yaws),
                hits=np.full(count, shown),
                missed=np.zeros(count, np.int64),
                strayed=np.zeros(count, np.int64),
                restless=np.zeros(count, np.int64),
            )
        )
        self._next += count

    # ---- what is held, and what rests

    def _tell_roles(self) -> None:
        """Where all loose things were seen, make as many of them see-through as there are: the likeliest ones."""
        things, roles = self._things, self._known.roles
        loose = np.flatnonzero(LOOSE[things.nouns.argmax(1)] & (things.hits >= self._config.confirmations))
        if roles is None or len(loose) != roles[0]:
            return
        order = loose[np.argsort(-things.targets[loose], kind="stable")]
        through, solid = order[: roles[1]], order[roles[1] :]
        things.targets[through] = np.maximum(things.targets[through], TOLD)
        things.targets[solid] = np.minimum(things.targets[solid], -TOLD)

    def _note_held(self, moment: Moment) -> None:
        """Tell what the gripper has taken hold of: the nearest thing that can be held."""
        things = self._things
        if not moment.holds:
            things.restless[things.ids == self._held] = RESTLESS
            self._held = NOTHING
        elif self._held == NOTHING:
            where = moment.gripper - [0.0, 0.0, self._known.grip_depth]
            loose = LOOSE[things.nouns.argmax(1)] & (things.targets <= 0)
            apart = np.where(loose, length(things.anchors - where), np.inf).tolist()
            apart += [float(length(fitting.handle - where)) for fitting in self._fittings.values()]
            ids = [*things.ids.tolist(), *map(_fitting_id, self._fittings)]
            if ids and min(apart) < HOLDS:
                self._held = ids[int(np.argmin(apart))]

    def _operate(self, moment: Moment) -> None:
        """Move devices as the gripper does, which hides them meanwhile."""
        things, known, tip = self._things, self._known, self._tip(moment)
        nouns, free = things.nouns.argmax(1), self._held == NOTHING
        buttons = np.flatnonzero(nouns == BUTTON)
        things.shares[buttons] = pressed(things.anchors[buttons], tip, known.width)
        close = length((things.anchors - tip)[:, :2]) < known.width + TIP_RADIUS
        for k in np.flatnonzero(close & free & np.isin(nouns, (LEVER, WHEEL))).tolist():
            things.yaws[k], things.shares[k] = pushed(
                int(nouns[k]),
                things.anchors[k],
                tip,
                yaw=float(things.yaws[k]),
                share=float(things.shares[k]),
                start=float(things.starts[k]),
                width=known.width,
            )

    def _tip(self, moment: Moment) -> Array:
        """(3,) the lowest point of the gripper, or of what it holds, metres."""
        known = self._known
        below = known.tips if self._held == NOTHING else known.grip_depth + known.size / 2
        return moment.gripper - [0.0, 0.0, below]

    def _level(self) -> None:
        """Put what stands on the table at its height there, and what stands on such a thing at its height."""
        things, size = self._things, self._known.size
        rests = LOOSE[things.nouns.argmax(1)] & (things.restless == 0) & (things.ids != self._held)
        low = rests & (np.abs(things.anchors[:, 2] - size / 2) < LEVEL)
        things.anchors[low, 2] = size / 2
        high = rests & (np.abs(things.anchors[:, 2] - 1.5 * size) < LEVEL)
        under = low & (things.targets <= 0)
        offset = things.anchors[high, None, :2] - things.anchors[None, under, :2]
        stands_on = np.max(np.abs(offset), axis=2, initial=0.0).min(1, initial=np.inf) < size / 2
        things.anchors[np.flatnonzero(high)[stands_on], 2] = 1.5 * size

    # ---- what is observed

    def seen(self) -> Seen:
        """Return the things as they are observed now: the furniture, and of all others those that are sure."""
        things, known = self._things, self._known
        sure = np.flatnonzero(things.hits >= self._config.confirmations)
        room = known.most - len(self._fittings)
        if len(sure) > room:
            sure = np.sort(sure[np.argsort(-things.hits[sure], kind="stable")][:room])
        nouns = things.nouns[sure].argmax(1)
        yaws, shares = things.yaws[sure], things.shares[sure]
        places = self._places(sure)
        fittings = list(self._fittings.values())
        ids = np.array([*things.ids[sure].tolist(), *map(_fitting_id, self._fittings)], np.int64)
        held = np.flatnonzero(ids == self._held)
        count = len(fittings)
        return Seen(
            ids=ids,
            nouns=np.array([*nouns.tolist(), *self._fittings], np.int64),
            colors=np.array([*things.colors[sure].argmax(1).tolist(), *(each.color for each in fittings)], np.int64),
            targets=np.append(things.targets[sure] > 0, np.zeros(count, bool)),
            positions=np.concatenate((places, np.reshape([each.handle for each in fittings], (-1, 3)))),
            quaternions=np.concatenate(
                (
                    quaternions_of(nouns, things.turns[sure], yaws=yaws, shares=shares),
                    np.reshape([each.quaternion for each in fittings], (-1, 4)),
                )
            ),
            yaws=np.append(np.where(nouns == WHEEL, things.starts[sure], yaws), np.zeros(count)),
            sizes=np.append(np.where(IS_DEVICE[nouns], known.width, known.size), [known.size] * count),
            held=int(held[0]) if len(held) and self._held != NOTHING else NOTHING,
        )


def _fitting_id(noun: int) -> int:
    """Return the id of the fitting with this noun's number."""
    return NOTHING - 1 - noun


def _between(screens: Array, widths: Array, places: Array, cameras: Array) -> NDArray[np.bool_]:
    """(C, W, S) whether screens (S, 3) of widths (S,) are between cameras (C, 3) and places (W, 3), all metres."""
    way = cameras[:, None] - places[None]  # (C, W, 3)
    offset = screens[None, None] - places[None, :, None]  # (1, W, S, 3)
    along = (offset * way[:, :, None]).sum(-1) / (way * way).sum(-1)[..., None]
    return np.asarray(length(offset - np.clip(along, 0.0, 1.0)[..., None] * way[:, :, None]) < widths)
