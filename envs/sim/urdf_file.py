"""URDF files, read as tolerantly as Bullet does.

Bullet's reader knows no namespaces, no encodings and no entities but XML's own five; `--` in a comment, a bare `&` or a
control character do not trouble it. Python's reader refuses all of these. Bytes are kept as they are: the text here has
one character for each byte.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, indent

BYTES = "latin-1"  # one character for each byte
MARKUP = re.compile(
    r"<!--.*?-->|<\?.*?\?>|<!\[CDATA\[.*?\]\]>|<!(?!--|\[CDATA\[)[^>]*>"
    r"|</\s*(?P<end>[^\s>]+)\s*>"
    r"""|<(?P<start>[^\s/>!?<]+)(?P<attributes>(?:[^>"'/]|"[^"]*"|'[^']*'|/(?!>))*)(?P<empty>/?)>""",
    re.DOTALL,
)
ATTRIBUTE = re.compile(r"""([^\s=/"']+)\s*=\s*(?:"([^"]*)"|'([^']*)')""", re.DOTALL)
ENTITY = re.compile(r"&(?:#(\d{1,7})|#x([0-9a-fA-F]{1,6})|(lt|gt|amp|quot|apos));")
NAMED = {"lt": "<", "gt": ">", "amp": "&", "quot": '"', "apos": "'"}
MAX_DEPTH = 60  # of nested elements
UTF16 = (b"\xff\xfe", b"\xfe\xff")
CONTROL = dict.fromkeys([*range(9), 11, 12, *range(14, 32)], " ")  # cannot be written to a file again
OTHER_FORMATS = {
    "sdf": "is an SDF file, and robots are read from URDF: convert it, or take the robot's URDF",
    "mujoco": "is an MJCF file of MuJoCo, and robots are read from URDF: take the robot's URDF",
    "COLLADA": "is a COLLADA mesh: give the URDF that names it",
}
XACRO = "is a xacro template: expand it with `xacro <file> > robot.urdf`, and give that file"
NUMBERS = (  # attributes of a link or joint that Bullet reads as numbers: a word becomes 0 without a message
    ("link/inertial/mass", ("value",)),
    ("link/inertial/inertia", ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")),
    ("link/inertial/origin", ("xyz", "rpy")),
    ("link/collision/origin", ("xyz", "rpy")),
    ("link/collision/geometry/*", ("size", "radius", "length", "scale")),
    ("joint/origin", ("xyz", "rpy")),
    ("joint/axis", ("xyz",)),
    ("joint/limit", ("lower", "upper", "effort")),
    ("joint/dynamics", ("damping", "friction")),
)
SEVERAL = ("xyz", "rpy", "size", "scale")  # attributes that hold several numbers


class URDFError(ValueError):
    """A file that is no URDF. The text continues a sentence that begins with the file's name."""


def read_urdf(path: Path) -> Element:
    """Return the `robot` element of a URDF, its names and paths as text. Raises URDFError and OSError."""
    return parse_urdf(path.read_bytes())


def parse_urdf(content: bytes) -> Element:
    """Return the `robot` element of a URDF's content. Raises URDFError."""
    if content.startswith(UTF16):
        raise URDFError("is UTF-16, which Bullet does not read: save it as UTF-8")
    top = _parse(content.removeprefix(b"\xef\xbb\xbf").decode(BYTES))
    robot = top.find("robot")
    if robot is None:
        first = next((element.tag for element in top), None)
        reason = "holds no XML" if first is None else f"has the root element {first!r} in place of 'robot'"
        raise URDFError(OTHER_FORMATS.get(str(first), reason))
    for part in robot:
        if part.tag.startswith("xacro:") or (part.tag in ("link", "joint") and any(map(_is_template, part.iter()))):
            raise URDFError(XACRO)
    return robot


def urdf_bytes(robot: Element) -> bytes:
    """Return the content of a file with this `robot` element."""
    indent(robot)  # Bullet cuts long lines in pieces
    file = io.BytesIO()
    ElementTree(robot).write(file, encoding=BYTES)
    return file.getvalue()


def name_of(element: Element) -> str:
    """Return the element's name, as `decoded_name` does that of PyBullet."""
    return decoded_name(element.get("name", "").encode(BYTES))


def decoded_name(name: bytes) -> str:
    """Return a name of PyBullet's as text; bytes that are not UTF-8 as escapes."""
    return name.decode("utf-8", "backslashreplace")


def path_of(value: str) -> str:
    """Return a path of the file as Python writes it."""
    return value.encode(BYTES, "replace").decode("utf-8", "surrogateescape")


def raw_path(path: str) -> str:
    """Return a path as it stands in the file."""
    return path.encode("utf-8", "surrogateescape").decode(BYTES)


def bad_number(robot: Element) -> str | None:
    """Return what is wrong with the first value that must be a number and is none; None if there is no such value."""
    for path, names in NUMBERS:
        outer, _, inner = path.partition("/")
        for part in robot.findall(outer):
            for element in part.findall(inner):
                for name in names:
                    value = element.get(name, "0")
                    words = value.split()
                    if not words or not all(map(_is_number, words)) or (len(words) > 1 and name not in SEVERAL):
                        return f'{outer} {name_of(part)} has {element.tag} {name}="{value}"'
    return None


def _is_number(word: str) -> bool:
    try:
        return "_" not in word and math.isfinite(float(word))
    except ValueError:
        return False


def _is_template(element: Element) -> bool:
    return element.tag.startswith("xacro:") or any(re.search(r"\$[({]", value) for value in element.attrib.values())


def _parse(text: str) -> Element:
    """Return an element that holds the file's root elements. Raises URDFError for elements that are not closed."""
    open_elements = [Element("file")]
    for markup in _markup(text):
        if markup["start"]:
            element = Element(markup["start"], _attributes(markup["attributes"]))
            open_elements[-1].append(element)
            if not markup["empty"]:
                open_elements.append(element)
            if len(open_elements) > MAX_DEPTH:
                line = text.count("\n", 0, markup.start()) + 1
                raise URDFError(f"is not a URDF: at line {line} its elements are nested more than {MAX_DEPTH} deep")
        elif markup["end"] and open_elements.pop().tag != markup["end"]:
            line = text.count("\n", 0, markup.start()) + 1
            raise URDFError(f"is not XML: line {line} has </{markup['end']}>, which closes nothing")
        if not open_elements:
            break
    if len(open_elements) > 1:
        raise URDFError(f"is not XML: <{open_elements[-1].tag}> is never closed")
    return open_elements[0]


def _markup(text: str) -> Iterator[re.Match[str]]:
    place = text.find("<")
    while place >= 0:
        found = MARKUP.match(text, place)
        if found is None:
            line = text.count("\n", 0, place) + 1
            raise URDFError(f"is not XML: line {line} has a < that begins no element")
        yield found
        place = text.find("<", found.end())


def _attributes(text: str) -> dict[str, str]:
    return {name: _decoded(double or single) for name, double, single in ATTRIBUTE.findall(text)}


def _decoded(value: str) -> str:
    return ENTITY.sub(_character, value).translate(CONTROL)


def _character(entity: re.Match[str]) -> str:
    decimal, hexadecimal, name = entity.groups()
    if name:
        return NAMED[name]
    number = int(decimal) if decimal else int(hexadecimal, 16)
    if number == 0:
        raise URDFError("is not XML: it has &#0;, a character that ends Bullet's names, and its process")
    return chr(number).encode("utf-8", "replace").decode(BYTES) if 0 < number < 0x110000 else entity[0]
