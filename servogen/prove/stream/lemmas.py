"""The lemmas about the words of a stream program: each holds for every value of every variable.

In: a program's words and names, and the numbers of its stream. Out: nothing where a lemma holds; `Fails` with
what differs, for which values, or `NotFollowed` where the execution does not reach so far. Each lemma
executes the words between two places symbolically and compares every variable with the specification, `chip`:

    start      ──▶ main loop ─┬─ request: begin_frame, prepare ─▶ cleared ─┬─ command: execute ─▶ main loop
                              └─ no request ─▶ main loop                   └─ none ─▶ main loop
    interrupt      rise: the pulse that was prepared ─▶ ticks, rest, fine
                   look: receiver, parser ─▶ todo, value

Between two steps of main `chip_bytes.invariant` holds: each step begins in any state with it and keeps it.
What `rounds` proves of the interrupt is when its edges and looks are; here it is what they do with each byte.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from copy import copy
from dataclasses import dataclass, fields

from servogen.engines.stream.protocol import CommandKind
from servogen.pic.device import INTERRUPT_VECTOR, registers
from servogen.pic.isa import encode
from servogen.pic.known_values import word_of
from servogen.prove.stream.bits import FALSE, TRUE, Bits, Solver, Truth, all_of, byte, choose, unknown
from servogen.prove.stream.chip import NOTHING, SENDING, ReceiverState, StreamChip
from servogen.prove.stream.chip_bytes import STARTING, chip_bytes, invariant, read_chip, receiver_counts
from servogen.prove.stream.counterexample import NOBODY, Suspect
from servogen.prove.stream.execution import (
    BANK_1,
    EECON1,
    EEPROM,
    FSR,
    GIE,
    INTCON,
    OPTION,
    PCLATH,
    RETURNED,
    STATUS,
    TMR0,
    WREN,
    Execution,
    NotFollowed,
    SymbolicState,
)
from servogen.prove.stream.names import SCRATCH, Names
from servogen.prove.stream.sharing import ANSWER_VARIABLES, RX_BITS, RX_BYTE, RX_LEFT, Accesses, Fails

ENABLED = 0xA0
"""INTCON while main runs: GIE and T0IE."""
TMR0_COUNTS_CYCLES = 0x8F
"""OPTION_REG: the prescaler is the watchdog's."""
SLOT = 0x3F
"""Of `slot`: the bits of the slot's number."""
REQUEST, COMMAND = 1, 2
"""Bits of `due`."""
MAX_BYTE = 0xFF  # begins a command: no value is as large
WRERR = 3
MAX_SHOWN = 8
"""The maximum number of values that a failed lemma shows."""

Tell = Callable[[str, int, int], None]


def _registers_between_steps() -> dict[int, Bits]:
    """Return the registers that main leaves to its next step: interrupts enabled, no write to the EEPROM."""
    return {INTCON: byte(ENABLED), EECON1: unknown("EECON1", 5).concat(Bits(3, 0))}


def _is_among(bits: Bits, values: Iterable[int]) -> Truth:
    among = FALSE
    for value in values:
        among = among | bits.equals(value)
    return among


@dataclass(slots=True)
class Lemmas:
    """The lemmas of one program."""

    names: Names
    solver: Solver
    tell: Tell
    runs: int = 0
    divided: int = 0
    """The maximum number of times that a preparation came to the loop of the division."""
    suspect: Suspect = NOBODY
    """What is being checked; after a failure, with the values for which it fails."""

    # what all lemmas do

    def _execution(self, suspect: Suspect = NOBODY) -> Execution:
        self.runs += 1
        self.suspect = suspect
        self.solver.forget()
        return Execution(self.names.words, self.solver)

    def _chip(self, read: Callable[[int], Bits]) -> StreamChip:
        return read_chip(self.names, read)

    def _initial_variables(self, code: Execution) -> dict[int, Bits]:
        """Return the variables, and those registers that no step of main changes, as they were."""
        places = {
            address + offset
            for name, (address, size) in self.names.variables.items()
            if name not in SCRATCH
            for offset in range(size)
        }
        ports = {self.names.port(pin) for pin in self.names.pins}
        places |= ports | {port | BANK_1 for port in ports} | {OPTION}
        return {place: code.initial(place) for place in sorted(places)}

    def _require(
        self,
        where: str,
        code: Execution,
        state: SymbolicState,
        wanted: Mapping[int, Bits],
        condition: Truth = TRUE,
    ) -> None:
        """Raise Fails unless all bytes of a state are as wanted, and `condition` holds."""
        # No step leaves the EEPROM unlocked that was not: what comes after could write it.
        condition = condition & (~code.byte(state, EECON1).bit(WREN) | code.initial(EECON1).bit(WREN))
        differs = {place: ~code.byte(state, place).equals(value) for place, value in wanted.items()}
        violation = ~condition
        for truth in differs.values():
            violation = violation | truth
        # One question about all bytes together; only if something differs is each asked about on its own.
        context = code.precondition & state.path
        if not self.solver.possible(context & violation):
            return
        for place, truth in differs.items():
            if self.solver.possible(context & truth):
                becomes, due = (
                    self.solver.example(bits) for bits in (code.byte(state, place), wanted[place])
                )
                self._note_values(code)
                wrong = f"{self.names.place_name(place)} becomes {becomes}, not {due}"
                raise Fails(f"{where}: {wrong}{self._example_text(code)}")
        # The solver has no example after a question about a place that does not differ.
        self.solver.possible(context & ~condition)
        self._note_values(code)
        raise Fails(f"{where}: what holds between two steps is lost{self._example_text(code)}")

    def _note_values(self, code: Execution) -> None:
        """Note the values of the example that the solver has found: of the chip's variables, of a command."""

        def value(place: int) -> Bits:
            return byte(self.solver.example(code.initial(place)))

        named = {name: value(self.names.at(name)).value for name in ("value", "command", "rx_byte")}
        second, third = self.suspect.second, named["value"]
        if second is None:  # a byte was being received
            second, third = named["command"], named["rx_byte"]
        self.suspect = Suspect(self._chip(value), second, third)

    def _example_text(self, code: Execution) -> str:
        """Return values of the example that the solver has found, as text: those that are not 0."""
        known_names = self.names.place_names
        values = {
            known_names[place]: value
            for place, bits in sorted(code.initial_bytes.items())
            if bits.value is None and place in known_names and (value := self.solver.example(bits))
        }
        shown = [f"{name} = {value}" for name, value in values.items()][:MAX_SHOWN]
        return ", if " + ", ".join(shown) if shown else ""

    def _run_to(
        self, code: Execution, begin: SymbolicState, stops: set[int], where: str
    ) -> list[SymbolicState]:
        """Return the ends of a step of main, in bank 0. Raises Fails if some chips reach none."""
        ends = code.run(begin, stops)
        covered = FALSE
        for end in ends:
            covered = covered | end.path
            if end.bank:
                raise Fails(f"{where}: bank 1 is still selected")
        if self.solver.possible(code.precondition & ~covered):
            raise Fails(f"{where}: the end is not reached{self._example_text(code)}")
        return ends

    # main

    def start(self) -> Accesses:
        """Check what main leaves to its loop after a reset: everything is unknown before it."""
        names = self.names
        if names.loop_head != names.after_enable:
            raise Fails("interrupts are enabled before all that comes before main's loop is done")
        code = self._execution()
        ends = code.run(code.state(0, self._registers_after_reset()), {names.loop_head})
        for end in ends:
            trims = [code.initial(EEPROM + n) for n in range(names.servos)]
            chip = StreamChip.after_reset(names.streamed, trims)
            chip.begin_frame()
            chip.prepare(0)
            wanted = chip_bytes(names, chip, byte(0)) | self._pulse(chip, 0, code, end)
            for name, value in (("todo", NOTHING), ("command", NOTHING), ("rx_bits", 0), ("rest", 0)):
                wanted[names.at(name)] = byte(value)
            wanted |= {names.at("due"): byte(0), names.at("ticks"): byte(3)}
            wanted |= {INTCON: byte(ENABLED), OPTION: byte(TMR0_COUNTS_CYCLES)}
            tris_bits = [code.byte(end, names.port(pin) | BANK_1).bit(int(pin[2])) for pin in names.pins]
            directions = all_of(~bit for bit in tris_bits) & self._directions(code, end, FALSE)
            self._require("after a reset", code, end, wanted, chip.valid() & directions)
        if not ends:
            raise Fails("after a reset the main loop is not reached")
        for address in sorted(code.intcon_writes - {names.after_enable - 1}):
            raise Fails(f"interrupts are switched before main's loop, at 0x{address:03X}")
        return Accesses(frozenset(code.reads), frozenset(code.writes))

    def _registers_after_reset(self) -> dict[int, Bits]:
        # WRERR is not known after a reset (DS35007 table 2-1, EECON1).
        interrupted_write = Bits(4, 0).concat(unknown("WRERR", 1)).concat(Bits(WRERR, 0))
        known = {PCLATH: byte(0), INTCON: byte(0), OPTION: byte(0xFF), EECON1: interrupted_write}
        return known | {registers()[name].address: byte(0xFF) for name in ("TRISA", "TRISB")}

    def _pulse(self, chip: StreamChip, n: int, code: Execution, end: SymbolicState) -> dict[int, Bits]:
        """Return the bytes with which the interrupt makes a servo's pulse; a pulse of 0 has no pin."""
        names, chip = self.names, chip.copy()
        off = chip.widths[n].equals(0)
        if names.streamed.coarse:
            # The place at the end is compared on its own: so both sides multiply the same byte.
            chip.widths[n] = code.byte(end, names.at("place", n)).zero_extend(16)
        width = chip.pulse(n)
        wanted = {
            names.at("mask"): choose(off, byte(0), byte(1 << int(names.pins[n][2]))),
            names.at("next_hi"): choose(off, byte(1), width[8:16]),
            names.at("next_lo"): width[0:8],
        }
        if names.two_ports:
            wanted[names.at("next_port")] = byte(names.port(names.pins[n]))
        return wanted

    def prepare(self, numbers: Iterable[int] | None = None) -> Accesses:
        """Check every pulse's preparation, from the request until it is cleared.

        `numbers`: the slots during which a pulse is requested, unless all.
        """
        names, slots = self.names, self.names.streamed.layout.slots
        accesses = Accesses()
        for number in range(slots) if numbers is None else numbers:
            self.tell("pulses prepared", number, slots)
            slot = unknown("flags", 2).concat(Bits(STARTING, number))
            # Bits of `due`: 0 a pulse was late, 1 the request, 2 a command is complete.
            due = Bits(5, 0).concat(unknown("command", 1)).concat(Bits(1, 1)).concat(unknown("late", 1))
            code = self._execution()
            code.counted = names.listing.label("st_whole")
            known = {names.at("slot"): slot, names.at("due"): due, **_registers_between_steps()}
            begin = code.state(names.loop_head, known)
            chip = self._chip(code.initial)
            code.precondition = invariant(names, chip, code.initial)
            # The rise of slot n requests the pulse of slot n + 1.
            following = (number + 1) % slots
            if following == 0:
                chip.begin_frame()
            wanted = self._initial_variables(code)
            if following < names.servos:
                chip.prepare(following)
            else:
                wanted |= {names.at("mask"): byte(0), names.at("next_hi"): byte(1)}
                wanted.pop(names.at("next_lo"))
                if names.two_ports:
                    wanted.pop(names.at("next_port"))
            wanted |= chip_bytes(names, chip, byte(following))
            # Main copies `due` to `sum_lo` and clears all of it but bit 0: `execute` begins with the copy.
            wanted |= {names.at("due"): due & 1, names.at("sum_lo"): due, INTCON: byte(ENABLED)}
            where = f"the pulse of slot {following}"
            for end in self._run_to(code, begin, {names.after_clear}, where):
                if following < names.servos:
                    wanted |= self._pulse(chip, following, code, end)
                self._require(where, code, end, wanted, chip.valid())
            accesses |= Accesses(frozenset(code.reads), frozenset(code.writes))
            self.divided = max(self.divided, code.visits)
        return accesses

    def idle(self) -> Accesses:
        """Check that main does nothing in a turn of its loop without a request, which it looks for once.

        A second look could find a request that comes between the two; of later looks in a turn with a request
        all find the same, because nothing but main clears it.
        """
        names = self.names
        code = self._execution()
        code.watched = frozenset({names.at("due")})
        due = Bits(6, 0).concat(Bits(1, 0)).concat(unknown("late", 1))
        begin = code.state(names.loop_head, {names.at("due"): due, **_registers_between_steps()})
        trims = {EEPROM + n: code.initial(EEPROM + n) for n in range(names.servos)}
        wanted = self._initial_variables(code) | trims
        for end in self._run_to(code, begin, {names.loop_head}, "without a request"):
            if end.reads_of(names.at("due")) > 1:
                raise Fails("main looks for a request more than once in a turn")
            self._require("without a request", code, end, wanted)
        return Accesses(frozenset(code.reads), frozenset(code.writes))

    def execute(self, seconds: Iterable[int] = range(256)) -> Accesses:
        """Check every command with one of these second bytes, and any third one that a receiver takes."""
        accesses = Accesses()
        for second in seconds:
            if second % 16 == 0:
                self.tell("commands", second, 256)
            accesses |= self._execute(second)
        return accesses

    def _execute(self, second: int) -> Accesses:
        names = self.names
        code = self._execution(Suspect(second=second))
        code.watched = frozenset(names.at(name) for name in ANSWER_VARIABLES)
        due = Bits(7, 0).concat(unknown("late", 1))
        known = {names.at("todo"): byte(second), names.at("due"): due, **_registers_between_steps()}
        begin = code.state(names.after_clear, known)
        # Main has copied `due` to `sum_lo` before it cleared the request.
        value, slot, copied = (code.initial(names.at(name)) for name in ("value", "slot", "sum_lo"))
        code.precondition = invariant(names, self._chip(code.initial), code.initial)
        code.precondition = (
            code.precondition & value.less(MAX_BYTE) & (slot & SLOT).less(names.streamed.layout.slots)
        )
        where = f"the command FF {second:02X}"
        ends = self._run_to(code, begin, {names.loop_head}, where)
        self._check_masking(where, code, second)
        # A command waits while the EEPROM is being written. The words test this once; both answers are
        # followed.
        if len(code.eeprom_busy) != 1:
            raise NotFollowed(f"{where}: EECON1 is read {len(code.eeprom_busy)} times")
        runs = copied.bit(COMMAND) & ~code.eeprom_busy[0]
        chip = self._chip(code.initial)
        chip.execute(second, value)
        self._check_handover(where, code, ends, chip.answer is not None)
        wanted = self._after_command(code, chip, runs, second, slot & SLOT)
        answers = runs if chip.answer is not None else FALSE
        for end in ends:
            value_kept = runs | code.byte(end, names.at("value")).equals(value)
            after = self._chip(lambda place: code.byte(end, place))  # noqa: B023 - used in this turn only
            condition = value_kept & after.valid() & self._directions(code, end, answers)
            self._require(where, code, end, wanted, condition)
        return Accesses(frozenset(code.reads), frozenset(code.writes))

    def _check_masking(self, where: str, code: Execution, second: int) -> None:
        """Check that only a trim masks interrupts, and no command changes which are enabled."""
        names = self.names
        trims = not names.streamed.coarse and second - CommandKind.TRIM.value in range(names.servos)
        for address in sorted(code.intcon_writes):
            word = word_of(names.words[address])
            if not word.changes_bit or (word.f, word.b) != (INTCON, GIE):
                raise Fails(f"{where}: the word at 0x{address:03X} changes which interrupts are enabled")
            if not trims:
                raise Fails(f"{where}: interrupts are masked")

    def _after_command(
        self, code: Execution, chip: StreamChip, runs: Truth, second: int, slot: Bits
    ) -> dict[int, Bits]:
        """Return the bytes after a command: those of `chip` where it runs, else as before."""
        names = self.names
        wanted = self._initial_variables(code)
        changed = chip_bytes(names, chip, slot)
        if chip.answer is not None:
            sent = {RX_BYTE: chip.answer, RX_LEFT: byte(0), RX_BITS: byte(1 << SENDING | 10)}
            changed |= {names.at(name): value for name, value in sent.items()}
        for place, value in changed.items():
            wanted[place] = choose(runs, value, code.initial(place))
        wanted[names.at("todo")] = choose(runs, byte(NOTHING), byte(second))
        wanted.pop(names.at("value"))
        wanted[INTCON] = byte(ENABLED)
        return wanted

    def _check_handover(
        self, where: str, code: Execution, ends: Iterable[SymbolicState], answers: bool
    ) -> None:
        """Check that main leaves the receiver's variables alone, but for an answer, which an interrupt may
        take from the moment on in which `rx_bits` is written: it is written once, after all else.
        """
        sent = {self.names.at(name) for name in ANSWER_VARIABLES}
        for place in sorted(sent & (code.reads if answers else code.reads | code.writes)):
            raise Fails(f"{where}: main uses {self.names.place_name(place)} of the receiver")
        for end in ends:
            written = [access.place for access in end.accesses if access.is_write and access.place in sent]
            if written and (written[-1], written.count(written[-1])) != (self.names.at(RX_BITS), 1):
                raise Fails(f"{where}: rx_bits is not written once and last")

    def _directions(self, code: Execution, end: SymbolicState, answers: Truth) -> Truth:
        """Return whether the receive pin is an input as before, and the transmit pin an output if the chip
        answers.
        """
        port, bit = self.names.line
        kept = code.byte(end, port | BANK_1).bit(bit) | ~code.initial(port | BANK_1).bit(bit)
        pin = self.names.streamed.stream.transmit_pin
        if pin is None:
            return kept
        return kept & (~answers | ~code.byte(end, self.names.port(pin) | BANK_1).bit(int(pin[2])))

    # the interrupt

    def rise(self) -> None:
        """Check what a rise takes over of the pulse that was prepared: for each of 2^16 widths."""
        names, rounds = self.names, self.names.streamed.layout.rounds
        code = self._execution()
        begin = code.state(names.edge + 1, {names.at("rest"): byte(0)})
        high, low = (code.initial(names.at(name)) for name in ("next_hi", "next_lo"))
        counts = receiver_counts(names.streamed)
        code.precondition = (
            ~high.equals(0) & high.less(rounds) & _is_among(code.initial(names.at("rx_bits")), counts)
        )
        ends = code.run(begin, {names.listing.label("st_out")})
        for end in ends:
            ticks = high + high - 1
            todo = code.byte(end, names.at("todo")).equals(NOTHING)
            due = code.initial(names.at("due")) | 1 << REQUEST
            wanted = {
                names.at("ticks"): ticks,
                names.at("rest"): byte(2 * rounds - 2) - ticks,
                names.at("fine"): low,
                names.at("due"): choose(todo, due, due | 1 << COMMAND),
                names.at("mask"): code.initial(names.at("mask")),
            }
            self._require("a rise", code, end, wanted)
        if not ends:
            raise Fails("a rise does not end")

    def receive(self) -> None:
        """Check a look at the line, in every state of the receiver and of the parser."""
        counts = receiver_counts(self.names.streamed)
        for number, bits in enumerate(counts):
            self.tell("states of the receiver", number, len(counts))
            self._receive(bits, counts)

    def _receive(self, bits: int, counts: Iterable[int]) -> None:
        """Check a look at the line with `bits` in rx_bits."""
        names = self.names
        port, bit = names.line
        code = self._execution()
        begin = code.state(names.listing.label("st_look"), {names.at("rx_bits"): byte(bits)}, (RETURNED,))
        line = code.initial(port).bit(bit)
        timer, ticks = code.initial(TMR0), code.initial(names.at("ticks"))
        # Where `ticks` is even, TMR0 is 128 cycles ahead of the time; a unit of time is 4 cycles.
        now = choose(ticks.bit(0), timer, timer + 128) >> 2
        own = ("rx_left", "rx_last", "rx_byte", "command", "todo", "value")
        left, stamp, shifted, command, todo, value = (code.initial(names.at(name)) for name in own)
        receiver = ReceiverState(names.streamed, byte(bits), left, stamp, shifted, command, todo, value)
        ends = code.run(begin, {RETURNED})
        if bits:
            receiver.look(now & SLOT, line)
        else:
            receiver.hunt(now & SLOT, line)
        values = [getattr(receiver, variable.name) for variable in fields(receiver)[1:8]]
        places = [names.at(name) for name in ("rx_bits", *own)]
        wanted = self._initial_variables(code) | dict(zip(places, values, strict=True))
        last = names.at("rx_last")
        wanted_last = wanted.pop(last)
        wanted.pop(names.at("t"))
        among = _is_among(receiver.bits, counts)
        where = f"a look at the line, {bits} in rx_bits"
        covered = FALSE
        for end in ends:
            covered = covered | end.path
            if end.reads_of(port) > 1 or end.reads_of(TMR0) > 1:
                raise Fails(f"{where}: the line or the timer is read twice")
            same_look = ((code.byte(end, last) ^ wanted_last) & SLOT).equals(0)
            condition = same_look & among & self._latch_as_due(code, end, receiver)
            self._require(where, code, end, wanted, condition)
        if self.solver.possible(code.precondition & ~covered):
            raise Fails(f"{where}: it does not return")

    def _latch_as_due(self, code: Execution, end: SymbolicState, receiver: ReceiverState) -> Truth:
        """Return whether the transmit pin's latch is as it should be after a look."""
        pin = self.names.streamed.stream.transmit_pin
        if pin is None:
            return TRUE
        place, bit = self.names.port(pin), int(pin[2])
        after, before = code.byte(end, place), code.initial(place)
        if receiver.level is None:
            return after.equals(before)
        sent = choose(receiver.level, before.with_bit(bit, 1), before.with_bit(bit, 0))
        return after.equals(choose(receiver.due, sent, before))

    def dispatch(self) -> None:
        """Check that a bit is taken only while a byte is being received, a start bit looked for only else."""
        names = self.names
        take, hunt, late = (names.listing.label(name) for name in ("st_take", "st_hunt", "st_late"))
        checked: set[int] = set()
        for label in (names.body, names.listing.label("st_plain_quiet")):
            code = self._execution()
            begin = code.state(label, {})
            ends = code.run(begin, {take, hunt, late, names.listing.label("st_out")}, anywhere=True)
            for end in ends:
                checked |= {return_address - 1 for return_address in end.stack}  # the calls that led here
                quiet = code.byte(end, names.at("rx_bits")).equals(0)
                wrong = {take: quiet, hunt: ~quiet}.get(end.pc, FALSE)
                if self.solver.possible(end.path & wrong):
                    raise Fails(f"the line is looked at in the wrong way, from 0x{label:03X}")
        calls = {encode("CALL", k=label) for label in (take, hunt)}
        for address in names.interrupt_addresses:
            if names.words[address] in calls and address not in checked:
                raise Fails(f"the line is looked at in the wrong way, from 0x{address:03X}")

    def context(self) -> frozenset[int]:
        """Check that an interrupt leaves the C its registers, and return where it keeps them."""
        return self._context(0) | self._context(1)

    def _context(self, bank: int) -> frozenset[int]:
        """Check an interrupt that begins while `bank` is selected."""
        names = self.names
        code = self._execution()
        before = code.state(INTERRUPT_VECTOR, {})
        before.bank = bank
        first = copy(before)
        status = code.status(before)
        (inside,) = code.run(before, {names.body})
        if inside.bank:
            raise Fails("the interrupt does not select bank 0")
        context = frozenset(code.writes) - {STATUS, PCLATH, FSR, INTCON}
        words = {word_of(names.words[address]) for address in names.body_addresses()}
        own = {word.f for word in words if word.writes_f}
        if context & own:
            raise Fails("the interrupt writes where the compiler keeps the C's registers")
        for end in code.run(self._before_restoring(inside, own), {RETURNED}):
            wanted = {place: code.initial(place) for place in (FSR, PCLATH)}
            same = end.w.equals(first.w) & code.status(end).equals(status)
            self._require("an interrupt's end", code, end, wanted, same)
        if frozenset(code.writes) - context - {STATUS, PCLATH, FSR, INTCON}:
            raise Fails("the interrupt's end writes a variable")
        return context

    def _before_restoring(self, inside: SymbolicState, own: set[int]) -> SymbolicState:
        """Return a state before the interrupt's end: whatever it has done in between to its `own` places."""
        after = copy(inside)
        after.bytes = dict(inside.bytes)
        after.path = TRUE
        after.pc = self.names.listing.label("st_out")
        after.w = unknown("W")
        after.carry, after.digit_carry, after.zero = (unknown(name, 1).bit(0) for name in ("C", "DC", "Z"))
        for place in own - {STATUS}:
            after.bytes[place] = unknown(f"0x{place:02X}")
        # RETFIE returns to what was interrupted.
        after.stack = (RETURNED,)
        return after
