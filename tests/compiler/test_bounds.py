"""Sources without measure are refused early, with what is too much and where; what fits the chip is not."""

from __future__ import annotations

import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.errors import InputError

MAIN = "void main(void) { PORTB = 1; }\n"
LONG = "a" * 60
"""Long names reach the limit of characters with few words."""
DOUBLED = f"#define A0 {LONG}\n#define {LONG}0 A0\n" + "".join(
    f"#define {LONG}{n + 1} {LONG}{n} + {LONG}{n}\n" for n in range(40)
)
DOUBLED += f"#define A40 {LONG}40\n"
NESTED = "#define D(x) x x\nvoid main(void) {\n" + "D(" * 30 + f"{LONG} = 1;" + ")" * 30 + "}"
QUOTED = "#define S(x) #x\n#define E(x) S(x)\nconst char s[] = " + "E(" * 60 + '"\\\\"' + ")" * 60 + ";\n"
EXPANDED = "the macros expand to more than 400000 characters"
WORDS = "the program has more than 40000 tokens"
DEEP = "something in the program is nested too deeply"
STRUCTURES = "struct s0 { char a[2]; };\n" + "".join(
    f"struct s{n + 1} {{ struct s{n} a, b; }};\n" for n in range(60)
)
CASES = {
    "macros that double": (DOUBLED + "void main(void) {\n  PORTB = A40;\n}", EXPANDED, 45),
    "macros that double in #if": (DOUBLED + "#if A40\n#endif\n" + MAIN, EXPANDED, 44),
    "macros that double in #pragma": (DOUBLED + "#pragma x A40\n" + MAIN, EXPANDED, None),
    "macros that double in assembly": (DOUBLED + "void main(void) { asm movlw A40\n }", EXPANDED, None),
    "arguments that double": (NESTED, EXPANDED, 3),
    "strings that double": (QUOTED + MAIN, EXPANDED, 3),
    "uses of a macro inside its own arguments":
        ("#define F(x) x\nint a = " + "F(" * 600 + "1" + ")" * 600 + ";\n" + MAIN,
        "macros are nested too deeply", None),
    "a long comment": ("/*" + "x" * 10_000_000 + "*/\n" + MAIN,
        "'main.c' has 10000036 characters, a source file has at most 200000", None),
    "200 000 statements": ("void main(void) {" + "PORTB = 1;" * 200_000 + "}",
        "'main.c' has 2000018 characters, a source file has at most 200000", None),
    "many statements": ("void main(void) {\n" + "RB0=1;\n" * 20_000 + "}", WORDS, 10_000),
    "parentheses": ("void main(void) {\n PORTB = " + "(" * 30_000 + "1" + ")" * 30_000 + ";}", WORDS, 2),
    "deep parentheses": ("void main(void) {\n PORTB = " + "(" * 2_000 + "1" + ")" * 2_000 + ";}", DEEP, 2),
    "deep blocks": ("void main(void) {\n" + "{" * 2_000 + "}" * 2_000 + "}", DEEP, 2),
    "deep initialisers": (MAIN + "const char t[1] = " + "{" * 2_000 + "1" + "}" * 2_000 + ";", DEEP, 2),
    "a deep sum": ("char a;\nvoid main(void) {\n a = a" + "+ a" * 2_000 + "; }", DEEP, 2),
    "code": ("char a;\nvoid main(void) {" + "PORTB = a;" * 3_000 + "}",
        "the program has 6001 instructions up to here, the chip has 1024 words", 2),
    "assembly": ("void main(void) {\n" + "asm nop\n" * 3_001 + "}",
        "the program has more than 3000 lines of assembly", 3_002),
    "an open comment": (MAIN + "/* x\n" * 9, "the comment is not closed", 2),
    "a long number": ("int a;\nvoid main(void) { a = " + "9" * 5_000 + "; }",
        "9999999999999999999999999999999999999999… does not fit in 32 bits", 2),
    "dots": ("int a = " + "1." * 50_000 + ";", None, 1),
    "a huge structure": (STRUCTURES + MAIN, "a structure of 2048 bytes is larger than the chip's memory", 11),
    "a huge array": ("char a[1000000000];\n" + MAIN,
        "an array of 1000000000 bytes is larger than the chip's memory", 1),
    "a huge index": ("const char a[] = {[2000000000] = 1};\n" + MAIN,
        "an array of 2000000001 bytes is larger than the chip's memory", 1),
    "a huge local array": ("void main(void) {\n  char a[1000] = {1};\n  PORTB = a[0];\n}",
        "'a' needs 1000 bytes of RAM, the chip has 68", 2),
}  # fmt: skip


SAME_LIMIT = ("macros that double in #if", "macros that double in #pragma", "macros that double in assembly")
"""The limit of "macros that double", met where else macros are replaced."""


@pytest.mark.parametrize(
    "case", [pytest.param(case, marks=pytest.mark.campaign if case in SAME_LIMIT else ()) for case in CASES]
)
def test_a_source_without_measure_is_refused(case: str) -> None:
    text, message, line = CASES[case]
    with pytest.raises(InputError) as caught:
        compile_sources([Source(text, "main.c")])
    errors = [each for each in caught.value.diagnostics if each.severity == "error"]
    assert message is None or errors[0].message == message
    assert errors[0].location.file == "main.c"
    assert line is None or errors[0].location.line == line


def test_a_shift_of_the_preprocessor_makes_no_huge_number() -> None:
    text = "#if 1 << 100000000000 || 1 << 64\n#error wrong\n#endif\n"
    text += "#if (1 << 62) >> 62 != 1\n#error bad\n#endif\n"
    assert compile_sources([Source(text + MAIN, "main.c")]).words


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('#include "main.c"\n#include "main.c"\n', "#include is nested more than 20 levels deep"),
        ('#include "main.c"\n', "#include is nested more than 20 levels deep"),
        (
            '#include "main.c"\n' * 2 + "// " + "x" * 20_000,
            "the source files have more than 400000 characters together",
        ),
    ],
)
def test_a_file_that_includes_itself_is_refused(text: str, message: str) -> None:
    options = Options(include=lambda name, includer: (name, text))
    with pytest.raises(InputError) as caught:
        compile_sources([Source(text, "main.c")], options)
    errors = {each.message for each in caught.value.diagnostics}
    assert message in errors and errors <= {message, "#include is nested more than 20 levels deep"}


def test_a_file_is_not_included_without_end() -> None:
    with pytest.raises(InputError) as caught:
        compile_sources(
            [Source('#include "a.h"\n' * 300, "main.c")], Options(include=lambda name, _: (name, ";\n"))
        )
    assert caught.value.diagnostics[0].message == "more than 200 files are included"
    assert caught.value.diagnostics[0].location.line == 201


def test_the_compiler_stops_after_fifty_errors() -> None:
    text = "void main(void) {\n" + "".join(f"  x{n} = 1;\n" for n in range(1_000)) + "}"
    with pytest.raises(InputError) as caught:
        compile_sources([Source(text, "main.c")])
    assert len(caught.value.diagnostics) == 50


@pytest.mark.parametrize("opened", ["/* ", "#asm\n", "asm { ", '"/* ', "__asm \n"])
def test_what_is_opened_again_and_again_is_read_once(opened: str) -> None:
    """A search for each end over the whole rest of the file would take minutes."""
    text = MAIN + opened * (190_000 // len(opened))
    try:
        assert compile_sources([Source(text, "main.c")]).words
    except InputError as error:
        assert error.diagnostics[0].location.line


def test_what_the_chip_holds_is_not_refused() -> None:
    """Nearly all of the chip's words, in the longest form that the source may have."""
    tables = "".join(f"const char t{n}[120] = {{{'1, ' * 120}}};\n" for n in range(5))
    uses = "".join(f"PORTB = t{n}[i];" for n in range(5))
    text = (
        "/*" + "x" * 100_000 + "*/\n" + tables + "char i;\nvoid main(void) {" + uses + "RB0 = 1;" * 300 + "}"
    )
    assert compile_sources([Source(text, "main.c")]).words > 900


def test_no_more_functions_have_numbers_than_a_byte_counts() -> None:
    functions = "".join(f"void f{number}(void) {{ PORTA = 1; }}\n" for number in range(256))
    uses = "".join(f"p = f{number};" for number in range(256))
    text = f"#include <xc.h>\n{functions}void (*p)(void);\nvoid main(void) {{ {uses} }}"
    with pytest.raises(InputError) as caught:
        compile_sources([Source(text, "many.c")], Options(dialect="xc8"))
    messages = [each.message for each in caught.value.diagnostics if each.severity == "error"]
    assert messages == ["the addresses of more than 255 functions are taken"]
