"""A network that reads the ray of a person's finger from a picture, the file of its weights, and readers that use it.

Weights are a NumPy archive without pickles, in 16 bits; the zip format carries a checksum of every array. Files come
from others: sizes are checked before an array is allocated, and nothing is unpickled.
"""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from core.cameras import Camera, CameraFrame
from core.errors import ConfigError
from core.safe_files import FileError, check_size
from human.arms import Array
from human.body.person_camera import FurnitureBox, PersonCamera, Picture, camera_of
from human.config import GestureConfig, HumanConfig

SHIPPED_WEIGHTS = Path(__file__).parent / "weights" / "pointing.npz"
SCALE = 0.1  # metres per unit of the network's position output
KEY = "gesture.weights"
TRAIN_HINT = "train others: python -m human.camera train out=<file>"
MAX_SHIFT, MAX_TURN = 0.1, 6.0  # metres, degrees: how far a camera may stand from the one of the training
MAX_BYTES, MAX_ARRAY_BYTES = 8 * 2**20, 32 * 2**20  # of a file of weights, of all its arrays
MAX_ARRAYS = 200


class RayNetwork(nn.Module):
    """Network from pictures (M, 3, H, W) in [0, 1] to fingertips (M, 3), metres, and unit directions (M, 3).

    Both are in the camera's frame.
    """

    def __init__(self, size: int = 128, middle: Array | None = None) -> None:
        """Build the network.

        Args:
            size: H = W, pixels, a multiple of 16.
            middle: (3,) metres, the mean position of fingertips; None: the origin.
        """
        super().__init__()
        self.layers = nn.Sequential(
            *_convolution(3, 32, 6, 4),
            *_convolution(32, 64, 3, 2),
            *_convolution(64, 64, 3, 1),
            *_convolution(64, 64, 3, 2),
            nn.Conv2d(64, 24, 1),
            nn.ReLU(),
            nn.Flatten(),
            nn.Linear(24 * (size // 16) ** 2, 96),
            nn.ReLU(),
            nn.Linear(96, 6),
        )
        self.register_buffer("middle", torch.as_tensor(np.zeros(3) if middle is None else middle, dtype=torch.float32))

    def forward(self, pictures: Tensor) -> tuple[Tensor, Tensor]:
        out = self.layers(pictures - 0.5)
        return self.middle + SCALE * out[:, :3], functional.normalize(out[:, 3:], dim=1)


def _convolution(inputs: int, outputs: int, kernel: int, stride: int) -> list[nn.Module]:
    return [nn.Conv2d(inputs, outputs, kernel, stride, 1, bias=False), nn.BatchNorm2d(outputs), nn.ReLU()]


def as_input(pictures: Picture) -> Tensor:
    """Return pictures (M, H, W, 3) uint8 as the network's input, (M, 3, H, W) in [0, 1]."""
    return torch.from_numpy(pictures).permute(0, 3, 1, 2).float().div_(255)


def save(path: Path, network: RayNetwork, human: HumanConfig) -> None:
    """Write the parameters and the pose of the camera that they were trained for."""
    arrays = {name: value.numpy() for name, value in network.state_dict().items() if "num_batches" not in name}
    halves = {name: value.astype(np.float32 if name == "middle" else np.float16) for name, value in arrays.items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        np.savez_compressed(file, lens=_intrinsics(camera_of(human)), stand=_camera_pose(human), **halves)


def load(path: Path, human: HumanConfig) -> RayNetwork:
    """Return the network of a file, in evaluation mode.

    Raises:
        ConfigError: the file is missing or damaged, or was trained for another camera than this person's.
    """
    if not path.is_file():
        raise ConfigError(f"{KEY}={path} is not a file; train it: python -m human.camera train out={path}")
    try:
        arrays = read_arrays(path)
        _check_camera(path, arrays.pop("lens"), arrays.pop("stand"), human)
        network = _with_parameters(RayNetwork(camera_of(human).width), arrays).eval()
        # Pictures are stored channels last; this layout is a third faster.
        return network.to(memory_format=torch.channels_last)  # type: ignore[call-overload, no-any-return]
    except FileError as error:
        raise ConfigError(f"{KEY}={path} is damaged, or holds other weights: it {error}") from None
    except ConfigError:
        raise
    except Exception as error:  # numpy, zipfile, zlib and ast raise many types for a bad file
        why = (str(error).splitlines() or [type(error).__name__])[0][:200]
        raise ConfigError(f"{KEY}={path} is damaged, or holds other weights: {why}") from None


def read_arrays(path: Path) -> dict[str, Any]:
    """Return the arrays of a .npz file by name.

    Raises:
        FileError: the file is too large, or an array is of Python objects or has other bytes than its shape needs.
        Exception: of numpy and zipfile, for a damaged file.
    """
    check_size(path, MAX_BYTES)
    with zipfile.ZipFile(path) as archive:
        entries = archive.infolist()
        if len(entries) > MAX_ARRAYS or sum(entry.file_size for entry in entries) > MAX_ARRAY_BYTES:
            raise FileError(f"describes more than {MAX_ARRAYS} arrays or {MAX_ARRAY_BYTES / 2**20:.0f} MiB")
        for entry in entries:
            _check_shape(archive, entry)
    with np.load(path, allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}


def _check_shape(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> None:
    with archive.open(entry) as file:
        version = np.lib.format.read_magic(file)
        read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = read_header(file)
    if dtype.hasobject or min(shape, default=0) < 0 or math.prod(shape) * dtype.itemsize > entry.file_size:
        raise FileError(f"has an array {entry.filename} that does not fit its shape {shape} of {dtype}")


def _with_parameters(network: RayNetwork, arrays: dict[str, Any]) -> RayNetwork:
    """Load parameters into the network. Raises RuntimeError or ValueError if they are not the network's."""
    state = {name: torch.from_numpy(value.astype(np.float32)) for name, value in arrays.items()}
    if not all(value.isfinite().all() for value in state.values()):
        raise ValueError("not all of its numbers are finite")
    counts = {name: value for name, value in network.state_dict().items() if "num_batches" in name}
    network.load_state_dict(state | counts)
    return network


def _check_camera(path: Path, intrinsics: Array, pose: Array, human: HumanConfig) -> None:
    """Raise ConfigError if this person's camera differs from the one of the training."""
    if intrinsics.shape != (3,) or pose.shape != (6,) or not np.isfinite([*intrinsics, *pose]).all():
        raise FileError("has a camera that is not three and six finite numbers")
    camera = camera_of(human)
    if not np.array_equal(intrinsics, _intrinsics(camera)):
        wanted, given = ("{:g} x {:g} pixels, {:g} degrees".format(*each) for each in (intrinsics, _intrinsics(camera)))
        raise ConfigError(
            f"{KEY}={path} reads pictures of {wanted}; workspace.human.camera takes {given}; {TRAIN_HINT}"
        )
    shift, cosine = pose[:3] - _camera_pose(human)[:3], pose[3:] @ _camera_pose(human)[3:]
    if np.linalg.norm(shift) > MAX_SHIFT or cosine < np.cos(np.deg2rad(MAX_TURN)):
        raise ConfigError(
            f"{KEY}={path} was trained for a camera whose pose relative to the person differs by more than "
            f"{MAX_SHIFT:g} m or {MAX_TURN:g} degrees from that of workspace.human.camera; {TRAIN_HINT}"
        )


def _intrinsics(camera: Camera) -> Array:
    """Return (3,), width and height in pixels and the field of view in degrees; all pictures must agree in them."""
    return np.array([camera.width, camera.height, camera.fov], np.float64)


def _camera_pose(human: HumanConfig) -> Array:
    """Return (6,), the camera's position, metres, and viewing direction in the person's frame; x is where they face."""
    frame, yaw = CameraFrame.of(camera_of(human)), np.deg2rad(human.yaw)
    turn = np.array([[np.cos(yaw), np.sin(yaw), 0], [-np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    return np.concatenate((turn @ (frame.place - human.position), turn @ frame.axes[2]))


class RayReader:
    """Reader of rays in pictures of one camera."""

    def __init__(self, human: HumanConfig, weights: str | Path | None = None) -> None:
        """Load weights; None: those that come with the project. Raises ConfigError as `load` does."""
        self._network = load(Path(weights) if weights is not None else SHIPPED_WEIGHTS, human)
        self._frame = CameraFrame.of(camera_of(human))

    @torch.no_grad()
    def read(self, pictures: Picture) -> tuple[Array, Array]:
        """Return fingertips (M, 3), metres, and unit directions (M, 3) in the workspace frame.

        Pictures (M, H, W, 3) are read one at a time: in a batch, the last bits of a result depend on the batch size.
        """
        rays = [self._network(as_input(picture[None])) for picture in pictures]
        tips, directions = (torch.cat(each).numpy().astype(np.float64) for each in zip(*rays, strict=True))
        return self._frame.to_workspace(tips, directions)


class CameraRayReader:
    """A camera in front of people of the same body and place, and the reader of their rays."""

    def __init__(self, human: HumanConfig, furniture: Iterable[FurnitureBox], config: GestureConfig) -> None:
        """Load the person and the weights.

        Args:
            human: the people's body and place, and the camera.
            furniture: boxes in the picture.
            config: how the person points, and the file of weights.

        Raises:
            ConfigError: a style but "finger"; and as `load`.
        """
        if config.style != "finger":
            raise ConfigError(f"gesture.style={config.style} can't be read from the camera; gesture.style=finger can")
        self._reader = RayReader(human, config.weights)
        self._camera = PersonCamera(human, furniture)
        self._camera.hide_invisible_shapes()

    def rays(self, arms: Sequence[Array]) -> tuple[Array, Array]:
        """Return fingertips (M, 3), metres, and unit directions (M, 3) of people with the arm at M angles (J,)."""
        return self._reader.read(np.stack([self._camera.picture(joints) for joints in arms]))

    def close(self) -> None:
        """Disconnect the camera's client. Idempotent."""
        self._camera.close()
