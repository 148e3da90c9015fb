"""N worlds as cameras see them, in the form in which the simulator has them: rows of objects, and a state of the task.

What policies observe follows from this state alone, through a second instance of the task, whose memory knows nothing
of the simulator. What is seen gets the slot of the true thing next to it, so that labels such as `privileged/referent`
mean the same thing; policies do not depend on the order of slots. What is seen where nothing is gets a slot that would
be empty, and what is overlooked is not shown.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from envs.mdp.grip_controller import GripController
from envs.mdp.object_rows import ATTRIBUTES, OBJECT_WIDTH, attribute_rows
from envs.mdp.world_state import WorldState
from envs.perception.assignment import assignment
from envs.perception.camera_reader import Gripper
from envs.perception.config import PerceptionConfig
from envs.perception.detections import Detections, UnusablePicture
from envs.perception.tracking import HAND_NUMBER, KnownThings, Moment, SceneTracker, Seen
from envs.sim.kinematics import Array, Kinematics
from envs.sim.object_pool import PARKED
from envs.sim.workspace import WorkspaceConfig
from envs.tasks import NOTHING, State, Task
from language import NOUNS, SHAPES, Placed, Scene

SPARE = 0.15  # metres from a true thing beyond which what is seen is taken for another one, if there is an empty slot
OTHER_ROLE = 0.1  # metres that a target seems farther away than it is from what is seen as real, and the reverse


class Reader(Protocol):
    """Tells what is seen in worlds: a `CameraReader`.

    angles: (J,) radians of a world's arm when the pictures that are read now were taken; None: now. read: raises
    UnusablePicture. places: (C, 3) of cameras, metres.
    """

    def angles(self, world: int) -> Array | None: ...

    def read(self, world: int, gripper: Gripper) -> Detections: ...

    def places(self, gripper: Gripper) -> Array: ...


class PerceivedWorlds:
    """N worlds of K slots as they are seen.

    Attributes:
        task: an own instance, whose memory follows from what is seen.
        state, rows: as in `WorldState`. Referents, targets and instructions are the true ones; grippers are measured.
        blind: for each world, why nothing could be seen at the last control step; None: it was seen.

    Args:
        config: of the perception.
        workspace: with the cameras.
        task: as above.
        arrays: the true state.
        kinematics: of the arm.
        grip: tells whether a gripper holds something.
        reader: tells what is seen.
    """

    def __init__(
        self,
        *,
        config: PerceptionConfig,
        workspace: WorkspaceConfig,
        task: Task,
        arrays: WorldState,
        kinematics: Kinematics,
        grip: GripController,
        reader: Reader,
    ) -> None:
        self.task, self._arrays, self._kinematics, self._reader = task, arrays, kinematics, reader
        self._grip = grip
        known = known_things(task, workspace, grip)
        true, count = arrays.state, len(arrays.index)
        self._trackers = [SceneTracker(config, known) for _ in range(count)]
        self._slots: list[dict[int, int]] = [{} for _ in range(count)]  # of the things that are shown, by their ids
        self.blind: list[str | None] = [None] * count
        self.rows = np.zeros((count, true.shown.shape[1], OBJECT_WIDTH))
        self.rows[..., :3] = PARKED
        flags = np.zeros((3, *true.shown.shape), bool)
        self.state = State(
            gripper=true.gripper,
            objects=self.rows[..., :3],
            shown=flags[0],
            referent=true.referent,
            target=true.target,
            movable=flags[1],
            goals=flags[2],
            quaternions=self.rows[..., 3:7],
            held=np.full(count, NOTHING),
            nouns=np.zeros(true.shown.shape, np.int64),
            kind=true.kind,
            yaw=np.zeros(true.shown.shape),
        )

    def begin(self, worlds: NDArray[np.int64]) -> None:
        """Look at worlds whose episodes have just begun."""
        for i in worlds.tolist():
            self._trackers[i].begin()
            self._slots[i], self.state.held[i] = {}, NOTHING
            self._clear(i)
        self._look(worlds)
        self.task.reset(worlds, self.state)

    def follow(self) -> None:
        """Look at all worlds after a control step."""
        new = self._look(self._arrays.index)
        with np.errstate(invalid="ignore"):  # rewards, which nobody reads, of worlds in which nothing is seen
            self.task.step(self.state)
        for world, slots in new.items():
            self.task.notice(world, slots, self.state)

    def look_again(self) -> None:
        """Look at all worlds, in which somebody has moved something between two control steps."""
        for tracker in self._trackers:
            tracker.expect_motion()
        self._look(self._arrays.index)

    def restart(self, worlds: NDArray[np.int64]) -> None:
        """Begin the task's memory anew: another instruction is given."""
        self.task.reset(worlds, self.state)

    @property
    def standing(self) -> NDArray[np.bool_]:
        """(N,) whose arms are to hold still: nothing could be seen."""
        return np.array([reason is not None for reason in self.blind])

    def _look(self, worlds: NDArray[np.int64]) -> dict[int, NDArray[np.int64]]:
        """Take pictures of these worlds. Returns the slots in which something appeared, by world."""
        arrays = self._arrays
        self.state.gripper = arrays.state.gripper
        frames = self._kinematics.frames(arrays.angles)[..., :3, :]  # (J + 1, N, 3, 4)
        new = {}
        for i in worlds.tolist():
            before = self._reader.angles(i)
            then = frames[:, i] if before is None else self._kinematics.frames(before[None])[:, 0, :3]
            moment, gripper = self._moment(i, then)
            try:
                detections = self._reader.read(i, gripper)
                self.blind[i] = None
            except UnusablePicture as error:
                self.blind[i] = str(error)
                continue
            self._trackers[i].update(detections, moment)
            seen = self._trackers[i].seen()
            if before is not None and seen.held != NOTHING:
                seen.positions[seen.held] = _carried(seen.positions[seen.held], then[-1], frames[-1, i])
            slots = self._show(i, seen)
            if len(slots):
                new[i] = slots
        return new

    def _moment(self, i: int, frames: Array) -> tuple[Moment, Gripper]:
        """Return where arm and cameras of world i are. frames: (J + 1, 3, 4) of its joints and its gripper."""
        gripper = frames[-1, :, 3], frames[-1, :, :3]
        holds = bool(self._grip.held[i] != NOTHING)
        return Moment(
            arm=frames[:, :, 3], rotation=gripper[1], holds=holds, cameras=self._reader.places(gripper)
        ), gripper

    # ---- slots

    def _show(self, i: int, seen: Seen) -> NDArray[np.int64]:
        """Write what is seen in world i. Returns the slots of what is new."""
        state, rows = self.state, self.rows[i]
        new = self._assign(i, seen)
        slots = np.array([self._slots[i][number] for number in seen.ids.tolist()], np.int64)
        goals = state.goals[i].copy()
        self._clear(i)
        state.goals[i, slots] = goals[slots]
        rows[slots, :3], rows[slots, 3:7] = seen.positions, seen.quaternions
        rows[slots, ATTRIBUTES] = attribute_rows(
            seen.nouns,
            seen.colors,
            sizes=seen.sizes,
            targets=seen.targets,
            devices=self.task.traits.operates,
        )
        state.shown[i, slots] = True
        state.movable[i, slots] = ~seen.targets & (seen.nouns != HAND_NUMBER)
        state.nouns[i, slots], state.yaw[i, slots] = seen.nouns, seen.yaws
        state.held[i] = NOTHING if seen.held == NOTHING else slots[seen.held]
        if len(new):
            state.goals[i, slots[new]] = self.task.possible_goals(self._placed(seen))[new]
        return np.asarray(slots[new])

    def _clear(self, i: int) -> None:
        """Show nothing in world i."""
        state = self.state
        for array in (state.shown, state.movable, state.goals, state.nouns, state.yaw, self.rows):
            array[i] = 0
        self.rows[i, :, :3] = PARKED

    def _assign(self, i: int, seen: Seen) -> NDArray[np.int64]:
        """Give slots to things that have none yet. Returns the rows of `seen` of those."""
        slots, true = self._slots[i], self._arrays.state
        slots = self._slots[i] = {number: slots[number] for number in seen.ids.tolist() if number in slots}
        new = np.flatnonzero([number not in slots for number in seen.ids.tolist()])
        if not len(new):
            return new
        free = np.setdiff1d(np.arange(true.shown.shape[1]), list(slots.values()))
        offset = seen.positions[new][:, None] - true.objects[i, free]
        apart = np.sqrt((offset * offset).sum(-1))
        see_through = self._arrays.rows[i, free, OBJECT_WIDTH - 1] > 0.5
        apart += OTHER_ROLE * (seen.targets[new][:, None] != see_through)
        rows, columns = assignment(np.where(true.shown[i, free], apart, SPARE))
        slots |= dict(zip(seen.ids[new[rows]].tolist(), free[columns].tolist(), strict=True))
        return new

    def _placed(self, seen: Seen) -> Placed:
        scene = Scene.from_arrays(
            seen.nouns,
            seen.colors,
            seen.positions,
            seen.sizes,
            seen.targets,
            self.task.config.viewpoint,
        )
        return Placed(scene, seen.yaws, seen.nouns == HAND_NUMBER)


def _carried(place: Array, there: Array, here: Array) -> Array:
    """(3,) where a held thing is now that was at this place, metres. there, here: (3, 4) of the gripper."""
    return here[:, 3] + here[:, :3] @ (there[:, :3].T @ (place - there[:, 3]))  # type: ignore[no-any-return]


def known_things(task: Task, workspace: WorkspaceConfig, grip: GripController) -> KnownThings:
    """Return what is known of a task's things before any is seen: sizes, nouns, and roles where these are fixed."""
    config = task.config
    layout = config.objects.layout(config.object_size)
    nouns = {*config.nouns} if layout is None else {spec.noun for spec in layout.specs}
    nouns = {*(SHAPES if None in nouns else nouns), *task.fixtures, *task.devices}
    targets, fixed = task.bodies[2], config.min_objects == config.num_objects
    return KnownThings(
        nouns=np.array([noun in nouns for noun in NOUNS]),
        targets=targets > 0,
        roles=(sum(task.bodies), targets) if targets and fixed else None,
        size=config.object_size,
        width=task.device_width,
        fittings={} if task.fittings is None else dict(task.fittings.by_noun),
        most=config.slots,
        bounds=np.reshape(workspace.bounds, (3, 2)).T,
        grip_depth=grip.grip_depth,
        tips=grip.tips,
    )
