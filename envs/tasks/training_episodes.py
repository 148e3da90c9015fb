"""Settings that only training episodes use: the curriculum, and domain randomisation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from numpy.random import Generator

from conf.schema import Checked, ConfigError, within

MOST_STEPS = 10  # control steps that an action may be late
OFF = [1.0, 1.0]


def _range(low: float, high: float, off: Sequence[float]) -> Any:
    """Declares a field: the two ends of a range within [low, high]; `off`, if it is left out."""
    return field(default_factory=lambda: list(off), metadata={"within": (low, high), "count": 2})


@dataclass(frozen=True, kw_only=True)
class CurriculumConfig(Checked):
    """Shares of training episodes that begin nearer to success, how they succeed and end, and the draw of verbs.

    Evaluations never use them.
    """

    near: float = within(0, 1)  # the gripper is just over the object
    held: float = within(0, 1)  # the gripper holds the object, somewhere over the table
    placed: float = within(0, 1)  # the gripper has just let go of the object at its target
    radius: float = within(0, 1, default=0.0)  # metres, in place of task.radius if smaller; 0: task.radius
    hold_steps: int = within(0, 1000, default=0)  # control steps, in place of task.hold_steps if fewer; 0: as there
    max_steps: int = within(0, 100_000, default=0)  # control steps, in place of task.max_steps if fewer; 0: as there
    # Metres along x and y that an object that is held from the start may be off the middle of a magnet, which takes
    # hold wherever it touches. Without, a policy may bring its middle to the target instead of the object.
    off_centre: float = within(0, 0.05, default=0.0)
    # Whether verbs that failed recently are drawn more often, in tasks with several. The draws of a world then depend
    # on the outcomes in the other worlds of its process.
    automatic: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.share > 1:
            raise ConfigError(f"near={self.near}, held={self.held} and placed={self.placed} must come to 1 at most")

    @property
    def share(self) -> float:
        """The sum of the three shares."""
        return self.near + self.held + self.placed


NO_CURRICULUM = CurriculumConfig(near=0.0, held=0.0, placed=0.0)


@dataclass(frozen=True, kw_only=True)
class RandomizeConfig(Checked):
    """Domain randomisation: each training episode draws these values, uniformly from [low, high].

    If low equals high, every episode has that value. Evaluations are not randomised.
    """

    start: float = within(0, 1, default=0.0)  # greatest distance of joints from rest, radians; 0: task.reset_noise
    mass: list[float] = _range(0.01, 100, OFF)  # factor of the objects' mass
    friction: list[float] = _range(0.01, 10, OFF)  # factor of the objects' lateral friction
    action_noise: float = within(0, 1, default=0.0)  # std of the arm's motion, as a share of a control step's motion
    observation_noise: float = within(0, 0.1, default=0.0)  # std of the objects' observed positions, metres
    delay: list[int] = _range(0, MOST_STEPS, [0, 0])  # control steps after which an action is carried out

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("mass", "friction", "delay"):
            low, high = getattr(self, name)
            if low > high:
                raise ConfigError(f"{name}={[low, high]} must be a range: the lower end first")

    @property
    def is_on(self) -> bool:
        """Whether an episode draws anything but where the arm begins."""
        ranges = self.mass != OFF or self.friction != OFF or self.delay != [0, 0]
        return ranges or self.action_noise > 0 or self.observation_noise > 0


@dataclass(frozen=True)
class Randomized:
    """The values of one episode. mass, friction: factors. delay: control steps. noise: seed of its noise."""

    mass: float
    friction: float
    delay: int
    noise: int


def draw_randomized(config: RandomizeConfig, rng: Generator) -> Randomized | None:
    """Draws for one episode; None if it is off. `rng` does not advance, so scenes do not depend on the values."""
    if not config.is_on:
        return None
    rng = Generator(rng.bit_generator.jumped())  # type: ignore[attr-defined]
    mass, friction = (float(rng.uniform(low, high)) for low, high in (config.mass, config.friction))
    return Randomized(mass, friction, int(rng.integers(config.delay[0], config.delay[1] + 1)), int(rng.integers(2**31)))
