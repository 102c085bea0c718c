"""What compile, assemble and disassemble print, pass on and write, with a compiler that is made by hand."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from servogen import compiler
from servogen.errors import Diagnostic, Location
from servogen.pic.image import Image
from servogen.units import Clock
from tests.cli.conftest import Run
from tests.cli.stand_ins import stand_in

IMAGE = Image({0: 0x2800}, 0x3FF1)
WARNING = Diagnostic("warning", "w", "odd")


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> dict[str, Any]:
    """`compile` and `assemble` give seen["result"]; what they are asked."""
    seen: dict[str, Any] = {}
    seen["result"] = SimpleNamespace(
        image=IMAGE,
        listing="listing",
        words=123,
        ram_bytes=45,
        clock=Clock(4_000_000),
        saved={"peephole": 1, "outlining": 20},
        ir="the form",
        diagnostics=(WARNING,),
        warnings=(WARNING,),
        source_lines={},
    )

    def within(work: Callable[[], Any], file: Path, limits: Any, hint: str) -> Any:
        seen["limits"] = (file, limits.seconds, limits.memory_mb, hint)
        return work()

    def compile_them(texts: Any, options: Any) -> Any:
        seen["files"], seen["options"] = [source.file for source in texts], options
        return seen["result"]

    def link(sources: Any, chip: Any, memory: Any) -> Any:
        seen["assembled"] = ([(each.text, each.file) for each in sources], chip and chip.name)
        return seen["result"]

    stand_in(monkeypatch, "servogen.cli.files", "within_limits", within)
    stand_in(monkeypatch, compiler, "compile_sources", compile_them)
    stand_in(monkeypatch, "servogen.pic.assembler.assembly", "link", link)
    stand_in(monkeypatch, "servogen.pic.listing", "listing_text", lambda rows: f"{rows}\n")
    monkeypatch.chdir(tmp_path)
    for name in ("a.c", "b.c", "a.asm"):
        Path(name).write_text(f"; {name}\n")
    return seen


def test_compile_writes_a_hex_beside_its_first_file(run: Run, compiled: dict[str, Any]) -> None:
    """1024 words and 68 bytes: DS35007 sections 2.1 and 2.2."""
    ran = run("compile", "a.c", "b.c")
    assert (ran.code, ran.out) == (
        0,
        "a.hex: 123 words of 1024, 45 bytes of 68, c2c\nnext: servogen simulate a.hex\n",
    )
    assert ran.err.splitlines()[0] == "1 warning:"
    assert sorted(path.name for path in Path().iterdir()) == ["a.asm", "a.c", "a.hex", "b.c"]
    assert (compiled["files"], compiled["limits"]) == (
        ["a.c", "b.c"],
        (Path("a.c"), 10.0, 300, "--timeout and --memory-mb allow more"),
    )
    options = compiled["options"]
    assert (options.dialect, options.optimise, options.dump_ir) == ("c2c", "speed", None)
    assert (options.clock_hz, options.float_bits, options.unwanted) == (None, None, frozenset())
    assert options.verify_ir is compiler.Options().verify_ir


@pytest.mark.parametrize(("level", "name"), [("0", "none"), ("1", "speed"), ("s", "size"), ("none", "none")])
def test_the_options_of_compile_reach_the_compiler(
    run: Run, compiled: dict[str, Any], level: str, name: str
) -> None:
    words = (
        "--dialect",
        "xc8",
        "--device",
        "PIC16F84A",
        "--clock-hz",
        8_000_000,
        "--float",
        24,
        "--verify-ir",
    )
    run("compile", "a.c", *words, f"-O{level}", "--timeout", 5, "--memory-mb", 77, "--listing", "a.lst")
    options = compiled["options"]
    assert (options.dialect, options.device.name, options.clock_hz) == ("xc8", "PIC16F84A", 8_000_000)
    assert (options.float_bits, options.verify_ir, options.optimise) == (24, True, name)
    assert compiled["limits"][1:3] == (5.0, 77)
    assert Path("a.lst").read_text() == "listing\n"


def test_compile_takes_folders_of_headers_and_macros(run: Run, tmp_path: Path) -> None:
    """A header beside the source comes before those of -I; -D can state the clock."""
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "board.h").write_text(f"#include <xc.h>\n#define BOARD {folder}\n")
    (tmp_path / "two" / "pins.h").write_text("#define LED RB3\n")
    source = tmp_path / "main.c"
    source.write_text(
        '#include "board.h"\n#include "pins.h"\nint one = N;\n'
        "void main(void) { TRISB = BOARD; LED = FLAG; __delay_us(4); }\n"
    )
    words = ("-I", tmp_path / "one", f"-I{tmp_path / 'two'}", "-DN=300", "-D", "FLAG")
    ran = run("compile", source, *words, "-D_XTAL_FREQ=8000000", "--json")
    found = json.loads(ran.out)
    assert (ran.code, found["dialect"], found["clock_hz"]) == (0, "xc8", 8_000_000)
    (tmp_path / "board.h").write_text("#include <xc.h>\n#define BOARD nowhere\n")
    assert "'nowhere' is not declared" in run("compile", source, *words).err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("-I", "nowhere"), "nowhere: error: -I names no folder [bad-option]"),
        (("-D", "5=3"), "error: -D takes NAME or NAME=VALUE, not '5=3' [bad-option]"),
        (("-D", "=3"), "error: -D takes NAME or NAME=VALUE, not '=3' [bad-option]"),
    ],
)
def test_a_folder_or_macro_that_is_none(
    run: Run, compiled: dict[str, Any], words: tuple[str, ...], said: str
) -> None:
    ran = run("compile", "a.c", *words)
    assert ran.code == 2
    assert said in ran.err


def test_equal_warnings_are_shown_once_with_their_number(run: Run, compiled: dict[str, Any]) -> None:
    places = [Location("a.c", line, 3) for line in range(1, 9)]
    again = [Diagnostic("warning", "again", "rounded", place) for place in places]
    compiled["result"].diagnostics = (*again, WARNING)
    ran = run("compile", "a.c")
    assert ran.err.splitlines() == [
        "9 warnings:",
        "a.c:1:3: warning: rounded [again]",
        "  and 7 more like it: a.c:2:3, a.c:3:3, a.c:4:3, a.c:5:3, a.c:6:3, …",
        "servogen: warning: odd [w]",
    ]
    found = json.loads(run("compile", "a.c", "--json").out)
    assert len(found["diagnostics"]) == 9


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("name", ["main.c", "main.asm"])
def test_a_source_in_utf_16_is_named_as_such(run: Run, tmp_path: Path, encoding: str, name: str) -> None:
    file = tmp_path / name
    file.write_bytes("void main(void) { PORTB = 1; }\n".encode(encoding))
    ran = run("compile" if name == "main.c" else "assemble", file)
    assert (ran.code, ran.err) == (
        2,
        f"{file}: error: is UTF-16 text [not-utf8]\n  save the file as UTF-8\n",
    )


def test_compile_as_json_has_the_form_only_if_it_is_dumped(run: Run, compiled: dict[str, Any]) -> None:
    shown = run("compile", "a.c", "-o", "x.hex", "--json")
    found = json.loads(shown.out)
    assert [each["code"] for each in found.pop("diagnostics")] == ["w"]
    expected = {
        "hex": "x.hex",
        "dialect": "c2c",
        "words": 123,
        "ram_bytes": 45,
        "clock_hz": 4_000_000,
        "saved_by_pass": {"peephole": 1, "outlining": 20},
    }
    assert found == expected
    compiled["result"].clock = None
    found = json.loads(run("compile", "a.c", "--dump", "ir", "-o", "x.hex", "--json").out)
    assert (found["clock_hz"], found["ir"]) == (None, "the form")


def test_a_dump_shows_the_form_and_what_each_pass_saved(run: Run, compiled: dict[str, Any]) -> None:
    lines = run("compile", "a.c", "--dump", "ir").out.splitlines()
    assert lines[:-2] == ["the form", "; peephole saved 1 word", "; outlining saved 20 words"]
    compiled["result"].saved = {}
    assert run("compile", "a.c", "--dump", "ir").out.splitlines()[1] == "; no pass saved a word"


def test_assemble_writes_a_hex_and_perhaps_a_listing(run: Run, compiled: dict[str, Any]) -> None:
    ran = run("assemble", "a.asm")
    assert (ran.code, ran.out) == (0, f"a.hex: {IMAGE.words} words of 1024\nnext: servogen simulate a.hex\n")
    assert ran.err.splitlines()[0] == "1 warning:"
    assert compiled["assembled"] == ([("; a.asm\n", "a.asm")], None)
    assert compiled["limits"] == (Path("a.asm"), 10.0, 300, "--timeout and --memory-mb allow more")
    assert not Path("a.lst").exists()
    words = ("--device", "PIC16F84A", "--listing", "a.lst", "-o", "x.hex", "--timeout", 5, "--memory-mb", 77)
    assert run("assemble", "a.asm", *words).out.startswith("x.hex: ")
    assert compiled["assembled"][1] == "PIC16F84A"
    assert compiled["limits"][1:3] == (5.0, 77)
    assert Path("a.lst").read_text() == "listing\n"


@pytest.mark.parametrize(
    "words",
    [
        ("compile", "a.c", "-o", "a.c"),
        ("compile", "a.c", "b.c", "-o", "b.c"),
        ("compile", "a.c", "--listing", "a.c"),
        ("compile", "a.c", "--listing", "a.hex"),
        ("assemble", "a.asm", "-o", "a.asm"),
        ("assemble", "a.asm", "--listing", "a.asm"),
        ("assemble", "a.asm", "--listing", "a.hex"),
    ],
)
def test_no_source_is_overwritten(run: Run, compiled: dict[str, Any], words: tuple[str, ...]) -> None:
    before = {path: path.read_text() for path in Path().iterdir()}
    ran = run(*words)
    assert (ran.code, "[output-exists]" in ran.err) == (2, True)
    assert {path: path.read_text() for path in Path().iterdir()} == before


def test_disassemble_prints_or_writes(run: Run, compiled: dict[str, Any]) -> None:
    Path("a.hex").write_text(":020000000028D6\n:00000001FF\n")
    printed = run("disassemble", "a.hex")
    assert (printed.code, "goto" in printed.out.lower(), printed.out.endswith("\n\n")) == (0, True, False)
    written = run("disassemble", "a.hex", "-o", "x.asm")
    assert (written.code, written.out, Path("x.asm").read_text()) == (
        0,
        "next: servogen assemble x.asm\n",
        printed.out,
    )
    assert "16f84a" in run("disassemble", "a.hex", "--device", "PIC16F84A").out.lower()


def test_assemble_links_all_sources_of_a_program(run: Run, tmp_path: Path) -> None:
    head = " list p=16f84a\n include <p16f84a.inc>\n"
    one, two = tmp_path / "one.asm", tmp_path / "two.asm"
    one.write_text(f"{head} extern far\nR CODE 0\n goto far\n end\n")
    two.write_text(f"{head} global far\nC CODE\nfar goto far\n end\n")
    done = run("assemble", one, two)
    assert done.code == 0 and "one.hex: 2 words of 1024" in done.out
    alone = run("assemble", one)
    assert alone.code == 2 and "name all of the program's sources" in alone.err
