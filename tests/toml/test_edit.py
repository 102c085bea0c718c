"""An element is added to an array and nothing else changes: comments, layout, the order of keys."""

from __future__ import annotations

import tomllib

import pytest

from servogen.toml.edit import append_element

CASES = {
    "lines with comments": (
        "[motion] # moves\nposes = [\n    { a = 1 },  # first\n    { a = 2 } # ä\n    # after\n]\nend = 1\n",
        "[motion] # moves\nposes = [\n    { a = 1 },  # first\n    { a = 2 }, # ä\n    { a = 3 },\n"
        "    # after\n]\nend = 1\n",
    ),
    "a trailing comma": (
        "[motion]\nposes = [\n  { a = 1 },\n]",
        "[motion]\nposes = [\n  { a = 1 },\n  { a = 3 },\n]",
    ),
    "one line": ("[motion]\nposes = [{ a = 1 }] # x\n", "[motion]\nposes = [{ a = 1 }, { a = 3 }] # x\n"),
    "one line with a comma": (
        "[motion]\nposes = [{ a = 1 }, ]\n",
        "[motion]\nposes = [{ a = 1 }, { a = 3 },]\n",
    ),
    "nothing": ("[motion]\nposes = []\n", "[motion]\nposes = [{ a = 3 }]\n"),
    "the end on the last line": (
        "[motion]\nposes = [\n  { a = 1 },\n  { a = 2 }]\n",
        "[motion]\nposes = [\n  { a = 1 },\n  { a = 2 },\n  { a = 3 },\n]\n",
    ),
    "after other signs": (
        'x = "ß [ ] ="\n[motion]\n"poses" = [\n\t{ a = 1 },\n]\n',
        'x = "ß [ ] ="\n[motion]\n"poses" = [\n\t{ a = 1 },\n\t{ a = 3 },\n]\n',
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_an_element_is_added(name: str) -> None:
    before, after = CASES[name]
    made = append_element(before, ("motion", "poses"), "{ a = 3 }")
    assert made == after
    old, new = tomllib.loads(before), tomllib.loads(made)
    assert new["motion"]["poses"] == [*old["motion"]["poses"], {"a": 3}]


def test_what_is_not_an_array_is_refused() -> None:
    for text in ("[motion]\nposes = 1\n", "[motion]\nx = []\n"):
        with pytest.raises(KeyError):
            append_element(text, ("motion", "poses"), "1")
