"""The runner of suites that others wrote tells right from wrong, and a bad program costs it nothing."""

from __future__ import annotations

import os
import signal
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

import pytest

from servogen.compiler import Options, Source
from servogen.isolation import WorkLimits
from tests.compiler.foreign import chip_programs
from tests.compiler.foreign.__main__ import main, shape, verdicts
from tests.compiler.foreign.judge import Compiler, Verdict, judge
from tests.compiler.foreign.suites import Program, programs

RIGHT = "int main(void) { int a = 2; return a - 2; }"
WRONG = "int main(void) { int a = 2; return a + 1; }"
ENDLESS = "volatile char go = 1;\nint main(void) { while (go) ; return 0; }"
REFUSED = "long long f;\nint main(void) { return 0; }"
ABORTED = "int main(void) { abort(); }"
HELLO = '#include <stdio.h>\nint main(int n, char **v) { puts("Hi"); putchar(33); return n; }'
TOO_LARGE = "unsigned char a[60], b[60];\nint main(void) { return a[b[1]]; }"

TEMPLATE = """/** A test.
    type: unsigned char, int
    limit: 300, 20
*/
#include <testfwk.h>
{type} held;
void testGrows(void) { held = {limit}; ASSERT(held == {limit}); }
void testFails(void) { ASSERT(1); ASSERTFALSE({limit} == 20); }
"""


def crashing(sources: Sequence[Source], options: Options) -> NoReturn:
    raise KeyError("a name")


def endless(sources: Sequence[Source], options: Options) -> NoReturn:
    while True:
        pass


def greedy(sources: Sequence[Source], options: Options) -> NoReturn:
    held = []
    while True:
        held.append(bytearray(10_000_000))


def killed(sources: Sequence[Source], options: Options) -> NoReturn:
    os.kill(os.getpid(), signal.SIGSEGV)
    raise AssertionError


def programs_in(folder: Path, **files: str) -> list[Program]:
    for name, text in files.items():
        (folder / f"{name}.c").write_text(text)
    return list(programs(folder, 64))


@pytest.mark.parametrize(
    ("text", "kind", "reason"),
    [
        (RIGHT, "right", ""), (WRONG, "wrong", "status 3"), (ABORTED, "wrong", "status 255"),
        (REFUSED, "refused", "64-bit integers are not supported"),
        (TOO_LARGE, "refused", "the program needs"),
        (f"/* {{ dg-require-effective-target int32plus }} */\n{WRONG}", "unsuitable",
            "needs the target int32plus"),
    ],
)  # fmt: skip
def test_a_program_is_judged(tmp_path: Path, text: str, kind: str, reason: str) -> None:
    (program,) = programs_in(tmp_path, one=text)
    verdict = judge(program)
    assert verdict.kind == kind
    assert verdict.reason.startswith(reason)
    assert verdict.bad == (kind == "wrong")
    assert verdict.does_not_fit == (text == TOO_LARGE)


def test_a_program_that_does_not_end_is_wrong(tmp_path: Path) -> None:
    (program,) = programs_in(tmp_path, endless=ENDLESS)
    verdict = judge(program, cycles=50_000)
    assert verdict == Verdict("wrong", "does not end in 50000 cycles")


@pytest.mark.parametrize(("expected", "kind"), [("Hi\n!", "right"), ("Hi!", "wrong")])
def test_what_a_program_writes_is_compared(tmp_path: Path, expected: str, kind: str) -> None:
    (tmp_path / "hello.c.expected").write_text(expected)
    (program,) = programs_in(tmp_path, hello=HELLO)
    assert judge(program).kind == kind


@pytest.mark.parametrize(
    ("compiler", "kind", "reason"),
    [
        (crashing, "crash", "KeyError: 'a name'"),
        (killed, "crash", "signal 11"),
        (endless, "over limit", "took more than 1 s"),
        (greedy, "over limit", "needed more than 300 MB"),
    ],
)
def test_a_compiler_that_fails_is_found(tmp_path: Path, compiler: Compiler, kind: str, reason: str) -> None:
    (program,) = programs_in(tmp_path, one=RIGHT)
    verdict = judge(program, limits=WorkLimits(seconds=1, elapsed_s=60), compiler=compiler)
    assert (verdict.kind, verdict.bad) == (kind, True)
    assert reason in verdict.reason


def test_a_template_is_every_combination_of_its_values(tmp_path: Path) -> None:
    (tmp_path / "grow.c.in").write_text(TEMPLATE)
    found = {each.name.removeprefix("grow.c.in "): judge(each).kind for each in programs(tmp_path, 64)}
    assert found == {
        "type=unsigned char limit=300": "wrong",
        "type=unsigned char limit=20": "wrong",
        "type=int limit=300": "right",
        "type=int limit=20": "wrong",
    }
    assert len(list(programs(tmp_path, 2))) == 2


def test_tests_that_do_not_fit_together_are_run_one_by_one(tmp_path: Path) -> None:
    tests = "".join(
        f"volatile unsigned char a{n}[60];\nvoid test{n}(void) {{ a{n}[n] = 1; ASSERT(a{n}[n] == {n}); }}\n"
        for n in (1, 2)
    )
    (program,) = programs_in(tmp_path, two=f"/* Two. */\n#include <testfwk.h>\nchar n;\n{tests}")
    found = [(name, verdict.kind) for name, verdict in verdicts(program, "speed")]
    assert found == [("two.c test1", "right"), ("two.c test2", "wrong")]


def test_the_command_counts_and_fails_on_a_bad_program(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    programs_in(tmp_path, one=RIGHT, two=REFUSED)
    assert main([str(tmp_path)]) == 0
    assert "1 refused: N-bit integers are not supported" in capsys.readouterr().out
    programs_in(tmp_path, three=WRONG)
    assert main([str(tmp_path)]) == 1
    printed = capsys.readouterr().out
    assert "WRONG three.c: status 3" in printed
    assert "3 programs" in printed and "'right': 1, 'wrong': 1" in printed.replace("'refused': 1, ", "")


def test_a_file_without_tests_is_no_program(tmp_path: Path) -> None:
    assert programs_in(tmp_path, one="#include <testfwk.h>\nint a;", two="int b;") == []


def test_a_folder_without_programs_is_not_a_success(tmp_path: Path) -> None:
    assert main([str(tmp_path)]) == 1


def test_refusals_are_counted_without_names_and_numbers() -> None:
    assert shape("the program needs 80 bytes of RAM\nmore") == shape("the program needs 81 bytes of RAM")
    assert shape("'a' is not declared") == shape("'b' is not declared") != shape("'b' is not defined")


CHIP_PROGRAMS = {
    "blink/main.c": "#include <xc.h>\n#define _XTAL_FREQ 4000000\nvoid main(void) { __delay_ms(5); }",
    "two/main.c": '#include <xc.h>\n#include "lib.h"\nvoid main(void)\n{ twice(2); }',
    "two/lib.c": "#include <xc.h>\nvoid twice(char n) { PORTB = 2 * n; }",
    "two/include/LIB.H": "void twice(char n);",
    "sdcc/main.c": "#include <pic14regs.h>\nvoid main() { PORTB = 1; }",
    "adc/main.c": "#include <xc.h>\nvoid main() { ADCON0 = 1; }",
    "fuse/main.c": "#include <xc.h>\n#pragma config BOREN = OFF\nvoid main() { }",
    "ccs/main.c": "#include <16F84A.h>\n#use delay(clock=4000000)\nvoid main() { }",
    "mikro/main.c": "void main() { TRISB.F0 = 0; Delay_ms(500); }",
    "big/main.c": "char a[60], b[60];\nvoid main() { a[b[1]] = b[a[1]]; }",
    "lost/main.c": '#include <xc.h>\n#include "elsewhere.h"\nvoid main() { }',
    "own/main.c": "#include <xc.h>\nvoid main() { PORTB = 1 }",
    "wrong/main.c": "#include <xc.h>\nvoid main() { PORTB = 1 2; }",
    "none/lib.c": "void nothing(void) { }",
}


@pytest.mark.campaign
def test_programs_for_this_chip_are_counted_by_why_they_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, text in CHIP_PROGRAMS.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    (tmp_path / "judged.toml").write_text('"own/main.c" = "a semicolon is missing"\n')
    assert chip_programs.main([str(tmp_path)]) == 1
    refused, *counts = capsys.readouterr().out.splitlines()
    assert refused.startswith("REFUSED wrong/main.c")
    assert [line.strip() for line in counts] == [
        "11 programs", "3 compiled", "2 other chip", "2 other dialect", "1 too large", "1 missing file",
        "1 own error", "1 refused", "0 over limit", "0 crash",
    ]  # fmt: skip


def test_a_folder_without_programs_for_this_chip_is_a_failure(tmp_path: Path) -> None:
    assert chip_programs.main([str(tmp_path)]) == 1
