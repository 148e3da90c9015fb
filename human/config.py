"""Configuration of the person in a workspace (`workspace.human`) and of how they point in a run (`gesture`)."""

from __future__ import annotations

from dataclasses import dataclass

from core.cameras import Camera
from core.errors import ConfigError
from core.schema import Checked, any_path, one_of, within

STYLES = ("finger", "wrist", "eye")  # the line of the body that is aimed at the target
SOURCES = ("none", "ray", "camera")


@dataclass(frozen=True, kw_only=True)
class HumanConfig(Checked):
    """The person.

    urdf: a file; None: the project's own model, `human/body/urdf_model.py`.
    position: of the URDF's origin, which lies between the feet, metres.
    yaw: degrees; 0 faces +x.
    rest: angles in radians of the joints that move in pointing, in the posture that pointing starts from. All other
        joints stay at 0.
    camera: the fixed camera that sees the person point, which gesture=camera needs; None: no camera.
    palm: x0, x1, y0, y1, z0, z1 where the person holds an open hand, palm up, metres; []: they hold out none.
    """

    urdf: str | None = any_path()
    position: list[float] = within(-20, 20, count=3)
    yaw: float = within(-360, 360)
    rest: dict[str, float] = within(-6.3, 6.3)
    camera: Camera | None
    palm: list[float] = within(-20, 20, count=(0, 6), default=())  # configs of older versions lack it

    def __post_init__(self) -> None:
        super().__post_init__()
        corners = list(zip(self.palm[::2], self.palm[1::2], strict=False))
        if self.palm and (len(self.palm) != 6 or any(low > high for low, high in corners)):
            raise ConfigError(f"palm={self.palm} must be [] or 6 numbers, each low <= high in turn")


@dataclass(frozen=True, kw_only=True)
class GestureConfig(Checked):
    """How the person points, and what the policy observes of it.

    source: "none": no gesture. "ray": the finger's true ray. "camera": the ray that a network reads from a picture.
    style: the line that is aimed: through the last two finger links, or from the wrist or the eyes to the fingertip.
    noise_deg: aiming error, the standard deviation in each of the two directions across the ray, degrees.
    dropout: probability that no gesture is shown.
    switch: probability that the finger moves on to another object during the episode.
    frames: physics steps that this motion of the arm takes.
    weights: of source=camera: a file; None: the weights that come with the project.
    """

    source: str = one_of(*SOURCES)
    style: str = one_of(*STYLES)
    noise_deg: float = within(0, 45)
    dropout: float = within(0, 1)
    switch: float = within(0, 1)
    frames: int = within(1, 10_000)
    weights: str | None = any_path()

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.weights is not None and self.source != "camera":
            raise ConfigError(f"weights={self.weights} is read by source=camera alone, and source={self.source}")
