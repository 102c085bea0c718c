"""Relocatable sources: sections by the rules of gplink, worked by hand; and gputils itself, where it is."""

from __future__ import annotations

import shutil

import pytest

from servogen.errors import InputError
from servogen.pic.assembler.assembly import Assembly, AssemblySource, link
from servogen.pic.assembler.sections import read_script
from tests.campaigns import sampled
from tests.pic import linked

HEAD = " list p=16f84a\n include <p16f84a.inc>\n"
GOTO, CALL, RETURN, RETLW = 0x2800, 0x2000, 0x0008, 0x3400


def program(*sources: str, script: str = "") -> Assembly:
    made = [AssemblySource(f"{HEAD}{text}\n end\n", f"m{number}.asm") for number, text in enumerate(sources)]
    return link(made, None, read_script(script, "a.lkr")) if script else link(made)


def problems(*sources: str) -> list[str]:
    with pytest.raises(InputError) as refused:
        program(*sources)
    return [f"{each.location}: {each.code}" for each in refused.value.diagnostics]


def test_code_at_an_address_comes_first_and_the_largest_of_the_rest_next() -> None:
    """Five words do not fit between 1 and 3, but the two of SMALL do."""
    text = "R CODE 0\n goto big\nI CODE 4\n retfie\nSMALL CODE\nsmall nop\n return\nBIG CODE\nbig fill 0, 5"
    made = program(text)
    assert dict(made.labels) == {"big": 5, "small": 1}
    assert made.image.program[0] == GOTO | 5
    assert made.image.program[2] == RETURN


def test_names_cross_from_source_to_source() -> None:
    first = " global work\n extern far, buffer\nM CODE 0\n call far\n movf buffer + 1, w\nW CODE\nwork return"
    second = " global far, buffer\n extern work\nD UDATA\n res 2\nbuffer res 2\nF CODE\nfar goto work"
    made = program(first, second)
    labels = dict(made.labels)
    assert made.image.program[0] == CALL | labels["far"]
    assert made.image.program[labels["far"]] == GOTO | labels["work"]
    assert made.image.program[1] == 0x0800 | 0x0C + 2 + 1
    assert made.listing.variables == ((0x0E, "buffer", 2),)


def test_sections_of_one_name_become_one_in_the_order_of_the_sources() -> None:
    made = program("R CODE 0\n nop\nP CODE\none nop\n nop", "P CODE\ntwo nop", "P CODE\nthree nop")
    assert dict(made.labels) == {"one": 1, "two": 3, "three": 4}


def test_overlaid_sections_share_their_bytes() -> None:
    made = program("O UDATA_OVR\nv res 3\nP CODE\n nop", "O UDATA_OVR\nw res 5\nS UDATA_SHR\nx res 1")
    assert made.listing.variables == ((0x0C, "v", 3), (0x0C, "w", 5), (0x11, "x", 1))


def test_a_section_that_is_opened_again_goes_on() -> None:
    made = program("R CODE 0\n nop\nP CODE\n movlw 1\nD UDATA\nx res 1\nP CODE\n movlw 2")
    assert [made.image.program[address] for address in (0, 1, 2)] == [0, 0x3001, 0x3002]


def test_org_in_a_relocatable_source_is_a_section_there() -> None:
    assert sorted(program(" org 0x10\n nop\nP CODE\na nop\n nop").image.program) == [0, 1, 0x10]


def test_a_linker_script_states_the_memory() -> None:
    script = """
    CODEPAGE NAME=boot START=0x0 END=0x1F PROTECTED   // by name only
    CODEPAGE NAME=app  START=0x20 END=0x3FF
    DATABANK NAME=high START=0x30 END=0x4F
    SECTION  NAME=LOADER ROM=boot
    """
    made = program("LOADER CODE\none nop\nOTHER CODE\ntwo nop\nV UDATA\nx res 1", script=script)
    assert dict(made.labels) == {"one": 0, "two": 0x20}
    assert made.listing.variables == ((0x30, "x", 1),)
    with pytest.raises(InputError, match="lacks"):
        read_script("CODEPAGE NAME=page START=0", "a.lkr")


def test_initialised_data_has_a_copy_in_the_program_and_a_table() -> None:
    """The words that gplink 1.4 makes of it: 14 of the table, 7 of VARS, 3 of code, 1 of OTHER."""
    made = program(
        "VARS idata\na db 1,2,3\nbb dw 0x1234\nc res 2\nOTHER idata\nd db 9\n"
        "R code 0\n goto main\nMAIN code\nmain movf a,w\n movf d,w\n goto main"
    )
    table = [2, 0, 0x0F, 0, 0x0C, 0, 7, 0, 0x19, 0, 0x13, 0, 1, 0]
    bytes_of = [*table, 1, 2, 3, 0x34, 0x12, 0, 0]
    code = [0x080C, 0x0813, GOTO | 0x16, RETLW | 9]
    assert made.image.program == dict(enumerate([GOTO | 0x16, *(RETLW | byte for byte in bytes_of), *code]))
    assert made.listing.variables == ((0x0C, "a", 3), (0x0F, "bb", 2), (0x11, "c", 2), (0x13, "d", 1))


def test_the_table_of_initialised_data_has_a_name_and_joins_sources() -> None:
    made = program("V idata\nx db 1\nC CODE 0\n extern _cinit\n movlw low _cinit", "V idata\ny db 2")
    table = made.image.program[0] & 0xFF
    assert [made.image.program[table + 6] & 0xFF, made.image.program[table]] == [2, RETLW | 1]
    copy = made.image.program[table + 2] & 0xFF
    assert [made.image.program[copy + number] for number in range(2)] == [RETLW | 1, RETLW | 2]


@pytest.mark.parametrize(
    ("sources", "said"),
    [
        ((" extern far\nC CODE\n call far",), ["m0.asm:5:7: asm-undefined-symbol"]),
        ((" global near\nC CODE\n nop",), ["m0.asm:3: asm-undefined-symbol"]),
        ((" global a\nC CODE\na nop", " global a\nC CODE\na nop"), ["m1.asm:3: asm-duplicate-symbol"]),
        ((" nop\nC CODE\n nop",), ["m0.asm:3:2: asm-section"]),
        (("D UDATA\n movlw 1",), ["m0.asm:4:2: asm-section"]),
        (("D IDATA\n movlw 1",), ["m0.asm:4:2: asm-section"]),
        (("D UDATA\nx res 1\nD CODE\n nop",), ["m0.asm:5:3: asm-section", "m0.asm:6:2: asm-section"]),
        (("D UDATA\nx res 0x45\nC CODE\n nop",), ["m0.asm:3:3: asm-no-room"]),
        (("A CODE 0\n nop\n nop", "BB CODE 1\n nop"), ["m1.asm:4:2: asm-overwrite"]),
    ],
)
def test_what_cannot_be_linked_is_an_error_at_its_place(sources: tuple[str, ...], said: list[str]) -> None:
    assert problems(*sources) == said


@pytest.mark.parametrize("second", ["D CODE\n", ""])
def test_of_many_names_that_are_global_wrongly_the_first_hundred_are_said(second: str) -> None:
    """They are defined in two sources, or in none."""
    names = [f"a{number}" for number in range(150)]
    source = "".join(f" global {name}\n" for name in names) + second
    source += "".join(f"{name} nop\n" for name in names) if second else ""
    with pytest.raises(InputError) as refused:
        program(*[source] * (2 if second else 1))
    said = [each.message.partition("'")[2].partition("'")[0] for each in refused.value.diagnostics]
    assert said == names[:100]


gputils = pytest.mark.skipif(shutil.which("gplink") is None, reason="gputils is not installed")


@gputils
@pytest.mark.parametrize("seed", sampled(range(8), 3))
def test_random_programs_are_those_of_gplink(seed: int) -> None:
    assert linked.verdict(seed) in ("same", "refused by both", "refused by gplink for the last byte")


@gputils
def test_a_word_that_differs_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    theirs = linked.by_gplink
    monkeypatch.setattr(
        linked,
        "by_gplink",
        lambda texts, folder: theirs(
            [*texts[:-1], texts[-1].replace(" return\n", " nop\n return\n", 1)], folder
        ),
    )
    assert linked.verdict(1) == "different"
