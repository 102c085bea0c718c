"""The text of a listing: source lines with their words and cycles, functions, and the map of RAM."""

from __future__ import annotations

import pytest

from servogen.pic.assembler import assemble
from servogen.pic.listing import ListedFunction, Listing, ListingRow, listing_text


def test_an_assembly_lists_each_line_with_its_words() -> None:
    source = (
        "; wait\n list p=16f84\n cblock 0x0C\n n:2\n endc\nagain decfsz n, f\n goto again\n dt 1, 2\n end\n"
    )
    assert listing_text(assemble(source, "a.asm").listing).splitlines() == [
        "4 of 1024 program words", "", "addr  word  cycles  instruction", "a.asm:",
        "                           1: ; wait",
        "                           2:  list p=16f84",
        "                           3:  cblock 0x0C", "                           4:  n:2",
        "                           5:  endc",
        "                           6: again decfsz n, f",
        "0000  0B8C  1(2)    DECFSZ 0x0C, F", "                           7:  goto again",
        "0001  2800  2       GOTO 0x000", "                           8:  dt 1, 2",
        "0002  3401  2       RETLW 0x01", "0003  3402  2       RETLW 0x02", "",
        "function  start  words  bytes of RAM  deepest calls  cycles",
        "again     0000       4             0              0  unknown",
        "", "addr  bytes  variable", "000C      2  n", "2 of 68 bytes of RAM", "", "0000              XX--",
        "0010  ----------------", "0020  ----------------", "0030  ----------------",
        "0040  ----------------", "X used, - free",
    ]  # fmt: skip


def routines(source: str) -> list[tuple[str, int, int]]:
    functions = assemble(f"{source}\n end\n").listing.functions
    return [(each.name, each.start, each.end) for each in functions]


def test_an_assembly_lists_what_is_called_and_what_the_vectors_lead_to() -> None:
    body = "isr retfie\nmain call sub\nagain goto again\nsub nop\n return\n dw 0x2001"
    source = f" goto main\n org 4\n{body}\n org 0x20\nfar return"
    assert routines(source) == [("reset", 0, 1), ("isr", 4, 5), ("main", 5, 7), ("sub", 7, 9)]


def test_a_program_that_runs_through_the_interrupt_vector_has_no_such_routine() -> None:
    assert routines(" nop\n nop\n nop\n nop\n nop\n goto 0") == [("reset", 0, 6)]
    assert routines(" org 0x10\n nop") == []


def test_functions_have_their_size_ram_stack_and_cycles() -> None:
    listing = Listing(
        (ListingRow(0, 0x0008, "RETURN", "2", "m.c", 3),),
        (
            ListedFunction("main", 0, 1, 3, 2, None, None),
            ListedFunction("step", 1, 11, 0, 0, 12, 12),
            ListedFunction("wait", 11, 20, 1, 0, 5, None),
            ListedFunction("both", 20, 22, 1, 0, 5, 9),
        ),
    )
    text = listing_text(listing).splitlines()
    assert text[-6:-1] == [
        "function  start  words  bytes of RAM  deepest calls  cycles",
        "main      0000       1             3              2  unknown",
        "step      0001      10             0              0  12",
        "wait      000B       9             1              0  5 to unbounded",
        "both      0014       2             1              0  5 to 9",
    ]


def test_a_row_without_a_source_line_stands_alone() -> None:
    rows = (ListingRow(0, 0x2805, "GOTO 0x005", "2"), ListingRow(5, 0, "NOP", "1", "m.c", 1))
    text = listing_text(Listing(rows, sources=(("m.c", "int x;\n"),))).splitlines()
    assert text[3:7] == [
        "0000  2805  2       GOTO 0x005",
        "m.c:",
        "                           1: int x;",
        "0005  0000  1       NOP",
    ]


def test_a_line_is_shown_again_when_code_comes_back_to_it() -> None:
    rows = tuple(ListingRow(address, 0, "NOP", "1", "m.c", line) for address, line in enumerate((2, 1, 1)))
    text = listing_text(Listing(rows, sources=(("m.c", "a\nb\n"),))).splitlines()
    assert [line.strip() for line in text[4:10]] == [
        "1: a", "2: b", "0000  0000  1       NOP", "1: a", "0001  0000  1       NOP",
        "0002  0000  1       NOP",
    ]  # fmt: skip


def test_the_same_values_make_the_same_text() -> None:
    listing = assemble(" nop\n end\n").listing
    assert listing_text(listing) == listing_text(listing)


def test_an_assembly_knows_the_addresses_of_its_labels() -> None:
    listing = assemble(" list p=16f84\nfirst nop\n nop\nlast goto first\n end\n", "a.asm").listing
    assert listing.labels == (("first", 0), ("last", 2))
    assert listing.label("last") == 2


@pytest.mark.parametrize(("labels", "count"), [((), 0), ((("on", 1), ("on", 5)), 2)])
def test_a_label_that_is_missing_or_ambiguous_has_no_address(
    labels: tuple[tuple[str, int], ...], count: int
) -> None:
    with pytest.raises(LookupError, match=f"{count} labels are called on"):
        Listing((), labels=labels).label("on")


def test_a_variable_is_found_by_its_name_if_there_is_exactly_one() -> None:
    listing = Listing((), variables=((0x20, "late", 1), (0x21, "twice", 1), (0x22, "twice", 2)))
    assert listing.variable("late") == 0x20
    for name, count in (("twice", 2), ("early", 0)):
        with pytest.raises(LookupError, match=f"{count} variables are called {name}"):
            listing.variable(name)
