"""What the headers of a source imply, which clock and chip a program gets, and how its files are read."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from servogen.errors import InputError
from servogen.grade import Submission
from servogen.pic.device import device
from servogen.pic.image import Image, to_hex
from servogen.pic.listing import ListedFunction, Listing
from servogen.programs import (
    MAX_HEADERS,
    Program,
    beside_c,
    clock_of,
    compile_program,
    device_of,
    devices_of,
    dialect_of,
    included_names,
    is_job,
    is_system_header,
    program_file,
    read_assembly,
    read_program,
    read_schedule,
    read_source,
    read_submission,
)
from servogen.units import Clock

CInclude = dict[str, str]


def names_of(text: str, files: CInclude | None = None) -> set[str]:
    known = files or {}

    def include(name: str, including: str) -> tuple[str, str] | None:
        return (name, known[name]) if name in known else None

    return included_names([("main.c", text)], include)


def test_includes_are_found_as_they_are_written() -> None:
    text = (
        '#include <XC.h>\n  # include "own.h"\n\t#include\t<a/b.h>\n// #include <no.h>\nx #include <no.h>\n'
    )
    assert names_of(text) == {"xc.h", "own.h", "a/b.h"}
    assert names_of('#include "own.h"', {"own.h": "#include <deep.h>\n#include <own.h>"}) == {
        "own.h",
        "deep.h",
    }
    assert names_of("#include <xc.h>", {"xc.h": "#include <never.h>"}) == {"xc.h"}, "a header of the compiler"


def test_a_header_that_cannot_be_read_is_left_to_the_compiler() -> None:
    def include(name: str, including: str) -> tuple[str, str] | None:
        raise InputError("x", "no")

    assert included_names([("main.c", "#include <a.h>\n")], include) == {"a.h"}


def test_headers_are_searched_up_to_a_limit() -> None:
    seen = []

    def include(name: str, including: str) -> tuple[str, str] | None:
        seen.append(including)
        return name, f"#include <{int(name[1:-2]) + 1:04d}.h>".replace("<", "<a")

    names = included_names([("main.c", "#include <a0000.h>\n")], include)
    assert len(names) == len(set(seen)) == MAX_HEADERS == 200


@pytest.mark.parametrize(
    ("names", "dialect"),
    [
        (set(), "c2c"), ({"own.h"}, "c2c"), ({"xc.h"}, "xc8"), ({"pic.h"}, "xc8"), ({"htc.h"}, "xc8"),
        ({"pic16f84.h"}, "sdcc"), ({"pic16f84a.h"}, "sdcc"), ({"pic14regs.h"}, "sdcc"),
        ({"pic16regs.h"}, "sdcc"), ({"pic14/anything.h"}, "sdcc"), ({"xc.h", "pic16f84.h"}, "xc8"),
        ({"own/pic14/x.h"}, "c2c"),
    ],
)  # fmt: skip
def test_the_dialect_follows_from_the_headers(names: set[str], dialect: str) -> None:
    assert dialect_of(names) == dialect


def test_headers_of_the_compilers_are_no_files_of_the_program() -> None:
    for name in ("xc.h", "XC.H", "pic14/pic16f84.h", "pic14regs.h"):
        assert is_system_header(name)
    for name in ("own.h", "p16f84a.h", "xc.h/own.h"):
        assert not is_system_header(name)


def test_the_chip_follows_from_the_headers_or_the_request() -> None:
    assert device_of(set()) is None
    assert device_of({"xc.h"}) is None
    assert device_of({"pic14/pic16f84.h"}) == "PIC16F84"
    assert device_of({"p16f84a.h"}) == device_of({"pic16f84.h", "pic16f84a.h"}) == "PIC16F84A"
    old, new = device("PIC16F84"), device("PIC16F84A")
    assert devices_of(None, set()) == (old, new)
    assert devices_of(None, {"pic16f84.h"}) == (old, None)
    assert devices_of(None, {"pic16f84a.h"}) == (new, None)
    assert devices_of("16f84", {"pic16f84a.h"}) == (old, None)


def test_the_clock_is_the_requested_one_else_that_of_the_program_else_4_mhz() -> None:
    program = Program(Image({}), clock=Clock(8_000_000))
    assert clock_of(None) == clock_of(Program(Image({}))) == Clock(4_000_000)
    assert clock_of(program) == Clock(8_000_000)
    assert clock_of(program, 1) == Clock(1)
    for wrong in (0, -4, 1.5):
        with pytest.raises(InputError) as caught:
            clock_of(program, wrong)  # type: ignore[arg-type]
        assert caught.value.message == f"clock_hz = {wrong!r} is not a whole number of at least 1"


def test_a_program_says_its_size_and_clock() -> None:
    assert repr(Program(Image({0: 1, 1: 2}))) == "<Program of 2 words>"
    assert repr(Program(Image({0: 1}), clock=Clock(4_000_000))) == "<Program of 1 word at 4 MHz>"
    assert "Program of 1 word" in Program(Image({0: 1}))._repr_html_()
    listing = Listing((), (ListedFunction("show", 0x01F, 0x022),))
    assert "<td>show</td><td>0x01F</td><td>3</td>" in Program(Image({0: 1}), listing)._repr_html_()


def test_texts_are_utf_8_or_else_latin_1(tmp_path: Path) -> None:
    file = tmp_path / "a.c"
    for raw, text in ((b"\xc3\xa4", "ä"), (b"\xef\xbb\xbfx", "x"), (b"\xe4", "ä")):
        file.write_bytes(raw)
        assert read_source(file) == text
    file.write_bytes(b"\xc3\xa4")
    assert read_assembly(file) == "Ã¤", "one character for each byte"
    assert beside_c("a.c", str(tmp_path / "main.c")) == (str(file), "ä")
    assert beside_c("b.c", str(tmp_path / "main.c")) is None
    file.write_bytes(b"x" * 11)
    assert read_source(file, 11) == "x" * 11
    with pytest.raises(InputError):
        read_source(file, 10)


def test_a_folder_of_a_build_stands_for_its_program(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        program_file(tmp_path)
    assert (caught.value.message, caught.value.hint) == (
        "is a folder without a main.hex", "servogen build writes one"
    )  # fmt: skip
    image = Image({0: 0x2800}, 0x3FF1)
    (tmp_path / "main.hex").write_text(to_hex(image))
    assert program_file(tmp_path) == tmp_path / "main.hex"
    assert program_file(tmp_path / "main.hex") == tmp_path / "main.hex"
    program = read_program(tmp_path)
    assert (program.image, program.clock, program.device, program.listing) == (image, None, None, None)
    (tmp_path / "job.toml").mkdir()
    assert not is_job(tmp_path / "job.toml")
    assert is_job(tmp_path / "other.TOML")
    assert not is_job(tmp_path / "other.hex")


def test_each_kind_of_file_is_compiled_by_its_suffix(tmp_path: Path) -> None:
    (tmp_path / "own.inc").write_text("five equ 5\n")
    for suffix in (".asm", ".s", ".src", ".ASM"):
        file = tmp_path / f"a{suffix}"
        file.write_text(" include own.inc\n movlw five\n end\n")
        program = compile_program(file)
        assert dict(program.image.program) == {0: 0x3005}
        assert program.listing is not None and program.clock is None and program.device is None
    file = tmp_path / "a.hex"
    file.write_text(":0200000001FFFE\n:00000001FF\n".replace("FFFE", "30CD"))
    assert dict(compile_program(file).image.program) == {0: 0x3001}
    c = tmp_path / "a.c"
    c.write_text("#pragma CLOCK_FREQ 4000000\nvoid main(void)\n{\n    while (1) ;\n}\n")
    compiled = compile_program(c)
    assert (compiled.clock, compiled.device) == (Clock(4_000_000), None)
    c.write_text("#pragma CLOCK_FREQ 20000000\nvoid main(void)\n{\n    while (1) ;\n}\n")
    faster = compile_program(c)
    assert (faster.clock, faster.device) == (Clock(20_000_000), "PIC16F84A"), "too fast for the PIC16F84"


def test_a_schedule_of_more_than_16_mib_is_not_read(tmp_path: Path) -> None:
    file = tmp_path / "schedule.json"
    file.touch()
    os.truncate(file, (16 << 20) + 1)
    with pytest.raises(InputError, match=r"schedule\.json: error: is larger than 16 MiB"):
        read_schedule(file)


def test_a_submission_includes_what_its_folder_holds_in_c_as_it_is_written(tmp_path: Path) -> None:
    (tmp_path / "own.h").write_text("#define FIVE 5\n")
    (tmp_path / "inc").mkdir()
    (tmp_path / "inc" / "deep.h").write_text('#include "../own.h"\n')
    main = tmp_path / "main.c"
    main.write_text('#include "inc/deep.h"\nvoid main(void) { PORTB = FIVE; while (1) ; }\n')
    program = Submission("main.c", main, tmp_path)
    assert read_submission(program).image == compile_program(main).image
    assert 0x3005 in read_submission(program).image.program.values(), "MOVLW 5"
    assert read_submission(program).listing is not None
    for name, reason in (("OWN.H", "'OWN.H' was not found"), ("gone.h", "'gone.h' was not found")):
        main.write_text(f'#include "{name}"\nvoid main(void) {{ while (1) ; }}\n')
        with pytest.raises(InputError, match=rf"main\.c:1:1: error: .*{reason}"):
            read_submission(program)


def test_a_submission_in_assembly_includes_names_as_dos_writes_them(tmp_path: Path) -> None:
    (tmp_path / "inc").mkdir()
    (tmp_path / "inc" / "Own.inc").write_text("five equ 5\n")
    main = tmp_path / "main.asm"
    for name in ("inc/Own.inc", "inc/OWN.INC", "inc\\own.inc"):
        main.write_text(f' include "{name}"\n movlw five\n end\n')
        program = read_submission(Submission("main.asm", main, tmp_path))
        assert dict(program.image.program) == {0: 0x3005}
    main.write_text(' include "gone.inc"\n end\n')
    with pytest.raises(InputError, match=r"main\.asm:1:.*'gone\.inc' not found"):
        read_submission(Submission("main.asm", main, tmp_path))
