"""What cameras see: `deixis look picture.png --camera front.yaml` names the things in a picture, and where they are.

    deixis look front.png --camera front.yaml
    deixis look front.png side.png --camera front.yaml --camera side.yaml --json

A camera file is what `deixis calibrate` writes. Pictures of several cameras must be of one moment; what they see is
fused. The pictures with boxes, names and the uncertainty's ellipses go to --out, side by side. The exit code is 2 for
pictures and cameras with which nothing can be seen.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from core.command_line import check_file
from core.errors import ConfigError
from core.program import OptionParser, help_text, program

if TYPE_CHECKING:
    from envs.perception import Detector, View

REFUSED = 2  # exit code
SCALE = (
    155.0  # pixels for a metre at the middle of the table: the network has learned from pictures of about this scale
)
NEAR_SCALE = 1.25  # factor within which a picture stays as it is
MOST_CAMERAS = 8
DRAWN = 640  # pixels of width that a drawn picture has at least


def parser() -> OptionParser:
    """Build the parser of the options."""
    options = OptionParser(
        prog="deixis look", description=help_text(__file__), formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("pictures", nargs="+", type=Path, metavar="picture.png")
    options.add_argument(
        "--camera", action="append", default=[], type=Path, help="its camera file; one for each picture"
    )
    options.add_argument("--json", action="store_true", help="print what is seen as JSON")
    options.add_argument("--out", type=Path, default=Path("seen.png"), help="the drawn picture (default: seen.png)")
    options.add_argument("--workspace", default="table", help="whose table it is (default: table)")
    options.add_argument("--weights", type=Path, help="of the network (default: those of the project)")
    return options


def cli() -> None:
    """Run the program with the words of this process."""
    with program(failed=REFUSED):
        main(sys.argv[1:])


def main(words: Sequence[str], detector: Detector | None = None) -> None:
    """Print and draw what is seen. Raises ConfigError. detector: in place of the network."""
    from envs.perception import UnusablePicture
    from envs.perception.detections import check_picture
    from envs.perception.drawing import as_plain, drawn, seen_things

    args = parser().parse_args(words)
    check_file("--out", args.out, (".png", ".jpg", ".jpeg"))
    views = _views(args)
    if detector is None:
        from envs.perception.detector import load_detector

        detector = load_detector(args.weights)
    try:
        for name, view in views.items():
            check_picture(name, view)
        found = detector({name: for_network(view) for name, view in views.items()})
    except UnusablePicture as error:
        raise ConfigError(str(error)) from None
    _save(args.out, [drawn(view, found, max(view.camera.width, DRAWN)) for view in views.values()])
    if args.json:
        print(json.dumps({"pictures": list(map(str, args.pictures)), "seen": as_plain(found), "drawn": str(args.out)}))
        return
    things = seen_things(found)
    print(f"{', '.join(map(str, args.pictures))}: {len(things)} thing{'s' * (len(things) != 1)}")
    for thing in things:
        print(f"  {thing.line}")
    print(f"drawn in {args.out}")


def _views(args: argparse.Namespace) -> dict[str, View]:
    """Return the views by their camera files. Raises ConfigError."""
    if len(args.pictures) != len(args.camera):
        given = f"{len(args.pictures)} picture(s) and {len(args.camera)} --camera are given"
        raise ConfigError(f"{given}: give each picture its camera file, like deixis look front.png --camera front.yaml")
    if len(args.pictures) > MOST_CAMERAS:
        raise ConfigError(f"{len(args.pictures)} pictures are given, and at most {MOST_CAMERAS} are taken at once")
    area, views = _area(args.workspace), {}
    for picture, path in zip(args.pictures, args.camera, strict=True):
        if str(path) in views:
            raise ConfigError(f"--camera {path} is given twice: pictures of one moment come from different cameras")
        views[str(path)] = _view(picture, path, area)
    return views


def _area(workspace: str) -> list[float]:
    """Return where objects are on the table, x0, x1, y0, y1, metres."""
    from core.overrides import check, compose

    check([f"workspace={workspace}"])
    return [float(value) for value in compose([f"workspace={workspace}"])["workspace"]["object_area"]]


def _view(picture: Path, path: Path, area: Sequence[float]) -> View:
    """Return a picture as its ideal camera had taken it. Raises ConfigError."""
    from core.cameras import CameraFrame
    from envs.perception import View
    from envs.perception.camera_files import read_camera, read_picture
    from envs.perception.config import sees_area

    file = read_camera(path)
    camera = file.camera
    if camera.mount != "workspace":
        raise ConfigError(f"{path} is a camera on the gripper, and a picture alone does not say where the gripper was")
    if not sees_area(camera, area):
        raise ConfigError(
            f"{path} sees no table: where objects are put (x0, x1, y0, y1 {list(area)}) is outside of its picture"
        )
    pixels = read_picture(picture)
    if pixels.shape[:2] != (camera.height, camera.width):
        raise ConfigError(
            f"{picture} has {pixels.shape[1]} x {pixels.shape[0]} pixels, but the camera of {path} takes "
            f"{camera.width} x {camera.height}: give a picture as that camera took it"
        )
    return View(file.ideal_picture(pixels), camera, CameraFrame.of(camera))


def for_network(view: View) -> View:
    """Return a view at the scale from which the network learned, with sides that it takes; cut evenly to fit."""
    from PIL import Image

    from envs.perception import View
    from envs.perception.config import STRIDE

    camera = view.camera
    ahead = np.array([0.44, 0.0, 0.0]) - view.frame.place
    factor = SCALE * max(float(ahead @ view.frame.axes[2]), 0.1) / camera.focal
    fits = camera.width % STRIDE == 0 and camera.height % STRIDE == 0
    if fits and 1 / NEAR_SCALE < factor < NEAR_SCALE:
        return view
    width, height = (max(STRIDE, round(side * factor / STRIDE) * STRIDE) for side in (camera.width, camera.height))
    # The part of the picture that has the new sides' ratio, around the middle: the optical axis stays there.
    share = min(camera.width / width, camera.height / height)
    wide, high = width * share, height * share
    box = ((camera.width - wide) / 2, (camera.height - high) / 2, (camera.width + wide) / 2, (camera.height + high) / 2)
    image = Image.fromarray(view.picture).resize((width, height), Image.Resampling.BOX, box)
    fov = float(np.degrees(2 * np.arctan(high / 2 / camera.focal)))
    return View(np.array(image, np.uint8), replace(camera, width=width, height=height, fov=fov), view.frame)


def _save(out: Path, pictures: Sequence[NDArray[np.uint8]]) -> None:
    """Write pictures side by side."""
    from PIL import Image

    height = max(picture.shape[0] for picture in pictures)
    padded = [np.pad(each, ((0, height - each.shape[0]), (0, 0), (0, 0))) for each in pictures]
    joined: Any = Image.fromarray(np.concatenate(padded, axis=1))
    out.parent.mkdir(parents=True, exist_ok=True)
    joined.save(out)
