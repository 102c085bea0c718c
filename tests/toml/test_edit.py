"""An element is added to an array and nothing else changes: comments, layout, the order of keys."""

from __future__ import annotations

import re
import tomllib

import pytest

from servogen.toml.edit import append_element, move_element, remove_element, set_in_element, set_in_table

CASES = {
    "lines with comments":
        ("[motion] # moves\nposes = [\n    { a = 1 },  # first\n    { a = 2 } # ä\n    # after\n]\nend = 1\n",
        "[motion] # moves\nposes = [\n    { a = 1 },  # first\n    { a = 2 }, # ä\n    { a = 3 },\n"
        "    # after\n]\nend = 1\n"),
    "a trailing comma": ("[motion]\nposes = [\n  { a = 1 },\n]",
        "[motion]\nposes = [\n  { a = 1 },\n  { a = 3 },\n]"),
    "one line": ("[motion]\nposes = [{ a = 1 }] # x\n", "[motion]\nposes = [{ a = 1 }, { a = 3 }] # x\n"),
    "one line with a comma": ("[motion]\nposes = [{ a = 1 }, ]\n",
        "[motion]\nposes = [{ a = 1 }, { a = 3 },]\n"),
    "nothing": ("[motion]\nposes = []\n", "[motion]\nposes = [{ a = 3 }]\n"),
    "the end on the last line": ("[motion]\nposes = [\n  { a = 1 },\n  { a = 2 }]\n",
        "[motion]\nposes = [\n  { a = 1 },\n  { a = 2 },\n  { a = 3 },\n]\n"),
    "after other signs": ('x = "ß [ ] ="\n[motion]\n"poses" = [\n\t{ a = 1 },\n]\n',
        'x = "ß [ ] ="\n[motion]\n"poses" = [\n\t{ a = 1 },\n\t{ a = 3 },\n]\n'),
}  # fmt: skip


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


KEY = ("motion", "poses")
ARRAYS = {
    "lines with comments": "[motion] # moves\nposes = [ # all\n    # one\n    { a = 1 },  # first, 1\n"
    "    { a = 2, b = '# no' } # second ]\n    , { a = 3 } # third\n    # after\n]\nend = 1\n",
    "one line": "[motion]\nposes = [{ a = 1 },   { a = 2 }, { a = 3 }] # x\n",
    "both": "[motion]\nposes = [{a=1}, # c\n   {a=2}, {a=3}, ] # x\n",
    "values of several lines": "[motion]\nposes = [\n  [1,\n   2], # ä\n  # of 3\n\n  3,\n 4]\n",
    "one": "[motion]\nposes = [\n    { a = 1 }, # only\n]\n",
}


def comments_of(text: str) -> list[str]:
    return sorted(re.findall("# [^'\n]*", text))


@pytest.mark.parametrize("name", ARRAYS)
def test_elements_move_with_their_comments(name: str) -> None:
    before = ARRAYS[name]
    old = tomllib.loads(before)
    count = len(old["motion"]["poses"])
    for index in range(count):
        for to in range(count):
            made = move_element(before, KEY, index, to)
            wanted = list(old["motion"]["poses"])
            wanted.insert(to, wanted.pop(index))
            new = tomllib.loads(made)
            assert new["motion"]["poses"] == wanted
            assert new["motion"].get("end") == old["motion"].get("end")
            assert comments_of(made) == comments_of(before)
            if index == to:
                assert re.sub(r"[\s,]", "", made) == re.sub(r"[\s,]", "", before)


def test_a_comment_stays_with_its_element() -> None:
    made = move_element(ARRAYS["lines with comments"], KEY, 0, 1)
    assert made == (
        "[motion] # moves\nposes = [ # all\n    { a = 2, b = '# no' }, # second ]\n    # one\n"
        "    { a = 1 },  # first, 1\n { a = 3 } # third\n    # after\n]\nend = 1\n"
    )
    made = remove_element(ARRAYS["lines with comments"], KEY, 0)
    assert made == (
        "[motion] # moves\nposes = [ # all\n    { a = 2, b = '# no' }, # second ]\n { a = 3 } # third\n"
        "    # after\n]\nend = 1\n"
    )
    assert remove_element(ARRAYS["one"], KEY, 0) == "[motion]\nposes = [\n]\n"


@pytest.mark.parametrize(
    ("table", "name", "value", "after"),
    [
        ("{ a = 1, b = 2 }", "b", "2.5", "{ a = 1, b = 2.5 }"),
        ("{ a = 1, b = 2 }", "c", "3", "{ a = 1, b = 2, c = 3 }"),
        ("{ a = 1 }", "c", "3", "{ a = 1, c = 3 }"),
        ("{ a = 1, b = 2, c = 3 }", "d", "4", "{ a = 1, b = 2, c = 3, d = 4 }"),
        ("{ a = 1, b = 2, c = 3 }", "b", None, "{ a = 1, c = 3 }"),
        ("{ a = 1, b = 2, c = 3 }", "c", None, "{ a = 1, b = 2 }"),
        ("{ a = 1, b = 2 }", "b", None, "{ a = 1 }"),
        ("{ a = 1, b = 2 }", "a", None, "{ b = 2 }"),
        ('{ "a" = 1 }', "a", "[1, 2]", '{ "a" = [1, 2] }'),
        ("{ a = 1 }", "a", None, "{  }"),
        ("{}", "a", "1", "{ a = 1 }"),
        ("{ a = 1 }", "b", None, "{ a = 1 }"),
    ],
)
def test_a_value_in_an_element_is_changed(table: str, name: str, value: str | None, after: str) -> None:
    text = "[motion]\nposes = [\n    {a = 0}, # 0\n    %s, # 1\n]\n"
    made = set_in_element(text % table, KEY, 1, name, value)
    assert made == text % after
    tomllib.loads(made)


def test_what_is_not_there_is_not_changed() -> None:
    text = ARRAYS["one line"]
    for index, to in ((3, 0), (0, 3), (-1, 0)):
        with pytest.raises(IndexError):
            move_element(text, KEY, index, to)
    with pytest.raises(IndexError):
        remove_element(text, KEY, 3)
    with pytest.raises(IndexError):
        set_in_element(text, KEY, 3, "a", "1")
    with pytest.raises(ValueError, match="not an inline table"):
        set_in_element("[motion]\nposes = [1]\n", KEY, 0, "a", "1")
    for edit in (lambda: move_element("x = 1\n", KEY, 0, 0), lambda: remove_element("x = 1\n", KEY, 0)):
        with pytest.raises(KeyError):
            edit()


A, B = '[[servo]]\nname = "a"\n', '[[servo]]\nname = "b"'
TABLES = {
    "the value of a key, before a comment": (f"{A}zero = 90 # guess\n", ("servo", 0),
        f"{A}zero = 12.5 # guess\n"),
    "a new key behind the last one and its comment": ('[[servo]] # one\nname = "a" # left\n# next\n\n' + B, (
        "servo", 0), '[[servo]] # one\nname = "a" # left\nzero = 12.5\n# next\n\n' + B),
    "the second of an array of tables": (A + B, ("servo", 1), f"{A}{B}\nzero = 12.5"),
    "an inline table": ("servo = [{ a = 1 }, { a = 2 }] # x\n", ("servo", 1),
        "servo = [{ a = 1 }, { a = 2, zero = 12.5 }] # x\n"),
    "a table without keys": ("[leg] # empty\n[x]\n", ("leg",), "[leg] # empty\nzero = 12.5\n[x]\n"),
}  # fmt: skip


@pytest.mark.parametrize("name", TABLES)
def test_a_key_of_a_table_is_set_and_nothing_else_changes(name: str) -> None:
    before, key, after = TABLES[name]
    made = set_in_table(before, key, "zero", "12.5")
    assert made == after
    assert tomllib.loads(made) != tomllib.loads(before)


def test_a_table_that_is_not_there_is_refused() -> None:
    with pytest.raises(KeyError):
        set_in_table("[leg]\n", ("servo", 0), "zero", "1")
