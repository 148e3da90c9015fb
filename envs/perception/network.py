"""The network that finds things in one picture of a calibrated camera, and the file of its weights.

It is fully convolutional: in each cell of 4 x 4 pixels it tells how likely the middle of a thing is there (Zhou et al.
2019, Objects as Points), and what it would be: where exactly, how high above the table, of which noun, colour, size and
role, how it is turned and how far it is moved or open. Each cell also reads where its line of sight meets the table,
so that the same weights serve cameras in other poses.
"""

from __future__ import annotations

import copy

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional
from torch.nn.utils.fusion import fuse_conv_bn_eval

from core.cameras import Camera, CameraFrame
from envs.perception.detections import COLOR_NAMES, NOUN_NAMES

CELL = 4  # pixels across a cell
MIDDLE = (0.45, 0.0)  # metres, a point of the table from which the network counts
HEIGHT_UNIT, SIZE_UNIT = 0.1, 0.05  # metres for one unit of the network's output
LEAST_DEPTH, MOST_DEPTH = 0.2, 4.0  # metres within which lines of sight meet the table, or are clipped
CHANNELS = (24, 40, 64, 96)
HEADS = {  # name -> numbers that a cell has of it
    "heat": 1,
    "offset": 2,  # from the cell's middle to the thing's, cells
    "height": 1,
    "spread": 2,  # log of the standard deviations of offset, cells, and height, units
    "noun": len(NOUN_NAMES),
    "color": len(COLOR_NAMES),
    "size": 1,
    "target": 1,
    "turn": 4,  # cosine and sine of the yaw relative to the line of sight; of four times that, or of a wheel's mark
    "share": 1,
}
WIDTH = sum(HEADS.values())
_ENDS = np.cumsum(list(HEADS.values())).tolist()
PART = {name: slice(end - width, end) for (name, width), end in zip(HEADS.items(), _ENDS, strict=True)}  # channels


def sight(cameras: Tensor, cells: tuple[int, int]) -> Tensor:
    """Return where the middle of each cell looks at, (M, 4, h, w).

    The channels: x and y of the point of the table, metres from `MIDDLE`; the logarithm of its depth, metres; and how
    steeply the line of sight falls, in [0, 1].

    Args:
        cameras: (M, 15) of `camera_numbers`.
        cells: h and w.
    """
    u = (torch.arange(cells[1], device=cameras.device) + 0.5) * CELL
    v = (torch.arange(cells[0], device=cameras.device) + 0.5) * CELL
    grid = torch.stack(torch.meshgrid(u, v, indexing="xy"), -1)
    place, axes, focal, middle = cameras[:, :3], cameras[:, 3:12].unflatten(1, (3, 3)), cameras[:, 12], cameras[:, 13:]
    across = (grid - middle[:, None, None]) / focal[:, None, None, None]
    rays = torch.cat((across, torch.ones_like(across[..., :1])), -1) @ axes[:, None]
    fall = -rays[..., 2]
    depth = (place[:, 2, None, None] / fall.clamp(min=1e-3)).clamp(LEAST_DEPTH, MOST_DEPTH)
    points = place[:, None, None, :2] + depth[..., None] * rays[..., :2]
    across_table = (points - points.new_tensor(MIDDLE)).clamp(-2.0, 2.0)
    steep = (fall / rays.norm(dim=-1))[..., None]
    return torch.cat((across_table, depth.log()[..., None], steep), -1).permute(0, 3, 1, 2)


def camera_numbers(camera: Camera, frame: CameraFrame) -> np.ndarray:
    """(15,) what `sight` needs of a camera: its place, axes, focal length and middle."""
    return np.concatenate((frame.place, frame.axes.ravel(), [camera.focal], camera.middle)).astype(np.float32)


class SightNetwork(nn.Module):
    """Network from pictures (M, 3, H, W) in [0, 1] and cameras (M, 15) to the numbers of cells (M, WIDTH, H/4, W/4)."""

    def __init__(self) -> None:
        super().__init__()
        a, b, c, d = CHANNELS
        self.stem = nn.Sequential(_convolution(3, a, 5, 2), _convolution(a, b, 3, 2))
        self.ground = nn.Conv2d(4, b, 1)
        self.fine = nn.Sequential(_Block(b), _Block(b))
        self.middle = nn.Sequential(_convolution(b, c, 3, 2), _Block(c), _Block(c))
        self.coarse = nn.Sequential(_convolution(c, d, 3, 2), _Block(d), _Block(d))
        self.up_coarse, self.up_middle = nn.Conv2d(d, c, 1), nn.Conv2d(c, b, 1)
        self.join_middle, self.join_fine = _Block(c), _convolution(b, c, 3, 1)
        self.heads = nn.Sequential(nn.Conv2d(c, c, 1), nn.ReLU(inplace=True), nn.Conv2d(c, WIDTH, 1))
        with torch.no_grad():
            self.heads[-1].bias.zero_()  # type: ignore[union-attr, operator]
            self.heads[-1].bias[0] = -4.0  # type: ignore[index, operator]

    def forward(self, pictures: Tensor, cameras: Tensor) -> Tensor:
        fine = self.stem(pictures - 0.5)
        with torch.autocast(pictures.device.type, enabled=False):  # 16 bits would round places to 4 mm
            ground = self.ground(sight(cameras, (fine.shape[2], fine.shape[3])))
        fine = self.fine(fine + ground)
        middle = self.middle(fine)
        coarse = self.coarse(middle)
        middle = self.join_middle(middle + _doubled(self.up_coarse(coarse)))
        out: Tensor = self.heads(self.join_fine(fine + _doubled(self.up_middle(middle))))
        return out


def _doubled(values: Tensor) -> Tensor:
    return functional.interpolate(values, scale_factor=2.0, mode="nearest")


def _convolution(inputs: int, outputs: int, kernel: int, stride: int) -> nn.Sequential:
    convolution = nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, bias=False)
    return nn.Sequential(convolution, nn.BatchNorm2d(outputs), nn.ReLU(inplace=True))


class _Block(nn.Module):
    """A residual block of two convolutions."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first = _convolution(channels, channels, 3, 1)
        self.second = nn.Sequential(nn.Conv2d(channels, channels, 3, 1, 1, bias=False), nn.BatchNorm2d(channels))

    def forward(self, values: Tensor) -> Tensor:
        return functional.relu_(values + self.second(self.first(values)))


def folded(network: SightNetwork) -> SightNetwork:
    """Return a copy that only reads pictures: its norms are folded into the convolutions, which is faster."""
    copied = copy.deepcopy(network).eval()
    for layers in [each for each in copied.modules() if isinstance(each, nn.Sequential)]:
        for i in range(len(layers) - 1):
            convolution, norm = layers[i], layers[i + 1]
            if isinstance(convolution, nn.Conv2d) and isinstance(norm, nn.BatchNorm2d):
                layers[i], layers[i + 1] = fuse_conv_bn_eval(convolution, norm), nn.Identity()
    return copied
