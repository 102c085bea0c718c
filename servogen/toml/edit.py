"""Changes to the text of a TOML file that leave its comments and its layout alone.

In: the text of a valid document, the key of an array, an element as TOML writes it. Out: the text with it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from servogen.toml.locations import Key, places_of, syntax_tree

if TYPE_CHECKING:
    from tree_sitter import Node


def append_element(text: str, key: Key, element: str) -> str:
    """Return the document with one more element at the end of the array at `key`.

    Raises KeyError where there is no array at `key`.
    """
    raw = text.encode()
    array = _array(raw, places_of(text)[key])
    elements = [child for child in array.named_children if child.type != "comment"]
    if not elements:
        inside = array.start_byte + 1
        return (raw[:inside] + element.encode() + raw[inside:]).decode()
    last, end = elements[-1], array.end_byte - 1
    commas = [child for child in array.children if child.type == "," and child.start_byte >= last.end_byte]
    if array.start_point[0] == array.end_point[0]:
        if commas:
            return (raw[:end].rstrip() + b" " + element.encode() + b"," + raw[end:]).decode()
        return (raw[: last.end_byte] + b", " + element.encode() + raw[last.end_byte :]).decode()
    line_begin = raw.rfind(b"\n", 0, last.start_byte) + 1
    line = raw[line_begin : last.start_byte]
    indent = line[: len(line) - len(line.lstrip())]
    comma = b"" if commas else b","
    line_end = raw.find(b"\n", last.end_byte, end)
    new_line = b"\n" + indent + element.encode() + b","
    if line_end < 0:  # the array ends on the line of its last element
        return (raw[: last.end_byte] + b"," + new_line + b"\n" + raw[end:]).decode()
    return (raw[: last.end_byte] + comma + raw[last.end_byte : line_end] + new_line + raw[line_end:]).decode()


def _array(raw: bytes, place: tuple[int, int]) -> Node:
    """Return the array that is the value of the pair at a place (line, column). Raises KeyError."""
    line, column = place
    before = raw.split(b"\n")[line - 1].decode()[: column - 1]
    point = line - 1, len(before.encode())
    node = syntax_tree(raw).descendant_for_point_range(point, point)
    while node is not None and node.type != "pair":
        node = node.parent
    for child in node.named_children if node is not None else ():
        if child.type == "array":
            return child
    raise KeyError(place)
