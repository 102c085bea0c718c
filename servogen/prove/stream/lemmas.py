"""The lemmas about the words of a stream program: each holds for every value of every variable.

In: a program's words and names, and the numbers of its stream. Out: nothing where a lemma holds; `Fails` with
what differs, for which values, or `NotFollowed` where the execution does not reach so far.

    start      ──▶ main loop ─┬─ request: begin_frame, prepare ─▶ cleared ─┬─ command: execute ─▶ main loop
                              └─ no request ─▶ main loop                   └─ none ─▶ main loop
    interrupt      rise: the pulse that was prepared ─▶ ticks, rest, fine
                   look: receiver, parser ─▶ todo, value
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from copy import copy
from dataclasses import dataclass, fields

from servogen.engines.inputs.serial import HOLD
from servogen.engines.stream.protocol import CommandKind
from servogen.engines.stream.streaming import Streaming
from servogen.pic.device import INTERRUPT_VECTOR, RAM_FIRST, RAM_LAST, STACK_LEVELS, registers
from servogen.pic.isa import encode
from servogen.pic.known_values import word_of
from servogen.pic.wcet import TimedProgram
from servogen.prove.stream.bits import FALSE, TRUE, Bits, Solver, Truth, all_of, byte, choose, unknown
from servogen.prove.stream.chip import BROKEN, NOTHING, SENDING, ReceiverState, StreamChip
from servogen.prove.stream.counterexample import NOBODY, Suspect
from servogen.prove.stream.execution import (
    BANK_1,
    EEADR,
    EECON1,
    EEDATA,
    EEPROM,
    FSR,
    GIE,
    INTCON,
    OPTION,
    PCL,
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

ENABLED = 0xA0
"""INTCON while main runs: GIE and T0IE."""
TMR0_COUNTS_CYCLES = 0x8F
"""OPTION_REG: the prescaler is the watchdog's."""
SLOT = 0x3F
STARTING, GATHERING = 6, 7
"""Of `slot`: the bits of the slot's number, and two flags above them."""
REQUEST, COMMAND = 1, 2
"""Bits of `due`."""
MAX_BYTE = 0xFF  # begins a command: no value is as large
WRERR = 3
SENT = RX_BYTE, RX_LEFT, RX_BITS = "rx_byte", "rx_left", "rx_bits"
"""The receiver's variables, in which main leaves an answer to the interrupt."""
MAX_SHOWN = 8
"""The maximum number of values that a failed lemma shows."""

Tell = Callable[[str, int, int], None]


def _between_steps() -> dict[int, Bits]:
    """Return the registers that main leaves to its next step: interrupts enabled, no write to the EEPROM."""
    return {INTCON: byte(ENABLED), EECON1: unknown("EECON1", 5).above(Bits(3, 0))}


class Fails(Exception):
    """Raised where a lemma does not hold; says what differs, and for which values."""


def between_steps(names: Names, chip: StreamChip, read: Callable[[int], Bits]) -> Truth:
    """Return what holds between two steps of main: of a chip's variables, and of the bits in the bytes of the
    groups that belong to no servo; `read` reads these bytes.
    """
    if names.streamed.coarse:
        return chip.valid()
    everybody = sum(1 << names.group_bit(n) for n in range(names.servos))
    unused_bits = [read(names.at(name)) & (0xFF ^ everybody) for name in ("group", "waiting")]
    return chip.valid() & all_of(bits.equals(0) for bits in unused_bits)


def bytes_of(names: Names, chip: StreamChip, slot: Bits) -> dict[int, Bits]:
    """Return the bytes of a chip's variables, by address."""
    content = {}
    coarse = names.streamed.coarse
    for n in range(names.servos):
        if coarse:
            content[names.at("place", n)] = chip.widths[n][0:8]
            content[names.at("goal", n)] = chip.goals[n][0:8]
        else:
            for name, pair in (("width", chip.widths[n]), ("goal", chip.goals[n])):
                content[names.at(f"{name}_low", n)] = pair[0:8]
                content[names.at(f"{name}_high", n)] = pair[8:16]
        content[names.at("speed", n)] = chip.speeds[n]
        content[EEPROM + n] = chip.trims[n]
    groups = {} if coarse else {"group": chip.group, "waiting": chip.waiting}
    for name, members in groups.items():
        together = byte(0)
        for n, member in enumerate(members):
            together = together | choose(member, byte(1 << names.group_bit(n)), byte(0))
        content[names.at(name)] = together
    content[names.at("left")] = chip.left
    if names.streamed.stream.fail_safe != HOLD:
        content[names.at("silence")] = chip.silence
    flags = choose(chip.starting, byte(1 << STARTING), byte(0))
    flags = flags | choose(chip.gathering, byte(1 << GATHERING), byte(0))
    content[names.at("slot")] = slot | flags
    return content


def receiver_counts(streamed: Streaming) -> list[int]:
    """Return what rx_bits can be."""
    sending = [1 << SENDING | bits for bits in range(1, 11)] if streamed.stream.transmit_pin else []
    return [*range(11), *sending, 1 << BROKEN]


@dataclass(frozen=True, slots=True)
class Accesses:
    """What main's words read and write, by address."""

    reads: frozenset[int] = frozenset()
    writes: frozenset[int] = frozenset()

    def __or__(self, other: Accesses) -> Accesses:
        return Accesses(self.reads | other.reads, self.writes | other.writes)


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

    def _execution(self, suspect: Suspect = NOBODY) -> Execution:
        self.runs += 1
        self.suspect = suspect
        self.solver.forget()
        return Execution(self.names.words, self.solver)

    # states as the specification has them

    def _chip(self, read: Callable[[int], Bits]) -> StreamChip:
        """Return the chip's variables, read by `read`."""
        names, servos, coarse = self.names, range(self.names.servos), self.names.streamed.coarse

        def pair(name: str, n: int) -> Bits:
            return read(names.at(f"{name}_high", n)).above(read(names.at(f"{name}_low", n)))

        def members(name: str) -> list[Truth]:
            together = read(names.at(name))
            return [together.bit(names.group_bit(n)) for n in servos]

        slot, left = read(names.at("slot")), read(names.at("left"))
        silent = names.streamed.stream.fail_safe != HOLD
        return StreamChip(
            names.streamed,
            [read(names.at("place", n)).wide(16) if coarse else pair("width", n) for n in servos],
            [read(names.at("goal", n)).wide(16) if coarse else pair("goal", n) for n in servos],
            [read(names.at("speed", n)) for n in servos],
            [read(EEPROM + n) for n in servos],
            [slot.bit(GATHERING) for _ in servos] if coarse else members("waiting"),
            [~left.equals(0) for _ in servos] if coarse else members("group"),
            left,
            slot.bit(STARTING),
            slot.bit(GATHERING),
            read(names.at("silence")) if silent else byte(0),
        )

    def _unchanged(self, code: Execution) -> dict[int, Bits]:
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

    def _compare(
        self,
        where: str,
        code: Execution,
        state: SymbolicState,
        wanted: Mapping[int, Bits],
        more: Truth = TRUE,
    ) -> None:
        """Raise Fails unless all bytes of a state are as wanted, and `more` holds."""
        more = more & (~code.byte(state, EECON1).bit(WREN) | code.initial(EECON1).bit(WREN))
        differs = {place: ~code.byte(state, place).equals(value) for place, value in wanted.items()}
        some = ~more
        for truth in differs.values():
            some = some | truth
        # One question about all bytes together; only if something differs is each asked about on its own.
        context = code.given & state.path
        if not self.solver.possible(context & some):
            return
        for place, truth in differs.items():
            if self.solver.possible(context & truth):
                is_, should = (self.solver.example(bits) for bits in (code.byte(state, place), wanted[place]))
                self._note_values(code)
                wrong = f"{self._place_name(place)} becomes {is_}, not {should}"
                raise Fails(f"{where}: {wrong}{self._example_text(code)}")
        # The solver has no example after a question about a place that does not differ.
        self.solver.possible(context & ~more)
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
        values = {
            self._place_names[place]: value
            for place, bits in sorted(code.first.items())
            if bits.value is None and place in self._place_names and (value := self.solver.example(bits))
        }
        shown = [f"{name} = {value}" for name, value in values.items()][:MAX_SHOWN]
        return ", if " + ", ".join(shown) if shown else ""

    @property
    def _place_names(self) -> dict[int, str]:
        place_names = {EEPROM + n: f"byte {n} of the EEPROM" for n in range(self.names.servos)}
        for name, register in registers().items():
            place_names[register.address] = name
        for name, (address, size) in self.names.variables.items():
            for offset in range(size):
                place_names[address + offset] = f"{name}[{offset}]" if size > 1 else name
        return place_names

    def _place_name(self, place: int) -> str:
        return self._place_names.get(place, f"place 0x{place:02X}")

    # main

    def start(self) -> Accesses:
        """Check what main leaves to its loop after a reset: everything is unknown before it."""
        names = self.names
        if names.head != names.enabled:
            raise Fails("interrupts are enabled before all that comes before main's loop is done")
        code = self._execution()
        # WRERR is not known after a reset (DS35007 table 2-1, EECON1).
        interrupted_write = Bits(4, 0).above(unknown("WRERR", 1)).above(Bits(WRERR, 0))
        known = {PCLATH: byte(0), INTCON: byte(0), OPTION: byte(0xFF), EECON1: interrupted_write}
        known |= {registers()[name].address: byte(0xFF) for name in ("TRISA", "TRISB")}
        ends = code.run(code.state(0, known), {names.head})
        for end in ends:
            trims = [code.initial(EEPROM + n) for n in range(names.servos)]
            chip = StreamChip.after_reset(names.streamed, trims)
            chip.begin_frame()
            chip.prepare(0)
            wanted = bytes_of(names, chip, byte(0)) | self._pulse(chip, 0, code, end)
            for name, value in (("todo", NOTHING), ("command", NOTHING), ("rx_bits", 0), ("rest", 0)):
                wanted[names.at(name)] = byte(value)
            wanted |= {names.at("due"): byte(0), names.at("ticks"): byte(3)}
            wanted |= {INTCON: byte(ENABLED), OPTION: byte(TMR0_COUNTS_CYCLES)}
            tris_bits = [code.byte(end, names.port(pin) | BANK_1).bit(int(pin[2])) for pin in names.pins]
            directions = all_of(~bit for bit in tris_bits) & self._directions(code, end, FALSE)
            self._compare("after a reset", code, end, wanted, chip.valid() & directions)
        if not ends:
            raise Fails("after a reset the main loop is not reached")
        for address in sorted(code.switches - {names.enabled - 1}):
            raise Fails(f"interrupts are switched before main's loop, at 0x{address:03X}")
        return Accesses(frozenset(code.reads), frozenset(code.writes))

    def _pulse(self, chip: StreamChip, n: int, code: Execution, end: SymbolicState) -> dict[int, Bits]:
        """Return the bytes with which the interrupt makes a servo's pulse; a pulse of 0 has no pin."""
        names, chip = self.names, chip.copy()
        off = chip.widths[n].equals(0)
        if names.streamed.coarse:
            # The place at the end is compared on its own: so both sides multiply the same byte.
            chip.widths[n] = code.byte(end, names.at("place", n)).wide(16)
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
        reads: set[int] = set()
        writes: set[int] = set()
        for number in range(slots) if numbers is None else numbers:
            self.tell("pulses prepared", number, slots)
            slot = unknown("flags", 2).above(Bits(STARTING, number))
            # Bits of `due`: 0 a pulse was late, 1 the request, 2 a command is complete.
            due = Bits(5, 0).above(unknown("command", 1)).above(Bits(1, 1)).above(unknown("late", 1))
            code = self._execution()
            code.counted = names.listing.label("st_whole")
            begin = code.state(names.head, {names.at("slot"): slot, names.at("due"): due, **_between_steps()})
            chip = self._chip(code.initial)
            code.given = between_steps(names, chip, code.initial)
            # The rise of slot n requests the pulse of slot n + 1.
            following = (number + 1) % slots
            if following == 0:
                chip.begin_frame()
            wanted = self._unchanged(code)
            if following < names.servos:
                chip.prepare(following)
            else:
                wanted |= {names.at("mask"): byte(0), names.at("next_hi"): byte(1)}
                wanted.pop(names.at("next_lo"))
                if names.two_ports:
                    wanted.pop(names.at("next_port"))
            wanted |= bytes_of(names, chip, byte(following))
            wanted |= {names.at("due"): due & 1, names.at("sum_lo"): due, INTCON: byte(ENABLED)}
            where = f"the pulse of slot {following}"
            for end in self._run_to(code, begin, {names.cleared}, where):
                if following < names.servos:
                    wanted |= self._pulse(chip, following, code, end)
                self._compare(where, code, end, wanted, chip.valid())
            reads |= code.reads
            writes |= code.writes
            self.divided = max(self.divided, code.visits)
        return Accesses(frozenset(reads), frozenset(writes))

    def _run_to(
        self, code: Execution, begin: SymbolicState, stops: set[int], where: str
    ) -> list[SymbolicState]:
        ends = code.run(begin, stops)
        covered = FALSE
        for end in ends:
            covered = covered | end.path
            if end.bank:
                raise Fails(f"{where}: bank 1 is still selected")
        if self.solver.possible(code.given & ~covered):
            raise Fails(f"{where}: the end is not reached{self._example_text(code)}")
        return ends

    def idle(self) -> Accesses:
        """Check that main does nothing in a turn of its loop without a request, which it looks for once.

        A second look could find a request that comes between the two; of later looks in a turn with a request
        all find the same, because nothing but main clears it.
        """
        names = self.names
        code = self._execution()
        code.watched = frozenset({names.at("due")})
        due = Bits(6, 0).above(Bits(1, 0)).above(unknown("late", 1))
        begin = code.state(names.head, {names.at("due"): due, **_between_steps()})
        wanted = self._unchanged(code) | {EEPROM + n: code.initial(EEPROM + n) for n in range(names.servos)}
        for end in self._run_to(code, begin, {names.head}, "without a request"):
            if end.looks.count(names.at("due")) > 1:
                raise Fails("main looks for a request more than once in a turn")
            self._compare("without a request", code, end, wanted)
        return Accesses(frozenset(code.reads), frozenset(code.writes))

    def execute(self, seconds: Iterable[int] = range(256)) -> Accesses:
        """Check every command with one of these second bytes, and any third one that a receiver takes."""
        names, slots = self.names, self.names.streamed.layout.slots
        reads: set[int] = set()
        writes: set[int] = set()
        for second in seconds:
            if second % 16 == 0:
                self.tell("commands", second, 256)
            due = Bits(7, 0).above(unknown("late", 1))
            code = self._execution(Suspect(second=second))
            code.watched = frozenset(names.at(name) for name in SENT)
            begin = code.state(
                names.cleared,
                {names.at("todo"): byte(second), names.at("due"): due, **_between_steps()},
            )
            value, slot, copied = (code.initial(names.at(name)) for name in ("value", "slot", "sum_lo"))
            code.given = between_steps(names, self._chip(code.initial), code.initial)
            code.given = code.given & value.less(MAX_BYTE) & (slot & SLOT).less(slots)
            where = f"the command FF {second:02X}"
            ends = self._run_to(code, begin, {names.head}, where)
            trims = not names.streamed.coarse and second - CommandKind.TRIM.value in range(names.servos)
            for address in sorted(code.switches):
                word = word_of(names.words[address])
                if not word.changes_bit or (word.f, word.b) != (INTCON, GIE):
                    raise Fails(f"{where}: the word at 0x{address:03X} changes which interrupts are enabled")
                if not trims:
                    raise Fails(f"{where}: interrupts are masked")
            # A command waits while the EEPROM is being written. The words test this once; both answers are
            # followed.
            if len(code.busy) != 1:
                raise NotFollowed(f"{where}: EECON1 is read {len(code.busy)} times")
            runs = copied.bit(COMMAND) & ~code.busy[0]
            chip = self._chip(code.initial)
            chip.execute(second, value)
            answers = runs if chip.answer is not None else FALSE
            self._check_handover(where, code, ends, chip.answer is not None)
            wanted = self._unchanged(code)
            for place, changed in bytes_of(names, chip, slot & SLOT).items():
                wanted[place] = choose(runs, changed, code.initial(place))
            wanted[names.at("todo")] = choose(runs, byte(NOTHING), byte(second))
            wanted.pop(names.at("value"))
            if chip.answer is not None:
                sent = {RX_BYTE: chip.answer, RX_LEFT: byte(0), RX_BITS: byte(1 << SENDING | 10)}
                for name, changed in sent.items():
                    wanted[names.at(name)] = choose(runs, changed, code.initial(names.at(name)))
            wanted[INTCON] = byte(ENABLED)
            for end in ends:
                value_kept = runs | code.byte(end, names.at("value")).equals(value)
                after = self._chip(lambda place: code.byte(end, place))  # noqa: B023 - used in this turn only
                self._compare(
                    where,
                    code,
                    end,
                    wanted,
                    value_kept & after.valid() & self._directions(code, end, answers),
                )
            reads |= code.reads
            writes |= code.writes
        return Accesses(frozenset(reads), frozenset(writes))

    def _check_handover(
        self, where: str, code: Execution, ends: Iterable[SymbolicState], answers: bool
    ) -> None:
        """Check that main leaves the receiver's variables alone, but for an answer, which an interrupt may
        take from the moment on in which `rx_bits` is written: it is written once, after all else.
        """
        sent = {self.names.at(name) for name in SENT}
        for place in sorted(sent & (code.reads if answers else code.reads | code.writes)):
            raise Fails(f"{where}: main uses {self._place_name(place)} of the receiver")
        for end in ends:
            written = [~look for look in end.looks if ~look in sent]
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
        code.given = ~high.equals(0) & high.less(rounds) & self._possible_bit_counts(code)
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
            self._compare("a rise", code, end, wanted)
        if not ends:
            raise Fails("a rise does not end")

    def _possible_bit_counts(self, code: Execution) -> Truth:
        among = FALSE
        for count in receiver_counts(self.names.streamed):
            among = among | code.initial(self.names.at("rx_bits")).equals(count)
        return among

    def receive(self) -> None:
        """Check a look at the line, in every state of the receiver and of the parser."""
        names = self.names
        port, bit = names.line
        for number, bits in enumerate(receiver_counts(self.names.streamed)):
            self.tell("states of the receiver", number, len(receiver_counts(self.names.streamed)))
            code = self._execution()
            begin = code.state(names.listing.label("st_look"), {names.at("rx_bits"): byte(bits)}, (RETURNED,))
            own = ("rx_left", "rx_last", "rx_byte", "command", "todo", "value")
            line = code.initial(port).bit(bit)
            timer, ticks = code.initial(TMR0), code.initial(names.at("ticks"))
            # Where `ticks` is even, TMR0 is 128 cycles ahead of the time.
            now = choose(ticks.bit(0), timer, timer + 128) >> 2
            left, last_look, shifted, command, todo, value = (code.initial(names.at(name)) for name in own)
            receiver = ReceiverState(
                names.streamed, byte(bits), left, last_look, shifted, command, todo, value
            )
            ends = code.run(begin, {RETURNED})
            if bits:
                receiver.look(now & SLOT, line)
            else:
                receiver.start(now & SLOT, line)
            values = [getattr(receiver, variable.name) for variable in fields(receiver)[1:8]]
            wanted = self._unchanged(code) | dict(
                zip([names.at(name) for name in ("rx_bits", *own)], values, strict=True)
            )
            last = names.at("rx_last")
            wanted_last = wanted.pop(last)
            wanted.pop(names.at("t"))
            among = FALSE
            for count in receiver_counts(self.names.streamed):
                among = among | receiver.bits.equals(count)
            where = f"a look at the line, {bits} in rx_bits"
            covered = FALSE
            for end in ends:
                covered = covered | end.path
                if end.looks.count(port) > 1 or end.looks.count(TMR0) > 1:
                    raise Fails(f"{where}: the line or the timer is read twice")
                same_look = ((code.byte(end, last) ^ wanted_last) & SLOT).equals(0)
                self._compare(
                    where, code, end, wanted, same_look & among & self._latch_as_due(code, end, receiver)
                )
            if self.solver.possible(code.given & ~covered):
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
                checked |= {back - 1 for back in end.stack}
                idle = code.byte(end, names.at("rx_bits")).equals(0)
                wrong = {take: idle, hunt: ~idle}.get(end.pc, FALSE)
                if self.solver.possible(end.path & wrong):
                    raise Fails(f"the line is looked at in the wrong way, from 0x{label:03X}")
        calls = {encode("CALL", k=label) for label in (take, hunt)}
        for address in names.of_interrupt:
            if names.words[address] in calls and address not in checked:
                raise Fails(f"the line is looked at in the wrong way, from 0x{address:03X}")

    def context(self) -> frozenset[int]:
        """Check that an interrupt leaves the C its registers, and return where it keeps them."""
        return self._context(0) | self._context(1)

    def _context(self, bank: int) -> frozenset[int]:
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
        changed = {word_of(names.words[address]) for address in self._body_addresses()}
        own = {word.f for word in changed if word.writes_f}
        if context & own:
            raise Fails("the interrupt writes where the compiler keeps the C's registers")
        after = copy(inside)
        after.bytes = dict(inside.bytes)
        after.path = TRUE
        after.pc = names.listing.label("st_out")
        after.w = unknown("W")
        after.carry, after.digit_carry, after.zero = (unknown(name, 1).bit(0) for name in ("C", "DC", "Z"))
        # Whatever the interrupt has done in between, its end must restore the context.
        for place in own - {STATUS}:
            after.bytes[place] = unknown(f"0x{place:02X}")
        # RETFIE returns to what was interrupted.
        after.stack = (RETURNED,)
        for end in code.run(after, {RETURNED}):
            wanted = {place: code.initial(place) for place in (FSR, PCLATH)}
            same = end.w.equals(first.w) & code.status(end).equals(status)
            self._compare("an interrupt's end", code, end, wanted, same)
        if frozenset(code.writes) - context - {STATUS, PCLATH, FSR, INTCON}:
            raise Fails("the interrupt's end writes a variable")
        return context

    def _body_addresses(self) -> Iterator[int]:
        """Yield the addresses of the interrupt without the compiler's words before and after it."""
        names = self.names
        end = names.listing.label("st_out")
        reached = TimedProgram(names.words, ()).reached(names.body)
        outside = TimedProgram(names.words, ()).reached(end)
        yield from sorted(reached - outside)

    def check_sharing(
        self,
        main: Accesses,
        preparing: Accesses,
        executing: Accesses,
        context: frozenset[int],
        idle: Accesses = Accesses(),
    ) -> None:
        """Check that main and the interrupt share only what the argument about times covers."""
        names = self.names
        interrupt = {word_of(names.words[address]) for address in self._body_addresses()}
        touched = {word.f for word in interrupt if word.has_f and word.f >= RAM_FIRST}
        written = {word.f for word in interrupt if word.writes_f and RAM_FIRST <= word.f <= RAM_LAST}

        def addresses(*wanted: str) -> set[int]:
            return {names.at(name) for name in wanted if names.has(name)}

        # These are shared on purpose: one side writes them before the other reads them, which the request in
        # `due` and the times in `response` ensure.
        taken_over = addresses("mask", "next_lo", "next_hi", "next_port", "due", "todo", "value")
        sent = addresses(*SENT)
        # Before its loop finds a request, an interrupt may take the pulse in any cycle.
        for place in sorted(idle.writes & touched):
            raise Fails(f"main writes {self._place_name(place)} without a request")
        preparing |= idle
        loop = preparing.reads | preparing.writes | executing.reads | executing.writes
        for place in sorted(context & (main.reads | main.writes | loop)):
            raise Fails(f"main uses {self._place_name(place)}, where the interrupt keeps its registers")
        for place in sorted(loop & written - taken_over - sent):
            raise Fails(f"main uses {self._place_name(place)}, which the interrupt writes")
        for place in sorted((preparing.writes | executing.writes) & touched - taken_over - sent):
            raise Fails(f"main writes {self._place_name(place)}, which the interrupt uses")
        late = addresses("mask", "next_lo", "next_hi", "next_port", "due")
        for place in sorted((executing.writes & late) | (executing.reads & addresses("due"))):
            raise Fails(f"main uses {self._place_name(place)} after the request is cleared")
        if INTCON in preparing.writes:
            raise Fails("main masks interrupts beside a command")
        early = (preparing.reads | preparing.writes) & (addresses("todo", "value") | sent)
        for place in sorted(early):
            raise Fails(f"main uses {self._place_name(place)} before the request is cleared")
        allowed = {STATUS, FSR, PCLATH, EEADR, EEDATA, EECON1, EECON1 + 1, INTCON, PCL}
        out = names.streamed.stream.transmit_pin
        allowed |= {names.port(out), names.port(out) | BANK_1} if out else set()
        for place in sorted((preparing.writes | executing.writes) - allowed):
            if not RAM_FIRST <= place <= RAM_LAST:
                raise Fails(f"main writes {self._place_name(place)} in its loop")

    def stack(self) -> None:
        """Check that the chip has the return addresses that main and an interrupt in it need together."""
        program = TimedProgram(self.names.words, ())

        def calls(start: int, left: int) -> int:
            if left < 0:
                raise Fails(f"calls need more than {STACK_LEVELS} return addresses")
            words = map(program.word, program.reached(start))
            called = {word.k for word in words if word.flow == "call"}
            return max((1 + calls(begin, left - 1) for begin in called), default=0)

        main = calls(0, STACK_LEVELS)
        calls(INTERRUPT_VECTOR, STACK_LEVELS - main - 1)
