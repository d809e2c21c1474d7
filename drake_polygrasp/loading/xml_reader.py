"""Reads XML as tinyxml2 does, the library by which Drake reads URDF, MJCF and SDF files.

Models that Drake loads need not be well-formed XML: it accepts prefixes without a declaration, a
bare "&", "--" in comments, a blank line before the declaration and bytes of any encoding, and a
default namespace changes no name. Names are therefore literal here (`drake:mu_static`), and bytes
that are not UTF-8 are kept as Python keeps them in file names (`surrogateescape`). What tinyxml2
refuses is refused here too, except for a few misplaced declarations that change nothing. tinyxml2
does not expand entities that a document declares; such documents are refused.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from xml.etree.ElementTree import Element

MAX_DEPTH = 500
"""tinyxml2's bound on the depth of nested elements."""
_SPACE = r"[ \t\n\v\f\r]*"
# Names hold letters, _ and :, then digits, . and - too, and all but ASCII. Python compiles what is
# left out of ASCII ten times as fast.
_NAME = r"[^\x00-9;-@\[-^`{-\x7f][^\x00-,/;-@\[-^`{-\x7f]*"
_SPACES = re.compile(_SPACE)
_TAG = re.compile(rf"<{_SPACE}(/?)({_NAME})")
_ATTRIBUTE = re.compile(rf"""{_SPACE}({_NAME}){_SPACE}={_SPACE}(?:"([^"]*)"|'([^']*)')""", re.ASCII)
_TAG_END = re.compile(rf"{_SPACE}(/?>)")
_LINE_END = re.compile(r"\r\n|\n\r|\r")
_REFERENCE = re.compile(r"&(?:(quot|amp|apos|lt|gt)|#(\d+)|#x([0-9a-fA-F]+));", re.ASCII)
_CHARACTERS = {"quot": '"', "amp": "&", "apos": "'", "lt": "<", "gt": ">"}
_SKIPPED = (("<?", "?>"), ("<!--", "-->"), ("<!", ">"))
"""How declarations, comments and document types begin and end. CDATA sections are text."""
_MAX_REASON = 120
_CDATA, _CDATA_END = "<![CDATA[", "]]>"


def parse_xml(content: bytes) -> list[Element]:
    """Parses a document.

    An element's `text` is the text that it begins with, as tinyxml2's `GetText` returns it; other
    text is left out.

    Args:
        content: the document.

    Returns:
        The elements at its top, of which there may be several, or none.

    Raises:
        ValueError: naming the line, where tinyxml2 reports an error.
    """
    # tinyxml2 stops at a null character, which ends a string in C.
    text = content.partition(b"\0")[0].decode(errors="surrogateescape")
    document = Element("")
    open_elements = [document]
    for position, kind, value, attributes in _tokens(text):
        parent = open_elements[-1]
        if kind == "text":
            if len(parent) == 0 and parent.text is None:
                parent.text = value
        elif kind == "end":
            if parent is document:
                break  # tinyxml2 stops here without an error.
            if parent.tag != value:
                raise _fault(text, position, f"</{value}> ends <{parent.tag}>")
            open_elements.pop()
        else:
            element = Element(value, attributes)
            parent.append(element)
            if kind == "start":
                open_elements.append(element)
                if len(open_elements) > MAX_DEPTH:
                    raise _fault(text, position, f"elements are nested over {MAX_DEPTH} deep")
    else:
        if len(open_elements) > 1:
            raise _fault(text, len(text), f"<{open_elements[-1].tag}> is not ended")
    return list(document)


def elements_at(element: Element, tags: Sequence[str]) -> list[Element]:
    """Returns the descendants of an element by a chain of literal tags.

    ElementTree's own paths would read the prefix of `drake:mu_static` as a namespace.

    Args:
        element: the element.
        tags: tags from its children down.
    """
    found = [element]
    for tag in tags:
        found = [child for parent in found for child in parent if child.tag == tag]
    return found


def _tokens(text: str) -> Iterator[tuple[int, str, str, dict[str, str]]]:
    """Yields each token's position, kind (text, start, end or empty), name or text, attributes."""
    here = _skip_space(text, 0)
    here += text.startswith("\ufeff", here)
    while (start := _skip_space(text, here)) < len(text):
        if text.startswith(_CDATA, start):
            end = _find(text, _CDATA_END, start, start)
            yield start, "text", _LINE_END.sub("\n", text[start + len(_CDATA) : end]), {}
            here = end + len(_CDATA_END)
        elif skipped := next((s for s in _SKIPPED if text.startswith(s[0], start)), None):
            end = _find(text, skipped[1], start + len(skipped[0]), start)
            if skipped[0] == "<!" and "<!ENTITY" in text[start:end]:
                raise _fault(
                    text, start, "it declares entities, which Drake does not read; write them out"
                )
            here = end + len(skipped[1])
        elif text[start] == "<":
            here, kind, name, attributes = _read_tag(text, start)
            yield start, kind, name, attributes
        else:
            end = text.find("<", start)
            if end < 0:
                raise _fault(text, start, "text stands after the last tag")
            yield start, "text", _decoded(text[here:end]), {}
            here = end


def _read_tag(text: str, start: int) -> tuple[int, str, str, dict[str, str]]:
    """Reads a tag; returns where it ends, its kind, name and attributes."""
    tag = _TAG.match(text, start)
    if tag is None:
        raise _fault(text, start, "'<' does not begin a tag")
    attributes: dict[str, str] = {}
    here = tag.end()
    while attribute := _ATTRIBUTE.match(text, here):
        name, double_quoted, single_quoted = attribute.groups()
        if name in attributes:
            raise _fault(text, here, f"attribute '{name}' is stated twice")
        attributes[name] = _decoded(single_quoted if double_quoted is None else double_quoted)
        here = attribute.end()
    end = _TAG_END.match(text, here)
    if end is None:
        raise _fault(text, here, f"an attribute of <{tag[2]}> or its end is malformed")
    kind = "empty" if end[1] == "/>" else "end" if tag[1] else "start"
    return end.end(), kind, tag[2], attributes


def _skip_space(text: str, start: int) -> int:
    space = _SPACES.match(text, start)
    assert space is not None
    return space.end()


def _find(text: str, what: str, start: int, where: int) -> int:
    end = text.find(what, start)
    if end < 0:
        raise _fault(text, where, f"what begins here is not ended by '{what}'")
    return end


def _decoded(text: str) -> str:
    return _REFERENCE.sub(_character, _LINE_END.sub("\n", text))


def _character(reference: re.Match[str]) -> str:
    name, decimal, hexadecimal = reference.groups()
    if name:
        return _CHARACTERS[name]
    code = int(decimal) if decimal else int(hexadecimal, 16)
    return chr(code) if 0 < code <= 0x10FFFF else reference[0]


def _fault(text: str, position: int, reason: str) -> ValueError:
    # The reason may quote a name as long as the file.
    return ValueError(f"line {text.count(chr(10), 0, position) + 1}: {reason[:_MAX_REASON]}")
