"""XML files of other programs, read strictly: bounded in size, depth and number of elements, and without a DOCTYPE.

Entities can only be declared in a DOCTYPE, so that none is expanded and nothing else is opened.
"""

from __future__ import annotations

import xml.parsers.expat
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from engine.storage.files import read_bytes

MAX_XML_BYTES = 4 << 20
MAX_ELEMENTS = 100_000
MAX_DEPTH = 20


class XmlError(ValueError):
    """Not XML as this program reads it. The text is a reason that fits into brackets behind a sentence."""


@dataclass(slots=True)
class XmlElement:
    """One element of a document.

    Attributes:
        tag: Its name.
        attributes: By name, as texts.
        children: Elements inside it, in order.
        text: Its own text, that of elements inside it left out.
    """

    tag: str
    attributes: dict[str, str]
    children: list[XmlElement] = field(default_factory=list)
    text: str = ""

    def inside(self, *tags: str) -> Iterator[XmlElement]:
        """Elements along a path of tags below this one, in order: `inside("cameras", "camera")`."""
        found = (child for child in self.children if child.tag == tags[0])
        for child in found:
            if len(tags) == 1:
                yield child
            else:
                yield from child.inside(*tags[1:])


def read_xml(path: Path) -> XmlElement:
    """The root element of a file.

    Raises:
        OSError: It cannot be read, or has more than MAX_XML_BYTES.
        XmlError: See `parse_xml`.
    """
    return parse_xml(read_bytes(path, max_bytes=MAX_XML_BYTES))


def parse_xml(data: bytes) -> XmlElement:
    """The root element of a document.

    Raises:
        XmlError: It is not well-formed, has a DOCTYPE, more than MAX_ELEMENTS elements, or nests them deeper than
            MAX_DEPTH.
    """
    top = XmlElement("", {})
    opened = [top]
    texts: list[list[str]] = [[]]
    n_elements = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal n_elements
        n_elements += 1
        if n_elements > MAX_ELEMENTS:
            raise XmlError(f"it has more than {MAX_ELEMENTS:,} elements")
        if len(opened) > MAX_DEPTH:
            raise XmlError(f"elements are nested more than {MAX_DEPTH} deep")
        element = XmlElement(tag, attributes)
        opened[-1].children.append(element)
        opened.append(element)
        texts.append([])

    def end(tag: str) -> None:
        opened.pop().text = "".join(texts.pop())

    def say(text: str) -> None:
        texts[-1].append(text)

    def refuse(*what: object) -> None:
        raise XmlError("it has a DOCTYPE, which is not read")

    parser = xml.parsers.expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = say, refuse
    try:
        parser.Parse(data, True)
    except xml.parsers.expat.ExpatError as error:
        reason = xml.parsers.expat.ErrorString(error.code)
        raise XmlError(f"{reason} in line {error.lineno}, column {error.offset + 1}") from error
    except (LookupError, UnicodeError) as error:
        raise XmlError("it is of an encoding that is not known") from error
    return top.children[0]
