"""What a stream program's words do with every byte; a changed word is noticed, with the place of the fault.

`servogen prove --any-line` checks all commands and slots; here some of them are.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any

import pytest

from servogen.edges import PINS
from servogen.engines.stream.engine import stream
from servogen.engines.stream.firmware import compiled, firmware
from servogen.engines.stream.protocol import NO_TRIM, SYNC, CommandKind, command_of
from servogen.engines.stream.streaming import Streaming
from servogen.job import PlannedJob, load, loads, plan_job
from servogen.pic.image import Image, read_hex
from servogen.pic.isa import encode
from servogen.pic.listing import Listing, ListingRow
from servogen.prove.counterexample import pin_changes
from servogen.prove.stream import lemmas as module
from servogen.prove.stream.bits import FALSE, Bits, Solver, Truth, all_of, byte
from servogen.prove.stream.chip import NOTHING, ReceiverState, StreamChip
from servogen.prove.stream.counterexample import CounterexampleSearch, Suspect
from servogen.prove.stream.execution import RETURNED, Execution, NotFollowed
from servogen.prove.stream.lemmas import Lemmas
from servogen.prove.stream.names import SCRATCH, Names
from servogen.prove.stream.proof import prove_line
from servogen.prove.stream.sharing import Accesses, Fails, MainAccesses, check_sharing, check_stack
from servogen.simulator import Levels, Machine, Stimuli
from tests.engines.stream import chip_model
from tests.engines.stream.stream_soak import JOBS, TWELVE

ARM = plan_job(load(JOBS / "stream-arm.toml"))
STREAMED = stream(ARM)[1]


@pytest.fixture(scope="module")
def listing() -> Listing:
    return compiled(ARM, STREAMED, "c2c").compilation.listing


def lemmas(  # type: ignore[no-untyped-def]
    listing: Listing, told: list[tuple[str, int, int]] | None = None, streamed: Streaming = STREAMED
):
    pytest.importorskip("bitwuzla", reason="the solver is not installed")
    told = [] if told is None else told
    return Lemmas(Names(listing, streamed), Solver(), lambda *progress: told.append(progress))


def changed(listing: Listing, at: int, word: int) -> Listing:
    assert any(row.address == at and row.word != word for row in listing.rows)
    rows = tuple(replace(row, word=word) if row.address == at else row for row in listing.rows)
    return replace(listing, rows=rows)


def found(listing: Listing, word: int, after: int) -> int:
    """The first address of a word from `after` on."""
    return next(row.address for row in listing.rows if row.address >= after and row.word == word)


@pytest.mark.campaign
def test_the_words_are_the_protocol_s(listing: Listing) -> None:
    told: list[tuple[str, int, int]] = []
    one = lemmas(listing, told)
    saved = one.context()
    assert len(saved) == 2 and saved.isdisjoint(one.names.variables.values()), "W and STATUS"
    one.dispatch()
    one.rise()
    one.receive()
    one.idle()
    # 0 to 10, 10 while it sends, and one after a broken byte.
    assert told == [("states of the receiver", n, 22) for n in range(22)]
    # Twice the context, two ways into the interrupt, a rise, the receiver's states, an idle turn.
    assert one.runs == 2 + 2 + 1 + 22 + 1


def variables_of(listing: Listing, places: Iterable[int]) -> set[str]:
    """The names of the C's variables at places, without those whose values no step leaves to the next."""
    return {
        name if size == 1 else f"{name}[{place - address}]"
        for address, name, size in listing.variables
        for place in places
        if address <= place < address + size and name not in SCRATCH and not name.endswith("(temporary)")
    }


def test_a_command_changes_its_variables_only(listing: Listing) -> None:
    told: list[tuple[str, int, int]] = []
    one = lemmas(listing, told)
    accesses = one.execute((0x08, 0x42))
    assert variables_of(listing, accesses.reads) == {"todo", "value"}
    assert variables_of(listing, accesses.writes) == {"todo", "speed[2]", "silence"}
    accesses = one.execute((0x42, 0x80))
    assert variables_of(listing, accesses.reads) == {"todo", "value", "slot", "waiting"}
    assert variables_of(listing, accesses.writes) == {
        "todo", "speed[2]", "silence", "slot", "waiting", "group", "left"
    }  # fmt: skip
    one.execute((0x01, 0xC0, 0xF0))
    # One of sixteen commands is told.
    assert told == [("commands", second, 256) for second in (0x80, 0xC0, 0xF0)]


def test_a_slot_without_a_servo_has_no_pulse(listing: Listing) -> None:
    """The servos are in slots 0 to 2 of six; the pulse of slot 3 is requested in slot 2."""
    told: list[tuple[str, int, int]] = []
    one = lemmas(listing, told)
    accesses = one.prepare([2])
    assert variables_of(listing, accesses.reads) == {"due", "slot"}
    assert variables_of(listing, accesses.writes) == {"due", "slot", "mask", "next_hi"}
    assert told == [("pulses prepared", 2, 6)]
    clear = found(listing, encode("CLRF", f=listing.variable("mask")), one.names.loop_head)
    for at, word, text in (
        (clear, NOP, "the pulse of slot 3: mask becomes"),
        (clear + 1, encode("MOVLW", k=2), "the pulse of slot 3: next_hi becomes 2, not 1"),
    ):
        other = lemmas(changed(listing, at, word))
        assert fault(lambda: other.prepare([2])).startswith(text)  # noqa: B023


@pytest.mark.campaign
def test_the_preparation_of_the_first_slot_begins_the_frame(
    listing: Listing, monkeypatch: pytest.MonkeyPatch
) -> None:
    """For servos that move at once and in no group; of all others the proof is longer."""
    everywhere = module.invariant

    def calm(names: Any, chip: StreamChip, of: Callable[[int], Bits]) -> Truth:
        alone = [~member for member in (*chip.group, *chip.waiting, chip.starting)]
        still = [value.equals(0) for value in (*chip.speeds, chip.frames_left)]
        return everywhere(names, chip, of) & all_of([*alone, *still, chip.silence.less(10)])

    monkeypatch.setattr(module, "invariant", calm)
    accesses = lemmas(listing).prepare([5])
    assert variables_of(listing, accesses.writes) >= {"silence", "slot", "next_lo", "width_low[0]"}
    count = found(listing, encode("INCF", f=listing.variable("silence"), d=1), 0)
    other = lemmas(changed(listing, count, NOP))
    assert fault(lambda: other.prepare([5])).startswith("the pulse of slot 0: silence becomes")


def test_a_start_writes_all_variables(listing: Listing) -> None:
    accesses = lemmas(listing).start()
    every = variables_of(listing, range(0x50))
    # What the start-up clears, the C need not write again.
    assert variables_of(listing, accesses.writes) == every
    assert {0x06, 0x86, 0x81, 0x0B} <= accesses.writes, "PORTB, TRISB, OPTION_REG, INTCON"
    assert 0x08 in accesses.reads, "EEDATA: the trims"


def test_each_lemma_begins_in_every_state_of_its_step(
    listing: Listing, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of all bytes, these bits only are known before it; "u" is unknown, bit 7 is the first."""
    begun: list[tuple[int, dict[int, str], Execution]] = []
    original = Execution.state

    def state(self: Execution, pc: int, known: dict[int, Bits], *more: Any) -> Any:
        shown = {
            place: "".join("01u"[2 if bit is None else bit] for bit in reversed(bits))
            for place, cell in known.items()
            if cell.width == 8
            for bits in [[cell.bit(n).known for n in range(8)]]
        }
        begun.append((pc, shown, self))
        return original(self, pc, known, *more)

    monkeypatch.setattr(Execution, "state", state)
    one = lemmas(listing)
    names, place = one.names, listing.variable

    def states(run: Callable[[], object]) -> list[tuple[int, dict[int, str]]]:
        begun.clear()
        run()
        return [(pc, shown) for pc, shown, _ in begun]

    # DS35007 table 6-2: after a reset PCLATH, INTCON and EECON1 but for WRERR are 0, OPTION_REG, TRIS 0xFF.
    ones = dict.fromkeys((0x81, 0x85, 0x86), "1" * 8)
    assert states(one.start) == [(0, {10: "0" * 8, 11: "0" * 8, 0x88: "0000u000", **ones})]
    # Between two steps GIE and T0IE are set, and neither RD, WR nor WREN is.
    between = {11: "10100000", 0x88: "uuuuu000"}
    # Of `due`, bit 0 says that a pulse was late, once; bit 1 requests one; bit 2: a command came before it.
    assert states(one.idle) == [(names.loop_head, between | {place("due"): "0000000u"})]
    slot = {place("slot"): "uu000010", place("due"): "00000u1u"}
    assert states(lambda: one.prepare([2])) == [(names.loop_head, between | slot)]
    command = {place("todo"): "01000010", place("due"): "0000000u"}
    assert states(lambda: one.execute((0x42,))) == [(names.after_clear, between | command)]
    assert states(one.rise) == [(names.edge + 1, {place("rest"): "0" * 8})]
    ((_, _, rise),) = begun
    # The prepared pulse has 1 to 12 rounds of 13, and the receiver has one of its counts.
    for name, values in (("next_hi", range(1, 13)), ("rx_bits", [*range(11), *range(0x41, 0x4B), 0x80])):
        found = [
            n
            for n in range(256)
            if one.solver.possible(rise.precondition & rise.initial(place(name)).equals(n))
        ]
        assert found == [*values]
    counts = [0, *range(1, 11), *range(0x41, 0x4B), 0x80]
    look = listing.label("st_look")
    assert states(one.receive) == [(look, {place("rx_bits"): f"{count:08b}"}) for count in counts]
    assert states(one.context)[0] == (4, {}) and RETURNED not in range(1024)


def test_a_look_that_forgets_its_time_or_sends_nothing_is_noticed(listing: Listing) -> None:
    where = "a look at the line, {} in rx_bits: what holds between two steps is lost"
    forgets = of_label("st_take", "MOVWF", NOP, f="rx_last")(listing)
    assert fault(lemmas(forgets).receive).startswith(where.format(1))
    # The chip answers on RA3; 10 bits are to be sent.
    mute = of_label("st_send", "BCF", NOP, f=5, b=3)(listing)
    assert fault(lemmas(mute).receive).startswith(where.format(0x4A))


def test_main_looks_once_in_a_turn_whether_a_pulse_is_requested(listing: Listing) -> None:
    """The interrupt may request one between two looks: then main would do half of its work."""
    again = encode("MOVF", f=listing.variable("due"), d=0)
    other = changed(listing, found(listing, encode("CLRWDT"), 0), again)
    assert fault(lemmas(other).idle) == "main looks for a request more than once in a turn"


def test_nothing_comes_between_the_start_of_interrupts_and_main_s_loop(listing: Listing) -> None:
    one = lemmas(listing)
    assert one.names.after_enable == one.names.loop_head
    one.names.__dict__["loop_head"] += 1
    assert fault(one.start) == "interrupts are enabled before all that comes before main's loop is done"


@pytest.mark.campaign
def test_the_turns_of_the_division_are_counted(listing: Listing, monkeypatch: pytest.MonkeyPatch) -> None:
    """Servo 1 has at most 778 cycles to go: three whole rounds, and a look at the remainder.

    Without a trim, from one end, in few frames: the proof of all is longer.
    """
    everywhere, travel = module.invariant, STREAMED.travels[1]

    def moving(names: Any, chip: StreamChip, of: Callable[[int], Bits]) -> Truth:
        one_way = chip.widths[1].equals(int(travel.minimum)) & chip.goals[1][0:8].equals(0x60)
        few = chip.frames_left.less(3) & chip.trims[1].equals(NO_TRIM)
        return everywhere(names, chip, of) & all_of(
            [chip.group[1], ~chip.waiting[1], ~chip.starting, one_way, few]
        )

    monkeypatch.setattr(module, "invariant", moving)
    assert travel.maximum - travel.minimum == 778
    one = lemmas(listing)
    assert one.divided == 0
    one.prepare([0])
    assert one.divided == 778 // 256 + 1


def fault(check: Callable[[], object]) -> str:
    """The reason for which a lemma does not hold or is not followed."""
    try:
        check()
    except (Fails, NotFollowed) as error:
        return str(error)
    return ""


def test_main_leaves_bank_0_selected_and_the_eeprom_locked(listing: Listing) -> None:
    ready = found(listing, encode("ANDLW", k=2), 0)
    other = changed(listing, ready - 1, NOP)  # BCF STATUS, RP0, after EECON1 has been read
    assert fault(lemmas(other).idle) == "without a request: bank 1 is still selected"
    # BCF EECON1, WREN: another fault could write the EEPROM.
    lock = found(listing, encode("BCF", f=8, b=2), 0)
    open_ = lemmas(changed(listing, lock, NOP))
    text = fault(lambda: open_.execute((0xC0,)))
    assert text.startswith("the command FF C0: what holds between two steps is lost, if ")
    assert open_.suspect.second == 0xC0 and open_.suspect.third is not None


def test_a_command_looks_once_whether_the_eeprom_is_being_written(listing: Listing) -> None:
    one = lemmas(changed(listing, lemmas(listing).names.after_clear, NOP))
    assert fault(lambda: one.execute((0x42,))) == "the command FF 42: EECON1 is read 0 times"


def test_a_look_reads_the_line_and_the_timer_once(listing: Listing) -> None:
    count = found(listing, encode("MOVLW", k=10), listing.label("st_hunt"))
    for f in (1, 5):  # TMR0, PORTA
        other = lemmas(changed(listing, count, encode("MOVF", f=f, d=0)))
        assert fault(other.receive) == "a look at the line, 0 in rx_bits: the line or the timer is read twice"


def test_a_lemma_whose_run_does_not_end_fails(listing: Listing, monkeypatch: pytest.MonkeyPatch) -> None:
    one = lemmas(listing)
    monkeypatch.setattr(Execution, "run", lambda *arguments, **options: [])
    assert fault(one.start) == "after a reset the main loop is not reached"
    assert fault(lambda: one.prepare([2])).startswith("the pulse of slot 3: the end is not reached")
    assert fault(one.rise) == "a rise does not end"
    assert fault(one.receive) == "a look at the line, 0 in rx_bits: it does not return"


def test_a_rise_takes_over_all_that_was_prepared(listing: Listing) -> None:
    edge = lemmas(listing).names.edge

    def rise(word: int, new: int) -> str:
        return fault(lemmas(changed(listing, found(listing, word, edge), new)).rise)

    place = listing.variable
    assert rise(encode("MOVWF", f=place("ticks")), NOP).startswith("a rise: ticks becomes")
    assert rise(encode("MOVWF", f=place("rest")), NOP).startswith("a rise: rest becomes")
    # 13 rounds have 26 interrupts, of which the first is that of the rise.
    assert rise(encode("SUBLW", k=24), encode("SUBLW", k=25)).startswith("a rise: rest becomes")
    assert rise(encode("BSF", f=place("due"), b=1), NOP).startswith("a rise: due becomes")
    assert rise(encode("BSF", f=place("due"), b=2), NOP).startswith("a rise: due becomes")
    assert rise(encode("BSF", f=place("due"), b=2), encode("CLRF", f=place("mask"))) != ""


def test_a_fault_of_the_receiver_is_suspected_of_the_command_that_comes(listing: Listing) -> None:
    one = lemmas(of_label("st_take", "MOVWF", NOP, f="value")(listing))
    assert fault(one.receive).startswith("a look at the line, 1 in rx_bits: value becomes")
    # The third byte of a command, whose second one came before.
    assert one.suspect.second not in (None, 0xFF, 0xFE) and one.suspect.third not in (None, 0xFF)
    assert one.suspect.chip is not None
    assert all(width.value is not None for width in one.suspect.chip.widths)


def test_an_interrupt_keeps_to_its_own_places(listing: Listing) -> None:
    one = lemmas(listing)
    body, place = one.names.body, listing.variable
    saved = one.context()
    ticks = found(listing, encode("MOVWF", f=place("ticks")), body)
    for at in saved:
        other = lemmas(changed(listing, ticks, encode("MOVWF", f=at)))
        assert fault(other.context) == "the interrupt writes where the compiler keeps the C's registers"
    # A longer end, which changes neither W nor STATUS, nor may change anything else.
    back = found(listing, encode("RETFIE"), 0)
    for f, text in (
        (place("left"), "the interrupt's end writes a variable"),
        (4, "an interrupt's end: FSR becomes"),
        (10, "an interrupt's end: PCLATH becomes"),
    ):
        longer = changed(listing, back, encode("GOTO", k=0x3F0))
        more = (encode("MOVWF", f=f), encode("RETFIE"))
        rows = [ListingRow(0x3F0 + n, word, "", "1") for n, word in enumerate(more)]
        assert fault(lemmas(replace(longer, rows=(*longer.rows, *rows))).context).startswith(text)


def test_what_the_interrupt_only_reads_main_may_not_write(listing: Listing) -> None:
    none, left = frozenset[int](), frozenset([listing.variable("left")])
    wait = found(listing, NOP, listing.label("st_exactly"))
    other = lemmas(changed(listing, wait, encode("MOVF", f=listing.variable("left"), d=0)))
    for one, text in ((lemmas(listing), ""), (other, "main writes left, which the interrupt uses")):
        write, read = Accesses(none, left), Accesses(left, none)
        for main, sentence in (
            (MainAccesses(prepare=write), text),
            (MainAccesses(execute=write), text),
            (MainAccesses(prepare=read, execute=read), ""),
        ):
            assert fault(lambda: check_sharing(one.names, main, none)) == sentence  # noqa: B023


Change = Callable[[Listing], Listing]


def of_label(label: str, old: str, new: int, **operands: str | int) -> Change:
    """Another word for the first one after a label that is the instruction `old`."""

    def change(listing: Listing) -> Listing:
        places = {
            name: listing.variable(value) if isinstance(value, str) else value
            for name, value in operands.items()
        }
        at = found(listing, encode(old, **places), listing.label(label))
        return changed(listing, at, new)

    return change


NOP = encode("NOP")


@pytest.mark.parametrize(
    ("lemma", "change", "why"),
    [
        # The receiver: a bit is shifted the wrong way; a byte without its stop bit; the third byte is lost.
        ("receive", of_label("st_data", "RRF", NOP, f="rx_byte", d=1), "rx_byte becomes"),
        ("receive", of_label("st_break", "MOVWF", NOP, f="command"), "command becomes"),
        ("receive", of_label("st_take", "MOVWF", NOP, f="value"), "value becomes"),
        # A command that does not begin with SYNC is taken for one.
        ("receive", of_label("st_sync", "MOVLW", encode("MOVLW", k=0xFD), k=0xFF), "command becomes"),
        # A rise: the width is not the prepared one; a command is not noted.
        ("rise", of_label("st_poll", "MOVWF", NOP, f="fine"), "fine becomes"),
        # A bit is taken though no byte is being received.
        ("dispatch", lambda listing: changed(listing, listing.label("st_plain_quiet") + 6, NOP), "wrong way"),
    ],
)
def test_a_changed_interrupt_is_noticed(lemma: str, change: Change, why: str, listing: Listing) -> None:
    one = lemmas(listing)
    if lemma == "rise":
        edge = one.names.edge
        word = encode("MOVWF", f=listing.variable("fine"))
        one = lemmas(changed(listing, found(listing, word, edge), NOP))
    else:
        one = lemmas(change(listing))
    with pytest.raises(Fails, match=why):
        getattr(one, lemma)()


@pytest.mark.parametrize(
    ("seconds", "change", "why"),
    [
        # The product is rounded down.
        ((0,), of_label("st_multiply", "RRF", NOP, f="value", d=1), r"FF 00.*goal"),
        # A servo's speed goes to another one; the trim is not stored; a group has another time.
        ((0x41,), None, r"FF 41.*speed"),
        ((0xC1,), None, r"FF C1.*byte 1 of the EEPROM"),
        ((0x80,), None, r"FF 80.*left"),
    ],
)
def test_a_changed_command_is_noticed(
    seconds: tuple[int, ...], change: Change | None, why: str, listing: Listing
) -> None:
    if change is None:
        change = {
            0x41: lambda it: swapped(it, encode("ADDLW", k=it.variable("speed")), 1),
            0xC1: lambda it: changed(it, found(it, encode("BSF", f=8, b=1), 0), NOP),
            0x80: lambda it: swapped(it, encode("MOVWF", f=it.variable("left")), None),
        }[seconds[0]]
    one = lemmas(change(listing))
    with pytest.raises(Fails, match=why):
        one.execute(seconds)


def swapped(listing: Listing, word: int, more: int | None) -> Listing:
    """The listing with another word wherever one is: with a larger operand, or none."""
    rows = tuple(
        replace(row, word=NOP if more is None else word + more) if row.word == word else row
        for row in listing.rows
    )
    assert rows != listing.rows
    return replace(listing, rows=rows)


@pytest.mark.parametrize(
    "change",
    [
        # The way is not divided by the frames that are left; a width goes down by too much.
        of_label("st_part", "RLF", NOP, f="sum_lo", d=1),
        of_label("st_down", "SUBWF", NOP, f="next_lo", d=1),
    ],
)
def test_a_changed_preparation_is_noticed(change: Change, listing: Listing) -> None:
    one = lemmas(change(listing))
    with pytest.raises(Fails, match=r"the pulse of slot 1: width_low\[1\] becomes"):
        one.prepare([0])


def test_a_changed_start_is_noticed(listing: Listing) -> None:
    # OPTION_REG: TMR0 would count the ticks of its pin.
    one = lemmas(swapped(listing, encode("MOVLW", k=0x8F), 0x20))
    with pytest.raises(Fails, match="after a reset: OPTION_REG becomes 175, not 143"):
        one.start()


def test_main_may_not_touch_a_pulse_after_it_has_been_prepared(listing: Listing) -> None:
    names, none = lemmas(listing).names, frozenset[int]()
    mask = Accesses(writes=frozenset([listing.variable("mask")]))
    check_sharing(names, MainAccesses(prepare=mask), none)
    with pytest.raises(Fails, match="main uses mask after the request is cleared"):
        check_sharing(names, MainAccesses(execute=mask), none)
    ticks = Accesses(frozenset([listing.variable("ticks")]))
    with pytest.raises(Fails, match="main uses ticks, which the interrupt writes"):
        check_sharing(names, MainAccesses(prepare=ticks), none)


def test_what_main_and_the_interrupt_may_share(listing: Listing) -> None:
    """Main hands a pulse over before it clears the request, takes a command after it, and answers then."""
    one = lemmas(listing)
    none = frozenset[int]()

    def fault(
        *, main: str = "", preparing: str = "", executing: str = "", writing: bool = True, context: str = ""
    ) -> str:
        def accesses(name: str) -> Accesses:
            places = frozenset(place_of(each) for each in name.split())
            return Accesses(none, places) if writing else Accesses(places, none)

        kept = frozenset(place_of(each) for each in context.split())
        try:
            steps = MainAccesses(
                start=accesses(main), prepare=accesses(preparing), execute=accesses(executing)
            )
            check_sharing(one.names, steps, kept)
        except Fails as error:
            return str(error)
        return ""

    def place_of(name: str) -> int:
        return int(name, 16) if name.startswith("0x") else listing.variable(name)

    for name in ("mask", "next_lo", "next_hi", "due"):
        assert fault(preparing=name) == ""
        assert fault(executing=name) == f"main uses {name} after the request is cleared"
        assert fault(executing=name, writing=False) == (
            "main uses due after the request is cleared" if name == "due" else ""
        )
    for name in ("todo", "value", "rx_byte", "rx_left", "rx_bits"):
        assert fault(executing=name) == ""
        early = f"main uses {name} before the request is cleared"
        assert fault(preparing=name) == fault(preparing=name, writing=False) == early
    for name in ("ticks", "rest", "fine", "t", "rx_last", "command"):
        for writing in (True, False):
            message = f"main uses {name}, which the interrupt writes"
            assert fault(preparing=name, writing=writing) == message
            assert fault(executing=name, writing=writing) == message
        assert fault(main=name) == "", "before the loop interrupts are not enabled"
        assert fault(main=name, context="left") == ""
        kept = f"main uses {name}, where the interrupt keeps its registers"
        for writing in (True, False):
            for step in ("main", "preparing", "executing"):
                assert fault(**{step: name}, context=name, writing=writing) == kept
    # Registers that main may write in its loop: STATUS, FSR, PCLATH, those of the EEPROM, PCL, and
    # PORTA and TRISA, on which the chip answers; INTCON in a command only.
    for place in ("0x03", "0x04", "0x0A", "0x08", "0x09", "0x88", "0x89", "0x02", "0x05", "0x85"):
        assert fault(preparing=place) == fault(executing=place) == ""
    assert (fault(executing="0x0B"), fault(preparing="0x0B")) == (
        "",
        "main masks interrupts beside a command",
    )
    for place, name in (("0x06", "PORTB"), ("0x86", "TRISB"), ("0x81", "OPTION_REG"), ("0x01", "TMR0")):
        text = fault(preparing=place)
        assert name in text and fault(executing=place) != ""
    assert fault(executing="0x86") == "main writes TRISB in its loop"
    assert fault(preparing="0x50") == "main writes place 0x50 in its loop"


def test_a_command_that_keeps_a_value_where_the_interrupt_keeps_w_is_noticed(listing: Listing) -> None:
    """Every word of it is right by itself: only an interrupt between its write and its reads changes it."""
    kept, scratch = min(lemmas(listing).context()), listing.variable("sum_lo")
    assert kept is not None and scratch is not None
    first = found(listing, encode("ANDWF", f=listing.variable("todo"), d=0), 0)
    first = found(listing, encode("MOVWF", f=scratch), first)
    other = listing
    for row in listing.rows:
        if first <= row.address < first + 0x38 and row.word & 0x7F == scratch and row.word < 0x1000:
            other = changed(other, row.address, row.word & ~0x7F | kept)
    one = lemmas(other)
    context, executing = one.context(), one.execute((0x00, 0x80))
    assert kept in executing.reads & executing.writes
    with pytest.raises(Fails, match="where the interrupt keeps its registers"):
        check_sharing(one.names, MainAccesses(execute=executing), context)


def test_an_interrupt_that_leaves_the_bank_is_noticed(listing: Listing) -> None:
    # CLRF STATUS selects the bank.
    select = found(listing, encode("CLRF", f=3), 4)
    with pytest.raises(Fails, match="the interrupt does not select bank 0"):
        lemmas(changed(listing, select, NOP)).context()
    # The words before RETFIE restore STATUS and W.
    restore = found(listing, encode("RETFIE"), listing.label("st_out"))
    for at in range(restore - 3, restore):
        with pytest.raises(Fails, match="an interrupt's end"):
            lemmas(changed(listing, at, NOP)).context()
    # One that restores them, but writes a variable on its way.
    with pytest.raises(Fails, match="an interrupt's end"):
        lemmas(changed(listing, restore - 2, encode("CLRF", f=listing.variable("left")))).context()


# counterexamples


def changed_text(old: str, new: str) -> str:
    text = (JOBS.parent / "firmware" / "stream-arm" / "main.c2c.c").read_text()
    assert text.count(old) == 1
    return text.replace(old, new)


def listing_of(text: str) -> Listing:
    return firmware(text, ARM, "c2c").compilation.listing


NAMES = ("base", "shoulder", "grip")
RARE = changed_text("left = value;", "left = value; if (left == 77) left = 9;")
"""Of 254 times of a group one is wrong."""
MASKED = "asm {\n    bcf     INTCON, 7\n    nop\n    bsf     INTCON, 7\n    }"


def test_pins_keep_their_directions_but_for_the_one_that_answers() -> None:
    for tris, text in (("0x07", "the command FF F0: what holds"), ("0x1F", "the command FF F0: what holds")):
        one = lemmas(listing_of(changed_text("TRISA = 0x17;", f"TRISA = {tris};")))
        assert fault(lambda: one.execute((0xF0,))).startswith(text)  # noqa: B023
    one = lemmas(listing_of(changed_text("TRISB = 0xF8;", "TRISB = 0xF8; TRISA = 0x0F;")))
    assert fault(one.start).startswith("after a reset: what holds")


@pytest.mark.campaign
def test_only_a_trim_masks_interrupts_and_nothing_else_changes_what_is_enabled() -> None:
    one = lemmas(listing_of(changed_text("speed[n] = value;", f"{{ {MASKED} speed[n] = value; }}")))
    assert fault(lambda: one.execute((0x42,))) == "the command FF 42: interrupts are masked"
    one.execute((0xC3,))
    # By its name or by a pointer, for good or for a moment.
    for word in (
        "bcf     INTCON, 5",
        "clrf    INTCON",
        "movwf   INTCON\n    bsf     INTCON, 2",
        "movlw   0x0B\n    movwf   FSR\n    bcf     INDF, 2",
    ):
        text = changed_text("bsf     0x08, 2 ", f"{word}\n    bsf     0x08, 2 ")
        other = lemmas(listing_of(text))
        text = fault(lambda: other.execute((0xC0,)))  # noqa: B023
        assert text.startswith("the command FF C0: the word at 0x")
        assert text.endswith(" changes which interrupts are enabled")


def test_interrupts_are_switched_on_by_the_last_word_before_the_loop_alone() -> None:
    """An interrupt before it would find variables that have no value yet."""
    for word in ("bsf     INTCON, 7", "movlw   0x0B\n    movwf   FSR\n    movlw   0xA0\n    movwf   INDF"):
        text = changed_text("TMR0 = 0; ", f"TMR0 = 0; asm {{\n    {word}\n    }}")
        one = lemmas(listing_of(text))
        assert fault(one.start).startswith("interrupts are switched before main's loop, at 0x")


def test_a_start_depends_on_no_bit_that_a_reset_leaves_unknown() -> None:
    """WRERR: a reset may have ended a write to the EEPROM."""
    text = changed_text("ticks = 3;", "if (WRERR) todo = 0; ticks = 3;")
    assert "todo becomes 0, not 254" in fault(lemmas(listing_of(text)).start)


def test_the_end_of_a_write_comes_at_any_time() -> None:
    """Two looks at EEIF in one step may find it 0 and 1."""
    text = changed_text("    slot++;", "    if (!EEIF) if (EEIF) silence = 0; slot++;")
    why = fault(lambda: lemmas(listing_of(text)).prepare((0,)))
    assert why.startswith("the pulse of slot 1: ") and " becomes " in why


def test_main_changes_a_prepared_pulse_in_no_cycle(listing: Listing) -> None:
    """Nothing of it is left after the turn: only an interrupt in between takes the wrong pulse."""
    again = "asm {\n    comf    _next_hi, 1\n    comf    _next_hi, 1\n    }"
    one = lemmas(listing_of(changed_text("while (1) {", f"while (1) {{ {again}")))
    idle = MainAccesses(idle=one.idle())
    assert fault(lambda: check_sharing(one.names, idle, frozenset())) == (
        "main writes next_hi without a request"
    )
    one = lemmas(listing)
    assert fault(lambda: check_sharing(one.names, MainAccesses(idle=one.idle()), frozenset())) == ""


def test_an_answer_is_handed_over_by_the_last_word_of_it() -> None:
    """The interrupt may send as soon as rx_bits says so, and receives until then."""
    early = changed_text("rx_left = 0;\n    rx_bits = 0x4A;", "rx_bits = 0x4A;\n    rx_left = 0;")
    twice = changed_text("rx_bits = 0x4A;", "rx_bits = 0x4B; rx_bits = 0x4A;")
    for text in (early, twice):
        assert fault(lambda: lemmas(listing_of(text)).execute((0xF0,))) == (  # noqa: B023
            "the command FF F0: rx_bits is not written once and last"
        )
    again = "asm {\n    comf    _rx_bits, 1\n    comf    _rx_bits, 1\n    }"
    text = changed_text("speed[n] = value;", f"{{ {again} speed[n] = value; }}")
    assert fault(lambda: lemmas(listing_of(text)).execute((0x41,))) == (
        "the command FF 41: main uses rx_bits of the receiver"
    )


def test_the_line_is_looked_at_as_the_receiver_needs_it_everywhere() -> None:
    text = changed_text("st_before\n    call    st_look", "st_before\n    call    st_take")
    one = lemmas(listing_of(text))
    assert fault(one.dispatch).startswith("the line is looked at in the wrong way, from 0x")


def test_main_and_an_interrupt_together_fit_the_stack() -> None:
    deep = "    call    deep_{0}\n    return\ndeep_{0}:\n"
    for levels, text in ((1, ""), (4, "calls need more than 8 return addresses")):
        more = "".join(deep.format(n) for n in range(levels))
        words = f"void extend(void)\n{{\n    asm {{\n{more}    nop\n    }}"
        one = lemmas(listing_of(changed_text("void extend(void)\n{", words)))
        assert fault(lambda: check_stack(one.names)) == text  # noqa: B023


@pytest.mark.campaign
def test_a_failed_lemma_names_the_values_for_which_it_fails() -> None:
    one = lemmas(listing_of(RARE))
    with pytest.raises(Fails, match="the command FF 80: left becomes 9, not 77"):
        one.execute((0x80,))
    assert (one.suspect.second, one.suspect.third) == (0x80, 77)


@pytest.mark.parametrize("trims", [(), (5, 0x90, 0xFF)])
def test_a_rare_fault_is_shown_by_a_run_once_it_is_suspected(trims: tuple[int, ...]) -> None:
    """On the line that shows it, the pulses are the right program's until then."""
    chip = StreamChip.after_reset(STREAMED, [byte(trim) for trim in trims]) if trims else None
    wrong = firmware(RARE, ARM, "c2c").compilation.image
    search = CounterexampleSearch(wrong, ARM, STREAMED, lambda what: None)
    found = search.about(Suspect(chip, second=0x80, third=77))
    assert found is not None and found.message.startswith(tuple(f"{name}'s pulse" for name in NAMES))
    assert found.eeprom == (dict(enumerate(trims)) or None), (
        "without trims to come near, this line has the file's"
    )

    def edges(image: Image, end: int) -> list[tuple[int, int, int]]:
        pins = Stimuli([Levels(PINS.index(pin), levels) for pin, levels in found.levels])
        whole = replace(image, eeprom=dict.fromkeys(range(64), 0xFF) | (found.eeprom or {}))
        changes = pin_changes(Machine(whole, ARM.clock, found.options, pins), 0, end)
        return [edge for edge in changes if PINS[edge[1]] != STREAMED.stream.transmit_pin]

    right = read_hex((JOBS.parent / "firmware" / "stream-arm" / "main.hex").read_text(), "main.hex").image
    before = found.cycle - STREAMED.layout.period
    assert edges(wrong, before) == edges(right, before)
    assert edges(wrong, found.cycle + 1) != edges(right, found.cycle + 1)


def test_the_right_program_has_no_counterexample() -> None:
    image = read_hex((JOBS.parent / "firmware" / "stream-arm" / "main.hex").read_text(), "main.hex").image
    assert CounterexampleSearch(image, ARM, STREAMED, lambda what: None).first() is None


def test_a_fault_that_no_pulse_shows_is_not_decided(
    listing: Listing, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("bitwuzla", reason="the solver is not installed")
    monkeypatch.setattr("servogen.prove.stream.counterexample.FIRST_LINES", 3)
    monkeypatch.setattr("servogen.prove.stream.counterexample.SUSPECTED_LINES", 2)
    monkeypatch.setattr("servogen.prove.stream.counterexample.MORE_LINES", 2)
    # The watchdog, which is off, would have another prescaler.
    other = swapped(listing, encode("MOVLW", k=0x8F), -1)
    image = Image(other.words, 0x3FF1)
    proof = prove_line(image, other, ARM, STREAMED, lambda what: None)
    assert not proof.proven and proof.counterexample is None
    assert "OPTION_REG becomes 142, not 143" in proof.reason


# the specification, with the second one that the simulator's edges are compared with


COARSE = plan_job(loads(TWELVE, "twelve.toml"))


def test_a_coarse_chip_keeps_positions_and_a_word_that_keeps_another_is_found() -> None:
    """Of the last servo's commands and of one that a coarse chip does not know; a position is kept with 1."""
    streamed = stream(COARSE)[1]
    made = compiled(COARSE, streamed, "c2c").compilation.listing
    one = lemmas(made, streamed=streamed)
    one.start()
    accesses = one.execute((0x0B, 0x4B, 0x80, 0xCB))
    assert {"place[11]", "goal[11]", "speed[11]", "left"} <= variables_of(made, accesses.writes)
    position = next(each.start for each in made.functions if each.name == "position")
    more = found(made, encode("INCF", f=made.variable("x_lo"), d=1), position)
    wrong = changed(made, more, encode("DECF", f=made.variable("x_lo"), d=1))
    with pytest.raises(Fails, match=r"the command FF 0B: place\[11\] becomes"):
        lemmas(wrong, streamed=streamed).execute([0x0B])


@pytest.mark.campaign
def test_a_coarse_chip_s_pulse_is_its_position_s() -> None:
    streamed = stream(COARSE)[1]
    made = compiled(COARSE, streamed, "c2c").compilation.listing
    lemmas(made, streamed=streamed).prepare([streamed.layout.slots - 1])


SPECIFIED = [*(plan_job(load(JOBS / f"stream-{name}.toml")) for name in ("arm", "eight", "fast")), COARSE]


@pytest.mark.parametrize("job", SPECIFIED, ids=lambda job: job.name)
def test_both_specifications_of_the_chip_agree(job: PlannedJob) -> None:
    streamed = stream(job)[1]
    servos, dice = len(streamed.neutral), random.Random(7)
    model = chip_model.Chip(streamed)
    chip = StreamChip.after_reset(streamed, [byte(NO_TRIM)] * servos)
    for _ in range(400):
        model.begin_frame()
        chip.begin_frame()
        for n in range(servos):
            width = model.prepare(n)
            chip.prepare(n)
            assert bool(chip.widths[n].value) == bool(width)
            assert width is None or chip.pulse(n).value == width
            assert chip.valid().known
        for second, third in commands(dice, servos):
            answers = streamed.stream.transmit_pin is not None
            command = command_of(second, third, servos, answers=answers, trims=not streamed.coarse)
            if command is not None:
                model.execute(command)
            chip.execute(second, byte(third))
        if dice.random() < 0.01:
            for _ in range(streamed.silence_frames + 3):
                model.begin_frame()
                chip.begin_frame()
                for n in range(servos):
                    model.prepare(n)
                    chip.prepare(n)


def commands(dice: random.Random, servos: int) -> Iterator[tuple[int, int]]:
    for _ in range(dice.randrange(3)):
        kind = dice.choices([*CommandKind], (6, 1, 2, 1, 1))[0]
        second = kind.value + (dice.randrange(servos + 1) if kind.of_a_servo else dice.randrange(2))
        yield second, dice.choice((0, 1, 7, 126, 127, 254, dice.randrange(255)))


def test_both_receivers_make_the_same_commands() -> None:
    dice, model = random.Random(3), chip_model.Receiver(len(STREAMED.neutral), answers=True)
    chip = ReceiverState(STREAMED, byte(0), byte(0), byte(0), byte(0), byte(NOTHING), byte(NOTHING), byte(0))
    for _ in range(1500):
        value = dice.choice((SYNC, 0, 1, 0x41, 0x80, NOTHING, dice.randrange(256)))
        whole = dice.random() < 0.9
        chip.todo = byte(NOTHING)
        sent(chip, value, whole)
        command = model.byte(value) if whole else model.broken()
        complete = chip.todo.value != NOTHING
        second, third = chip.todo.value or 0, chip.value.value or 0
        made = command_of(second, third, len(STREAMED.neutral)) if complete else None
        assert made == command


BEGINS = 11
"""When a byte begins, in units of time: any is as good."""


def sent(chip: ReceiverState, value: int, whole: bool) -> None:
    """A byte whose bits are looked at in their middle, in units of time."""
    units, now = STREAMED.bit_units, BEGINS
    chip.hunt(byte(now & 0x3F), FALSE)
    levels = [0, *(value >> n & 1 for n in range(8)), int(whole)]
    end = now + units * 10
    while chip.bits.value and now < end:
        now += 30
        number = (now - BEGINS) // units
        chip.look(byte(now & 0x3F), Truth(bool(levels[min(number, 9)])))
    if not whole:
        chip.look(byte(now & 0x3F), Truth(True))
    assert chip.bits.value == 0
