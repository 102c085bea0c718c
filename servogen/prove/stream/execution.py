"""Symbolic execution of a program's words: every path between two places, for every value of every byte.

In: words, a state in which bytes may be unknown, and where to stop. Out: the states there, as terms over the
bytes of the first one. Where an unknown bit decides, every outcome that the solver finds possible is
followed; states that meet again at an address become one, whose bytes depend on the path.
"""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import count
from typing import NamedTuple

from servogen.pic.device import BOTH_BANKS, EEPROM_BYTES, RAM_FIRST, RAM_LAST, addresses, registers
from servogen.pic.isa import encode
from servogen.pic.known_values import NOT_FOLLOWED, DecodedWord, Undefined, word_of
from servogen.pic.semantics import flags, result
from servogen.prove.stream.bits import (
    TERMS,
    TRUE,
    Bits,
    Solver,
    Truth,
    as_bit,
    byte,
    choose,
    choose_truth,
    unknown,
)
from servogen.simulator.layout import ROWS

INDF, TMR0, PCL, STATUS, FSR, PCLATH, INTCON = addresses(
    "INDF", "TMR0", "PCL", "STATUS", "FSR", "PCLATH", "INTCON"
)
PORTA, PORTB, OPTION, EEDATA, EEADR, EECON1, EECON2 = (
    registers()[name].address
    for name in ("PORTA", "PORTB", "OPTION_REG", "EEDATA", "EEADR", "EECON1", "EECON2")
)
BANK_1 = 0x80
EEPROM = 0x100
"""The place of the EEPROM's first byte."""
IN_BOTH_BANKS = tuple(address for address in addresses(*BOTH_BANKS) if address != INDF)
KEPT = frozenset(register.address for row in ROWS for register in row.registers)
"""The registers that a program can read."""
VOLATILE = frozenset(
    register.address for row in ROWS if row.timed or row.name == "PINS" for register in row.registers
)
"""Those of them that time and the pins change."""
RD, WR, WREN, EEIF, GIE = 0, 1, 2, 4, 7
RP0 = 5
MAX_STEPS = 60_000  # between two stops of main; against a loop that the words never leave
RETURNED = -1
"""The address to which a subroutine returns that is executed by itself."""
UNLOCK = tuple(
    encode(name, **operands)
    for name, operands in (
        ("MOVLW", {"k": 0x55}),
        ("MOVWF", {"f": EECON2 & 0x7F}),
        ("MOVLW", {"k": 0xAA}),
        ("MOVWF", {"f": EECON2 & 0x7F}),
    )
)
"""The words before the one that starts a write to the EEPROM (DS35007 section 3.2)."""


class Access(NamedTuple):
    """A word reads or writes a place."""

    place: int
    is_write: bool = False


class NotFollowed(Exception):
    """Raised where the execution does not reach so far; says why and where."""


@dataclass(slots=True)
class SymbolicState:
    """All chips at an address, those of a path condition."""

    pc: int
    stack: tuple[int, ...]
    bank: int
    """RP0."""
    w: Bits
    carry: Truth
    digit_carry: Truth
    zero: Truth
    bytes: dict[int, Bits]
    """By place: an address, `BANK_1` and an address, or `EEPROM` and one; others are as at the beginning."""
    path: Truth = TRUE
    accesses: tuple[Access, ...] = ()
    """The reads of volatile registers since the beginning, and the reads and writes of watched variables, one
    after the other.
    """
    unlocked: int = 0
    """How many words of UNLOCK came last."""
    writes_eeprom: bool = False
    """Whether a write to the EEPROM has begun."""
    visits: int = 0
    """The maximum number of times that the counted address was executed."""

    def reads_of(self, place: int) -> int:
        """Return how often a volatile register or a watched variable was read."""
        return self.accesses.count(Access(place))


@dataclass(slots=True)
class Execution:
    """Executes words; `reads` and `writes` collect the addresses in the RAM and the registers."""

    words: Mapping[int, int]
    solver: Solver
    precondition: Truth = TRUE
    """What holds of the first state."""
    reads: set[int] = field(default_factory=set)
    writes: set[int] = field(default_factory=set)
    watched: frozenset[int] = frozenset()
    """Variables shared with an interrupt; each of their reads and writes is noted among the accesses."""
    counted: int | None = None
    """The address whose executions are counted."""
    visits: int = 0
    """The maximum number of times that it was executed."""
    eeprom_busy: list[Truth] = field(default_factory=list)
    """Whether the EEPROM is being written, at each read of EECON1."""
    intcon_writes: set[int] = field(default_factory=set)
    """The addresses of the words that write INTCON."""
    initial_bytes: dict[int, Bits] = field(default_factory=dict)
    """The bytes of the first state, those that are asked for."""
    _number: Iterator[int] = field(default_factory=count)

    def state(self, pc: int, known: Mapping[int, Bits], stack: tuple[int, ...] = ()) -> SymbolicState:
        """Return a state in which only the bytes of `known` are known, in bank 0."""
        self.initial_bytes.update(known)
        carry, digit_carry, zero = (unknown(name, 1).bit(0) for name in ("C", "DC", "Z"))
        return SymbolicState(pc, stack, 0, unknown("W"), carry, digit_carry, zero, dict(known))

    def byte(self, state: SymbolicState, place: int) -> Bits:
        """Return the byte at a place."""
        current = state.bytes.get(place)
        return self.initial(place) if current is None else current

    def initial(self, place: int) -> Bits:
        """Return the byte that was at a place in the first state."""
        if place not in self.initial_bytes:
            self.initial_bytes[place] = unknown(f"0x{place:02X}")
        return self.initial_bytes[place]

    def run(
        self, start: SymbolicState, stops: Collection[int], *, anywhere: bool = False
    ) -> list[SymbolicState]:
        """Return the states at the addresses of `stops` that are reached from `start`.

        `anywhere`: in subroutines, too. Raises NotFollowed, GivenUp.
        """
        waiting: list[tuple[int, int, int]] = []
        states: dict[tuple[object, ...], SymbolicState] = {}
        numbers: dict[int, tuple[object, ...]] = {}
        reached: list[SymbolicState] = []
        depth = len(start.stack)

        def add(state: SymbolicState) -> None:
            key = self._key(state)
            if key in states:
                states[key] = self._merge(states[key], state)
                return
            states[key] = state
            number = next(self._number)
            numbers[number] = key
            # The deepest subroutine first, then the lowest address: the paths through a branch are merged
            # before the code after it is executed.
            heapq.heappush(waiting, (-len(state.stack), state.pc, number))

        for following in self.step(start):
            add(following)
        for _ in range(MAX_STEPS):
            if not waiting:
                return reached
            state = states.pop(numbers.pop(heapq.heappop(waiting)[2]))
            if state.pc == RETURNED or (state.pc in stops and (anywhere or len(state.stack) <= depth)):
                reached.append(state)
                continue
            for following in self.step(state):
                add(following)
        raise NotFollowed(f"the program does not come to an end, at 0x{start.pc:03X}")

    def _key(self, state: SymbolicState) -> tuple[object, ...]:
        pointer = self.byte(state, FSR).value
        page = self.byte(state, PCLATH).value
        # Only states that agree in what steers the execution are merged: a pointer that became a term would
        # have to be split into its values again at every access.
        eeprom = state.unlocked, state.writes_eeprom
        return state.pc, state.stack, state.bank, pointer, page, state.accesses, eeprom

    def _merge(self, first: SymbolicState, second: SymbolicState) -> SymbolicState:
        where = first.path
        places = {*first.bytes, *second.bytes}
        merged = {p: choose(where, self.byte(first, p), self.byte(second, p)) for p in places}
        return replace(
            first,
            w=choose(where, first.w, second.w),
            carry=choose_truth(where, first.carry, second.carry),
            digit_carry=choose_truth(where, first.digit_carry, second.digit_carry),
            zero=choose_truth(where, first.zero, second.zero),
            bytes=merged,
            path=first.path | second.path,
            visits=max(first.visits, second.visits),
        )

    def _possible(self, state: SymbolicState, condition: Truth) -> bool:
        return self.solver.possible(self.precondition & state.path & condition)

    def _split(self, state: SymbolicState, condition: Truth) -> Iterable[tuple[SymbolicState, bool]]:
        """Return the state where a condition holds, and where it does not, if they are possible."""
        if condition.known is not None:
            return [(state, condition.known)]
        outcomes = []
        for holds, truth in ((True, condition), (False, ~condition)):
            if self._possible(state, truth):
                outcomes.append((replace(state, bytes=dict(state.bytes), path=state.path & truth), holds))
        return outcomes

    def _split_by_value(self, state: SymbolicState, bits: Bits) -> Iterable[tuple[SymbolicState, int]]:
        """Return the state with each of the values that bits can have."""
        if bits.value is not None:
            return [(state, bits.value)]
        outcomes: list[tuple[SymbolicState, int]] = []
        left = state.path
        while self.solver.possible(self.precondition & left):
            value = self.solver.example(bits)
            this = bits.equals(value)
            outcomes.append((replace(state, bytes=dict(state.bytes), path=state.path & this), value))
            left = left & ~this
        return outcomes

    # registers

    def _operand_places(self, state: SymbolicState, f: int) -> Iterable[tuple[SymbolicState, int]]:
        """Return the place that an operand addresses, for each value of the pointer."""
        if f != INDF:
            return [(state, self._banked(f, state.bank))]
        return [
            (branch, self._banked(pointer & 0x7F, pointer >> 7))
            for branch, pointer in self._split_by_value(state, self.byte(state, FSR))
        ]

    def _banked(self, f: int, bank: int) -> int:
        if f in IN_BOTH_BANKS or f >= RAM_FIRST or not bank:
            return f
        return f | BANK_1

    def _read(self, state: SymbolicState, place: int) -> Bits:
        self.reads.add(place)
        if place == STATUS:
            return self.status(state)
        if place in VOLATILE:
            state.accesses = (*state.accesses, Access(place))
            # The first read has a name, so that a lemma can speak of the level that was read; later ones may
            # give anything.
            return self.initial(place) if state.reads_of(place) == 1 else unknown("later")
        if place in self.watched:
            state.accesses = (*state.accesses, Access(place))
        if place == EECON1:
            stored = self.byte(state, place)
            self.eeprom_busy.append(unknown("WR", 1).bit(0))
            # The end of a write sets EEIF at any time.
            above = stored[EEIF + 1 : 8].concat(unknown("EEIF", 1)).concat(stored[WREN:EEIF])
            return above.concat(as_bit(self.eeprom_busy[-1])).concat(Bits(1, 0))
        if place == INTCON:
            return self.byte(state, place)[3:8].concat(unknown("flags", 3))
        if place in (INDF, INDF | BANK_1, EECON2, PCL) or not self._is_implemented(place):
            if place == PCL:
                raise NotFollowed(f"PCL is read at 0x{state.pc:03X}")
            return byte(0)
        return self.byte(state, place)

    def _is_implemented(self, place: int) -> bool:
        return place in KEPT or RAM_FIRST <= place <= RAM_LAST

    def status(self, state: SymbolicState) -> Bits:
        """Return the byte STATUS."""
        low = as_bit(state.digit_carry).concat(as_bit(state.carry))
        low = as_bit(state.zero).concat(low)
        rest = self.byte(state, STATUS)
        return rest[6:8].concat(Bits(1, state.bank)).concat(rest[3:5]).concat(low)

    def _write(self, state: SymbolicState, place: int, value: Bits) -> None:
        self.writes.add(place)
        if place in self.watched:
            state.accesses = (*state.accesses, Access(place, is_write=True))
        if place == INTCON:
            self.intcon_writes.add(state.pc)
        if place in (EEDATA, EEADR) and state.writes_eeprom:
            raise NotFollowed(f"the EEPROM is used at 0x{state.pc:03X} while it is being written")
        if place == STATUS:
            if value[5:6].value is None:
                raise NotFollowed(f"an unknown bank is selected at 0x{state.pc:03X}")
            state.bank = value[5:6].value or 0
            state.carry, state.digit_carry, state.zero = (value.bit(n) for n in range(3))
            old = self.byte(state, STATUS)
            state.bytes[STATUS] = value[5:8].concat(old[3:5]).concat(value[0:3])
        elif place == EECON1:
            self._write_eecon1(state, value)
        elif place in (INDF, INDF | BANK_1, EECON2):
            pass
        else:
            state.bytes[place] = value

    def _write_eecon1(self, state: SymbolicState, value: Bits) -> None:
        read, write = value.bit(RD).known, value.bit(WR).known
        state.bytes[EECON1] = value
        if read is None:
            raise NotFollowed(f"EECON1 is written with an unknown value at 0x{state.pc:03X}")
        if (read or write) and state.writes_eeprom:
            raise NotFollowed(f"the EEPROM is used at 0x{state.pc:03X} while it is being written")
        if read:
            state.bytes[EEDATA] = self.byte(state, EEPROM + self._eeprom_address(state))
        if state.unlocked == len(UNLOCK) and value.bit(WREN).known and write:
            if self.byte(state, INTCON).bit(GIE).known is not False:
                raise NotFollowed(f"the EEPROM is written while interrupts are enabled, at 0x{state.pc:03X}")
            state.bytes[EEPROM + self._eeprom_address(state)] = self.byte(state, EEDATA)
            state.writes_eeprom = True

    def _eeprom_address(self, state: SymbolicState) -> int:
        address = self.byte(state, EEADR).value
        if address is None or address >= EEPROM_BYTES:
            raise NotFollowed(f"the EEPROM's address is not known at 0x{state.pc:03X}")
        return address

    # instructions

    def step(self, state: SymbolicState) -> Iterator[SymbolicState]:
        """Yield the states after one instruction."""
        try:
            word = word_of(self.words[state.pc])
        except (KeyError, Undefined):
            raise NotFollowed(f"there is no instruction at 0x{state.pc:03X}") from None
        if state.pc == self.counted:
            state = replace(state, visits=state.visits + 1)
            self.visits = max(self.visits, state.visits)
        unlocked = self._unlock_progress(state)
        for following in self._execute(state, word):
            following.unlocked = 0 if following.writes_eeprom else unlocked
            yield following

    def _unlock_progress(self, state: SymbolicState) -> int:
        """Return how many words of UNLOCK have come after the next instruction: one after the other, in bank
        1.
        """
        executed = self.words[state.pc]
        if state.unlocked < len(UNLOCK) and executed == UNLOCK[state.unlocked] and state.bank:
            return state.unlocked + 1
        return int(executed == UNLOCK[0] and state.bank == 1)

    def _execute(self, state: SymbolicState, word: DecodedWord) -> Iterator[SymbolicState]:
        """Yield the states after an instruction, which may be as it was before in `unlocked`."""
        if word.flow in ("jump", "call", "return"):
            yield self._branch_to(state, word)
        elif word.name in NOT_FOLLOWED:
            raise NotFollowed(f"{word.name} at 0x{state.pc:03X} is not followed")
        elif word.has_f:
            for branch, place in self._operand_places(self._copy(state), word.f):
                yield from self._execute_on_file(branch, word, place)
        else:
            after = self._copy(state)
            if word.writes_w:  # NOP and CLRWDT do not
                after.w = self._result(after, word, byte(word.k))
            after.pc += 1
            yield after

    def _copy(self, state: SymbolicState) -> SymbolicState:
        return replace(state, bytes=dict(state.bytes))

    def _branch_to(self, state: SymbolicState, word: DecodedWord) -> SymbolicState:
        if word.flow == "jump":
            return replace(state, pc=word.k)
        if word.flow == "call":
            return replace(state, pc=word.k, stack=(*state.stack, state.pc + 1))
        if not state.stack:
            raise NotFollowed(f"a return without a call at 0x{state.pc:03X}")
        w = byte(word.k) if word.name == "RETLW" else state.w
        return replace(state, pc=state.stack[-1], stack=state.stack[:-1], w=w)

    def _execute_on_file(
        self, state: SymbolicState, word: DecodedWord, place: int
    ) -> Iterator[SymbolicState]:
        if word.tests_bit:
            bit = self._bit_value(state, word, place)
            skips = bit if word.name == "BTFSS" else ~bit
            for branch, holds in self._split(state, skips):
                branch.pc += 1 + holds
                yield branch
            return
        if word.changes_bit and place == STATUS:
            self.writes.add(STATUS)
            self._change_status(state, word)
            state.pc += 1
            yield state
            return
        operand = self._operand(state, word, place) if "f" in word.reads else byte(0)
        value = self._result(state, word, operand)
        if word.writes_w:
            state.w = value
        elif word.writes_f:
            if place == PCL:
                yield from self._computed_branch(state, value)
                return
            self._write(state, place, value)
        if word.flow != "skip":
            state.pc += 1
            yield state
            return
        for branch, holds in self._split(state, value.equals(0)):
            branch.pc += 1 + holds
            yield branch

    def _operand(self, state: SymbolicState, word: DecodedWord, place: int) -> Bits:
        if place == PCL:  # ADDWF PCL,F: the address of the next instruction
            return byte(state.pc + 1)
        if place == EECON1 and word.changes_bit:
            return self.byte(state, place)[2:8].concat(Bits(2, 0))
        if place == INTCON and word.changes_bit:
            return self.byte(state, place)
        if place in (PORTA, PORTB) and word.changes_bit:
            self.reads.add(place)
            return self.byte(state, place)  # of the latch: the levels of inputs do not matter
        return self._read(state, place)

    def _bit_value(self, state: SymbolicState, word: DecodedWord, place: int) -> Truth:
        flags = {0: state.carry, 1: state.digit_carry, 2: state.zero}
        if place == STATUS and word.b in flags:
            return flags[word.b]
        return self._read(state, place).bit(word.b)

    def _change_status(self, state: SymbolicState, word: DecodedWord) -> None:
        to = Truth(word.name == "BSF")
        if word.b == 0:
            state.carry = to
        elif word.b == 1:
            state.digit_carry = to
        elif word.b == 2:
            state.zero = to
        elif word.b == RP0:
            state.bank = int(word.name == "BSF")
        elif word.name == "BSF":
            raise NotFollowed(f"IRP or RP1 is set at 0x{state.pc:03X}")

    def _computed_branch(self, state: SymbolicState, result: Bits) -> Iterator[SymbolicState]:
        """Yield the states after a computed jump."""
        page = self.byte(state, PCLATH).value
        if page is None:
            raise NotFollowed(f"PCLATH is not known at 0x{state.pc:03X}")
        for branch, low in self._split_by_value(state, result):
            branch.pc = ((page & 3) << 8) | low
            yield branch

    def _result(self, state: SymbolicState, word: DecodedWord, operand: Bits) -> Bits:
        """Return the result of an instruction for its byte or literal; update the flags."""
        value = result(TERMS, word.name, operand, state.w, state.carry, word.b)
        changed = flags(TERMS, word.name, operand, state.w, value)
        state.carry = changed.get("C", state.carry)
        state.digit_carry = changed.get("D", state.digit_carry)
        state.zero = changed.get("Z", state.zero)
        return value
