"""Camera files, and the pictures that their cameras took.

A camera file is YAML with the keys of `core.cameras.Camera`, which place an ideal camera. Two groups may follow: `lens`
says how the pictures of the real one differ from that, and `calibration` what the camera was found from and how well.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.cameras import Camera
from core.errors import ConfigError
from core.safe_files import FileError, check_plain, read_bytes, read_yaml
from core.schema import Checked, read, within
from core.system import import_optional

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]
MAX_PICTURE = 64 * 2**20  # bytes of a file
SMALLEST, LARGEST = 16, 4096  # pixels of a side, as for a Camera
FORMATS = ("PNG", "JPEG", "BMP", "WEBP")
PLACING = ("target", "distance", "yaw", "pitch")  # keys that say where a camera is


class UnusableCamera(ConfigError):
    """A camera file that does not say what is needed."""


@dataclass(frozen=True, kw_only=True)
class Lens(Checked):
    """How a real camera forms its picture.

    focal: pixels. middle: (2,) where the optical axis meets the picture, pixels, the middle of the first one being
    (0.5, 0.5). distortion: k1, k2, p1, p2, k3 of OpenCV. width, height: of the picture, pixels.
    """

    focal: float = within(8, 100_000)
    middle: list[float] = within(-4096, 8192, count=2)
    width: int = within(SMALLEST, LARGEST)
    height: int = within(SMALLEST, LARGEST)
    distortion: list[float] = within(-100, 100, count=5, default=(0.0,) * 5)

    @classmethod
    def ideal(cls, fov: float, width: int, height: int) -> Lens:
        """Return a lens without distortion. fov: vertical field of view, degrees. Raises ConfigError."""
        camera = Camera(target=[0.0, 0.0, 0.0], distance=1.0, yaw=0.0, pitch=0.0, fov=fov, width=width, height=height)
        return cls(focal=camera.focal, middle=camera.middle.tolist(), width=width, height=height)

    @property
    def fov(self) -> float:
        """The vertical field of view of an ideal camera with this focal length, degrees."""
        return float(np.degrees(2 * np.arctan(self.height / 2 / self.focal)))

    @property
    def is_ideal(self) -> bool:
        """Whether pictures need no correction."""
        return not any(self.distortion) and self.middle == [self.width / 2, self.height / 2]

    @property
    def matrix(self) -> Array:
        """(3, 3) the intrinsic matrix for OpenCV, whose first pixel has its middle at (0, 0)."""
        x, y = self.middle
        return np.array([[self.focal, 0, x - 0.5], [0, self.focal, y - 0.5], [0, 0, 1.0]])

    def project(self, points: Array) -> Array:
        """Return the pixels (N, 2) of points (N, 3) in the camera's frame: right, down, ahead; metres."""
        x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
        k1, k2, p1, p2, k3 = self.distortion
        r = x * x + y * y
        radial = 1 + r * (k1 + r * (k2 + r * k3))
        across = x * radial + 2 * p1 * x * y + p2 * (r + 2 * x * x)
        down = y * radial + p1 * (r + 2 * y * y) + 2 * p2 * x * y
        return np.array(self.middle) + self.focal * np.column_stack((across, down))

    def undistorted(self, picture: Picture) -> Picture:
        """Return a picture as the ideal camera with this focal length had taken it. Raises ConfigError."""
        if self.is_ideal:
            return picture
        (cv2,) = import_optional("cv2", extra="eyes", what="pictures through a lens with distortion")
        middle = [self.width / 2, self.height / 2]
        straight = replace(self, middle=middle, distortion=[0.0] * 5)
        corrected: Picture = cv2.undistort(picture, self.matrix, np.array(self.distortion), None, straight.matrix)
        return corrected


@dataclass(frozen=True)
class CameraFile:
    """What a camera file says. calibration: what the camera was found from, with residuals; {} for one by hand."""

    camera: Camera
    lens: Lens
    calibration: Mapping[str, Any]

    def ideal_picture(self, picture: Picture) -> Picture:
        """Return a picture of the real camera as `camera` had taken it."""
        return self.lens.undistorted(picture)


def read_camera(path: Path) -> CameraFile:
    """Read a camera file. Raises UnusableCamera where it does not say where its camera is, and ConfigError."""
    content = _group(path)
    lens = read(Lens, content.pop("lens"), f"{path}: lens") if content.get("lens") is not None else None
    calibration = content.pop("calibration", {})
    missing = [key for key in PLACING if content.get(key) is None]
    if missing:
        raise UnusableCamera(
            f"{path} has no {missing[0]}, so it does not say where its camera is: find that with deixis calibrate"
        )
    camera = read(Camera, content, str(path))
    lens = lens or Lens.ideal(camera.fov, camera.width, camera.height)
    if (lens.width, lens.height) != (camera.width, camera.height) or abs(lens.focal / camera.focal - 1) > 1e-3:
        raise ConfigError(
            f"{path}: lens belongs to another camera: its size or focal length is not that of fov={camera.fov}"
        )
    return CameraFile(camera, lens, calibration if isinstance(calibration, dict) else {})


def read_lens(path: Path) -> Lens:
    """Read the lens of a lens file or a camera file. Raises ConfigError."""
    content = _group(path)
    if content.get("lens") is None:
        raise UnusableCamera(f"{path} has no lens: find it with deixis calibrate lens, or give fov=<degrees> instead")
    return read(Lens, content["lens"], f"{path}: lens")


def _group(path: Path) -> dict[str, Any]:
    try:
        content = read_yaml(path)
        check_plain(content, 1000)
    except FileError as error:
        raise ConfigError(f"{path} {error}") from None
    if not isinstance(content, dict):
        raise ConfigError(f"{path} is no camera file: it must have the keys {', '.join(_keys())}")
    return content


def _keys() -> list[str]:
    return [field.name for field in fields(Camera)]


def camera_text(title: str, camera: Camera | None, lens: Lens, calibration: Mapping[str, Any]) -> str:
    """Return the content of a camera file, or of a lens file where there is no camera. title: one line."""
    import yaml

    content: dict[str, Any] = {} if camera is None else _rounded(asdict(camera))
    if camera is None or not lens.is_ideal:
        content["lens"] = _rounded(asdict(lens))
    content["calibration"] = _rounded(dict(calibration))
    return f"# {title}\n" + yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=120)


def override_of(name: str, camera: Camera) -> str:
    """Return the word that puts a camera into a workspace's config under this name, or replaces that of this name."""
    values = ",".join(f"{key}:{_plain(value)}" for key, value in _rounded(asdict(camera)).items())
    return f"++workspace.cameras.{name}={{{values}}}"


def _plain(value: Any) -> str:
    return f"[{','.join(map(str, value))}]" if isinstance(value, list) else str(value)


def _rounded(value: Any) -> Any:
    """Return values of a config with 6 digits after the point: micrometres, and far less than a degree's thousandth."""
    if isinstance(value, dict):
        return {key: _rounded(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_rounded(inner) for inner in value]
    return round(value, 6) if isinstance(value, float) else value


# ---- pictures


def read_picture(path: Path) -> Picture:
    """Return the RGB picture (H, W, 3) in a file, turned as its camera was held. Raises ConfigError."""
    from PIL import Image, ImageOps, UnidentifiedImageError

    try:
        content = read_bytes(path, MAX_PICTURE)
    except FileError as error:
        raise ConfigError(f"{path} {error}") from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            image = Image.open(io.BytesIO(content), formats=FORMATS)
            if not all(SMALLEST <= side <= LARGEST for side in image.size):
                raise ConfigError(
                    f"{path} has {image.width} x {image.height} pixels: a side must have {SMALLEST} to {LARGEST}"
                )
            turned = ImageOps.exif_transpose(image)
            return np.array((turned or image).convert("RGB"), np.uint8)  # writable, as PyTorch wants it
    except (UnidentifiedImageError, Image.DecompressionBombError):
        raise ConfigError(f"{path} is no picture that can be read: give one of {', '.join(FORMATS)}") from None
    except (OSError, ValueError, SyntaxError, EOFError) as error:
        if isinstance(error, ConfigError):
            raise
        raise ConfigError(f"{path} is a damaged picture: {str(error) or type(error).__name__}") from None
