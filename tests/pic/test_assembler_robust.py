"""Whatever the source, the assembler answers with an image or with errors that have a place."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servogen.errors import InputError
from servogen.pic.assembler import assemble
from servogen.pic.assembler.control import CONTROL
from servogen.pic.assembler.definitions import DEFINITIONS
from servogen.pic.assembler.instructions import mnemonics
from servogen.pic.assembler.layout import LAYOUT
from servogen.pic.assembler.settings import SETTINGS

DIRECTIVES = sorted({**CONTROL, **DEFINITIONS, **LAYOUT, **SETTINGS})
PIECES = (
    *DIRECTIVES,
    *sorted(name.lower() for name in mnemonics()),
    *("a", "b", "m", "x", "0x10", "10", "'c'", "b'1'", "$", "w", "f", '"ab"', "<p16f84.inc>", "p=16f84",
        "#v(", "a="),
    *("+", "-", "*", "/", "<<", "(", ")", "[", "]", ",", ":", ";", "'", '"', "==", "&&", "!", "~", "high",
        ".", "\\"),
)  # fmt: skip
LINES = st.lists(
    st.lists(st.sampled_from(PIECES), max_size=6).flatmap(
        lambda pieces: st.sampled_from(["", " "]).map(lambda start: start + " ".join(pieces))
    ),
    max_size=12,
)


def check(source: str) -> None:
    try:
        assembly = assemble(source, "t.asm")
    except InputError as error:
        assert error.diagnostics
        assert all(each.location.line is not None for each in error.diagnostics)
    else:
        assert all(0 <= word <= 0x3FFF for word in assembly.image.program.values())


@settings(max_examples=150)
@given(LINES)
def test_no_heap_of_words_crashes_it(lines: list[str]) -> None:
    check("\n".join(line for line in lines if "while" not in line))


@settings(max_examples=50)
@given(st.text(max_size=80))
def test_no_text_crashes_it(text: str) -> None:
    check(f" {text}")


def test_deep_brackets_are_an_error_with_a_column() -> None:
    try:
        assemble(f" movlw {'(' * 5000}1\n end")
    except InputError as error:
        assert error.location is not None
        assert error.location.column is not None


# -- docs/assembler.md ---------------------------------------------------------------------------------

PAGE = (Path(__file__).parents[2] / "docs" / "assembler.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r", "\f\n"])
def test_the_lines_of_every_system_are_lines(ending: str) -> None:
    """Unix, DOS, old Macintosh, and printers' page breaks. A Ctrl-Z ends the file, whatever is behind it."""
    lines = [" list p=16f84", " movlw 5", " nop", ""]
    text = ending.join(lines)
    assert assemble(text).image.program == {0: 0x3005, 1: 0x0000}
    for behind in ("", "\x1a", f"{ending} no code{ending}\x1a{ending} nop"):
        assert assemble(f"{text}\x1a{behind}").image.program == {0: 0x3005, 1: 0x0000}
    with pytest.raises(InputError) as caught:
        assemble(f"{text} wrong 5{ending}\x1a", "old.asm")
    assert [each.location.line for each in caught.value.diagnostics] == [4]


def test_the_example_of_the_page_assembles() -> None:
    example = re.search(r"```asm\n(.*?)```", PAGE, re.DOTALL)
    assert example is not None
    assembly = assemble(example[1])
    assert assembly.image.words == 8
    assert {each.code for each in assembly.warnings} == {"asm-bank"}


def test_every_directive_and_mnemonic_is_on_the_page() -> None:
    words = set(re.findall(r"[#\w]+", PAGE.lower()))
    plain = {name for name in DIRECTIVES if name.isidentifier()}
    not_shown = {"set", "subtitl", "stitle", "pageselw", "__maxrom", "__badrom", "extern"}
    relocatable = {name for name in plain if name.startswith("udata_")}
    assert plain - words - not_shown - relocatable == set()
    special = {"SKPNDC", "CLRDC", "BNDC", "ADDDCF", "SUBDCF", "MOVFW", "TSTF", "NEGF", "LGOTO"}
    assert {name.lower() for name in special} <= words
