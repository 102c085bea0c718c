"""Random programs do the same when gcc and when servogen compiles them; the generator itself is sound."""

import re
from dataclasses import replace
from functools import cache

import pytest

from servogen.pic.image import Image
from servogen.pic.isa import encode
from tests.campaigns import sampled
from tests.compiler.random.compare import Outcome, compare, host, stores, target
from tests.compiler.random.generate import generate
from tests.compiler.random.host_c import PRELUDE
from tests.compiler.random.program import (
    BOOL,
    S8,
    S16,
    S24,
    U8,
    U16,
    U24,
    U32,
    Assign,
    ExprStmt,
    Member,
    MemberOf,
    Num,
    Out,
    Program,
    SetBit,
    Step,
    Struct,
    Update,
    Var,
    Variable,
)
from tests.compiler.random.shrink import candidates
from tests.compiler.random.target_c import DONE, TargetC
from tests.compiler.random.typing_rules import common, literal

BATCH, BATCHES = 10, 2


@pytest.mark.parametrize("number", sampled(range(BATCHES)))
def test_both_compilers_agree(number: int) -> None:
    """All results are equal, at every level, and most of the programs fit the chip.

    `python -m tests.compiler.random` compares any number of them.
    """
    first = 1_000_000 + number * BATCH
    programs = [
        replace(generate(seed, ("c2c", "xc8")[seed % 2]), level=("speed", "size", "none")[seed % 3])
        for seed in range(first, first + BATCH)
    ]
    outcomes = compare(programs)
    pairs = list(zip(programs, outcomes, strict=True))
    wrong = [report(program, outcome) for program, outcome in pairs if outcome.bad]
    assert not wrong, "\n".join(wrong)
    assert sum(outcome.kind == "same" for outcome in outcomes) >= 0.7 * len(programs)


def report(program: Program, outcome: Outcome) -> str:
    seed = 2 * program.seed + (program.dialect == "c2c")
    again = f"python -m tests.compiler.random --seeds 1 --first {seed} --level {program.level}"
    return f"{outcome.kind}: gcc {outcome.expected}, chip {outcome.got} {outcome.message}; {again}"


def test_a_seed_is_a_program() -> None:
    texts = [TargetC(generate(seed, "xc8")).text() for seed in (1, 2, 1)]
    assert texts[0] == texts[2] != texts[1]


def test_the_host_keeps_the_widths_of_the_chip() -> None:
    """The checksum of one value shows its bytes: (v << 1 | v >> 7 of the one before) ^ v."""
    empty = replace(generate(0, "xc8"), globals=(), structs=(), functions=())
    main = generate(0, "xc8").functions[-1]
    main.locals, main.body = (), (Out(Num(0x1234)),)
    (found,) = host([replace(empty, functions=(main,))])
    first = 0x34
    second = first << 1 & 0xFF ^ 0x12
    assert found == (second, first + second & 0xFF, 2)


@pytest.mark.parametrize(
    ("left", "right", "xc8", "c2c"),
    [
        (U8, U8, S16, U16), (U8, S8, S16, U16), (S8, S8, S16, S16), (U16, S16, U16, U16),
        (U16, S24, S24, S24), (U24, S16, U24, U24), (U32, S24, U32, U32), (BOOL, BOOL, S16, U16),
    ],
)  # fmt: skip
def test_the_usual_arithmetic_conversions(left: object, right: object, xc8: object, c2c: object) -> None:
    assert common(left, right, "xc8") == common(right, left, "xc8") == xc8  # type: ignore[arg-type]
    assert common(left, right, "c2c") == common(right, left, "c2c") == c2c  # type: ignore[arg-type]


def test_literals_have_the_first_type_that_holds_them() -> None:
    assert literal(Num(32767), "xc8") == S16
    assert literal(Num(32768), "xc8").name == "S32"
    assert literal(Num(32768, base=16), "xc8") == U16
    assert literal(Num(32768, "U"), "xc8") == U16
    assert literal(Num(32768), "c2c") == U16


def test_what_the_shrinker_makes_is_defined_and_smaller() -> None:
    for seed in range(6):
        program = generate(seed, "xc8")
        smaller = [each for _, each in zip(range(12), candidates(program), strict=False)]
        assert all(size(each) < size(program) for each in smaller)


def size(program: Program) -> int:
    parts = sum(len(repr((each.locals, each.body))) for each in program.functions)
    return len(repr(program)) + parts + 100 * program.interrupt


def test_the_host_spells_every_type_of_the_program() -> None:
    assert all(
        f"#define {name}(x)" in PRELUDE for name in ("U8", "S8", "U16", "S16", "U24", "S24", "U32", "S32")
    )


WATCHED = 0x4B


def test_the_watcher_sees_every_store() -> None:
    """Direct and through FSR, one that changes nothing too; not reads, nor what comes before the start."""
    words = [
        encode("MOVWF", f=WATCHED), encode("CLRF", f=DONE), encode("MOVLW", k=5),
        encode("MOVWF", f=WATCHED),  # 5
        encode("MOVLW", k=WATCHED), encode("MOVWF", f=4), encode("INCF", f=0, d=1),  # 6
        encode("MOVF", f=WATCHED, d=1),  # 6: read and written back
        encode("BSF", f=WATCHED, b=0),  # 7
        encode("BTFSC", f=WATCHED, b=0), encode("MOVF", f=WATCHED, d=0), encode("MOVWF", f=WATCHED - 1),
        encode("DECFSZ", f=WATCHED, d=1),  # 6
        encode("GOTO", k=13),
    ]  # fmt: skip
    seen = stores(Image(dict(enumerate(words))), {WATCHED}, 40)
    assert seen == tuple(number for value in (5, 6, 6, 7, 6) for number in (WATCHED, value))
    assert stores(Image(dict(enumerate(words))), {WATCHED - 1}, 40) == (WATCHED - 1, 7)


def test_the_host_logs_every_store() -> None:
    fields = Struct("W1", (Member("a", U8, 3), Member("b", U8, 5), Member("c", U8)))
    byte = Variable("w0", U8, "global", where="watched @ 0x4B")
    parts = Variable("w1", fields, "global", where="watched @ 0x49")
    a, b, c = (MemberOf(Var(parts), each) for each in fields.members)
    body = (
        ExprStmt(Assign(Var(byte), Num(3))), ExprStmt(Update("|", Var(byte), Num(4))),
        ExprStmt(Step("++", Var(byte), True)), SetBit("clear", Var(byte), 3), ExprStmt(Assign(b, Num(1))),
        ExprStmt(Assign(a, Num(2))), ExprStmt(Assign(c, Num(9))),
    )  # fmt: skip
    main = generate(0, "xc8").functions[-1]
    main.locals, main.body = (), body
    program = replace(generate(0, "xc8"), globals=(byte, parts), structs=(fields,), functions=(main,))
    program = replace(program, files="one", interrupt=False)
    expected = (0, 0, 0, 75, 3, 75, 7, 75, 8, 75, 0, 73, 8, 73, 10, 74, 9)
    (found,) = host([program])
    assert found == expected
    assert target(program, found).got == expected


def test_a_store_too_many_is_a_difference() -> None:
    byte = Variable("w0", U8, "global", where="watched @ 0x4B")
    main = generate(0, "xc8").functions[-1]
    main.locals, main.body = (), (ExprStmt(Assign(Var(byte), Num(3))),)
    program = replace(generate(0, "xc8"), globals=(byte,), structs=(), functions=(main,), interrupt=False)
    assert target(program, (0, 0, 0, WATCHED, 3)).kind == "same"
    assert target(program, (0, 0, 0)).kind == "different"
    assert target(program, (0, 0, 0, WATCHED, 0, WATCHED, 3)).kind == "different"


@cache
def random_texts() -> list[str]:
    return [TargetC(generate(seed, ("c2c", "xc8")[seed % 2])).text() for seed in range(400)]


@pytest.mark.parametrize(
    ("shape", "pattern"),
    [
        (
            "members of constant structures by pointer",
            r"const struct \w+ \*(?:const )?([qpz]\d).*\b\1->m\d\[",
        ),
        ("fields of constant arrays by index", r"\bc\d\[[^\]\d][^\]]*\]\.\w"),
        ("bit-fields of constant objects", r"struct \w+ \{[^}]*: \d.*const struct.*\bc\d(\[[^\]]*\])?\.f\d"),
        ("pointers to member arrays", r"= &?\w+(\[\d\])?\.m\d(\[\d\])?;"),
        ("watched volatile variables", r"volatile unsigned char w\d @"),
        ("watched volatile structures", r"volatile struct W\d w\d @"),
        ("constant pointers", r"\*const z\d = &?\w+"),
        ("objects that only constant pointers name", r"\bh0\b(?:(?!\bh0\b).)*= &?h0;(?!.*\bh0\b)"),
        ("loops that never end, in helpers", r"f\d\([^)]*\) \{(?:(?!\n\}).)*if \(never\) \{\s*while \(1\)"),
        ("functions that never return", r"if \(never\) stop\(\)"),
        ("extern before the definition", r"extern [^;]*\bg0;.*\n[^e][^;]*\bg0\b"),
        ("the definitions in the first file", r"\bg0( = [^;]*)?;.*next file.*extern [^;]*\bg0;"),
        ("the definitions in the last file", r"void main.*next file.*\bg0( = [^;]*)?;"),
    ],
)
def test_the_generator_reaches(shape: str, pattern: str) -> None:
    found = sum(re.search(pattern, text, re.S) is not None for text in random_texts())
    assert found >= 2, shape
