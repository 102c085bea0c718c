"""The abstract state of the chip before an instruction, and what one instruction makes of it.

In: an `AbstractState` and a decoded word. Out: the state afterwards, with what the instruction read that was
never written, and which pins it wrote, in `Effects`. DS35007 sections 2 to 4 and 7.

`values` maps a place to the values that it may have; a missing place may have any. `written` holds the places
that were written on every path since reset. `saved` is used inside the interrupt's code only: it maps a place
to the register whose value at the interrupt it holds, and whether its nibbles are swapped.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass, field
from functools import cache

from servogen.pic import semantics
from servogen.pic.analysis import values
from servogen.pic.analysis.values import ANY, BIT, Value
from servogen.pic.device import RAM_FIRST, RAM_LAST, addresses, masks
from servogen.pic.known_values import CARRY, FSR, INDF, PCL, STATUS, ZERO, DecodedWord, W

TMR0, PORTA, PORTB, PCLATH, INTCON = addresses("TMR0", "PORTA", "PORTB", "PCLATH", "INTCON")
EEDATA, EECON1 = addresses("EEDATA", "EECON1")
DIGIT, BANK, OPTION, TRISA, TRISB = -4, -5, -6, -7, -8
LATCHES = 0x100
"""Places LATCHES + pin are the bits of the port latches, in the order RA0 to RA4, RB0 to RB7."""
PORT_BITS = {PORTA: (0, 5), PORTB: (5, 8)}
"""First pin and number of pins of each port."""
_FIVE_BITS = (TRISA, PCLATH)
"""Registers whose upper three bits are read as 0 (DS35007 figure 2-2)."""
GIE, T0IE, T0IF = masks("GIE", "T0IE", "T0IF")
ENABLES = sum(masks("EEIE", "T0IE", "INTE", "RBIE"))
"""The enable bits of the four interrupts in INTCON."""
_FLAG_PLACES = {0: CARRY, 1: DIGIT, 2: ZERO, 5: BANK}
"""The bits of STATUS that are tracked."""
_PLACE_OF_FLAG = {"C": CARRY, "D": DIGIT, "Z": ZERO}
"""By the letters of `isa`."""
_FLAGS = frozenset(_FLAG_PLACES.values())
PRESERVED = (W, FSR, CARRY, DIGIT, ZERO, BANK, PCLATH)
"""The registers that an interrupt has to restore."""
_STATUS_PLACES = (CARRY, DIGIT, ZERO, BANK)
_FIRST_BIT = 16
_SAVED_STATUS = -100
"""The mark, in `saved`, of a byte that holds STATUS."""

Place = int
Saved = dict[Place, tuple[Place, bool]]
Fact = tuple[Place, str, int]
"""The meaning of a flag for a place: it is 1 if `place == k`, `place >= k`, `place <= k` or, for the relation
`&`, `place & k == 0`.
"""


def bit(place: Place) -> int:
    """Return the bit of a place in a bit set."""
    return 1 << place + _FIRST_BIT


def bits(places: Iterable[Place]) -> int:
    """Return a bit set of places."""
    bit_set = 0
    for place in places:
        bit_set |= bit(place)
    return bit_set


@dataclass(slots=True)
class AbstractState:
    """What is known before an instruction. Places that are not in `values` may have any value."""

    values: dict[Place, Value]
    written: int
    """A bit set, see `bit`."""
    saved: Saved = field(default_factory=dict)
    facts: dict[Place, Fact] = field(default_factory=dict)
    """The meaning of the flags C and Z for other places, so that a comparison bounds the compared place."""
    copies: tuple[Place, ...] = ()
    """The places whose values are equal to W, the latest copy last."""

    def copy(self) -> AbstractState:
        """Return an independent copy; values are immutable and shared."""
        return AbstractState(
            self.values.copy(), self.written, self.saved.copy(), self.facts.copy(), self.copies
        )

    def get(self, place: Place) -> Value:
        """Return the values that a place may have; a flag that is not known is 0 or 1."""
        value = self.values.get(place)
        if value is None:
            return BIT if place in _FLAGS else ANY
        return value

    def put(self, place: Place, value: Value) -> None:
        """Write a place; whatever it had saved is lost."""
        # A missing place means any value, so that equal knowledge has one representation.
        if value is ANY:
            self.values.pop(place, None)
        else:
            self.values[place] = value
        self.saved.pop(place, None)
        self.written |= bit(place)
        self.unrelate(place)

    def unrelate(self, place: Place) -> None:
        """Forget the relations of flags and W to a place that changes."""
        if place == W:
            self.copies = ()
        elif place in self.copies:
            self.copies = tuple(copy for copy in self.copies if copy != place)
        self.facts.pop(place, None)
        for flag in [flag for flag, fact in self.facts.items() if fact[0] == place]:
            del self.facts[flag]

    def forget(self, places: Set[Place]) -> None:
        """Forget what is known of the values of some places."""
        for place in self.values.keys() & places:
            del self.values[place]
        for place in self.saved.keys() & places:
            del self.saved[place]
        if self.copies:
            unchanged = () if W in places else self.copies
            self.copies = tuple(copy for copy in unchanged if copy not in places)
        for flag, fact in list(self.facts.items()):
            if flag in places or fact[0] in places:
                del self.facts[flag]

    def may_put(self, place: Place, value: Value) -> None:
        """Write a place on some of the paths that this state stands for."""
        joined = self.get(place) | value
        was_written = self.written & bit(place)
        self.put(place, joined)
        if not was_written:
            self.written &= ~bit(place)

    def join(self, other: AbstractState, max_grown: int = 256, exempt: int = 0) -> bool:
        """Add the paths of another state, and return whether this one changed. A value that exceeds
        `max_grown` members when it grows becomes any, except at the places in the bit set `exempt`.
        """
        changed = False
        # Only places that both states know stay known: a missing place already stands for any value.
        for place in list(self.values):
            if place not in other.values:
                del self.values[place]
                changed = True
                continue
            joined = self.values[place] | other.values[place]
            # Widening: a counter that grows with every turn of a loop would otherwise be joined 256 times.
            if joined is not self.values[place] and joined.size > max_grown and not exempt & bit(place):
                joined = ANY
            if joined is not self.values[place]:
                if joined is ANY:
                    del self.values[place]
                else:
                    self.values[place] = joined
                changed = True
        if self.written & ~other.written:
            self.written &= other.written
            changed = True
        for place, saved in list(self.saved.items()):
            if other.saved.get(place) != saved:
                del self.saved[place]
                changed = True
        for flag, fact in list(self.facts.items()):
            if other.facts.get(flag) != fact:
                del self.facts[flag]
                changed = True
        if self.copies and self.copies != other.copies:
            common = tuple(copy for copy in self.copies if copy in other.copies)
            changed |= common != self.copies
            self.copies = common
        return changed

    def equal_to(self, place: Place) -> tuple[Place, ...]:
        """Return the places that certainly have the same value, the given one included."""
        return (W, *self.copies) if place in self.copies else (place,)

    def split(self, place: Place) -> list[AbstractState]:
        """Return one state for each value that a place may have; what is equal to it has the same value."""
        equal = self.equal_to(place)
        parts = []
        for member in self.get(place):
            # A copy of the byte may have been narrowed further than the byte itself, by a test of the copy.
            if all(member in self.get(copy) for copy in equal):
                part = self.copy()
                part.values.update(dict.fromkeys(equal, values.constant(member)))
                parts.append(part)
        return parts

    def has_written(self, place: Place) -> bool:
        """Return whether a place was written on every path since reset."""
        return bool(self.written & bit(place))

    @property
    def interruptible(self) -> bool:
        """Return whether an interrupt may be served before the next instruction."""
        return _allows_interrupts(self.get(INTCON))


@cache
def _allows_interrupts(intcon: Value) -> bool:
    return any(member & GIE and member & ENABLES for member in intcon)


def at_reset() -> AbstractState:
    """Return what every reset guarantees (DS35007 table 6-4); the rest may have any value."""
    return AbstractState(
        {
            BANK: values.constant(0),
            PCLATH: values.constant(0),
            INTCON: values.constant(0),
            OPTION: values.constant(0xFF),
            TRISA: values.constant(0x1F),
            TRISB: values.constant(0xFF),
        },
        bits((BANK, PCLATH, INTCON, OPTION, TRISA, TRISB)),
    )


def at_interrupt(interrupted: AbstractState) -> AbstractState:
    """Return the state in which the interrupt's code begins."""
    state = interrupted.copy()
    # Serving an interrupt clears GIE (DS35007 section 6.8).
    state.put(INTCON, values.mapped(state.get(INTCON), lambda member: member & ~GIE))
    state.saved = {place: (place, False) for place in PRESERVED}
    state.facts, state.copies = {}, ()
    return state


@dataclass(slots=True)
class Effects:
    """The effects of one execution of an instruction that the state does not show."""

    unwritten: set[Place] = field(default_factory=set)
    """Places that it read although they may never have been written."""
    any_byte: bool = False
    """Whether it read through a completely unknown pointer."""
    changed: set[Place] = field(default_factory=set)
    """Places that it may have written."""
    wild: bool = False
    """Whether it wrote through a completely unknown pointer."""
    jumps: bool = False
    """Whether it may have written PCL through a pointer."""
    pins: list[tuple[int, int, int]] = field(default_factory=list)
    """(port, mask of pins that it may have written, mask of those that it certainly wrote)."""
    driven_unwritten: set[int] = field(default_factory=set)
    """Pins that became outputs while their latch may never have been written."""
    timer_writes: Value | None = None
    """The value that it wrote to TMR0, unless it added one to it."""
    timer_adds: Value | None = None
    """The value that it added to TMR0."""
    requests_timer: bool = False
    """Whether it may have set T0IF."""


@dataclass(frozen=True, slots=True)
class _Operand:
    """A byte that an operand f may address."""

    place: Place | None
    """None for a byte that is not tracked, such as an unimplemented one or the pins of a port."""
    port: int | None = None
    special: int | None = None
    """TMR0, PCL, STATUS or INTCON, which are not plain bytes."""


_EVERY_BYTE = [_Operand(place) for place in range(RAM_FIRST, RAM_LAST + 1)]
_BANK_0 = {INDF: None, TMR0: TMR0, PCL: PCL, STATUS: STATUS, FSR: FSR, PCLATH: PCLATH, INTCON: INTCON}
_BANK_1 = _BANK_0 | {TMR0: OPTION, PORTA: TRISA, PORTB: TRISB}


def _at_address(address: int) -> _Operand:
    """Return the byte at an address of both banks (DS35007 figure 2-2)."""
    low, bank_1 = address & 0x7F, bool(address & 0x80)
    if RAM_FIRST <= low <= RAM_LAST:
        return _Operand(low)
    if low in (PORTA, PORTB) and not bank_1:
        return _Operand(None, port=low)
    place = (_BANK_1 if bank_1 else _BANK_0).get(low)
    if place in (TMR0, PCL, STATUS, INTCON) and not (place == TMR0 and bank_1):
        return _Operand(None, special=place)
    return _Operand(place)


@cache
def _direct(f: int, banks: Value) -> list[_Operand]:
    return sorted({_at_address(f | bank << 7) for bank in banks}, key=repr)


@cache
def _through(pointer: Value) -> list[_Operand]:
    return sorted({_at_address(address) for address in pointer}, key=repr)


def operands(state: AbstractState, f: int) -> tuple[list[_Operand], bool]:
    """Return the bytes that an operand f may address, and whether nothing is known of the pointer.

    Such a pointer is taken to address RAM; whoever relies on the result has to state that.
    """
    if f != INDF:
        return _direct(f, state.get(BANK)), False
    pointer = state.get(FSR)
    # More than half of all addresses: in practice a pointer of which nothing, or one bit, is known.
    if pointer.size > 128:
        return _EVERY_BYTE, True
    return _through(pointer), False


def _status(state: AbstractState) -> Value:
    zeros = ones = 0x18 | 0xC0  # TO, PD, IRP and RP1 are not followed
    for number, place in _FLAG_PLACES.items():
        value = state.get(place)
        zeros |= (value.may_be_0 & 1) << number
        ones |= (value.may_be_1 & 1) << number
    return values.of_bits(zeros, ones)


def _special(state: AbstractState, place: int, address: int) -> Value:
    if place == PCL:
        return values.constant(address + 1 & 0xFF)
    if place == STATUS:
        return _status(state)
    if place == INTCON:  # the interrupt flags change at any time
        value = state.get(INTCON)
        return values.of_bits(value.may_be_0 | 0x07, value.may_be_1 | 0x07)
    return ANY


def _read(
    state: AbstractState, word: DecodedWord, address: int, effects: Effects
) -> tuple[Value, list[_Operand], bool]:
    addressed, any_byte = operands(state, word.f)
    reads = "f" in word.reads
    modifies_bit = word.changes_bit
    if reads and any_byte:
        effects.any_byte = True
    value: Value | None = None
    for operand in addressed:
        if operand.special is not None:
            single = _special(state, operand.special, address)
            if reads and operand.special == TMR0 and not state.has_written(TMR0):
                effects.unwritten.add(TMR0)
            if reads and operand.special == STATUS and not modifies_bit:
                numbers = [word.b] if word.tests_bit else [0, 1, 2]
                flags = {_FLAG_PLACES[number] for number in numbers if number in _FLAG_PLACES}
                effects.unwritten |= {flag for flag in flags if not state.has_written(flag)}
        elif operand.place is None:
            single = ANY if operand.port is not None else values.constant(0)
            single = ANY if word.f in (EEDATA, EEDATA + 1) or word.f == INDF else single
        else:
            single = state.get(operand.place)
            if reads and not any_byte and not state.has_written(operand.place):
                effects.unwritten.add(operand.place)
        value = single if value is None else value | single
    if word.f == INDF and not state.has_written(FSR):
        effects.unwritten.add(FSR)
    return value or ANY, addressed, any_byte


def computed(word: DecodedWord, w: Value, f: Value, carry: Value) -> tuple[Value, Mapping[Place, Value]]:
    """Return the result, and the flags that change."""
    unread = values.constant(0)
    f = values.constant(word.k) if not word.has_f else f if "f" in word.reads else unread
    return _computed(
        word.name,
        word.b,
        w if "W" in word.reads else unread,
        f,
        carry if "C" in word.reads else unread,
    )


@cache
def _computed(name: str, b: int, w: Value, f: Value, carry: Value) -> tuple[Value, Mapping[Place, Value]]:
    result = semantics.result(values.SETS, name, f, w, carry, b)
    changed = semantics.flags(values.SETS, name, f, w, result)
    return result, {_PLACE_OF_FLAG[letter]: value for letter, value in changed.items()}


def _preserving(
    state: AbstractState, word: DecodedWord, addressed: list[_Operand]
) -> tuple[Place, bool] | None:
    """Return what a move or swap of nibbles copies of the registers at the interrupt; None if nothing."""
    source: tuple[Place, bool] | None = None
    if word.name == "MOVWF":
        return state.saved.get(W)
    if word.name not in ("MOVF", "SWAPF") or len(addressed) != 1:
        return None
    if addressed[0].special == STATUS:
        if all(state.saved.get(place) == (place, False) for place in _STATUS_PLACES):
            source = (_SAVED_STATUS, False)
    elif addressed[0].place is not None:
        source = state.saved.get(addressed[0].place)
    if source is None or word.name == "MOVF":
        return source
    return source[0], not source[1]


def execute(before: AbstractState, word: DecodedWord, address: int) -> tuple[AbstractState, Effects]:
    """Return the state after an instruction, without where it continues, and its effects."""
    state, effects = before.copy(), Effects()
    if "W" in word.reads and not before.has_written(W):
        effects.unwritten.add(W)
    if "C" in word.reads and not before.has_written(CARRY):
        effects.unwritten.add(CARRY)
    if word.name in ("OPTION", "TRIS"):
        place = OPTION if word.name == "OPTION" else {PORTA: TRISA, PORTB: TRISB}[word.f]
        _write_place(state, place, before.get(W), effects, definitely=True)
        return state, effects
    if word.flow in ("jump", "call", "return") or word.name in ("NOP", "CLRWDT", "SLEEP"):
        if word.name == "RETLW":
            _write_place(state, W, values.constant(word.k), effects, definitely=True)
        return state, effects
    f, addressed, any_byte = _read(before, word, address, effects) if word.has_f else (ANY, [], False)
    if word.tests_bit:
        return state, effects
    copied = _preserving(before, word, addressed)
    if copied:
        effects.unwritten.clear()  # the interrupt saves or restores a register: that uses nothing of it
    result, changed = computed(word, before.get(W), f, before.get(CARRY))
    for flag, value in changed.items():
        state.put(flag, value)
        effects.changed.add(flag)
    if word.writes_w:
        _write_place(state, W, result, effects, definitely=True)
        if copied:
            state.saved[W] = copied
    elif word.writes_f and not word.writes_pcl:
        _write(before, state, word, addressed, any_byte, result, copied, effects)
    _relate(before, state, word, addressed)
    return state, effects


def _relate(
    before: AbstractState, state: AbstractState, word: DecodedWord, addressed: list[_Operand]
) -> None:
    """Note the relations of the instruction's flags, and of its result in W, to the byte that it read."""
    place = addressed[0].place if len(addressed) == 1 else None
    if word.name == "MOVF" and place is not None:
        if place in state.values or RAM_FIRST <= place <= RAM_LAST:
            state.facts[ZERO] = (place, "==", 0)
            state.copies = (place,) if word.writes_w else before.copies
        return
    if word.name == "MOVWF" and place is not None and place not in (FSR, *_FIVE_BITS):
        state.copies = (*(copy for copy in before.copies if copy != place), place)
        return
    w = before.get(W).constant
    if word.name == "ANDWF" and word.writes_w and place is not None and w is not None:
        state.facts[ZERO] = (place, "&", w)
        return
    if word.name == "ANDLW" and before.copies:
        state.facts[ZERO] = (before.copies[-1], "&", word.k)
        return
    if word.name in ("SUBWF", "XORWF") and word.writes_w and place is not None and w is not None:
        compared: tuple[Place, int, str] = (place, w, ">=")
    elif word.name in ("SUBLW", "XORLW", "ADDLW") and before.copies:
        k = word.k if word.name != "ADDLW" else -word.k & 0xFF
        # SUBLW computes k - W: no borrow, C = 1, if W <= k. ADDLW -k carries if W >= k.
        compared = (before.copies[-1], k, "<=" if word.name == "SUBLW" else ">=")
        # ADDLW 0 never carries, whereas `place >= 0` always holds.
        if word.name == "ADDLW" and k == 0:
            return
    else:
        return
    state.facts[ZERO] = (compared[0], "==", compared[1])
    if "C" in word.flags:
        state.facts[CARRY] = (compared[0], compared[2], compared[1])


def _satisfies(fact: Fact, member: int) -> bool:
    _, relation, number = fact
    if relation == "&":
        return not member & number
    return {"==": member == number, ">=": member >= number, "<=": member <= number}[relation]


def _write(
    before: AbstractState,
    state: AbstractState,
    word: DecodedWord,
    addressed: list[_Operand],
    any_byte: bool,
    result: Value,
    copied: tuple[Place, bool] | None,
    effects: Effects,
) -> None:
    definitely = len(addressed) == 1
    if any_byte:
        effects.wild = True
    for operand in addressed:
        if operand.port is not None:
            may, must = _pins_meant(word, result)
            effects.pins.append((operand.port, may, must if definitely else 0))
            _write_latches(before, state, word, operand.port, result, definitely=definitely)
        elif operand.special == STATUS:
            _write_status(before, state, word, result, copied, effects, definitely=definitely)
        elif operand.special == TMR0:
            # Its value is not followed: it counts.
            effects.timer_adds = _added(before, word) if definitely else None
            if effects.timer_adds is None:
                written = effects.timer_writes
                effects.timer_writes = result if written is None else written | result
            effects.changed.add(TMR0)
            if definitely:
                state.written |= bit(TMR0)
        elif operand.special == INTCON:
            effects.requests_timer |= _requests_timer(before, word)
            enables = values.mapped(result, lambda member: member & 0xF8)
            if before.interruptible:
                # An interrupt during this instruction sets GIE again when it returns.
                enables |= values.mapped(enables, lambda member: member | GIE)
            _write_place(state, INTCON, enables, effects, definitely=definitely)
        elif operand.special == PCL:
            effects.jumps = True
        elif operand.place is not None:
            if operand.place in (TRISA, TRISB):
                _directions(before, operand.place, result, effects)
            _write_place(state, operand.place, result, effects, definitely=definitely)
            if definitely and copied:
                state.saved[operand.place] = copied


def _added(before: AbstractState, word: DecodedWord) -> Value | None:
    """Return what an instruction adds to the byte that it reads and writes; None if it does something
    else.
    """
    if word.name in ("INCF", "INCFSZ"):
        return values.constant(1)
    return before.get(W) if word.name == "ADDWF" else None


def _write_latches(
    before: AbstractState,
    state: AbstractState,
    word: DecodedWord,
    port: int,
    result: Value,
    *,
    definitely: bool,
) -> None:
    """Note which latches of a port are written. An instruction that reads the port writes to the latches of
    inputs what their surroundings say, which is no value of the program (DS35007 section 4).
    """
    first, count = PORT_BITS[port]
    inputs = before.get(TRISA if port == PORTA else TRISB).may_be_1
    for pin in range(count):
        if "f" in word.reads and (result.may_be_0 & result.may_be_1) >> pin & 1:
            if inputs >> pin & 1:
                state.written &= ~bit(LATCHES + first + pin)
        elif definitely:
            state.written |= bit(LATCHES + first + pin)


def _requests_timer(before: AbstractState, word: DecodedWord) -> bool:
    """Return whether a write of INTCON may set T0IF where it is 0."""
    flags = _special(before, INTCON, 0)
    clear = values.conjunction(flags, values.constant(~T0IF & 0xFF))
    result, _ = computed(word, before.get(W), clear, before.get(CARRY))
    return bool(result.may_be_1 & T0IF)


def _pins_meant(word: DecodedWord, result: Value) -> tuple[int, int]:
    """Return the pins that a write of a port may and must mean: for a whole byte, those that it sets to 1."""
    if word.changes_bit:
        return 1 << word.b, 1 << word.b
    return result.may_be_1, result.may_be_1 & ~result.may_be_0


def _directions(before: AbstractState, place: Place, result: Value, effects: Effects) -> None:
    """Note pins that become outputs while their latches may never have been written."""
    first, count = PORT_BITS[PORTA if place == TRISA else PORTB]
    for pin in range(count):
        if result.may_be_0 >> pin & 1 and not before.has_written(LATCHES + first + pin):
            effects.driven_unwritten.add(first + pin)


def _write_place(
    state: AbstractState, place: Place, value: Value, effects: Effects, *, definitely: bool
) -> None:
    effects.changed.add(place)
    if place in _FIVE_BITS:
        value = values.mapped(value, lambda member: member & 0x1F)
    if definitely:
        state.put(place, value)
    else:
        state.may_put(place, value)


def _write_status(
    before: AbstractState,
    state: AbstractState,
    word: DecodedWord,
    result: Value,
    copied: tuple[Place, bool] | None,
    effects: Effects,
    *,
    definitely: bool,
) -> None:
    """Write STATUS; an instruction that affects a flag writes none of C, DC and Z (DS35007 section 2.3.1)."""
    affects_flags = bool(set(word.flags) & set("CDZ"))
    for number in [word.b] if word.changes_bit else [5] if affects_flags else [0, 1, 2, 5]:
        place = _FLAG_PLACES.get(number)
        if place is None:
            continue
        zero, one = result.may_be_0 >> number & 1, result.may_be_1 >> number & 1
        value = values.of([bit for bit, may in ((0, zero), (1, one)) if may])
        _write_place(state, place, value, effects, definitely=definitely)
    # MOVWF and SWAPF affect no flags, so that the restored STATUS stays as it was saved.
    if copied == (_SAVED_STATUS, False) and word.name in ("MOVWF", "SWAPF") and definitely:
        for place in _STATUS_PLACES:
            state.saved[place] = (place, False)


def skip_ways(
    state: AbstractState, before: AbstractState, word: DecodedWord, address: int
) -> list[tuple[int, AbstractState]]:
    """Return (words to advance by, state) for each outcome of a skip; `before` is the state that it tests."""
    if word.tests_bit:
        skip_level = int(word.name == "BTFSS")
        addressed, _ = operands(before, word.f)
        ways = []
        for level in (0, 1):
            refined = _refined(state, before, word, addressed, level, address)
            if refined is not None:
                ways.append((2 if level == skip_level else 1, refined))
        return ways
    # INCFSZ and DECFSZ: the result tells
    if word.writes_w:
        place: Place | None = W
    else:
        addressed, _ = operands(before, word.f)
        place = addressed[0].place if len(addressed) == 1 else None
        if place in _FIVE_BITS:
            place = None  # its byte is not the result
    result = ANY if place is None else state.get(place)
    ways = []
    if result.constant != 0:
        after = state.copy()
        nonzero = None if result.members is None else values.where(result, bool)
        if place is not None and nonzero is not None:
            after.values[place] = nonzero
        ways.append((1, after))
    if 0 in result:
        after = state.copy()
        if place is not None:
            after.values[place] = values.constant(0)
        ways.append((2, after))
    return ways


def _refined(
    state: AbstractState,
    before: AbstractState,
    word: DecodedWord,
    addressed: list[_Operand],
    level: int,
    address: int,
) -> AbstractState | None:
    """Return the state in which the tested bit has that level; None if it cannot."""
    place: Place | None = None
    tested = word.b
    if len(addressed) == 1:
        if addressed[0].special == STATUS:
            place, tested = _FLAG_PLACES.get(word.b), 0
        elif addressed[0].special == INTCON and word.b > 2:
            place = INTCON
        else:
            place = addressed[0].place
    if place is None:
        return state.copy()
    value = before.get(place)
    if value.members is None:
        mask = 1 << tested
        if not (value.may_be_1 if level else value.may_be_0) & mask:
            return None
        narrowed_value = values.of_bits(
            value.may_be_0 & ~mask if level else value.may_be_0,
            value.may_be_1 if level else value.may_be_1 & ~mask,
        )
    else:
        remaining = values.where(value, lambda member: member >> tested & 1 == level)
        if remaining is None:
            return None
        narrowed_value = remaining
    after = state.copy()
    after.values[place] = narrowed_value
    fact = before.facts.get(place)
    if fact is not None:
        possible = values.where(before.get(fact[0]), lambda member: _satisfies(fact, member) == bool(level))
        if possible is None:
            return None
        # W and the copies of the compared byte have its value, so the comparison bounds them as well.
        for equal in after.equal_to(fact[0]):
            narrowed = values.where(possible, after.get(equal).__contains__)
            if narrowed is None:
                return None
            if narrowed is not values.ANY:
                after.values[equal] = narrowed
    return after
