"""The position of each key of a TOML document.

In: the text of a valid TOML document. Out: line and column of every key, table and array element. The
standard library's parser forgets positions; tree-sitter's concrete syntax tree keeps them.
"""

from __future__ import annotations

import tomllib
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tree_sitter import Node, Parser

Key = tuple[str | int, ...]
"""The path to a value: table names, and array indices from 0."""


@cache
def _parser() -> Parser:
    import tree_sitter
    import tree_sitter_toml

    return tree_sitter.Parser(tree_sitter.Language(tree_sitter_toml.language()))


def syntax_tree(raw: bytes) -> Node:
    """Return the root of a document's concrete syntax tree."""
    return _parser().parse(raw).root_node


MAX_ENTRIES = 200_000
"""The maximum number of keys, tables and array elements of a document."""

MAX_DEPTH = 32
"""The maximum length of a key; servogen's own files need 5."""


class TooMuch(Exception):
    """Raised when a document is larger than the limits, with the line and what is allowed."""

    def __init__(self, message: str, line: int, hint: str) -> None:
        super().__init__(message)
        self.message = message
        self.line = line
        self.hint = hint


def find_places(text: str) -> dict[Key, tuple[int, int]]:
    """Return line and column (from 1, in characters) of every key and array element of a valid document.

    Raises TooMuch for more than MAX_ENTRIES of them, and for one that is deeper than MAX_DEPTH.
    """
    raw = text.encode()
    lines = raw.split(b"\n")
    last_row, last_byte, last_column = -1, 0, 0
    places: dict[Key, tuple[int, int]] = {}
    counts: dict[Key, int] = {}

    def note(key: Key, node: Node) -> None:
        nonlocal last_row, last_byte, last_column
        row, byte = node.start_point
        if len(key) > MAX_DEPTH:
            raise TooMuch("tables or arrays are nested too deeply", row + 1, f"at most {MAX_DEPTH} deep")
        if row != last_row or byte < last_byte:
            last_row, last_byte, last_column = row, 0, 0
        # Counts on from the previous node: decoding a long line from its beginning each time is quadratic.
        last_column += len(lines[row][last_byte:byte].decode(errors="replace"))
        last_byte = byte
        places.setdefault(key, (row + 1, last_column + 1))
        if len(places) > MAX_ENTRIES:
            raise TooMuch("has too many values", row + 1, f"at most {MAX_ENTRIES} keys and array elements")

    def header(names: list[str]) -> Key:
        """Return a table's key, in which each array of tables stands for its newest element."""
        key: Key = ()
        for name in names:
            key = (*key, name)
            if key in counts:
                key = (*key, counts[key] - 1)
        return key

    def pair(node: Node, base: Key) -> None:
        name, value = node.named_children[0], _value(node)
        key: Key = base
        for part in _names(name):
            key = (*key, part)
            note(key, node)
        if value is not None:
            inside(value, key)

    def inside(node: Node, key: Key) -> None:
        if node.type == "inline_table":
            for child in node.named_children:
                if child.type == "pair":
                    pair(child, key)
        elif node.type == "array":
            for index, child in enumerate(child for child in node.named_children if child.type != "comment"):
                note((*key, index), child)
                inside(child, (*key, index))

    for node in syntax_tree(raw).named_children:
        if node.type == "pair":
            pair(node, ())
        elif node.type in ("table", "table_array_element"):
            names = _names(node.named_children[0])
            parent = header(names[:-1])
            key: Key = (*parent, names[-1])
            note(key, node)
            if node.type == "table_array_element":
                counts[key] = counts.get(key, 0) + 1
                key = (*key, counts[key] - 1)
                note(key, node)
            for child in node.named_children[1:]:
                if child.type == "pair":
                    pair(child, key)
    return places


def _value(pair: Node) -> Node | None:
    rest = [child for child in pair.named_children[1:] if child.type != "comment"]
    return rest[0] if rest else None


def _names(node: Node) -> list[str]:
    """Return the parts of a bare, quoted or dotted key; the standard library removes the quotes."""
    if node.type == "dotted_key":
        return [name for child in node.named_children for name in _names(child)]
    text = (node.text or b"").decode()
    return [next(iter(tomllib.loads(f"{text} = 0")))] if node.type == "quoted_key" else [text]
