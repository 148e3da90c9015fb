"""From a picture of a person to the ray from their fingertip: the network, its weights' file, and who reads with it.

Weights are a NumPy archive without pickles; its zip format carries a checksum of every array. They are kept in 16 bits.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from conf.schema import ConfigError
from human.body.person_camera import CameraFrame, FurnitureBox, PersonCamera, Picture, camera_of
from human.config import Camera, GestureConfig, HumanConfig
from human.pointing_ik import Array

SHIPPED_WEIGHTS = Path(__file__).parent / "weights" / "pointing.npz"
SCALE = 0.1  # metres to which one of the network's units amounts
KEY = "gesture.weights"
TRAIN = "train others: python -m human.camera train out=<file>"
MOVED, TURNED = 0.1, 6.0  # metres and degrees that a camera may stand beside where it stood in training


class RayNetwork(nn.Module):
    """Pictures (M, 3, H, W) in [0, 1] to fingertips (M, 3), metres, and unit directions (M, 3), in the camera's frame.

    size: H = W, pixels, a multiple of 16. middle: (3,) metres, where fingertips are on average.
    """

    def __init__(self, size: int = 128, middle: Array | None = None) -> None:
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


def _convolution(before: int, after: int, kernel: int, stride: int) -> list[nn.Module]:
    return [nn.Conv2d(before, after, kernel, stride, 1, bias=False), nn.BatchNorm2d(after), nn.ReLU()]


def as_input(pictures: Picture) -> Tensor:
    """Pictures (M, H, W, 3) as the network takes them."""
    return torch.from_numpy(pictures).permute(0, 3, 1, 2).float().div_(255)


def save(path: Path, network: RayNetwork, human: HumanConfig) -> None:
    """Write what `load` reads: the parameters, and how the camera stood that they were trained for."""
    arrays = {name: value.numpy() for name, value in network.state_dict().items() if "num_batches" not in name}
    halves = {name: value.astype(np.float32 if name == "middle" else np.float16) for name, value in arrays.items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        np.savez_compressed(file, lens=_lens(camera_of(human)), stand=_stand(human), **halves)


def load(path: Path, human: HumanConfig) -> RayNetwork:
    """The network, ready to read what this person's camera sees. Raises ConfigError where it isn't made for that."""
    if not path.is_file():
        raise ConfigError(f"{KEY}={path} is not a file; train it: python -m human.camera train out={path}")
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays: dict[str, Any] = {name: archive[name] for name in archive.files}
        _fits(path, arrays.pop("lens"), arrays.pop("stand"), human)
        network = _filled(RayNetwork(camera_of(human).width), arrays).eval()
        # how pictures come: a third faster
        return network.to(memory_format=torch.channels_last)  # type: ignore[call-overload, no-any-return]
    except ConfigError:
        raise
    except (OSError, ValueError, KeyError, TypeError, RuntimeError, EOFError, zipfile.BadZipFile) as error:
        why = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ConfigError(f"{KEY}={path} is damaged, or holds other weights: {why}") from None


def _filled(network: RayNetwork, arrays: dict[str, Any]) -> RayNetwork:
    """The network with these parameters. Raises RuntimeError or ValueError for others than it has."""
    state = {name: torch.from_numpy(value.astype(np.float32)) for name, value in arrays.items()}
    if not all(value.isfinite().all() for value in state.values()):
        raise ValueError("not all of its numbers are finite")
    counts = {name: value for name, value in network.state_dict().items() if "num_batches" in name}
    network.load_state_dict(state | counts)
    return network


def _fits(path: Path, lens: Array, stand: Array, human: HumanConfig) -> None:
    """Raises ConfigError where the camera takes other pictures than those that were learned from."""
    camera = camera_of(human)
    if not np.array_equal(lens, _lens(camera)):
        wanted, given = ("{:g} x {:g} pixels, {:g} degrees".format(*each) for each in (lens, _lens(camera)))
        raise ConfigError(f"{KEY}={path} reads pictures of {wanted}; workspace.human.camera takes {given}; {TRAIN}")
    place, ahead = stand[:3] - _stand(human)[:3], stand[3:] @ _stand(human)[3:]
    if np.linalg.norm(place) > MOVED or ahead < np.cos(np.deg2rad(TURNED)):
        raise ConfigError(
            f"{KEY}={path} was trained for a camera that stands elsewhere to the person, by more than {MOVED:g} m or "
            f"{TURNED:g} degrees, than workspace.human.camera does; {TRAIN}"
        )


def _lens(camera: Camera) -> Array:
    """(3,) width and height in pixels, and degrees across: what all pictures have to have in common."""
    return np.array([camera.width, camera.height, camera.fov], np.float64)


def _stand(human: HumanConfig) -> Array:
    """(6,) where the camera is, metres, and where it looks, both as seen by the person: x is where they face."""
    frame, yaw = CameraFrame.of(camera_of(human)), np.deg2rad(human.yaw)
    turn = np.array([[np.cos(yaw), np.sin(yaw), 0], [-np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    return np.concatenate((turn @ (frame.place - human.position), turn @ frame.axes[2]))


class RayReader:
    """Reads rays off pictures of one camera. Raises ConfigError for weights that are missing or not for it."""

    def __init__(self, human: HumanConfig, weights: str | Path | None = None) -> None:
        self._network = load(Path(weights) if weights is not None else SHIPPED_WEIGHTS, human)
        self._frame = CameraFrame.of(camera_of(human))

    @torch.no_grad()
    def read(self, pictures: Picture) -> tuple[Array, Array]:
        """Fingertips (M, 3), metres, and unit directions (M, 3) in the workspace frame, of (M, H, W, 3) pictures.

        One picture after the other: in batches a picture's result depends in its last bits on how many there are.
        """
        rays = [self._network(as_input(picture[None])) for picture in pictures]
        tips, directions = (torch.cat(each).numpy().astype(np.float64) for each in zip(*rays, strict=True))
        return self._frame.to_workspace(tips, directions)


class CameraRayReader:
    """A camera that watches people who look alike and stand alike, and tells the ray of each. Raises ConfigError."""

    def __init__(self, human: HumanConfig, furniture: Iterable[FurnitureBox], config: GestureConfig) -> None:
        if config.style != "finger":
            raise ConfigError(f"gesture.style={config.style} can't be read from the camera; gesture.style=finger can")
        self._reader = RayReader(human, config.weights)
        self._sight = PersonCamera(human, furniture)
        self._sight.hide_invisible_shapes()

    def rays(self, arms: Sequence[Array]) -> tuple[Array, Array]:
        """Fingertips (M, 3), metres, and unit directions (M, 3) of people with their arms at these M angles (J,)."""
        return self._reader.read(np.stack([self._sight.picture(joints) for joints in arms]))

    def close(self) -> None:
        self._sight.close()
