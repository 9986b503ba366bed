"""Reading a URDF's XML within bounds: no entities, no network, limited size, depth and number of elements."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from paretoik.errors import InvalidInput, InvalidRobot
from paretoik.missing_files import missing_file

PARTS = ("link", "joint")  # what is read below <robot>; transmissions, materials and plug-ins are not
SHAPES = ("visual", "collision")  # skipped in every part


@dataclass(frozen=True, kw_only=True)
class XmlOptions:
    """The largest file that is read."""

    max_bytes: int = 10_000_000
    max_depth: int = 64  # elements nested in each other
    max_elements: int = 50_000  # a humanoid with hands has some 10,000


OPTIONS = XmlOptions()


@dataclass(frozen=True, kw_only=True)
class Element:
    """One XML element that matters, with the line where it begins."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[Element] = field(default_factory=list)

    def find_all(self, tag: str) -> list[Element]:
        """Return the children of that tag, in order."""
        return [child for child in self.children if child.tag == tag]


def is_macro(tag: str) -> bool:
    """Return whether an element is one that xacro should have expanded."""
    return tag.startswith("xacro:")


def parse_elements(data: bytes, source: str) -> tuple[Element, list[int]]:
    """Return the ``<robot>`` element with its links and joints, without their shapes, and the lines of unread macros.

    Raises InvalidRobot, naming ``source`` and the line, if data are not the XML of a robot.
    """
    reader = _Reader(source)
    try:
        reader.parser.Parse(data, True)
    except expat.ExpatError as error:
        raise reader.error(f"well-formed XML wanted, got {expat.ErrorString(error.code)}", error.lineno) from None
    except (LookupError, ValueError) as error:
        if isinstance(error, InvalidInput):
            raise
        raise reader.error(f"readable text wanted, got {error}", 1) from None
    assert reader.root is not None  # expat reports a document without a root element
    return reader.root, reader.unread_macros


def read_bytes(file: Path) -> bytes:
    """Return what a file of a robot holds; raises InvalidInput for no file, InvalidRobot for an empty or large one."""
    try:
        if not file.is_file():
            raise InvalidInput(f"{file}: a plain file wanted, got {missing_file(file)}")
        with file.open("rb") as stream:
            data = stream.read(OPTIONS.max_bytes + 1)
    except OSError as error:
        raise InvalidInput(f"{file}: cannot be read, {error.strerror}") from None
    if not data:
        raise InvalidRobot(str(file), ["a robot wanted, got an empty file"])
    if len(data) > OPTIONS.max_bytes:
        raise InvalidRobot(str(file), [f"at most {OPTIONS.max_bytes // 1_000_000} MB wanted, got a larger file"])
    return data


class _Reader:
    """Handlers of the parser: collect links and joints, skip shapes, refuse what a URDF does not need."""

    def __init__(self, source: str) -> None:
        self.source = source
        self.root: Element | None = None
        self.open: list[Element | None] = []  # None: inside a part that is skipped
        self.count = 0
        self.unread_macros: list[int] = []
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.StartDoctypeDeclHandler = self.doctype

    def error(self, message: str, line: int | None = None) -> InvalidRobot:
        number = self.parser.CurrentLineNumber if line is None else line
        return InvalidRobot(self.source, [f"line {number}: {message}"])

    def doctype(self, *_: object) -> None:
        raise self.error("a robot without DOCTYPE wanted, as none needs entities, got one")

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        self.count += 1
        if self.count > OPTIONS.max_elements:
            raise self.error(f"at most {OPTIONS.max_elements:,} elements wanted, got more")
        if len(self.open) == OPTIONS.max_depth:
            raise self.error(f"elements nested at most {OPTIONS.max_depth} deep wanted, got deeper ones")
        element = Element(tag=tag, attributes=attributes, line=self.parser.CurrentLineNumber)
        parent = self.open[-1] if self.open else None
        if not self.open:
            if tag != "robot":
                raise self.error(f"the root element must be <robot>, got <{tag[:80]}>")
            self.root = element
        elif parent is self.root and is_macro(tag):  # it may be any number of links and joints
            raise self.error(f"a robot that xacro has expanded wanted, got the macro <{tag[:80]}>")
        elif parent is None or (parent is self.root and tag not in PARTS) or tag in SHAPES:
            if is_macro(tag):
                self.unread_macros.append(element.line)
            self.open.append(None)
            return
        else:
            parent.children.append(element)
        self.open.append(element)

    def end(self, _: str) -> None:
        self.open.pop()
