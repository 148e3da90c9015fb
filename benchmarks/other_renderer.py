"""How well the network sees pictures of another renderer than it learned from: the page's 3D view in Chromium.

    python -m benchmarks.other_renderer                       500 scenes, two cameras each
    python -m benchmarks.other_renderer --save FOLDER         keep the pictures, and sheets of both renderers' ones
    python -m benchmarks.other_renderer --load FOLDER --weights sight.safetensors    see those pictures again

The scenes are those that episodes of `nl_reach` with six objects, `nl_pick_and_place` and `anything` begin with. The
page's view draws each by WebGL, and photographs it with the pose, field of view and size of the workspace's cameras
`front` and `side`. PyBullet's pictures of the same scenes are seen too, for comparison. `silhouettes` is the share of
pixels, apart from those next to an edge, where both renderers agree on what shows an object and what lies behind the
room; it is taken from the first scenes of each setup. Needs Chromium.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
import viser
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.spatial.transform import Rotation

from core.cameras import Camera, CameraFrame
from core.program import program
from demo.scene_view import SceneView
from envs.config import EnvConfig
from envs.interactive.interactive_env import InteractiveEnv
from envs.perception.detections import View
from envs.perception.detector import SightDetector, fuse, load_detector
from envs.perception_training.judging import Judgement, judge
from envs.perception_training.scenes import PLAIN, SETUPS, THINGS, SceneSource
from envs.sim.rendering import VisualShape, VisualShapes
from human import Body
from tools.browser import free_port, headless_browser

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]
CAMERAS = "front", "side"
CASES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("nl_reach, six objects", SETUPS[0]),
    ("nl_pick_and_place", ("task=nl_pick_and_place",)),
    ("anything", ("task=anything",)),
)
CHECKED = 3  # scenes of a setup whose silhouettes are compared
SHOWN = 6  # scenes of a setup on the sheet
WINDOW = 256  # pixels of the browser's window
NOWHERE = (0.0, 0.0, 50.0), (0.0, 0.1, 60.0)  # metres: place and target from which the window shows nothing
TIMEOUT = 120.0  # seconds
RENDERERS = "page", "PyBullet"


@dataclass(frozen=True)
class Scenes:
    """N scenes of one setup. pictures: by renderer, (N, V, H, W, 3). labels: (N, V, THINGS, ...). positions: (N,
    THINGS, 3) metres."""

    pictures: dict[str, Picture]
    labels: NDArray[np.float32]
    positions: Array


Taken = tuple[str, Sequence[str], Scenes]  # name of a setup, its overrides, and its scenes


class ShownScenes(SceneSource):
    """Scenes as episodes begin, and what a viewer needs to draw them.

    cameras: of the workspace. view_of: what `SceneView` takes.
    """

    def __init__(self, overrides: Sequence[str], seed: int) -> None:
        super().__init__(overrides, CAMERAS, seed, looks=PLAIN, disturbed=False)
        person = self._world.person
        cone = (person.body, person.cone) if isinstance(person, Body) and person.cone is not None else None
        self.cameras: list[Camera] = self._cameras
        self.shapes = ShapesWithout(self._world.client, cone)
        self.all_bodies: list[int] = []  # that can be clicked

    @property
    def visual_shapes(self) -> ShapesWithout:
        return self.shapes

    @property
    def config(self) -> EnvConfig:
        return self._env.config

    @property
    def objects(self) -> list[int]:
        """The bodies of objects."""
        return list(self._world.pool.bodies)

    def seen(self, camera: Camera) -> NDArray[np.int32]:
        """Return the body of each pixel (H, W), -1 where there is nothing."""
        pose = self._env.kinematics.forward(self._joints[None])
        links = self._world.photograph(camera, (pose.position[0], pose.rotation[0])).links
        return np.where(links < 0, -1, links & 0xFFFFFF)


class ShapesWithout(VisualShapes):
    """The visual shapes of a client but for one link's: the cone along a finger, which cameras do not see."""

    def __init__(self, client: int, left_out: tuple[int, int] | None) -> None:
        super().__init__(client)
        self._left_out = left_out

    def shapes(self) -> list[VisualShape]:
        return [shape for shape in super().shapes() if (shape.body, shape.link) != self._left_out]


class PageCamera(SceneView):
    """Takes pictures of the page's 3D view in a browser."""

    def __init__(self, browser: Any, server: viser.ViserServer) -> None:
        place, target = NOWHERE
        server.initial_camera.position, server.initial_camera.look_at = place, target
        tab = browser.new_page(viewport={"width": WINDOW, "height": WINDOW})
        tab.goto(f"http://127.0.0.1:{server.get_port()}/?fixedDpr=1")
        end = time.monotonic() + TIMEOUT
        while not server.get_clients() and time.monotonic() < end:
            tab.wait_for_timeout(50)
        self._client = next(iter(server.get_clients().values()))
        # The client's own scene: its messages come in one order with the requests for pictures, those to all do not.
        super().__init__(cast(viser.ViserServer, self._client), lambda _: None, lambda *_: None)

    def show(self, scenes: ShownScenes) -> None:
        """Take over all shapes of a setup."""
        self.show_env(cast(InteractiveEnv, scenes))

    def update(self) -> None:
        """Take over what has changed between two scenes of a setup."""
        with self._client.atomic():
            self.update_colors()
            self.update_poses()

    @contextmanager
    def alone(self, bodies: Sequence[int]) -> Iterator[None]:
        """Show these bodies alone in this block."""
        others = [frame for (body, _), frame in zip(self._links, self._frames, strict=True) if body not in bodies]
        shown = [frame for frame in others if frame.visible]
        for frame in shown:
            frame.visible = False
        yield
        for frame in shown:
            frame.visible = True

    def picture(self, camera: Camera) -> NDArray[np.uint8]:
        """Return what the camera sees, (H, W, 4): red, green, blue and opacity."""
        frame = CameraFrame.of(camera)
        x, y, z, w = Rotation.from_matrix(frame.axes.T).as_quat().tolist()
        return self._client.get_render(
            camera.height,
            camera.width,
            wxyz=(w, x, y, z),
            position=frame.place,
            fov=float(np.deg2rad(camera.fov)),
            transport_format="png",
            timeout=TIMEOUT,
        )


def on_white(picture: NDArray[np.uint8]) -> Picture:
    """Return a picture (H, W, 4) before the page's white background, (H, W, 3)."""
    opacity = picture[..., 3:] / 255
    return np.rint(picture[..., :3] * opacity + 255 * (1 - opacity)).astype(np.uint8)


# ---- the pictures


def take(page: PageCamera, overrides: Sequence[str], count: int, seed: int) -> tuple[Scenes, float, float]:
    """Return the scenes of a setup, the share of pixels where silhouettes agree, and seconds that a picture took."""
    with closing(ShownScenes(overrides, seed)) as source:
        taken: dict[str, list[Picture]] = {name: [] for name in RENDERERS}
        labels, positions, agreed, spent = [], np.zeros((count, THINGS, 3)), [], 0.0
        for number in range(count):
            views = list(source.draw())
            labels.append(np.stack([each.labels for each in views]))
            positions[number, : len(views[0].positions)] = views[0].positions
            if number == 0:
                page.show(source)
            began = time.perf_counter()
            page.update()
            pictures = [page.picture(camera) for camera in source.cameras]
            spent += time.perf_counter() - began
            taken["page"].append(np.stack([on_white(picture) for picture in pictures]))
            taken["PyBullet"].append(np.stack([each.view.picture for each in views]))
            if number < CHECKED:
                agreed += [agreement(page, source, *pair) for pair in zip(source.cameras, pictures, strict=True)]
    scenes = Scenes({name: np.stack(each) for name, each in taken.items()}, np.stack(labels), positions)
    return scenes, float(np.mean(agreed)), spent / (count * len(CAMERAS))


def agreement(page: PageCamera, source: ShownScenes, camera: Camera, picture: NDArray[np.uint8]) -> float:
    """Return the share of pixels where both renderers agree on what is an object and what is nothing.

    Pixels next to an edge of PyBullet's picture do not count, nor do those of the robot and a person for objects.
    """
    bodies, objects = source.seen(camera), source.objects
    with page.alone(objects):
        alone = page.picture(camera)[..., 3] > 127
    inner = maximum_filter(bodies, 3) == minimum_filter(bodies, 3)
    object_seen, nothing_seen = np.isin(bodies, objects), bodies < 0
    same = ((picture[..., 3] < 128) == nothing_seen) & (alone | ~object_seen)
    return float(same[inner].mean())


# ---- what is seen in them


def see(detector: SightDetector, overrides: Sequence[str], scenes: Scenes, renderer: str) -> Judgement:
    """Return how exactly the scenes are seen in a renderer's pictures."""
    with closing(ShownScenes(overrides, 0)) as source:
        cameras = source.cameras
    frames = [CameraFrame.of(camera) for camera in cameras]
    found = []
    for pictures in scenes.pictures[renderer]:
        views = [View(*each) for each in zip(pictures, cameras, frames, strict=True)]
        found.append(fuse(detector.each(views), [frame.place for frame in frames]))
    return judge(found, list(scenes.labels), list(scenes.positions))


def joined(parts: Sequence[Judgement]) -> Judgement:
    """Return the judgement of all scenes of several."""
    return Judgement(
        errors=np.concatenate([part.errors for part in parts]),
        nouns=np.concatenate([part.nouns for part in parts]),
        colors=np.concatenate([part.colors for part in parts]),
        targets=np.concatenate([part.targets for part in parts]),
        missed=sum(part.missed for part in parts),
        invented=sum(part.invented for part in parts),
        things=sum(part.things for part in parts),
    )


def row(name: str, judged: Judgement) -> str:
    """Return a row of the table."""
    of = judged.summary()
    both = float((judged.nouns & judged.colors).mean())
    shares = "".join(f"{share:10.4f}" for share in (of["noun"], of["color"], both, of["missed"], of["invented"]))
    return f"{name:34}{int(of['things']):8d}{of['median_mm']:7.1f} mm{of['p95_mm']:7.1f} mm{shares}"


def report(detector: SightDetector, taken: Sequence[Taken]) -> None:
    """Print a row for each setup and renderer, and for all setups."""
    heads = "".join(f"{head:>10}" for head in ("median", "95 %", "noun", "colour", "both", "missed", "invented"))
    print(f"{'':34}{'things':>8}{heads}")
    for renderer in RENDERERS:
        judged = []
        for name, overrides, scenes in taken:
            judged.append(see(detector, overrides, scenes, renderer))
            print(row(f"{renderer}: {name}", judged[-1]), flush=True)
        print(row(f"{renderer}: all", joined(judged)), flush=True)


# ---- files


def save(folder: Path, taken: Sequence[Taken]) -> None:
    """Write pictures.npz, and a sheet of each setup: for each camera, the page's pictures and then PyBullet's."""
    folder.mkdir(parents=True, exist_ok=True)
    arrays: dict[str, NDArray] = {}
    for number, (_, _, scenes) in enumerate(taken):
        arrays |= {f"{number} {name}": pictures for name, pictures in scenes.pictures.items()}
        arrays |= {f"{number} labels": scenes.labels, f"{number} positions": scenes.positions}
        rows = [
            np.concatenate([scenes.pictures[name][i, v] for v in range(len(CAMERAS)) for name in RENDERERS], 1)
            for i in range(min(SHOWN, len(scenes.positions)))
        ]
        Image.fromarray(np.concatenate(rows)).save(folder / f"sheet_{number}.png")
    np.savez_compressed(folder / "pictures.npz", **arrays)  # type: ignore[arg-type]


def stored(folder: Path) -> list[Taken]:
    """Return what `save` wrote. Exits with a sentence if it is not there."""
    file = folder / "pictures.npz"
    if not file.exists():
        sys.exit(f"--load {folder}: it has no pictures.npz; --save writes one")
    taken: list[Taken] = []
    with np.load(file, allow_pickle=False) as arrays:
        for number, (name, overrides) in enumerate(CASES):
            if f"{number} labels" in arrays:
                pictures = {each: arrays[f"{number} {each}"] for each in RENDERERS}
                scenes = Scenes(pictures, arrays[f"{number} labels"], arrays[f"{number} positions"])
                taken.append((name, overrides, scenes))
    return taken


def photographed(count: int, seed: int) -> list[Taken]:
    """Return scenes of all setups, `count` in all. Prints how silhouettes agree and the time of a picture."""
    taken: list[Taken] = []
    with redirect_stdout(StringIO()):  # viser prints addresses
        server = viser.ViserServer("127.0.0.1", int(free_port()), verbose=False)
    try:
        with headless_browser() as browser:
            page = PageCamera(browser, server)
            for number, (name, overrides) in enumerate(CASES):
                share = count // len(CASES) + (number < count % len(CASES))
                if share:
                    scenes, same, seconds = take(page, overrides, share, seed + number)
                    print(f"{name}: {share} scenes, silhouettes {same:.4f}, {seconds:.2f} s a picture", flush=True)
                    taken.append((name, overrides, scenes))
    finally:
        with redirect_stdout(StringIO()):
            server.stop()
    return taken


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=500)
    parser.add_argument("--seed", type=int, default=4500)
    parser.add_argument("--weights", help="file; default: the weights that come with the project")
    parser.add_argument("--save", type=Path, help="folder for the pictures")
    parser.add_argument("--load", type=Path, help="folder of --save, whose pictures are seen again")
    args = parser.parse_args()
    torch.set_num_threads(1)
    detector = load_detector(args.weights)
    taken = photographed(args.scenes, args.seed) if args.load is None else stored(args.load)
    if args.save is not None:
        save(args.save, taken)
    report(detector, taken)


if __name__ == "__main__":
    with program():
        main()
