"""XML of other programs: elements and attributes, and everything that could cost or open something is refused."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import pytest

from engine.storage.xml_files import MAX_DEPTH, MAX_ELEMENTS, MAX_XML_BYTES, XmlError, parse_xml, read_xml

LAUGHS = b"""<?xml version="1.0"?><!DOCTYPE a [<!ENTITY x "ha"><!ENTITY y "&x;&x;&x;&x;">]><a b="&y;"/>"""
OUTSIDE = b"""<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]><a>&x;</a>"""


def test_elements_and_attributes_come_in_order() -> None:
    root = parse_xml(b"<a><!-- no --><b c='1'>text</b><d><b c='2'/></d><b c='&lt;3'/></a>")
    assert root.tag == "a"
    assert [element.attributes for element in root.inside("b")] == [{"c": "1"}, {"c": "<3"}]
    assert [element.attributes["c"] for element in root.inside("d", "b")] == ["2"]
    assert list(root.inside("nothing", "b")) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("data", "said"),
    [
        (LAUGHS, "has a DOCTYPE"),
        (OUTSIDE, "has a DOCTYPE"),
        (b"", "no element found"),
        (b"<a><b></a>", "mismatched tag in line 1"),
        (b"<a b='&unknown;'/>", "undefined entity"),
        (b"\xff\xfe\xfd", "line 1"),
        (b'<?xml version="1.0" encoding="no-such"?><a/>', "encoding"),
        (b"<a>" * (MAX_DEPTH + 1), f"more than {MAX_DEPTH} deep"),
        (b"<a>" + b"<b/>" * MAX_ELEMENTS, f"more than {MAX_ELEMENTS:,} elements"),
    ],
)
def test_what_is_no_plain_document_is_refused(data: bytes, said: str) -> None:
    with pytest.raises(XmlError, match=said):
        parse_xml(data)


def test_a_large_file_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "large.xcp"
    with path.open("wb") as file:
        file.truncate(MAX_XML_BYTES + 1)
    tracemalloc.start()
    with pytest.raises(OSError, match="at most"):
        read_xml(path)
    assert tracemalloc.get_traced_memory()[1] < 1 << 20
    tracemalloc.stop()
