"""The longest way through a program from one address to others, counted from its words.

In: program words, functions, a start and ends. Out: cycles, or None where no bound is known. Instructions are
followed with the values that are known, so that a loop whose counter begins at a constant is gone through as
often as it will be; where a value is not known, both ways of a skip are. Costs as in DS35007 table 7-2.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache

from servogen.pic.device import RAM_FIRST, RAM_LAST
from servogen.pic.isa import decode
from servogen.pic.listing import ListedFunction
from servogen.units import Cycles

MOST_STATES = 200_000
"""States that are followed before the search is given up."""

ERASED = 0x3FFF
INDF, PCL, STATUS, FSR = 0, 2, 3, 4
C, Z = 0, 2
_BANK_1 = 0x80


@dataclass(frozen=True, slots=True)
class _State:
    """Where the chip is and what is known: `known` holds (place, value), sorted; places are RAM addresses,
    FSR, "W", "C" and "Z".
    """

    at: int
    stack: tuple[int, ...] = ()
    known: tuple[tuple[str, int], ...] = ()


_Step = tuple[int, _State]


class _Unbounded(Exception):
    """Something whose time is not known."""


@dataclass(frozen=True, slots=True)
class _Word:
    """An instruction and what of it is asked again and again: what it reads and where its result goes."""

    name: str
    f: int
    b: int
    k: int
    skips: bool
    flags: str
    has_f: bool
    writes_f: bool
    writes_w: bool


@cache
def _word(number: int) -> _Word:
    """Raises _Unbounded for a word that no data sheet defines."""
    word = decode(number)
    if word is None:
        raise _Unbounded
    row, operands = word.instruction, word.instruction.operands
    name = row.mnemonic
    to_f = "f" in operands and (bool(word.d) if "d" in operands else name in ("MOVWF", "CLRF", "BCF", "BSF"))
    to_w = not to_f and operands in ("fd", "k", "") and name not in ("NOP", "CLRWDT", "TRIS", "OPTION")
    return _Word(name, word.f, word.b, word.k, row.skips, row.flags, "f" in operands, to_f, to_w)


def longest(
    program: Mapping[int, int],
    functions: Collection[ListedFunction],
    start: int,
    ends: Collection[int],
    without: Collection[int] = (),
) -> Cycles | None:
    """The most cycles from `start` to the first of `ends`; ways through `without` do not count.

    None where a loop has no known bound, no way leads to an end, or a computed jump leads anywhere but into
    a table of RETLW. A return beyond the function that `start` is in goes to each of its callers.
    """
    walk = _Walk(program, tuple(functions), frozenset(ends), frozenset(without))
    try:
        found = walk.longest(_State(start))
    except _Unbounded:
        return None
    return None if found is None else Cycles(found)


@dataclass(slots=True)
class _Walk:
    program: Mapping[int, int]
    functions: tuple[ListedFunction, ...]
    ends: frozenset[int]
    without: frozenset[int]
    done: dict[_State, int | None] = field(default_factory=dict)

    def longest(self, start: _State) -> int | None:
        """Depth first; a state that comes back to itself is a loop without a bound."""
        following: dict[_State, tuple[_Step, ...]] = {}
        stack: list[_State] = [start]
        while stack:
            state = stack[-1]
            if state in self.done:
                stack.pop()
                continue
            if state not in following:
                if len(following) > MOST_STATES:
                    raise _Unbounded
                following[state] = tuple(self._steps(state))
                for _, after in following[state]:
                    if after.at in self.ends or after in self.done:
                        continue
                    if after in following:
                        raise _Unbounded
                    stack.append(after)
                continue
            self.done[state] = self._most(following[state])
            stack.pop()
        return self.done[start]

    def _most(self, steps: tuple[_Step, ...]) -> int | None:
        ways = [
            cycles + most
            for cycles, after in steps
            for most in (0 if after.at in self.ends else self.done[after],)
            if most is not None
        ]
        return max(ways, default=None)

    def _steps(self, state: _State) -> Iterator[_Step]:
        if state.at in self.without:
            return
        word = _word(self.program.get(state.at, ERASED))
        name = word.name
        known = dict(state.known)
        if name == "GOTO":
            yield 2, _State(word.k, state.stack, state.known)
        elif name == "CALL":
            yield 2, _State(word.k, (*state.stack, state.at + 1), state.known)
        elif name in ("RETURN", "RETLW"):
            if name == "RETLW":
                known["W"] = word.k
            for back, stack in self._returns(state):
                yield 2, _State(back, stack, _sorted(known))
        elif name in ("SLEEP", "RETFIE"):
            raise _Unbounded
        elif word.f == PCL and word.writes_f:
            self._check_table(state.at + 1)
            known.pop("W", None)
            for back, stack in self._returns(state):
                yield 2 + 2, _State(back, stack, _sorted(known))
        elif word.skips:
            taken = _skipped(word, known)
            after = _sorted(known)
            if taken is not True:
                yield 1, _State(state.at + 1, state.stack, after)
            if taken is not False:
                yield 2, _State(state.at + 2, state.stack, after)
        else:
            _execute(word, known)
            yield 1, _State(state.at + 1, state.stack, _sorted(known))

    def _check_table(self, first: int) -> None:
        """A computed jump goes to a RETLW: what follows it must be nothing else, up to the function's end."""
        end = next((each.end for each in self.functions if each.start <= first < each.end), first)
        rows = [_word(self.program.get(at, ERASED)) for at in range(first, end)]
        if not rows or any(row.name != "RETLW" for row in rows):
            raise _Unbounded

    def _returns(self, state: _State) -> Iterator[tuple[int, tuple[int, ...]]]:
        if state.stack:
            yield state.stack[-1], state.stack[:-1]
            return
        for back in self._callers(state.at, set()):
            yield back, ()

    def _callers(self, at: int, seen: set[str]) -> Iterator[int]:
        """Where a return from the function that `at` is in may lead; who jumps to it returns for it."""
        function = next((each for each in self.functions if each.start <= at < each.end), None)
        if function is None:
            raise _Unbounded
        if function.name in seen:
            return
        seen.add(function.name)
        for address, number in self.program.items():
            word = _word(number)
            if word.k != function.start or function.start <= address < function.end:
                continue
            if word.name == "CALL":
                yield address + 1
            elif word.name == "GOTO":
                yield from self._callers(address, seen)


def _sorted(known: dict[str, int]) -> tuple[tuple[str, int], ...]:
    return tuple(sorted(known.items()))


def _place(f: int, known: dict[str, int]) -> str | None:
    """The name of what an operand f addresses; None for what is not followed."""
    if f == INDF:
        if "FSR" not in known:
            return None
        f = known["FSR"] & ~_BANK_1
    if f == FSR:
        return "FSR"
    return f"{f:02X}" if RAM_FIRST <= f <= RAM_LAST else None


def _skipped(word: _Word, known: dict[str, int]) -> bool | None:
    """Whether the next instruction is skipped; None where that is not known."""
    name = word.name
    if name in ("BTFSC", "BTFSS"):
        if word.f == STATUS:
            bit = known.get({C: "C", Z: "Z"}.get(word.b, ""))
        else:
            value = known.get(_place(word.f, known) or "")
            bit = None if value is None else value >> word.b & 1
        return None if bit is None else bit == (name == "BTFSS")
    _execute(word, known)
    result = known.get("W" if word.writes_w else _place(word.f, known) or "")
    return None if result is None else result == 0


def _execute(word: _Word, known: dict[str, int]) -> None:
    """Changes what is known as the instruction does."""
    name = word.name
    place = _place(word.f, known) if word.has_f else None
    if word.f == STATUS and word.writes_f:
        flag = {C: "C", Z: "Z"}.get(word.b) if name in ("BCF", "BSF") else None
        if name not in ("BCF", "BSF"):
            known.pop("C", None)
            known.pop("Z", None)
        elif flag:
            known[flag] = int(name == "BSF")
        return
    result, carry = _result(word, known.get("W"), known.get(place or ""), known.get("C"))
    for flag, letter in (("C", "C"), ("Z", "Z")):
        if letter in word.flags:
            known.pop(flag, None)
    if "Z" in word.flags and result is not None:
        known["Z"] = int(result == 0)
    if "C" in word.flags and carry is not None:
        known["C"] = carry
    if word.writes_f:
        if word.f == INDF and place is None and "FSR" not in known:
            for other in [key for key in known if key not in ("W", "C", "Z")]:
                del known[other]  # it may be any of them
        target = place
    else:
        target = "W" if word.writes_w else None
    if target is not None:
        known.pop(target, None)
        if result is not None:
            known[target] = result


def _result(word: _Word, w: int | None, f: int | None, carry: int | None) -> tuple[int | None, int | None]:
    """(result, carry) of an instruction, each None where it is not known."""
    name = word.name
    if name in ("CLRF", "CLRW"):
        return 0, None
    if name == "MOVLW":
        return word.k, None
    if name == "MOVWF":
        return w, None
    if f is not None and name in _OF_ONE:
        return _OF_ONE[name](f, word.b) & 0xFF, None
    if f is not None and name == "RLF":
        return None if carry is None else (f << 1 | carry) & 0xFF, f >> 7
    if f is not None and name == "RRF":
        return None if carry is None else f >> 1 | carry << 7, f & 1
    other = word.k if name.endswith("LW") else f
    if w is None or other is None:
        return None, None
    match name[:3]:
        case "ADD":
            return other + w & 0xFF, int(other + w > 0xFF)
        case "SUB":
            return other - w & 0xFF, int(other >= w)
        case "AND":
            return other & w, None
        case "IOR":
            return other | w, None
        case "XOR":
            return other ^ w, None
    return None, None


_OF_ONE = {
    "MOVF": lambda f, b: f,
    "INCF": lambda f, b: f + 1,
    "INCFSZ": lambda f, b: f + 1,
    "DECF": lambda f, b: f - 1,
    "DECFSZ": lambda f, b: f - 1,
    "COMF": lambda f, b: ~f,
    "SWAPF": lambda f, b: f << 4 | f >> 4,
    "BSF": lambda f, b: f | 1 << b,
    "BCF": lambda f, b: f & ~(1 << b),
}
