"""What keeps an arm safe: every target passes here on its way to the motors, and every measurement on its way back.

`Safety` computes; it sends nothing and knows no clock, so that it can be tested with any sequence of times. The times
that it is given are seconds of the arm's clock.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np

from core.schema import Checked, within
from deployment.arm import ArmState, Array
from envs.config import EnvConfig
from envs.sim.clearance import Clearance
from envs.sim.kinematics import Kinematics

BEYOND = 0.1  # radians beyond a joint's limit at which a measurement is not believed
JUMP = 0.05  # radians that a measurement may jump beyond what twice the joint's greatest speed explains
TOLERANCE = 1e-6  # radians and metres of rounding
EARLY = 0.01  # seconds that a measurement may seem to come from the future
ROUNDED = 0.02  # share by which a motion may exceed its greatest without being told: clocks are not exact
SLOW = 0.1  # share of its speed with which an arm starts
CADENCE = 0.1  # seconds of motion that one target may stand for, however long ago the last one was sent
FIRST = 0.01  # ... for the first target of an arm that has held
LAG = 0.5  # seconds of past targets at any of which the arm may still be


@dataclass(frozen=True, kw_only=True)
class SafetyConfig(Checked):
    """The rules that have numbers; the limits of joints, speeds and workspace are those of the robot and the workspace.

    speed: share of the joints' greatest speeds. slow_start: seconds in which that speed is reached after a stop.
    clearance: metres between the moving links and solid furniture. margin: metres that the gripper may be outside of
    the workspace's gripper_box. watchdog: age in seconds at which the newest measurement is too old. following: radians
    that a joint may be from where it was commanded in the last `LAG` seconds. deadman: seconds after which a person's
    key must have been pressed again; 0: no key. dry_run: compute and log everything, and send nothing.
    """

    speed: float = within(0.01, 1, default=1.0)
    slow_start: float = within(0, 60, default=2.0)
    clearance: float = within(0, 0.2, default=0.005)
    margin: float = within(0, 0.5, default=0.03)
    watchdog: float = within(0.02, 5, default=0.2)
    following: float = within(0.01, 1, default=0.15)
    deadman: float = within(0, 10, default=0.0)
    dry_run: bool = False


@dataclass(frozen=True)
class Decision:
    """What is sent to the arm.

    angles: (J,) the target, radians; None: nothing, the arm is to hold. opening: of the gripper, in [0, 1]. reasons: a
    sentence for each rule that changed what was wanted.
    """

    angles: Array | None
    opening: float
    reasons: tuple[str, ...] = ()


class Limits:
    """Where joints and gripper may be. low, high: (J,) radians. speed: (J,) rad/s.

    Args:
        setup: of the environment: its robot and workspace.
        kinematics: of the arm.
        config: margins.
        magnet: whether the arm carries its magnet.
    """

    def __init__(self, setup: EnvConfig, kinematics: Kinematics, config: SafetyConfig, *, magnet: bool) -> None:
        self.low, self.high, self._kinematics = kinematics.low, kinematics.high, kinematics
        self.joints, self.speed = setup.robot.joints, np.array(setup.robot.max_speed) * config.speed
        box = np.reshape(setup.workspace.gripper_box, (3, 2)).T
        self._box = box + np.array([[-config.margin], [config.margin]])
        self._clearance = Clearance(setup.robot, setup.workspace, magnet=magnet, margin=config.clearance)

    def refusal(self, angles: Array) -> str | None:
        """Return why an arm may not be at angles (J,), None if it may."""
        beyond = np.maximum(self.low - angles, angles - self.high)
        if beyond.max() > TOLERANCE:
            return f"{self.joints[beyond.argmax()]} would be {beyond.max():.3f} rad beyond its limit"
        position = self._kinematics.forward(angles[None]).position[0]
        outside = np.maximum(self._box[0] - position, position - self._box[1])
        if outside.max() > TOLERANCE:
            axis = "xyz"[outside.argmax()]
            return f"the gripper would leave its workspace along {axis}, to {position[outside.argmax()]:.3f} m"
        if missing := self._clearance.missing(angles):
            return f"a link would be {missing * 1000:.1f} mm too near to the table"
        return None

    def close(self) -> None:
        """Free what it holds. Idempotent."""
        self._clearance.close()


class Safety:
    """Decides what is sent to one arm.

    measured: the newest measurement that is believed, or None. sent: (J,) the target last sent; None while the arm
    holds. stopped: why a person must release the arm before it moves again, or "".

    Not thread-safe but for `request_stop`: all other calls must come from the thread that drives the arm.

    Args:
        config: the rules.
        limits: of the arm.
    """

    def __init__(self, config: SafetyConfig, limits: Limits) -> None:
        self.config, self.limits = config, limits
        self.measured: ArmState | None = None
        self.sent: Array | None = None
        self.stopped = ""
        self._opening = 1.0
        self._last = self._pressed = self._started = -np.inf  # when a target was sent, a key pressed, the arm started
        self._relocated = False
        self._past: deque[tuple[float, Array]] = deque()  # targets of the last LAG seconds with their times
        self._requested = ""  # by another thread
        self._doubted = ""  # why the newest measurement was not believed

    # ---- what a person does

    def stop(self, reason: str) -> None:
        """Stop the arm until `release`. The first reason is kept."""
        self.stopped = self.stopped or reason
        self._forget()

    def request_stop(self, reason: str) -> None:
        """Stop the arm from any thread: it takes effect at the next call of `heed`, `alarm` or `decide`."""
        self._requested = reason

    def heed(self) -> None:
        """Stop if another thread has requested it."""
        if self._requested:  # a second request between these lines may be lost: the arm is stopped then
            self.stop(self._requested)
            self._requested = ""

    def release(self) -> None:
        """Let a stopped arm move again: a person says that all is well. A stop that was requested since stays."""
        self.stopped = ""

    def relocate(self) -> None:
        """Forget where the arm was: a simulated one was put elsewhere. It goes on without a slow start."""
        self.measured, self._relocated = None, np.isfinite(self._started)
        self._forget()

    def press(self, now: float) -> None:
        """Note that the dead-man key was pressed."""
        self._pressed = now

    # ---- measurements

    def observe(self, now: float, state: Any) -> str | None:
        """Take a measurement. Returns why it is not believed, None if it is.

        An arm whose measurements are not believed is one that is not seen: the watchdog stops it.
        """
        try:
            angles = np.array(state.angles, np.float64)
            time, opening, holds = float(state.time), float(state.opening), state.holds
        except (AttributeError, TypeError, ValueError, OverflowError):
            self._doubted = "the arm sent something that is no measurement"
            return self._doubted
        reason = self._doubt(now, time, angles, opening)
        self._doubted = reason or ""
        if reason is None:
            self.measured = ArmState(time, angles, min(max(opening, 0.0), 1.0), holds)
        return reason

    def _doubt(self, now: float, time: float, angles: Array, opening: float) -> str | None:
        """Return why a measurement cannot be true."""
        limits, last = self.limits, self.measured
        if angles.shape != limits.low.shape:
            return f"the arm measured {angles.size} angles; it has {len(limits.low)} joints"
        if not (np.isfinite(angles).all() and np.isfinite(time) and np.isfinite(opening)):
            return "the arm measured something that is not a finite number"
        if time > now + EARLY:
            return f"a measurement is {time - now:.3f} s from the future"
        if last is not None and time <= last.time:
            return f"a measurement is {last.time - time:.3f} s older than the last one"
        beyond = np.maximum(limits.low - angles, angles - limits.high)
        if beyond.max() > BEYOND:
            return f"{limits.joints[beyond.argmax()]} was measured {beyond.max():.2f} rad beyond its limit"
        if last is not None:
            far = np.abs(angles - last.angles) - 2 * limits.speed / self.config.speed * (time - last.time)
            if far.max() > JUMP:
                return f"{limits.joints[far.argmax()]} was measured to jump by {far.max():.2f} rad"
        return None

    # ---- targets

    def alarm(self, now: float) -> str:
        """Return why the arm must hold at this time whatever is wanted, "" if it may move. Stops where it must."""
        self.heed()
        if not self.stopped and self.measured is not None and self.sent is not None:
            self._check_following(now)
        if self.stopped:
            return self.stopped
        age = np.inf if self.measured is None else now - self.measured.time
        if age > self.config.watchdog:
            since = f"for {age * 1000:.0f} ms" if np.isfinite(age) else "yet"
            return f"the arm was not seen {since}{self._doubted and ': '}{self._doubted}"
        if self.config.deadman and now - self._pressed > self.config.deadman:
            return "the dead-man key is not pressed"
        return ""

    def _check_following(self, now: float) -> None:
        """Stop if a joint is far from all targets of the last LAG seconds."""
        assert self.measured is not None
        while len(self._past) > 1 and self._past[1][0] < now - LAG:
            self._past.popleft()
        targets = np.array([target for _, target in self._past])
        angles = self.measured.angles
        error = np.maximum(targets.min(0) - angles, angles - targets.max(0))
        if error.max() > self.config.following:
            joint = self.limits.joints[error.argmax()]
            self.stop(f"{joint} is {error.max():.2f} rad from where it was commanded")

    def decide(self, now: float, wanted: Any, opening: Any) -> Decision:
        """Return what to send.

        Args:
            now: the time, seconds.
            wanted: (J,) angles that the policy wants, radians; anything else is refused.
            opening: that it wants of the gripper, in [0, 1]; anything else is refused.
        """
        if reason := self.alarm(now) or self._start(now):
            return self.hold(reason)
        reasons: list[str] = []
        self._opening = self._gripper(opening, reasons)
        assert self.sent is not None
        target = self._target(now, wanted, reasons)
        self._last = now
        if not self.config.dry_run:
            self.sent = target
            self._past.append((now, target))
            return Decision(target, self._opening, tuple(reasons))
        self._forget()  # nothing is sent: the next target starts from where the arm is
        return Decision(target, self._opening, (*reasons, "dry run: nothing was sent"))

    def hold(self, reason: str) -> Decision:
        """Return the decision to hold, for this reason. The arm starts slowly afterwards."""
        self._forget()
        return Decision(None, self._opening, (reason,))

    def _forget(self) -> None:
        """The arm holds: the next target starts from where it is then."""
        self.sent = None
        self._past.clear()

    def _start(self, now: float) -> str | None:
        """Let an arm that holds start from where it is. Returns why it may not."""
        if self.sent is not None:
            return None
        assert self.measured is not None
        start = np.clip(self.measured.angles, self.limits.low, self.limits.high)
        if reason := self.limits.refusal(start):
            return f"the arm cannot start from where it is: {reason}; move it there by hand"
        if not (self._relocated or (self.config.dry_run and np.isfinite(self._started))):
            self._started, self._last = now, now - FIRST
        self._relocated = False
        self.sent = start
        self._past.append((now, start))
        return None

    def _gripper(self, opening: Any, reasons: list[str]) -> float:
        value = _array(opening)
        if value is None or value.shape != () or not 0 <= value <= 1:
            reasons.append("the policy wants an opening of the gripper that is not from 0 to 1")
            return self._opening
        return float(value)

    def _target(self, now: float, wanted: Any, reasons: list[str]) -> Array:
        """Return the nearest allowed target to (J,) wanted angles on the way from the last one, or that itself."""
        assert self.sent is not None
        goal, limits = _array(wanted), self.limits
        if goal is None or goal.shape != limits.low.shape:
            reasons.append("the policy wants something that is not an angle for each joint")
            return self.sent
        inside = np.clip(goal, limits.low, limits.high)
        if not np.array_equal(inside, goal):
            reasons.append(f"{limits.joints[np.abs(goal - inside).argmax()]} is kept within its limits")
        delta = inside - self.sent
        excess = np.abs(delta) / np.maximum(self._most(now), TOLERANCE)
        if excess.max() > 1 + ROUNDED:
            reasons.append(f"{limits.joints[excess.argmax()]} is slowed down to its greatest speed")
        target = np.clip(self.sent + delta / max(1.0, excess.max()), limits.low, limits.high)
        if refusal := limits.refusal(target):
            reasons.append(refusal)
            return self.sent
        return target

    def _most(self, now: float) -> Array:
        """(J,) how far the joints may go from the last target, radians: slowly at first."""
        share = 1.0
        if self.config.slow_start:
            share = min(1.0, SLOW + (1 - SLOW) * (now - self._started) / self.config.slow_start)
        return self.limits.speed * (share * min(max(now - self._last, 0.0), CADENCE))


def _array(value: Any) -> Array | None:
    """Return finite numbers as an array, None for anything else."""
    try:
        array = np.array(value, np.float64)
    except (TypeError, ValueError, OverflowError):
        return None
    return array if np.isfinite(array).all() else None
