"""What a workspace says of the person in it, and a run of how that person points."""

from __future__ import annotations

from dataclasses import dataclass

from conf.schema import Checked, ConfigError, one_of, within

STYLES = ("finger", "wrist", "eye")  # the line of the body that goes through what is meant
SOURCES = ("none", "ray", "camera")


@dataclass(frozen=True, kw_only=True)
class Camera(Checked):
    """target and distance in metres, yaw and pitch in degrees, width and height in pixels.

    fov: degrees that the picture's height spans.
    """

    target: list[float] = within(-20, 20, count=3)
    distance: float = within(0.1, 20)
    yaw: float
    pitch: float = within(-90, 90)
    fov: float = within(1, 120)
    width: int = within(16, 4096)
    height: int = within(16, 4096)


@dataclass(frozen=True, kw_only=True)
class HumanConfig(Checked):
    """The person.

    urdf: a file; None: the project's own model, `human/body/urdf_model.py`.
    position: of the URDF's origin, which lies between the feet, in metres.
    yaw: degrees; 0 faces +x.
    rest: angles in radians of the joints that move in pointing, in the posture that pointing starts from. All other
        joints stay at 0.
    camera: the fixed camera that sees the person point, needed for gesture=camera; None: no camera.
    """

    urdf: str | None
    position: list[float] = within(-20, 20, count=3)
    yaw: float = within(-360, 360)
    rest: dict[str, float] = within(-6.3, 6.3)
    camera: Camera | None


@dataclass(frozen=True, kw_only=True)
class GestureConfig(Checked):
    """How the person shows what is meant, and what the policy is given of it."""

    source: str = one_of(*SOURCES)  # nothing, the finger's true ray, or the one that a network sees in a picture
    style: str = one_of(*STYLES)  # which line is aimed: through the last finger links, or from wrist or eyes to tip
    noise_deg: float = within(0, 45)  # aiming error: standard deviation in each of the two directions across the ray
    dropout: float = within(0, 1)  # how often no gesture is shown
    switch: float = within(0, 1)  # how often the finger moves on to another object in mid-episode
    frames: int = within(1, 10_000)  # physics steps that the arm then takes
    weights: str | None  # of source=camera: a file; none: the ones that come with the project

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.weights is not None and self.source != "camera":
            raise ConfigError(f"weights={self.weights} is read by source=camera alone, and source={self.source}")
