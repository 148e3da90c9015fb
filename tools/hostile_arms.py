"""Drive an arm that lies with policies that rage, and count the targets that break a rule.

    python -m tools.hostile_arms steps=100_000 robot=kuka seed=0

Measurements are true, missing, late, frozen, from the past or the future, of another shape, not finite, or jump;
targets are anything. Each target that reaches the arm is compared with the limits of joints, speeds, workspace and
table, and an arm that is no longer seen must hold within 250 ms of its last true measurement.
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from core.errors import ConfigError
from core.overrides import compose
from core.program import run_program
from core.schema import Checked, read, within, word
from deployment.arm import Arm, ArmError, ArmState, Array, Clock
from deployment.safe_arm import SafeArm
from deployment.safety import CADENCE, Limits, Safety, SafetyConfig
from envs import read_env
from envs.config import EnvConfig
from envs.sim.clearance import Clearance
from envs.sim.robot import read_kinematics

PERIOD = 0.05  # seconds of a control step
HOLD_WITHIN = 0.25  # seconds after the last true measurement
ROUND = 100  # steps until everything begins anew, with the arm somewhere in its workspace
EXACT = 1e-5  # radians and metres: the tolerance of the comparison
DARK = ("nothing", "not finite", "shape", "past", "text")  # what an arm shows that is not seen


@dataclass(frozen=True, kw_only=True)
class HostileConfig(Checked):
    """The program's keys."""

    steps: int = within(1, 10_000_000, default=100_000)
    robot: str = word(default="kuka")
    seed: int = within(0, 2**31 - 1, default=0)


class FuzzClock(Clock):
    """A time that passes when it is told to. due: called after each of its steps."""

    def __init__(self) -> None:
        self.time = 0.0
        self.due: Any = lambda: None

    def now(self) -> float:
        return self.time

    def sleep(self, seconds: float) -> None:
        self.time += max(0.0, seconds)
        self.due()


class Truth:
    """What may be sent to the arm, found out without `Safety`."""

    def __init__(self, setup: EnvConfig, rules: SafetyConfig) -> None:
        self.kinematics, self.speed = read_kinematics(setup.robot), np.array(setup.robot.max_speed) * rules.speed
        low, high = np.reshape(setup.workspace.gripper_box, (3, 2)).T
        self.box = low - rules.margin, high + rules.margin
        self.clearance = Clearance(
            setup.robot, setup.workspace, magnet=setup.robot.grippers[0] == "magnet", margin=rules.clearance
        )

    def broken(self, angles: Array, last: Array | None) -> list[str]:
        """Return the limits that a target breaks. last: the target before it; None: the arm held."""
        kin = self.kinematics
        if angles.shape != kin.low.shape or not np.isfinite(angles).all():
            return ["form"]
        position = kin.forward(angles[None]).position[0]
        checks = {
            "joints": (angles < kin.low).any() or (angles > kin.high).any(),
            "workspace": (position < self.box[0] - EXACT).any() or (position > self.box[1] + EXACT).any(),
            "table": self.clearance.missing(angles) > EXACT,
            "speed": last is not None and (np.abs(angles - last) > self.speed * CADENCE + EXACT).any(),
        }
        return [name for name, wrong in checks.items() if wrong]


class HostileArm(Arm):
    """An arm that moves as it is told, and says about it what it likes. broken: the rules that its targets broke."""

    settings: ClassVar[type[Checked]] = Checked
    on_hardware: ClassVar[str] = "an arm that lies"

    def __init__(self, setup: EnvConfig, truth: Truth, rng: np.random.Generator, start: Array) -> None:
        super().__init__(None, setup)
        self.clock: FuzzClock = FuzzClock()
        self.clock.due = self._check_hold
        self._truth, self._rng, self._angles = truth, rng, start
        self._mood, self._until = "true", 0.3  # what it shows until this time
        self._seen, self._frozen, self._late = 0.0, start, 0.0
        self._last: Array | None = None
        self.broken: Counter[str] = Counter()
        self.targets = self.holds = 0

    def connect(self) -> None:
        """Nothing is needed."""

    def disconnect(self) -> None:
        """Nothing is needed."""

    def command(self, angles: Array, opening: float) -> None:
        self.targets += 1
        self.broken.update(self._truth.broken(np.asarray(angles), self._last))
        if not 0 <= opening <= 1:
            self.broken["opening"] += 1
        self._last = self._angles = np.array(angles)
        if self._rng.random() < 0.002:
            raise ArmError("the cable is loose")

    def hold(self) -> None:
        self.holds += 1
        self._last = None

    def _check_hold(self) -> None:
        if self._last is not None and self.clock.now() - self._seen > HOLD_WITHIN + 1e-9:
            self.broken["hold"] += 1
            self._last = None  # it is counted once

    def observe(self) -> Any:
        now, rng = self.clock.now(), self._rng
        if now > self._until:
            moods = ("true", "true", "true", "late", "frozen", "jump", "edge", "future", *DARK)
            self._mood, self._until = str(rng.choice(moods)), now + rng.exponential(0.3)
            self._frozen, self._late = self._angles, rng.uniform(0, 0.3)
        if self._mood not in DARK:
            self._seen = now
        return self._shown(now)

    def _shown(self, now: float) -> Any:
        """Return what the arm shows in its mood."""
        rng, angles = self._rng, self._angles
        kin, bad = self._truth.kinematics, np.array(angles)
        bad[rng.integers(len(bad))] = rng.choice([np.nan, np.inf, -np.inf])
        shown: dict[str, Any] = {
            "true": ArmState(now, angles + rng.normal(0, 1e-3, len(angles)), 1.0),
            "late": ArmState(now - self._late, angles, 0.5),
            "frozen": ArmState(now, self._frozen, 1.0),
            "jump": ArmState(now, angles + rng.normal(0, rng.choice([0.01, 0.1, 1.0, 100.0]), len(angles)), 1.0),
            "edge": ArmState(now, rng.choice([kin.low, kin.high]) + rng.normal(0, 0.01, len(angles)), 1.0),
            "future": ArmState(now + rng.exponential(0.1), angles, 1.0),
            "nothing": None,
            "not finite": ArmState(float(rng.choice([now, np.nan])), bad, 1.0),
            "shape": ArmState(now, angles[: rng.integers(len(angles))], 1.0),
            "past": ArmState(-now - 1.0, angles, 1.0),
            "text": ArmState(now, "here", 1.0),  # type: ignore[arg-type]
        }
        return shown[self._mood]


def raging(rng: np.random.Generator, truth: Truth, angles: Array) -> Any:
    """Return what a hostile policy wants of an arm at angles (J,)."""
    kin, count = truth.kinematics, len(angles)
    wild = rng.normal(0, rng.choice([0.01, 0.1, 1.0, 1e3, 1e300]), count)
    bad = np.array(angles)
    bad[rng.integers(count)] = rng.choice([np.nan, np.inf, -np.inf])
    wishes = [
        angles + wild,
        rng.uniform(kin.low, kin.high),
        np.where(rng.random(count) < 0.5, kin.low, kin.high) + rng.normal(0, 1e-6, count),
        kin.solve(angles[None], np.array([[rng.uniform(0.2, 0.8), rng.uniform(-0.5, 0.5), -0.2]]), np.eye(3), 3)[0],
        angles + 0.02 * np.sign(wild),
        bad,
        angles[: rng.integers(count)],
        angles[None],
        [None, "down", object(), {}, 1e400, [["x"]]][rng.integers(6)],
    ]
    return wishes[rng.choice(len(wishes), p=[0.2, 0.15, 0.1, 0.2, 0.2, 0.05, 0.03, 0.03, 0.04])]


def run(config: HostileConfig) -> dict[str, Any]:
    """Return how many targets were sent, how often the arm held, and how often each rule was broken."""
    setup = read_env(compose([f"robot={config.robot}"]))
    rng, broken, totals = np.random.default_rng(config.seed), Counter[str](), Counter[str]()
    rules = [SafetyConfig(), SafetyConfig(slow_start=0.0), SafetyConfig(slow_start=0.0, following=1.0, speed=0.5)]
    truths = [Truth(setup, each) for each in rules]
    magnet = setup.robot.grippers[0] == "magnet"
    limits = [Limits(setup, read_kinematics(setup.robot), each, magnet=magnet) for each in rules]
    for number in range(-(-config.steps // ROUND)):
        i = number % len(rules)
        arm = HostileArm(setup, truths[i], rng, _start(truths[i], rng))
        _round(arm, Safety(rules[i], limits[i]), rng, min(ROUND, config.steps - number * ROUND), truths[i])
        broken.update(arm.broken)
        totals.update(targets=arm.targets, holds=arm.holds)
    for limit, truth in zip(limits, truths, strict=True):
        limit.close()
        truth.clearance.close()
    return {"steps": config.steps, **totals, "broken": dict(broken)}


def _start(truth: Truth, rng: np.random.Generator) -> Array:
    """Return angles (J,) with the gripper somewhere in the workspace."""
    kin = truth.kinematics
    low, high = truth.box
    place = rng.uniform(low + 0.06, high - 0.06)[None]
    return kin.solve(kin.rest[None], place, kin.forward(kin.rest[None]).rotation[0], 100)[0]


def _round(arm: HostileArm, safety: Safety, rng: np.random.Generator, steps: int, truth: Truth) -> None:
    """Drive one arm for some steps."""
    safe = SafeArm(arm, safety)
    safe.connect()
    for _ in range(steps):
        if safety.stopped and rng.random() < 0.3:
            safety.release()
        if rng.random() < 0.01:
            safe.stop("somebody pressed stop")
        opening = [0.0, 1.0, rng.random(), np.nan, 7.0, None][rng.integers(6)]
        safe.step(raging(rng, truth, arm._angles), opening, PERIOD)


def main(words: list[str]) -> None:
    """Run the program. Raises ConfigError, also if a rule was broken."""
    values = dict(word.partition("=")[::2] for word in words)
    config = read(HostileConfig, values, "")
    result = run(config)
    print(
        f"{config.steps:,} hostile steps with robot={config.robot}: {result['targets']:,} targets sent, "
        f"{result['holds']:,} times held, {sum(result['broken'].values())} rules broken"
    )
    if result["broken"]:
        raise ConfigError(f"rules were broken: {result['broken']}")


if __name__ == "__main__":
    run_program(main, __file__, sys.argv[1:])
