"""The functions of a program before their code is generated: places of values, copies for the interrupt."""

from __future__ import annotations

from unittest.mock import patch

import pytest

from servogen.compiler import Options, Source, compile_sources, driver
from servogen.compiler.ast.types import U16, FloatType
from servogen.compiler.codegen import program
from servogen.compiler.codegen.program import ProgramGenerator
from servogen.compiler.ir.function import Function
from servogen.errors import InputError

HEAD = "#include <xc.h>\n#include <stdbool.h>\nstruct one { unsigned char only; };\n"


class _Enough(Exception):
    """Ends the compilation where all code has been generated."""


def generated(text: str) -> ProgramGenerator:
    with patch.object(driver, "arrange", side_effect=_Enough) as arrange, pytest.raises(_Enough):
        compile_sources([Source(HEAD + text, "main.c")], Options(dialect="xc8"))
    found = arrange.call_args.args[0]
    assert isinstance(found, ProgramGenerator)
    return found


def names(function: Function) -> list[str]:
    return [symbol.name for symbol in function.own]


def test_a_result_of_one_byte_is_in_w_and_any_other_has_bytes_of_its_own() -> None:
    text = """
    unsigned char c(void) { return 1; }
    bool b(void) { return 1; }
    char *p(void) { return 0; }
    unsigned int w(void) { return 1; }
    float f(void) { return 1; }
    struct one s(void) { struct one x; x.only = 1; return x; }
    void v(void) { }
    void main(void) { c(); b(); p(); w(); f(); s(); v(); }
    """
    functions = generated(text).functions
    assert {name for name, each in functions.items() if each.returns_w} == {"c", "b", "p"}
    results = {name: each.result for name, each in functions.items() if each.result is not None}
    assert {name: (each.name, each.size, each.kind) for name, each in results.items()} == {
        "w": ("w.result", 2, "result"),
        "f": ("f.result", 3, "result"),
        "s": ("s.result", 1, "result"),
    }
    assert (results["w"].type, isinstance(results["f"].type, FloatType)) == (U16, True)
    # an address may lead to a structure
    assert [name for name, each in results.items() if each.pinned] == ["s"]
    assert all(each.function == name for name, each in results.items())
    assert names(functions["w"])[:1] == ["w.result"]


@pytest.mark.parametrize(
    ("parameters", "arguments", "in_w"),
    [
        ("void", "", None),
        ("unsigned char a", "1", "a"),
        ("unsigned char a, unsigned char b", "1, 2", "b"),
        ("unsigned char a, unsigned int b", "1, 2", "a"),
        ("unsigned int a, char *b, long c", "1, 0, 2", "b"),
        ("unsigned int a, float b", "1, 2", None),
        ("unsigned char a, struct one b", "1, x", "a"),
        ("struct one a", "x", None),
    ],
)
def test_the_last_argument_of_one_byte_is_in_w(parameters: str, arguments: str, in_w: str | None) -> None:
    text = f"struct one x; void f({parameters}) {{ unsigned char n; n = 1; PORTB = n; }}\n"
    made = generated(f"{text}void main(void) {{ f({arguments}); }}").functions["f"]
    assert (made.w_parameter.name if made.w_parameter else None) == in_w
    named = [each.name for each in made.parameters]
    assert named == [each.split()[-1].strip("*") for each in parameters.split(",") if each != "void"]
    assert names(made)[: len(named) + 1] == [*named, "n"]


SHARED = """
unsigned int total;
static unsigned char count;
unsigned int both(unsigned char x, unsigned int y) {
  static unsigned char kept; unsigned int z;
  z = y * x; kept++; total = z; return z;
}
unsigned char mine(unsigned char x) { unsigned char n; n = x; return n + 1; }
void __interrupt() isr(void) { unsigned char m; m = mine(count); both(m, 2); T0IF = 0; }
void main(void) { unsigned int w; w = both(1, 2); total = w; GIE = 1; while (1); }
"""


def test_a_function_of_main_and_the_interrupt_has_two_copies() -> None:
    functions = generated(SHARED).functions
    assert {"main", "isr", "mine", "both", "both$isr"} <= functions.keys()
    assert not {"main$isr", "isr$isr", "mine$isr"} & functions.keys()
    one, two = functions["both"], functions["both$isr"]
    assert (one.place, one.size) == (two.place, two.size) and one.size > 0
    assert names(one) == [each.replace("$isr", "") for each in names(two)]
    assert not {id(each) for each in one.own} & {id(each) for each in two.own}
    assert one.result is not None and two.result is not None
    assert (one.result.name, two.result.name) == ("both.result", "both$isr.result")
    named = [
        {symbol for ins in each.instructions() if (symbol := getattr(ins.f, "symbol", None)) is not None}
        for each in (one, two)
    ]
    # each copy names its own variables, and the static ones of the program
    for symbols, each in zip(named, (one, two), strict=True):
        assert {symbol.name for symbol in symbols if symbol in each.own} >= {"x", "y", "z"}
        other = one if each is two else two
        assert not symbols & {*other.own}
    assert {symbol.name for symbol in named[0] & named[1]} == {"total", "kept"}


def test_the_interrupt_has_routines_of_its_own() -> None:
    functions = generated(SHARED).functions
    routines = [name for name in functions if name.startswith("__")]
    assert sorted(routines) == sorted([f"__mul_2_1_2{suffix}" for suffix in ("", "$isr")])
    one, two = (functions[name] for name in sorted(routines))
    assert one.size == two.size > 0 and not {*map(id, one.own)} & {*map(id, two.own)}
    calls = {name: functions[name].calls() for name in ("both", "both$isr")}
    assert calls == {"both": [routines[0]], "both$isr": [routines[1]]}


def test_expressions_too_deep_for_the_generator_are_named_by_their_place() -> None:
    text = "unsigned char a;\nvoid main(void) {\n  a = 1;\n\n  a = 2;\n}"
    with patch.object(program, "generate", side_effect=RecursionError), pytest.raises(InputError) as caught:
        compile_sources([Source(text, "main.c")], Options(dialect="xc8"))
    (found,) = caught.value.diagnostics
    assert (found.code, found.message) == (
        "nested-too-deeply",
        "something in the program is nested too deeply",
    )
    assert (found.location.line, found.location.column) == (2, 6)


def test_a_program_is_given_up_where_its_instructions_pass_the_limit() -> None:
    text = "unsigned char a;\nvoid f(void) { a = 1; }\nvoid main(void) { f(); }"
    size = sum(each.size for each in generated(text).functions.values())
    with patch.object(program, "INSTRUCTIONS", size):
        assert generated(text)
    with patch.object(program, "INSTRUCTIONS", size - 1), pytest.raises(InputError) as caught:
        compile_sources([Source(HEAD + text, "main.c")], Options(dialect="xc8"))
    (found,) = caught.value.diagnostics
    assert found.message == f"the program has {size} instructions up to here, the chip has 1024 words"
    assert (found.code, found.location.line) == ("program-too-large", 5)
