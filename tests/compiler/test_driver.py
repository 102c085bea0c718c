"""The stages of a compilation: which one ends it, what is kept of each, which functions remain."""

from __future__ import annotations

from unittest.mock import patch

import pytest

from servogen.compiler import Compilation, Options, Source, compile_sources, driver
from servogen.compiler.ast.nodes import Symbol
from servogen.compiler.ast.types import U8
from servogen.compiler.codegen.startup import RESET
from servogen.compiler.ir.function import Function
from servogen.errors import InputError
from tests.compiler.ir.assembly import function


def compiled(text: str, **options: object) -> Compilation:
    return compile_sources([Source(f"#include <xc.h>\n{text}")], Options(dialect="xc8", **options))  # type: ignore[arg-type]


CHAIN = "".join(f"void f{at}(void) {{ f{at + 1}(); PORTB = {at}; }}\n" for at in range(8, 0, -1))


@pytest.mark.parametrize(
    ("text", "next_stage", "message"),
    [
        ("void main(void) { x = 1; }", "call_graph", "'x' is not declared"),
        ("void f(void) { f(); } void main(void) { f(); }", "check_program", "recursion is not possible"),
        ('void main(void) { asm("movlw lost"); }', "arrange", "assembly: 'lost' is not a number"),
        (
            f"void f9(void) {{ PORTB = 9; }}\n{CHAIN}void main(void) {{ f1(); }}",
            "expand_delays",
            "calls are nested 9 levels deep",
        ),
    ],
)
def test_an_error_ends_the_compilation_behind_its_stage(text: str, next_stage: str, message: str) -> None:
    with patch.object(driver, next_stage) as behind, pytest.raises(InputError) as caught:
        compiled(text)
    assert not behind.called
    errors = [each.message for each in caught.value.diagnostics if each.severity == "error"]
    assert len(errors) == 1 and errors[0].startswith(message)


def test_a_stage_that_nests_too_deeply_is_reported_at_the_first_file() -> None:
    sources = [Source("void main(void) { }", name) for name in ("one.c", "two.c")]
    with patch.object(driver, "analyse", side_effect=RecursionError), pytest.raises(InputError) as caught:
        compile_sources(sources)
    (found,) = caught.value.diagnostics
    assert (found.code, found.location.file) == ("nested-too-deeply", "one.c")


SHARED = "PORTB = a; a = b + c; b = c ^ 5; c = a + 3; "
PROGRAM = f"""
unsigned char a, b, c;
void one(void) {{ {SHARED} PORTB = 1; {SHARED} _delay(9); }}
void two(void) {{ {SHARED} TRISB = 0; {SHARED} PORTA = 2; }}
void main(void) {{ one(); two(); while (1); }}
"""


def test_each_stage_shows_what_it_has_made() -> None:
    kept = {
        name: compiled(PROGRAM, optimise="size", dump_ir=name).ir
        for name in ("codegen", "startup", "bank-select", "outlining", "delays")
    }
    assert ["__start:" in text for text in kept.values()] == [False, True, True, True, True]
    assert ["BSF STATUS" in text for text in kept.values()] == [False, False, True, True, True]
    assert ["__shared" in text for text in kept.values()] == [False, False, False, True, True]
    assert ["delay 9 cycles" in text for text in kept.values()] == [True, True, True, True, False]
    named = [line.partition(":")[0] for line in kept["codegen"].splitlines() if line[:1].isalpha()]
    assert named == ["main", "one", "two"]


def test_what_a_pass_has_saved_is_the_difference_in_words() -> None:
    plain, small = compiled(PROGRAM), compiled(PROGRAM, optimise="size")
    assert small.saved["outlining"] == plain.words - small.words > 0
    assert "outlining" not in plain.saved
    assert compiled(PROGRAM, optimise="none").saved == {}


def test_a_call_that_is_never_executed_leaves_no_function() -> None:
    text = "void f(void) { PORTB = 1; }\nvoid main(void) { if (0) f(); while (1); }"
    assert [each.name for each in compiled(text).listing.functions] == ["main"]


def program() -> dict[str, Function]:
    texts = {
        "main": "CALL a; GOTO b; x: GOTO x", "a": "CALL c; CALL lost; RETURN", "b": "RETURN",
        "c": "CALL a; RETURN", "d": "CALL e; RETURN", "e": "RETURN",
    }  # fmt: skip
    return {name: function(text, name=name) for name, text in texts.items()}


def test_what_a_root_reaches() -> None:
    """Through calls and jumps, also in a circle; what is no function of the program does not count."""
    found = program()
    assert driver.functions_called(found, ["main"]) == {"main", "a", "b", "c"}
    assert driver.functions_called(found, ["b", "d"]) == {"b", "d", "e"}
    assert driver.functions_called(found, []) == set()


def test_what_nothing_reaches_is_dropped_except_the_reset_vector_and_the_data_of_tables() -> None:
    found = program() | {RESET: function("GOTO main", name=RESET)}
    for name in ("read", "pointed"):
        index = Symbol("index", U8, "temp", function=name)
        table = Symbol("c", U8, "flash")
        found[name] = Function(name, own=[index], table=table, w_parameter=index)
    found["b"] = function("CALL read; RETURN", name="b")
    driver.drop_unused(found, ["main"])
    assert list(found) == ["main", "a", "b", "c", RESET, "read", "pointed"]
    # a table whose address alone is used needs no index
    assert [(each.w_parameter is None, each.own == []) for each in (found["read"], found["pointed"])] == [
        (False, False),
        (True, True),
    ]
    assert found["main"].size == 3
