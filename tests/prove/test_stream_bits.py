"""Bit-vectors do what Python's integers modulo 2^width do, whether the solver knows a number or not."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from types import SimpleNamespace

import pytest

from servogen.errors import ToolError
from servogen.prove.stream import bits as module
from servogen.prove.stream.bits import (
    FALSE,
    TRUE,
    Bits,
    GivenUp,
    Solver,
    Truth,
    all_of,
    as_bit,
    byte,
    choose,
    choose_truth,
    unknown,
)

WIDTH = 3
NUMBERS = range(1 << WIDTH)
MASK = (1 << WIDTH) - 1

Operation = Callable[[Bits, Bits], Bits]
Statement = Callable[[Bits, Bits], Truth]


def quotient(x: int, y: int) -> int:
    """The quotient as SMT-LIB's bvudiv defines it: all ones where the divisor is 0."""
    return x // y if y else MASK


def signed(x: int) -> int:
    """The number that three bits are in two's complement, in five bits."""
    return (x if x < 4 else x - 8) & 0x1F


OPERATIONS: dict[str, tuple[Operation, int, Callable[[int, int], int]]] = {
    "+": (lambda x, y: x + y, 3, lambda x, y: (x + y) % 8),
    "-": (lambda x, y: x - y, 3, lambda x, y: (x - y) % 8),
    "*": (lambda x, y: x * y, 3, lambda x, y: x * y % 8),
    "//": (lambda x, y: x // y, 3, quotient),
    "&": (lambda x, y: x & y, 3, lambda x, y: x & y),
    "|": (lambda x, y: x | y, 3, lambda x, y: x | y),
    "^": (lambda x, y: x ^ y, 3, lambda x, y: x ^ y),
    "~": (lambda x, y: ~x, 3, lambda x, y: 7 - x),
    "above": (lambda x, y: x.concat(y), 6, lambda x, y: 8 * x + y),
    "above's upper bits": (lambda x, y: x.concat(y)[3:], 3, lambda x, y: x),
    "above's lower bits": (lambda x, y: x.concat(y)[:3], 3, lambda x, y: y),
    "above's middle": (lambda x, y: x.concat(y)[1:5], 4, lambda x, y: (8 * x + y) // 2 % 16),
    "above's bits of the lower part": (lambda x, y: x.concat(y)[1:3], 2, lambda x, y: y // 2),
    "above's bits of the upper part": (lambda x, y: x.concat(y)[3:5], 2, lambda x, y: x % 4),
    "above, masked": (lambda x, y: x.concat(y) & 0b101101, 6, lambda x, y: (8 * x + y) & 0b101101),
    "above and a number": (lambda x, y: x.concat(y) + 9, 6, lambda x, y: (8 * x + y + 9) % 64),
    "choose": (lambda x, y: choose(x.less(y), x, y), 3, min),
    "as_bit": (lambda x, y: as_bit(x.less(y)), 1, lambda x, y: int(x < y)),
    "signed": (lambda x, y: x.sign_extend(5), 5, lambda x, y: signed(x)),
    "wide": (lambda x, y: x.zero_extend(5), 5, lambda x, y: x),
    "as wide": (lambda x, y: x.zero_extend(3), 3, lambda x, y: x),
    "the whole": (lambda x, y: x[0:3], 3, lambda x, y: x),
    "all above 0": (lambda x, y: x[1:], 2, lambda x, y: x // 2),
    "one bit": (lambda x, y: x[1:2], 1, lambda x, y: x // 2 % 2),
    **{
        f">> {n}": (lambda x, y, n=n: x >> n, 3, lambda x, y, n=n: x >> n)  # type: ignore[misc]
        for n in range(5)
    },
    **{
        f"bit {n} = {value}": (
            lambda x, y, n=n, value=value: x.with_bit(n, value),  # type: ignore[misc]
            3,
            lambda x, y, n=n, value=value: x & ~(1 << n) | value << n,  # type: ignore[misc]
        )
        for n in range(3)
        for value in (0, 1)
    },
}

STATEMENTS: dict[str, tuple[Statement, Callable[[int, int], bool]]] = {
    "equals": (lambda x, y: x.equals(y), lambda x, y: x == y),
    "less": (lambda x, y: x.less(y), lambda x, y: x < y),
    "bit 0": (lambda x, y: x.bit(0), lambda x, y: x % 2 == 1),
    "bit 2": (lambda x, y: x.bit(2), lambda x, y: x >= 4),
    "not": (lambda x, y: ~x.less(y), lambda x, y: x >= y),
    "and": (lambda x, y: x.less(y) & y.bit(0), lambda x, y: x < y and y % 2 == 1),
    "or": (lambda x, y: x.less(y) | y.bit(0), lambda x, y: x < y or y % 2 == 1),
    "all": (
        lambda x, y: all_of([x.bit(0), y.bit(1), x.less(y)]),
        lambda x, y: x % 2 == 1 and y & 2 != 0 and x < y,
    ),
    "all of none": (lambda x, y: all_of([]), lambda x, y: True),
    "choose_truth": (
        lambda x, y: choose_truth(x.bit(0), y.bit(1), x.less(y)),
        lambda x, y: y & 2 != 0 if x % 2 else x < y,
    ),
}


def needs_the_solver() -> None:
    pytest.importorskip("bitwuzla", reason="the solver is not installed")


@pytest.mark.parametrize("name", OPERATIONS)
def test_numbers_give_the_numbers_of_arithmetic(name: str) -> None:
    operation, width, wanted = OPERATIONS[name]
    for x, y in itertools.product(NUMBERS, NUMBERS):
        result = operation(Bits(WIDTH, x), Bits(WIDTH, y))
        assert (result.width, result.value) == (width, wanted(x, y)), (x, y)


@pytest.mark.parametrize("name", STATEMENTS)
def test_statements_about_numbers_are_known(name: str) -> None:
    statement, wanted = STATEMENTS[name]
    for x, y in itertools.product(NUMBERS, NUMBERS):
        assert statement(Bits(WIDTH, x), Bits(WIDTH, y)).known is wanted(x, y), (x, y)


@pytest.mark.parametrize("kind", ["both unknown", "y known", "x known"])
def test_terms_give_the_same_for_every_value(kind: str) -> None:
    """All results at once: one model of the solver for each pair of values."""
    needs_the_solver()
    solver, x, y = Solver(), unknown("x", WIDTH), unknown("y", WIDTH)

    def results(left: Bits, right: Bits) -> dict[str, Bits]:
        statements = {name: as_bit(statement(left, right)) for name, (statement, _) in STATEMENTS.items()}
        operations = {name: operation(left, right) for name, (operation, _, _) in OPERATIONS.items()}
        return statements | operations

    of_terms = results(x, y)
    for a, b in itertools.product(NUMBERS, NUMBERS):
        if kind == "y known":
            of_terms = results(x, Bits(WIDTH, b))
        elif kind == "x known":
            of_terms = results(Bits(WIDTH, a), y)
        assert solver.possible(x.equals(a) & y.equals(b))
        values = {name: (bits.width, solver.example(bits)) for name, bits in of_terms.items()}
        wanted = {name: (1, int(right(a, b))) for name, (_, right) in STATEMENTS.items()}
        wanted |= {name: (width, right(a, b)) for name, (_, width, right) in OPERATIONS.items()}
        assert values == wanted, (a, b)


def test_a_plain_number_is_an_operand_modulo_the_width() -> None:
    needs_the_solver()
    solver, x = Solver(), unknown("x", WIDTH)
    for number in range(9):
        pairs = [
            (x + number, lambda a, n=number: (a + n) % 8),
            (x - number, lambda a, n=number: (a - n) % 8),
            (x * number, lambda a, n=number: a * n % 8),
            (x & number, lambda a, n=number: a & n),
            (x | number, lambda a, n=number: (a | n) % 8),
            (x ^ number, lambda a, n=number: (a ^ n) % 8),
        ]
        for a in NUMBERS:
            assert solver.possible(x.equals(a))
            for bits, right in pairs:
                assert solver.example(bits) == right(a), (a, number)


def test_a_number_is_taken_modulo_its_width() -> None:
    assert [Bits(4, n).value for n in (15, 16, 17, -1)] == [15, 0, 1, 15]
    assert byte(0x1FE).value == 0xFE and byte(3).width == 8
    assert Bits(4, 1).equals(17).known is True and Bits(4, 1).equals(16).known is False


def test_what_changes_nothing_makes_no_term() -> None:
    needs_the_solver()
    x = unknown("x", WIDTH)
    assert x + 0 is x and x - 0 is x and x | 0 is x and x ^ 0 is x and x & 7 is x
    assert x[0:3] is x and x.zero_extend(3) is x and x >> 0 is x
    assert (x & 0).value == 0 and (Bits(WIDTH, 0) & x).value == 0 and (x >> 3).value == 0
    assert (x & 6).value is None and (x + 1).value is None and (x * 0).value is None


def test_parts_that_are_known_stay_known() -> None:
    needs_the_solver()
    x = unknown("x", 4)
    pair = x.concat(Bits(4, 9))
    assert pair[0:4].value == 9 and pair[0:2].value == 1 and pair[4:8] is x
    # 9 + 6 = 15 fits the lower four bits; 9 + 7 = 16 does not.
    assert (pair + 6)[0:4].value == 15 and (pair + 6)[4:8] is x
    assert (pair + 7)[0:4].value is None
    assert (pair & 0x0A)[0:4].value == 8 and (pair & 0x0A)[4:8].value == 0
    assert (pair & 0xF1)[4:8] is x and (pair & 0xF1)[0:4].value == 1
    assert pair.bit(0).known is True and pair.bit(1).known is False and pair.bit(4).known is None
    assert x.with_bit(0, 1).bit(0).known is True and x.with_bit(3, 0).bit(3).known is False
    assert x.with_bit(2, 1).bit(2).known is True and x.with_bit(2, 1)[0:2].value is None


def test_a_choice_that_is_none_is_made_at_once() -> None:
    needs_the_solver()
    x, y, truth = unknown("x"), unknown("y"), unknown("t", 1).bit(0)
    assert choose(TRUE, x, y) is x and choose(FALSE, x, y) is y
    assert choose(truth, x, x) is x
    assert choose(truth, byte(5), byte(5)).value == 5
    assert choose(truth, byte(5), byte(6)).value is None
    assert choose(truth, x, Bits(8, None, x.term)) is x
    assert choose(truth, x, y).value is None and choose(truth, x, byte(0)).value is None
    assert choose_truth(truth, TRUE, TRUE) is TRUE
    assert choose_truth(truth, TRUE, FALSE).known is None


def test_truths_that_are_known_decide_without_terms() -> None:
    needs_the_solver()
    truth = unknown("t", 1).bit(0)
    assert (TRUE & truth) is truth and (truth & TRUE) is truth and (truth & truth) is truth
    assert (FALSE & truth).known is False and (truth & FALSE).known is False
    assert (TRUE | truth).known is True and (truth | TRUE).known is True
    assert (truth | FALSE).known is None and (FALSE | truth).known is None
    assert (~TRUE).known is False and (~FALSE).known is True and (~truth).known is None
    x = unknown("x")
    assert x.equals(x).known is True and x.equals(unknown("x")).known is None


def test_a_truth_that_is_known_has_the_term_of_its_value() -> None:
    assert [str(Truth(known).term) for known in (True, False)] == ["true", "false"]


def test_the_solver_answers_and_counts_its_questions() -> None:
    needs_the_solver()
    solver, x = Solver(), unknown("x")
    assert solver.questions == 0
    assert solver.possible(TRUE) and not solver.possible(FALSE)
    assert solver.questions == 0, "a truth that is known is not asked about"
    assert solver.possible(x.less(1))
    assert solver.example(x) == 0 and solver.example(byte(7)) == 7
    assert not solver.possible(x.less(0)) and not solver.possible(x.equals(3) & x.less(3))
    assert solver.questions == 3
    assert solver.possible(x.equals(200))
    assert solver.example(x) == 200 and solver.example(x + 100) == 44
    solver.forget()
    assert solver.questions == 4


def test_the_solver_keeps_its_examples_and_has_twenty_minutes(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: dict[str, object] = {}
    library = SimpleNamespace(
        Options=lambda: SimpleNamespace(set=asked.__setitem__),
        Option=SimpleNamespace(PRODUCE_MODELS="examples", TIME_LIMIT_PER="limit in ms"),
        Bitwuzla=lambda manager, options: None,
        Result=SimpleNamespace(SAT=1, UNSAT=0),
    )
    monkeypatch.setattr(module, "solver_library", lambda: library)
    monkeypatch.setattr(module, "term_manager", lambda: None)
    Solver()
    assert asked == {"examples": True, "limit in ms": 20 * 60 * 1000}


def test_an_answer_that_does_not_come_in_time_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    needs_the_solver()
    import bitwuzla

    solver = Solver()

    class Slow:
        def check_sat(self, statement: object) -> object:
            return bitwuzla.Result.UNKNOWN

    monkeypatch.setattr(solver, "solver", Slow())
    with pytest.raises(GivenUp):
        solver.possible(unknown("x").equals(1))


def test_a_proof_for_any_line_names_the_package_that_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "find_spec", lambda name: None)
    with pytest.raises(ToolError) as error:
        module.solver_library.__wrapped__()
    assert error.value.message == "the proof for any line needs the solver bitwuzla"
    assert error.value.hint == "pip install 'servogen[solver]'"
