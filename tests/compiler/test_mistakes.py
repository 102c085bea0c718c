"""Mistakes that students make, as asked about in forums: each is named with its code, in its line.

`mistakes/*.txt` hold one small program for each, below a line `==== what is wrong`; a comment at the end of a
line names the codes of what is reported there. Nothing else may be reported. What `clang -Wall -Wextra` says
about a line, in words of its own, must be said here too.
"""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

from servogen.compiler import Options, Source, compile_sources, driver
from servogen.compiler.diagnostics import WARNINGS, Reporter
from servogen.errors import Diagnostic, InputError
from servogen.pic.device import register_bits, registers
from servogen.programs import dialect_of, included_names

HERE = Path(__file__).parent / "mistakes"
CLANG = shutil.which("clang")
FIRST_LINE = "#include <xc.h>\n"


@dataclass(frozen=True)
class Mistake:
    name: str
    text: str
    dialect: str

    @property
    def expected(self) -> set[tuple[int, str]]:
        """Return the (line, code) that the comments at the ends of the lines state."""
        found = set()
        for number, line in enumerate(self.text.splitlines(), 1):
            if codes := re.search(r"//((?: c-[a-z-]+)+)$", line):
                found |= {(number, code) for code in codes[1].split()}
        return found


def mistakes() -> list[Mistake]:
    found = []
    for path in sorted(HERE.glob("*.txt")):
        for part in re.split(r"^==== ", path.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]:
            name, text = part.split("\n", 1)
            dialect = "c2c" if text.startswith("// dialect: c2c") else "xc8"
            found.append(
                Mistake(f"{path.stem}: {name}", ("" if dialect == "c2c" else FIRST_LINE) + text, dialect)
            )
    return found


ALL = mistakes()


@cache
def reported(mistake: Mistake, unwanted: frozenset[str] = frozenset()) -> tuple[Diagnostic, ...]:
    options = Options(mistake.dialect, unwanted=unwanted)
    try:
        return compile_sources([Source(mistake.text)], options).diagnostics
    except InputError as error:
        return error.diagnostics


def test_there_are_at_least_a_hundred_and_each_states_what_is_reported() -> None:
    assert len(ALL) >= 100
    assert len({each.name for each in ALL}) == len(ALL)
    assert not [each.name for each in ALL if not each.expected]


@pytest.mark.parametrize("mistake", ALL, ids=lambda each: each.name)
def test_a_mistake_is_named_in_its_line_and_nothing_else_is(mistake: Mistake) -> None:
    found = {(each.location.line, each.code) for each in reported(mistake)}
    assert found == mistake.expected


OTHERS = (
    Mistake("semicolon", "#include <string.h>;\nvoid main(void) { }\n", "c2c"),
    Mistake("pragma", "#pragma unknown\nvoid main(void) { }\n", "c2c"),
    Mistake("attribute", "__attribute__((interrupt)) void main(void) { }\n", "c2c"),
    Mistake("message", "#warning later\nvoid main(void) { }\n", "c2c"),
    Mistake("escape", "char a;\nvoid main(void) { a = '\\q'; }\n", "c2c"),
    Mistake("delay", "#pragma CLOCK_FREQ 3579545\nvoid main(void) { delay_us(10); }\n", "c2c"),
)
"""Warnings that are not about mistakes of students."""


@pytest.mark.parametrize("code", sorted(WARNINGS))
def test_each_warning_can_be_switched_off_alone(code: str) -> None:
    for mistake in (*ALL, *OTHERS):
        found = reported(mistake)
        named = {each for each in found if (each.severity, each.code) == ("warning", code)}
        if named:
            rest = tuple(each for each in found if each not in named)
            assert reported(mistake, frozenset((code,))) == rest
            return
    pytest.fail(f"no program has this warning: {code}")


def test_the_warnings_are_those_that_the_source_gives() -> None:
    given = set()
    for path in Path(driver.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("reporter.warn"):
                code = node.args[0]
                assert isinstance(code, ast.Constant), f"{path}:{node.lineno}"
                given.add(code.value)
    assert given == WARNINGS


@pytest.mark.skipif(CLANG is None, reason="clang is not installed")
def test_what_clang_names_is_named(tmp_path: Path) -> None:
    said = clang(tmp_path)
    assert len(said) > 50, "clang has hardly said anything: does it understand the programs?"
    missed = [
        f"{ALL[number].name}: line {line}: {text}"
        for number, line, text in said
        if not named(ALL[number], line, text)
    ]
    assert not missed, "\n".join(missed)


ELSEWHERE = {
    "return-type": "c-missing-return",
    "sometimes-uninitialized": "c-uninitialised",
    "infinite-recursion": "c-call-depth",
    "dangling-else": "c-dangling-else",
}
"""What clang reports in another line: at the end of the function, at the condition, at the `else`."""


def named(mistake: Mistake, line: int, text: str) -> bool:
    """Return whether what clang says about a line is reported."""
    option = re.search(r"\[-W([\w-]+)\]$", text)
    code = ELSEWHERE.get(option[1]) if option else None
    return any(each == code or at == line for at, each in mistake.expected)


def clang(folder: Path) -> list[tuple[int, int, str]]:
    """Return what clang reports: (number of the mistake, line, message). `int` has 16 bits for an AVR."""
    headers = folder / "headers"
    headers.mkdir()
    names = [*registers(), *register_bits()]
    chip = "".join(f"extern volatile unsigned char {name};\n" for name in names)
    (headers / "xc.h").write_text(
        f"{chip}#define interrupt\n#define __interrupt()\nvoid NOP(void);\nvoid _delay(unsigned long);\n"
        "void __delay_ms(unsigned long);\n"
    )
    (headers / "stdio.h").write_text(
        "int sprintf(char *, const char *, ...) __attribute__((format(printf, 2, 3)));\n"
    )
    files = []
    for number, mistake in enumerate(ALL):
        files.append(f"{number}.c")
        # what the dialect adds to C stands in a header that is no line of the program
        (folder / files[-1]).write_text(mistake.text)
    c2c = headers / "c2c.h"
    c2c.write_text("void delay_ms(unsigned char);\nvoid set_bit(int, int);\n")
    command = [
        str(CLANG), "-target", "avr", "-ffreestanding", "-fsyntax-only", "-Wall", "-Wextra", "-std=gnu11",
    ]  # fmt: skip
    command += ["-funsigned-char", "-Wno-unknown-pragmas", "-I", str(headers), "-include", str(c2c), *files]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    found = re.findall(r"^(\d+)\.c:(\d+):\d+: (?:warning|error): (.*)$", done.stderr, re.MULTILINE)
    return [(int(number), int(line), text) for number, line, text in found]


# programs that are right


class Analysed(Exception):
    """Raised in place of the code generator, whose work warnings do not need."""


def right_programs() -> list[tuple[str, str, str]]:
    """Return (file, text, dialect) of the firmware of all jobs, and of the labs' and the docs' programs."""
    root = HERE.parents[2]
    found = []
    for path in sorted([*root.glob("firmware/*/main.*.c"), *root.glob("tests/labs_*/*.c")]):
        dialect = (
            path.parent.name.removeprefix("labs_") if "labs_" in path.parent.name else path.suffixes[0][1:]
        )
        found.append((str(path.relative_to(root)), path.read_text(encoding="utf-8"), dialect))
    for path in sorted([root / "README.md", *root.glob("docs/*.md")]):
        for text in re.findall(
            r"^```c\n(.*?)^```", path.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
        ):
            if "void main(" in text:
                names = included_names([(path.name, text)], lambda name, file: None)
                found.append((path.name, text, dialect_of(names)))
    return found


@pytest.mark.campaign
def test_nothing_is_said_about_programs_that_are_right(monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(graph: object, reporter: Reporter, symbols: object) -> None:
        said.extend(reporter.ordered())
        raise Analysed

    said: list[Diagnostic] = []
    monkeypatch.setattr(driver, "ProgramGenerator", stop)
    programs = right_programs()
    assert len(programs) > 60
    for file, text, dialect in programs:
        with pytest.raises(Analysed):
            compile_sources([Source(text, file)], Options(dialect))
    assert not said
