"""Changes to the text of a TOML file that leave its comments and its layout alone.

In: the text of a valid document, the key of an array, and elements and values as TOML writes them. Out: the
changed text. A comment on the line of an element, or on lines of its own before one, stays with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from servogen.toml.locations import Key, find_places, syntax_tree

if TYPE_CHECKING:
    from tree_sitter import Node


def append_element(text: str, key: Key, element: str) -> str:
    """Return the document with one more element at the end of the array at `key`.

    Raises KeyError where there is no array at `key`.
    """
    raw = text.encode()
    array = _array(raw, find_places(text)[key])
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


def move_element(text: str, key: Key, index: int, to: int) -> str:
    """Return the document with element `index` of the array at `key` as element `to`.

    Raises KeyError where there is no array at `key`, IndexError where it has no such element.
    """
    array = _elements(text, key)
    parts = list(array.parts)
    if not (0 <= index < len(parts) and 0 <= to < len(parts)):
        raise IndexError(index)
    parts.insert(to, parts.pop(index))
    return array.joined(parts)


def remove_element(text: str, key: Key, index: int) -> str:
    """Return the document without element `index` of the array at `key`, and without its comments.

    Raises KeyError where there is no array at `key`, IndexError where it has no such element.
    """
    array = _elements(text, key)
    if not 0 <= index < len(array.parts):
        raise IndexError(index)
    return array.joined([*array.parts[:index], *array.parts[index + 1 :]])


def set_in_element(text: str, key: Key, index: int, name: str, value: str | None) -> str:
    """Return the document with `name = value` in element `index`, an inline table, of the array at `key`.

    None: without that pair. Raises KeyError where there is no array at `key`, IndexError where it has no such
    element, ValueError where the element is not an inline table.
    """
    raw = text.encode()
    array = _array(raw, find_places(text)[key])
    tables = [child for child in array.named_children if child.type != "comment"]
    if not 0 <= index < len(tables):
        raise IndexError(index)
    table = tables[index]
    if table.type != "inline_table":
        raise ValueError(f"element {index} is not an inline table")
    pairs = [child for child in table.named_children if child.type == "pair"]
    place = next((number for number, pair in enumerate(pairs) if _key_name(pair) == name), None)
    if place is None and value is None:
        return text
    if place is None:
        pair = f"{name} = {value}".encode()
        if not pairs:
            return (raw[: table.start_byte] + b"{ " + pair + b" }" + raw[table.end_byte :]).decode()
        end = pairs[-1].end_byte
        return (raw[:end] + b", " + pair + raw[end:]).decode()
    if value is not None:
        old = pairs[place].named_children[-1]
        return (raw[: old.start_byte] + value.encode() + raw[old.end_byte :]).decode()
    if place > 0:  # with the comma before it
        begin, end = pairs[place - 1].end_byte, pairs[place].end_byte
    else:
        begin, end = pairs[0].start_byte, pairs[1].start_byte if len(pairs) > 1 else pairs[0].end_byte
    return (raw[:begin] + raw[end:]).decode()


def set_in_table(text: str, key: Key, name: str, value: str) -> str:
    """Return the document with `name = value` in the table at `key`: a table, an element of an array of
    tables, or an inline table; in place of its value, or behind the last pair of its own.

    Raises KeyError where there is no table at `key`.
    """
    raw, places = text.encode(), find_places(text)
    if (*key, name) in places:
        old = _at(raw, places[(*key, name)], ("pair",)).named_children[1]  # a comment may follow
        return (raw[: old.start_byte] + value.encode() + raw[old.end_byte :]).decode()
    table = _at(raw, places[key], ("inline_table", "table", "table_array_element"))
    pairs = [child for child in table.named_children if child.type == "pair"]
    new = f"{name} = {value}".encode()
    if table.type == "inline_table":
        end, separator = (pairs[-1].end_byte, b", ") if pairs else (table.start_byte + 1, b" ")
        return (raw[:end] + separator + new + raw[end:]).decode()
    last = pairs[-1] if pairs else table.named_children[0]
    end = raw.find(b"\n", last.end_byte)
    end = len(raw) if end < 0 else end  # behind a comment on the line
    return (raw[:end] + b"\n" + new + raw[end:]).decode()


def _key_name(pair: Node) -> str:
    """Return the key of a pair that is one name; a dotted key as it is written."""
    name = pair.named_children[0]
    text = (name.text or b"").decode()
    return text[1:-1] if name.type == "quoted_key" else text


@dataclass(frozen=True, slots=True)
class _Part:
    """An element: what stands before it since the one before, itself, and what follows on its line."""

    lead: str
    body: str
    trail: str


@dataclass(frozen=True, slots=True)
class _Elements:
    """A document, cut around the elements of an array."""

    before: str
    commented: bool
    """Whether `before` ends with a comment."""
    parts: tuple[_Part, ...]
    tail: str
    """From behind the last element on, with the bracket."""
    last_comma: bool
    """Whether a comma follows the last element."""

    def joined(self, parts: list[_Part]) -> str:
        """Return the document with other elements; those of one line keep the spaces of their places."""
        own_lines = any("\n" in part.lead for part in self.parts)
        text, commented = self.before, self.commented
        for place, part in enumerate(parts):
            lead = part.lead if own_lines else self.parts[place].lead
            if commented and "\n" not in lead:
                lead = f"\n{lead}"
            comma = "," if place + 1 < len(parts) or self.last_comma else ""
            text += lead + part.body + comma + part.trail
            commented = "#" in part.trail
        return text + ("\n" if commented and "\n" not in self.tail.partition("]")[0] else "") + self.tail


def _elements(text: str, key: Key) -> _Elements:
    """Return the elements of the array at `key`. Raises KeyError where there is none."""
    raw = text.encode()
    array = _array(raw, find_places(text)[key])
    children = array.children[1:-1]
    begin = array.start_byte + 1
    if children and children[0].type == "comment" and children[0].start_point[0] == array.start_point[0]:
        begin = children[0].end_byte  # about the array
    first, parts, comma = begin, [], False
    for place, child in enumerate(children):
        if child.type in (",", "comment"):
            continue
        end, trail, comma = child.end_byte, "", False
        for node in children[place + 1 :]:
            on_line = node.type == "comment" and node.start_point[0] == child.end_point[0]
            if not on_line and (node.type != "," or comma):
                break
            trail += raw[end : node.start_byte if node.type == "," else node.end_byte].decode()
            end, comma = node.end_byte, comma or node.type == ","
        lead, body = raw[begin : child.start_byte].decode(), raw[child.start_byte : child.end_byte].decode()
        parts.append(_Part(lead, body, trail.rstrip()))
        begin = end
    return _Elements(
        before=raw[:first].decode(),
        commented=first > array.start_byte + 1,
        parts=tuple(parts),
        tail=raw[begin:].decode(),
        last_comma=comma,
    )


def _array(raw: bytes, place: tuple[int, int]) -> Node:
    """Return the array that is the value of the pair at a place (line, column). Raises KeyError."""
    for child in _at(raw, place, ("pair",)).named_children:
        if child.type == "array":
            return child
    raise KeyError(place)


def _at(raw: bytes, place: tuple[int, int], types: tuple[str, ...]) -> Node:
    """Return the innermost node of these types around a place (line, column). Raises KeyError."""
    line, column = place
    before = raw.split(b"\n")[line - 1].decode()[: column - 1]
    point = line - 1, len(before.encode())
    node = syntax_tree(raw).descendant_for_point_range(point, point)
    while node is not None and node.type not in types:
        node = node.parent
    if node is None:
        raise KeyError(place)
    return node
