"""The meshes of a URDF: where they are, and copies in a format that Bullet reads.

Bullet reads binary STL, OBJ and COLLADA. It takes other formats for errors in the URDF, and an STL file of text or an
empty one for a mesh of a millimetre, without an error.
"""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from core.safe_files import FileError, read_bytes
from envs.sim.urdf import STL, stl
from envs.sim.urdf_file import name_of, path_of, raw_path

LARGEST = 256 * 2**20  # bytes of a mesh
READ = (".stl", ".obj", ".dae")  # by Bullet
CONVERTED = (".ply", ".off", ".glb", ".gltf", ".3mf")  # by trimesh
NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
VERTEX = re.compile(rb"vertex\s+(%s)\s+(%s)\s+(%s)" % (NUMBER, NUMBER, NUMBER))
COLLADA = (b"<asset", b"<library_geometries")  # without which Bullet ends the process
UNIT = re.compile(rb"<unit(?![^>]*meter)")
PACKAGE = re.compile(r"(?:package|model)://([^/]*)/?(.*)", re.DOTALL)
XML_NAME = re.compile(r"<name>\s*([^<\s]+)\s*</name>")
MOST_FILES = 3000  # of a package that are looked at
LISTED = 3  # meshes named in a note


class Meshes:
    """Puts paths that are there in place of those of a robot element, and removes shapes whose mesh is missing.

    Attributes:
        notes: what was done, in sentences.
        converted: new files by name, to be put in `folder` beside the URDF.

    Args:
        robot: the element, which is changed.
        urdf: the file that it was read from.
        packages: folders that hold the packages of package://, or are one.
        folder: name of the folder of converted meshes.
    """

    def __init__(self, robot: Element, urdf: Path, packages: tuple[Path, ...], folder: str) -> None:
        self._beside = tuple(dict.fromkeys((*urdf.absolute().parents, *urdf.resolve().parents)))
        self._folders = (*packages, *self._beside)
        self._folder, self._stem = folder, urdf.stem
        self._files: list[Path] | None = None  # of the package, listed when they are needed
        self.notes: list[str] = []
        self.converted: dict[str, bytes] = {}
        self._done: dict[str, str | None] = {}  # mesh of the URDF -> its new path, None for one that cannot be used
        self._missing: list[str] = []
        self._bad: list[str] = []
        self._elsewhere: dict[str, Path] = {}  # where Bullet would not look -> the mesh that is there
        for link in robot.findall("link"):
            self._mend(link)
        self._tell()

    def _mend(self, link: Element) -> None:
        for part in [*link.findall("visual"), *link.findall("collision")]:
            for mesh in part.findall("geometry/mesh"):
                given = path_of(mesh.get("filename", ""))
                if given not in self._done:
                    self._done[given] = self._usable(given, name_of(link))
                path = self._done[given]
                if path is None:
                    link.remove(part)
                    break
                mesh.set("filename", raw_path(path))

    def _usable(self, given: str, link: str) -> str | None:
        """Return the path of a mesh that Bullet can read; None where there is none."""
        path = self._find(given)
        if path is None:
            self._missing.append(given)
            return None
        try:
            content = _unreadable(path)
            if content is None:
                if not any(_file(folder / PACKAGE.sub(r"\1/\2", given)) for folder in self._beside):
                    found = PACKAGE.fullmatch(given)
                    self._elsewhere[found[1] if found else given] = path
                return str(path.absolute())
            points = _points(path, content)
        except (FileError, ValueError) as error:
            self._bad.append(f"{path.name} of link {link} {error}")
            return None
        name = f"{len(self.converted)}_{re.sub(r'[^A-Za-z0-9_-]', '_', path.stem)[:60]}.stl"
        self.converted[name] = stl(points)
        self.notes.append(f"{path.name} is {_kind(path)}, which Bullet does not read: it was made a binary STL file.")
        return f"{self._folder}/{name}"

    def _find(self, given: str) -> Path | None:
        """Return the file that a path of the URDF means, None if it is not there."""
        if not given or "\0" in given:
            return None
        if given.startswith("file://"):
            return _file(Path(given.removeprefix("file://")))
        found = PACKAGE.fullmatch(given)
        if found is None:
            beside = next((path for folder in self._folders if (path := _file(folder / given))), None)
            return beside or self._by_name(given)
        package, rest = found.groups()
        for folder in self._homes(package):
            if path := _file(folder / rest):
                return path
        return self._by_name(f"{package}/{rest}" if rest else package)

    def _by_name(self, ending: str) -> Path | None:
        """Return the one file of the URDF's package whose path ends so: packages that are moved lose their names."""
        if self._files is None:
            own, above = self._beside[0], self._beside[min(1, len(self._beside) - 1)]
            home = above if (above / "meshes").is_dir() or (above / "package.xml").is_file() else own
            self._files = list(itertools.islice((path for path in home.rglob("*") if path.suffix), MOST_FILES))
        for end in (ending, ending.rpartition("/")[2]):
            found = [path for path in self._files if path.as_posix().lower().endswith("/" + end.lower())]
            named = [path for path in found if self._stem in path.as_posix()]
            if len(found) == 1 or len(named) == 1:
                return (named or found)[0]
        return None

    def _homes(self, package: str) -> Iterator[Path]:
        """Yield the folders that may be the package, the likeliest first."""
        paths = [Path(place) for place in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if place]
        for folder in (*self._folders, *paths):
            yield folder / package
        for folder in (*self._folders, *paths):
            if folder.name == package or _package_name(folder) == package:
                yield folder
        yield from self._folders  # a copy of the package under another name

    def _tell(self) -> None:
        if self._missing:
            shown = ", ".join(self._missing[:LISTED]) + (", ..." if len(self._missing) > LISTED else "")
            self.notes.append(
                f"{len(self._missing)} meshes are not there ({shown}), and their shapes were left out; give "
                "packages=<folder that holds the packages> if they are elsewhere."
            )
        for package, path in self._elsewhere.items():
            self.notes.append(f"meshes of {package or 'no package'} were found in {path.parent}.")
        for reason in self._bad:
            self.notes.append(f"{reason}; the shape was left out.")


def _file(path: Path) -> Path | None:
    try:
        return path if path.is_file() else None
    except (OSError, ValueError):  # a name that is too long
        return None


def _package_name(folder: Path) -> str | None:
    """Return the name of the ROS package in a folder."""
    path = folder / "package.xml"
    try:
        found = XML_NAME.search(read_bytes(path).decode("utf-8", "replace")) if path.is_file() else None
    except (FileError, OSError):
        return None
    return found[1] if found else None


def _kind(path: Path) -> str:
    return "an STL file of text" if path.suffix.lower() == ".stl" else f"a {path.suffix[1:].upper()} file"


def _unreadable(path: Path) -> bytes | None:
    """Return the content of a mesh that must be converted; None for one that Bullet reads. Raises FileError."""
    suffix = path.suffix.lower()
    if suffix not in (*READ, *CONVERTED):
        formats = ", ".join(each[1:].upper() for each in (*READ, *CONVERTED))
        raise FileError(f"is of an unknown format: meshes are {formats} files")
    content = read_bytes(path, LARGEST)
    if content.startswith(b"version https://git-lfs"):
        raise FileError("is a pointer of Git LFS, and not the mesh: fetch it with `git lfs pull`")
    if suffix in CONVERTED:
        return content
    if suffix == ".stl":
        count = int.from_bytes(content[80:84], "little")
        if len(content) >= 84 and len(content) == 84 + count * STL.itemsize and count:
            return None
        return content
    mark = {".obj": rb"^\s*v\s", ".dae": rb"<COLLADA"}[suffix]
    if re.search(mark, content, re.MULTILINE) is None:
        raise FileError(f"is no {suffix[1:].upper()} file, whatever its name says")
    if suffix == ".dae" and (not all(part in content for part in COLLADA) or UNIT.search(content)):
        raise FileError(
            "is a COLLADA file without an asset, geometries or the length of its unit, with which Bullet ends"
        )
    return None


def _points(path: Path, content: bytes) -> np.ndarray:
    """Return the corners (3 T, 3) of a mesh's T triangles. Raises ValueError, with the end of a sentence."""
    if path.suffix.lower() == ".stl":
        return _stl_points(content)
    try:
        trimesh = import_module("trimesh")
    except ImportError:
        raise ValueError("needs trimesh to be converted, which is not installed: pip install trimesh") from None
    try:
        mesh = trimesh.load(path, force="mesh")
        points = np.asarray(mesh.triangles, float).reshape(-1, 3)
    except Exception as error:  # its readers raise whatever they meet
        raise ValueError(f"cannot be read: {type(error).__name__}") from None
    if not len(points) or not np.isfinite(points).all():
        raise ValueError("has no triangles")
    return points


def _stl_points(content: bytes) -> np.ndarray:
    corners = np.array([found.groups() for found in VERTEX.finditer(content)], float)
    if content[:5].lower() == b"solid" and len(corners) and len(corners) % 3 == 0:
        return corners
    count = (len(content) - 84) // STL.itemsize  # a binary file with a wrong count, or with something after it
    if count > 0 and int.from_bytes(content[80:84], "little") in range(1, count + 1):
        given = int.from_bytes(content[80:84], "little")
        points = np.frombuffer(content, STL, given, 84)["points"].reshape(-1, 3).astype(float)
        if np.isfinite(points).all():
            return points
    raise ValueError("is no STL file: it has no triangles")
