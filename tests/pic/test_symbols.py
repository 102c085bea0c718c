"""What a program gets from the files that makers' tools write beside its HEX: names, lines and variables."""

from __future__ import annotations

import random
import shutil
import subprocess
from pathlib import Path

import pytest

from servogen.debug.symbols import line_at, variable
from servogen.debug.time_machine import TimeMachine
from servogen.grade import Submission
from servogen.inputs import MAX_TEXT_BYTES
from servogen.pic.image import Image, to_hex
from servogen.programs import Program, read_program, read_submission
from servogen.testing.chip import Board, Chip
from servogen.units import Clock
from tests.pic.symbol_files import BESIDE, CMF, COF, MAP, ROWS, SOURCE, SYM, cod_of, elf_of, image_of

needs_gpasm = pytest.mark.skipif(shutil.which("gpasm") is None, reason="gpasm is not installed")


def read(folder: Path, beside: dict[str, bytes | str], image: Image | None = None) -> Program:
    """The program in prog.hex, with files of these suffixes beside it."""
    for suffix, content in beside.items():
        raw = content.encode("latin-1") if isinstance(content, str) else content
        (folder / f"prog{suffix}").write_bytes(raw)
    (folder / "prog.hex").write_text(to_hex(image or image_of()))
    return read_program(folder / "prog.hex")


def run_by_tool(folder: Path, *command: str) -> None:
    subprocess.run(command, cwd=folder, check=True, capture_output=True, timeout=60)


def variables(program: Program) -> dict[str, tuple[int, int]]:
    assert program.listing is not None
    return {name: (address, size) for address, name, size in program.listing.variables}


def test_a_hex_alone_has_no_names(tmp_path: Path) -> None:
    program = read(tmp_path, {})
    assert program.listing is None and program.names == () and program.remarks == ()


@needs_gpasm
def test_what_gpasm_writes_names_the_chip_that_runs(tmp_path: Path) -> None:
    """`count:2` has two bytes, but a .cod states no sizes."""
    (tmp_path / "prog.asm").write_text(SOURCE)
    run_by_tool(tmp_path, "gpasm", "prog.asm")
    program = read_program(tmp_path / "prog.hex")
    assert program.remarks == () and repr(program).endswith("with names from prog.cod and prog.lst>")
    assert program.listing is not None
    assert variables(program) == {"duty": (0x0C, 1), "count": (0x0D, 1)}
    assert dict(program.listing.labels) == {"main": 0, "loop": 2, "delay": 4}
    assert {row.address: row.line for row in program.listing.rows} == ROWS
    chip = TimeMachine(program.image, Clock(4_000_000), listing=program.listing)
    chip.run(20)
    assert variable("duty", program.listing).number(chip.machine.ram) == 0x42
    assert str(line_at(chip, 1)) == "prog.asm:8: movwf duty"


@needs_gpasm
def test_the_listing_of_gpasm_names_a_program_whose_cod_is_lost(tmp_path: Path) -> None:
    """An included file is numbered from 1 again, so that the lines are those of the listing."""
    (tmp_path / "part.inc").write_text("part\tmovlw 1\n return\n")
    text = SOURCE.replace("delay  ", ' include "part.inc"\ntable dt "hello"\ndelay  ')
    (tmp_path / "prog.asm").write_text(text)
    run_by_tool(tmp_path, "gpasm", "prog.asm")
    from_cod = read_program(tmp_path / "prog.hex")
    (tmp_path / "prog.cod").unlink()
    program = read_program(tmp_path / "prog.hex")
    assert program.names == ("prog.lst",) and program.remarks == ()
    assert program.listing is not None and from_cod.listing is not None
    assert program.listing.labels == from_cod.listing.labels
    assert program.listing.variables == from_cod.listing.variables
    listed = (tmp_path / "prog.lst").read_text().splitlines()
    shown = [listed[row.line - 1] for row in program.listing.rows if row.line]
    assert "movwf duty" in shown[1] and "part" in shown[4] and "3468 3465 346C" in shown[6]


def test_the_listing_of_an_old_gpasm_has_narrower_columns(tmp_path: Path) -> None:
    rows = [f"{at:06X} {word:04X}    {ROWS[at]:05} main  x" for at, word in image_of().program.items()]
    head = [
        "gpasm-0.10.6 alpha              prog.asm",
        "",
        "  0000000C     00003 duty",
        "000000         00006  org 0",
    ]
    program = read(tmp_path, {".lst": "\n".join([*head, *rows])})
    assert program.listing is not None and program.remarks == ()
    assert variables(program) == {"duty": (0x0C, 1)}
    assert program.listing.label("main") == 0
    assert [row.line for row in program.listing.rows] == [5, 6, 7, 8, 9, 10, 11]


@needs_gpasm
def test_the_listing_of_another_program_is_refused(tmp_path: Path) -> None:
    (tmp_path / "prog.asm").write_text(SOURCE)
    run_by_tool(tmp_path, "gpasm", "prog.asm")
    (tmp_path / "prog.cod").unlink()
    program = read(tmp_path, {}, Image({**image_of().program, 4: image_of().program[4] ^ 1}))
    assert program.listing is None
    assert "word 0x004 is 0x3007 there and 0x3006" in program.remarks[0].message
    (tmp_path / "prog.lst").write_text((tmp_path / "prog.lst").read_text()[:200])
    assert [each.code for each in read(tmp_path, {}).remarks] == ["names-damaged"]


@needs_gpasm
def test_what_gplink_writes_names_static_variables_and_lines_of_all_files(tmp_path: Path) -> None:
    head = ' list p=16f84a\n include "p16f84a.inc"\n'
    (tmp_path / "one.asm").write_text(
        head + " extern delay\n global duty\n udata_shr\nduty res 1\ncount res 2\n"
        "go code 0\nmain movlw 42\n movwf duty\n call delay\n goto main\n end\n"
    )
    (tmp_path / "two.asm").write_text(
        head + " extern duty\n global delay\n code\ndelay decfsz duty, f\n goto delay\n return\n end\n"
    )
    for name in ("one", "two"):
        run_by_tool(tmp_path, "gpasm", "-c", f"{name}.asm")
    run_by_tool(tmp_path, "gplink", "-m", "-o", "prog.hex", "one.o", "two.o")
    program = read_program(tmp_path / "prog.hex")
    assert program.remarks == () and program.names == ("prog.map", "prog.cod")
    assert program.listing is not None
    assert {name: size for name, (_, size) in variables(program).items()} == {"duty": 1, "count": 2}
    places = {(Path(row.file or "").name, row.line) for row in program.listing.rows}
    assert places == {("one.asm", line) for line in (9, 10, 11, 12)} | {
        ("two.asm", line) for line in (6, 7, 8)
    }


def test_a_cod_gives_lines_labels_and_bytes_of_ram(tmp_path: Path) -> None:
    """0x8D is 0x0D, seen in bank 1; a constant is no variable; a line without words is not shown."""
    (tmp_path / "prog.asm").write_text(SOURCE)
    program = read(tmp_path, {".COD": cod_of(image_of())})
    assert program.listing is not None and program.names == ("prog.COD",)
    assert variables(program) == {"duty": (0x0C, 1), "count": (0x0D, 1)}
    assert program.listing.label("delay") == 4
    assert {row.address: row.line for row in program.listing.rows} == ROWS
    assert [text for _, text in program.listing.sources] == [SOURCE]


def test_the_symbols_of_xc8_are_the_names_of_the_c(tmp_path: Path) -> None:
    """MPLAB X writes the HEX to dist/default/production, three folders below the sources."""
    folder = tmp_path / "blink.X" / "dist" / "default" / "production"
    folder.mkdir(parents=True)
    (tmp_path / "blink.X" / "main.c").write_text("int duty;\n")
    program = read(folder, {".sym": SYM})
    assert program.listing is not None and program.remarks == ()
    assert variables(program) == {
        "duty": (0x0C, 1),
        "count": (0x0D, 2),
        "delay.n": (0x10, 1),
        "fixed": (0x20, 1),
    }
    functions = [(each.name, each.start, each.end) for each in program.listing.functions]
    assert functions == [("main", 0, 4), ("delay", 4, 7)]
    assert [row.line for row in program.listing.rows] == [12, 12, 13, 13, 20, 20, 20]
    assert program.listing.sources == ((str(tmp_path / "blink.X" / "main.c"), "int duty;\n"),)
    assert "l77" not in dict(program.listing.labels)


def test_a_test_of_a_hex_knows_variables_functions_and_the_line_of_c(tmp_path: Path) -> None:
    """The C is shown as `main.c`: it is not beside the HEX."""
    program = read(tmp_path, {".sym": SYM})
    chip = Chip(Board("prog.hex", program.image, Clock(4_000_000), program.listing))
    chip.run_until("delay()", within_ms=1)
    assert chip.variable("duty") == 0x42
    assert "main.c:20" in str(chip.line)
    chip.run_until("main.c:13", within_ms=1)
    assert chip.array("count") == [7, 0]


def test_the_map_of_sdcc_gives_names_without_its_prefix(tmp_path: Path) -> None:
    program = read(tmp_path, {".map": MAP})
    assert program.listing is not None and program.remarks == ()
    assert variables(program) == {"duty": (0x0C, 1), "count": (0x0D, 2)}
    assert dict(program.listing.labels) == {"main": 0, "delay": 4}


def test_the_cof_of_gplink_gives_lines_labels_and_bytes_of_ram(tmp_path: Path) -> None:
    (tmp_path / "linked.asm").write_bytes((Path(__file__).parent / "linked.asm").read_bytes())
    program = read(tmp_path, {".cof": COF})
    assert program.listing is not None and program.remarks == ()
    assert variables(program) == {"duty": (0x0C, 1), "count": (0x0D, 2)}
    assert dict(program.listing.labels) == {"main": 0, "loop": 2, "delay": 4}
    assert {row.address: row.line for row in program.listing.rows} == ROWS
    assert [Path(name).name for name, _ in program.listing.sources] == ["linked.asm"]


@pytest.mark.parametrize(
    ("suffix", "content"),
    [(".elf", elf_of(image_of())), (".elf", elf_of(image_of(), version=4)), (".cmf", CMF.encode())],
)
def test_the_elf_and_the_cmf_of_xc8_say_what_its_symbols_do(
    tmp_path: Path, suffix: str, content: bytes
) -> None:
    """RB0 is no byte of RAM, although its value, 0x30, is the address of one."""
    program = read(tmp_path, {suffix: content})
    assert program.listing is not None and program.remarks == ()
    assert variables(program) == {"duty": (0x0C, 1), "count": (0x0D, 2)}
    functions = [(each.name, each.start, each.end) for each in program.listing.functions]
    assert functions == [("main", 0, 4), ("delay", 4, 7)]
    assert [row.line for row in program.listing.rows] == [12, 12, 13, 13, 20, 20, 20]
    assert {row.file for row in program.listing.rows} == {"main.c"}


def test_an_address_of_a_whole_file_is_not_counted_with(tmp_path: Path) -> None:
    """Each of the steps that follow it would take as long as the file: minutes together."""
    address = bytes([0, 0x80, 0xB5, 0x18, 2]) + b"\xff" * 399_999
    program = read(tmp_path, {".elf": elf_of(image_of(), more=address + b"\x5f" * 100_000)})
    assert program.listing is not None
    assert [row.line for row in program.listing.rows] == [12, 12, 13, 13, 20, 20, 20]


def test_symbols_that_do_not_say_where_all_words_are_are_left_out(tmp_path: Path) -> None:
    """pic-as writes no segments for absolute sections, but their lines."""
    program = read(tmp_path, {".sym": SYM.replace("maintext 0 D CODE 0 0\n", ""), ".cmf": CMF})
    assert program.names == ("prog.cmf",) and program.remarks == ()


def test_a_map_of_another_tool_is_not_read(tmp_path: Path) -> None:
    program = read(tmp_path, {".map": "Microchip MPLAB XC8 Compiler V2.41\n"})
    assert program.listing is None and program.remarks == ()


@pytest.mark.parametrize("suffix", [".cod", ".cof", ".elf"])
def test_names_of_another_program_are_refused_with_the_first_difference(tmp_path: Path, suffix: str) -> None:
    """One bit of one word differs: a file that holds the words is not of this program."""
    other = Image({**image_of().program, 4: image_of().program[4] ^ 1})
    program = read(tmp_path, {suffix: BESIDE[suffix]}, other)
    assert program.image.program == other.program and program.listing is None
    (warning,) = program.remarks
    assert warning.severity == "warning" and warning.code == "names-other-program"
    assert "0x004 is 0x3007 there and 0x3006" in warning.message
    assert warning.location is not None and warning.location.file == str(tmp_path / f"prog{suffix}")


@pytest.mark.parametrize(("suffix", "content"), [(".map", MAP), (".sym", SYM), (".cmf", CMF)])
def test_names_of_a_program_of_another_length_are_refused(tmp_path: Path, suffix: str, content: str) -> None:
    words = dict(image_of().program)
    longer = read(tmp_path, {suffix: content}, Image({**words, 7: 0x0008}))
    assert longer.listing is None
    assert "has no word at 0x007" in longer.remarks[0].message
    shorter = read(tmp_path, {suffix: content}, Image({at: words[at] for at in range(6)}))
    assert "has a word at 0x006, where the HEX has none" in shorter.remarks[0].message


def test_a_file_that_fits_is_used_beside_one_that_does_not(tmp_path: Path) -> None:
    other = Image({**image_of().program, 4: image_of().program[4] ^ 1})
    program = read(tmp_path, {".cod": cod_of(other), ".map": MAP})
    assert program.names == ("prog.map",)
    assert [warning.code for warning in program.remarks] == ["names-other-program"]


@pytest.mark.parametrize(
    ("suffix", "content", "line"),
    [
        (".sym", SYM.replace("_duty C 0 BANK0 1", "_duty C zero BANK0 1"), 9),
        (".sym", SYM.replace("maintext 0 D CODE 0 0", "maintext 0 D"), 16),
        (".sym", SYM[: SYM.index("%locals")], 18),
        (".map", MAP.replace("0x00000d       data", "here"), 19),
        (".map", MAP.replace("   0x00000e", ""), 7),
        (".map", MAP[: MAP.index("Symbols")], 16),
        (".map", "gplink-1.4.0", 1),
        (".sym", "", 1),
        (".cmf", CMF.replace(" >13:", " 13:"), 13),
        (".cmf", CMF.replace("_duty C 0 BANK0 1 ", "_duty C 0 BANK0 "), 21),
        (".cmf", CMF[: CMF.index("%SPLITSTAB")], 22),
    ],
)
def test_a_damaged_text_is_a_warning_that_names_the_line(
    tmp_path: Path, suffix: str, content: str, line: int
) -> None:
    program = read(tmp_path, {suffix: content})
    assert program.image.words == 7 and program.listing is None
    (warning,) = program.remarks
    assert (warning.severity, warning.code) == ("warning", "names-damaged")
    assert warning.location is not None
    assert (warning.location.file, warning.location.line) == (str(tmp_path / f"prog{suffix}"), line)


@pytest.mark.parametrize(
    ("at", "value", "problem"),
    [
        (None, b"", "not whole blocks"),
        (0, b"\x09", "block 9"),
        (436, b"\x63", "to 99"),
        (1548, b"\x09", "line 7 is of source file 9"),
    ],
)
def test_a_damaged_cod_is_a_warning(tmp_path: Path, at: int | None, value: bytes, problem: str) -> None:
    raw = cod_of(image_of())
    damaged = raw[:-1] if at is None else raw[:at] + value + raw[at + 1 :]
    program = read(tmp_path, {".cod": damaged})
    assert program.image.words == 7 and program.listing is None
    assert [warning.code for warning in program.remarks] == ["names-damaged"]
    assert problem in program.remarks[0].message


@pytest.mark.parametrize("suffix", [".cof", ".elf"])
def test_a_file_that_is_cut_off_is_a_warning(tmp_path: Path, suffix: str) -> None:
    program = read(tmp_path, {suffix: BESIDE[suffix][:200]})
    assert program.listing is None
    assert [warning.code for warning in program.remarks] == ["names-damaged"]
    assert "incomplete" in program.remarks[0].message


def test_no_damage_stops_the_program_from_being_read(tmp_path: Path) -> None:
    rng = random.Random(84)
    for _ in range(25):
        damaged: dict[str, bytes | str] = {}
        for suffix, raw in BESIDE.items():
            changed = bytearray(raw[: rng.randrange(len(raw) + 1)] if rng.random() < 0.5 else raw)
            for _ in range(rng.randrange(4) if changed else 0):
                changed[rng.randrange(len(changed))] = rng.randrange(256)
            damaged[suffix] = bytes(changed)
        assert read(tmp_path, damaged).image.words == 7


def test_a_huge_file_is_not_read(tmp_path: Path) -> None:
    program = read(tmp_path, {".sym": SYM + " " * MAX_TEXT_BYTES})
    assert program.listing is None
    assert [warning.severity for warning in program.remarks] == ["warning"]


def test_a_source_outside_the_folder_of_the_hex_is_not_read(tmp_path: Path) -> None:
    (tmp_path / "main.c").write_text("secret")
    folder = tmp_path / "inner"
    folder.mkdir()
    path = str(tmp_path / "main.c")
    program = read(folder, {".sym": SYM.replace("C:\\Users\\a user\\main.c", path)})
    assert program.listing is not None and program.listing.sources == ()
    assert program.listing.rows[0].file == "main.c"


def test_a_students_hex_gets_no_names_from_other_files(tmp_path: Path) -> None:
    read(tmp_path, {".map": MAP})
    file = tmp_path / "prog.hex"
    assert read_submission(Submission("a student", file, tmp_path)).listing is None
