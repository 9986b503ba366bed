"""Reading a URDF's XML within bounds: no entities, no network, limited size, depth and number of elements."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from paretoik.errors import InvalidInput, InvalidRobot

MAX_BYTES = 10_000_000
MAX_DEPTH = 64
MAX_ELEMENTS = 50_000  # a humanoid with hands has some 10,000
PARTS = ("link", "joint")  # what is read below <robot>; transmissions, materials and plug-ins are not
SHAPES = ("visual", "collision")


@dataclass(frozen=True, kw_only=True)
class Element:
    """One XML element that matters, with the line where it begins."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[Element] = field(default_factory=list)

    def all(self, tag: str) -> list[Element]:
        """Return the children of that tag, in order."""
        return [child for child in self.children if child.tag == tag]


def read_elements(file: Path) -> Element:
    """Return the ``<robot>`` element with its links and joints, and what they hold but for shapes.

    Raises InvalidInput where there is no such file, InvalidRobot naming the line where it is not the XML of a robot.
    """
    data = _bytes(file)
    reader = _Reader(str(file))
    try:
        reader.parser.Parse(data, True)
    except expat.ExpatError as error:
        raise reader.refused(f"not well-formed XML, {expat.ErrorString(error.code)}", error.lineno) from None
    except (LookupError, ValueError) as error:
        if isinstance(error, InvalidInput):
            raise
        raise reader.refused(f"not readable as text, {error}", 1) from None
    assert reader.root is not None  # expat reports a document without a root element
    return reader.root


def _bytes(file: Path) -> bytes:
    if not file.is_file():
        raise InvalidInput(f"{file}: {'is not a regular file' if file.exists() else 'no such file'}")
    try:
        with file.open("rb") as stream:
            data = stream.read(MAX_BYTES + 1)
    except OSError as error:
        raise InvalidInput(f"{file}: cannot be read, {error.strerror}") from None
    if not data:
        raise InvalidRobot(str(file), ["the file is empty"])
    if len(data) > MAX_BYTES:
        raise InvalidRobot(str(file), [f"the file is larger than {MAX_BYTES // 1_000_000} MB"])
    return data


class _Reader:
    """Handlers that keep links and joints, skip shapes, and stop at what a URDF has no use for."""

    def __init__(self, source: str) -> None:
        self.source = source
        self.root: Element | None = None
        self.open: list[Element | None] = []  # None: inside a part that is skipped
        self.count = 0
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.StartDoctypeDeclHandler = self.doctype

    def refused(self, what: str, line: int | None = None) -> InvalidRobot:
        place = self.parser.CurrentLineNumber if line is None else line
        return InvalidRobot(self.source, [f"line {place}: {what}"])

    def doctype(self, *_: object) -> None:
        raise self.refused("a DOCTYPE is refused, a URDF needs no entities")

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        self.count += 1
        if self.count > MAX_ELEMENTS:
            raise self.refused(f"more than {MAX_ELEMENTS:,} elements")
        if len(self.open) == MAX_DEPTH:
            raise self.refused(f"elements nested deeper than {MAX_DEPTH}")
        if tag.startswith("xacro:"):
            raise self.refused(f"<{tag}> is a macro, expand the file with xacro first")
        element = Element(tag=tag, attributes=attributes, line=self.parser.CurrentLineNumber)
        parent = self.open[-1] if self.open else None
        if not self.open:
            if tag != "robot":
                raise self.refused(f"the root element must be <robot>, got <{tag[:80]}>")
            self.root = element
        elif parent is None or (parent is self.root and tag not in PARTS) or tag in SHAPES:
            self.open.append(None)
            return
        else:
            parent.children.append(element)
        self.open.append(element)

    def end(self, _: str) -> None:
        self.open.pop()
