"""How the proof for any line is put together: its limits from both sides, its sentences, its reasons.

The lemmas are those of test_stream_lemmas.py; here the times that they are combined with are given.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import pytest

from servogen.engines.stream.engine import stream
from servogen.engines.stream.response import Response
from servogen.job import load, plan_job
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.pic.known_values import Undefined
from servogen.pic.listing import Listing, ListingRow
from servogen.prove.stream import proof
from servogen.prove.stream.bits import FALSE, TIME_LIMIT_MS, TRUE, Bits, GivenUp, byte
from servogen.prove.stream.chip import StreamChip
from servogen.prove.stream.counterexample import NOBODY, Suspect
from servogen.prove.stream.execution import EEPROM, NotFollowed
from servogen.prove.stream.lemmas import Fails, Lemmas, between_steps, bytes_of, receiver_counts
from servogen.prove.stream.looks import InterruptChanged
from servogen.prove.stream.names import Names
from servogen.prove.stream.proof import (
    LineProof,
    UndecidedPart,
    _assumptions,
    _listing,
    _Proof,
    _proof,
    _unlike,
)
from servogen.units import Cycles
from tests.engines.stream.stream_soak import JOBS

JOB = plan_job(load(JOBS / "stream-arm.toml"))
ARM = stream(JOB)[1]
EMPTY = Listing(())
WATCHDOG_OFF = 0x3FF1
"""A configuration word: the crystal XT, bit 2 (WDTE) clear (DS35007 register 6-1)."""


def changed(**changes: Any) -> Any:
    return replace(ARM, **changes)


def proof_of(streamed: Any, divided: int = 0) -> _Proof:
    lemmas: Any = SimpleNamespace(divided=divided)
    return _Proof(EMPTY, JOB, streamed, lemmas, lambda what: None)


# widths


@pytest.mark.parametrize(
    ("minimum", "maximum", "fits"),
    [
        # With a trim of -128, a pulse is a round at least.
        (384, 2000, True),
        (383, 2000, False),
        # With a trim of 127, it ends 12 rounds and 80 cycles after its rise at the latest.
        (1000, 3025, True),
        (1000, 3026, False),
    ],
)
def test_every_width_fits_its_slot(minimum: int, maximum: int, fits: bool) -> None:
    travels = (replace(ARM.travels[0], minimum=minimum, maximum=maximum), *ARM.travels[1:])
    one = proof_of(changed(travels=travels))
    low, high = min(minimum, 1111) - 128, maximum + 127
    if fits:
        assert one._widths() == [f"pulses of {low} to {high} cycles, in slots of 3328"]
    else:
        with pytest.raises(UndecidedPart) as error:
            one._widths()
        assert str(error.value) == f"pulses of {low} to {high} cycles do not fit 13 rounds"


# times

BYTE = (15 + 9 * 104) * 4
"""The cycles of a byte from its start bit's time stamp to its stop bit: 9 bits of 104 units."""


class Bound:
    """A bound of the C, and what it was asked for."""

    def __init__(
        self, prepare: int | None, execute: int | None, supply: int | None, interval: int = 3
    ) -> None:
        self.asked: list[tuple[int, int, int]] = []
        self.response = Response(*map(cycles, (prepare, execute, supply)), interval, 0)

    def __call__(self, listing: Listing, rounds: int, travel: int, interval: int) -> Response:
        self.asked.append((rounds, travel, interval))
        return self.response


def cycles(number: int | None) -> Cycles | None:
    return None if number is None else Cycles(number)


def times(bound: Bound, monkeypatch: pytest.MonkeyPatch, streamed: Any = ARM) -> list[str]:
    monkeypatch.setattr(proof, "response", bound)
    return proof_of(streamed)._times()


def test_the_division_takes_no_more_turns_than_the_time_of_the_c_has(monkeypatch: pytest.MonkeyPatch) -> None:
    """A servo has 1000 cycles to go and 256 of its trim: four rounds, and a look at the remainder."""
    assert max(travel.maximum - travel.minimum for travel in ARM.travels) == 1000
    monkeypatch.setattr(proof, "response", Bound(900, 100, 1500))
    assert proof_of(ARM, divided=1256 // 256 + 1)._times()
    more = r"^the division of a distance takes more turns than the distance has rounds$"
    with pytest.raises(UndecidedPart, match=more):
        proof_of(ARM, divided=1256 // 256 + 2)._times()


def test_the_times_are_asked_for_and_told(monkeypatch: pytest.MonkeyPatch) -> None:
    bound = Bound(900, 100, 1500)
    found = times(bound, monkeypatch)
    # The largest travel is 1000 cycles, and two trims are up to 256 apart.
    assert bound.asked == [(13, 1256, 3 * BYTE)]
    assert found == [
        "the C takes at most 900 cycles to prepare a pulse; interrupts leave it 1500 of 3328",
        "a command takes effect in every pulse that begins 6912 µs after its stop bit or later: "
        "within 26880 µs",
    ]


@pytest.mark.parametrize(
    ("prepare", "execute", "supply", "taken"),
    [
        # A command leaves 26 cycles of its slot to the next one; without another one they are made up for.
        (100, 50, 124, "126 of 124"),
        (1501, 0, 1500, "None of 1500"),
        (900, 100, None, "None of None"),
        (None, 100, 1500, "None of 1500"),
        (900, None, 1500, "None of 1500"),
        (1000, 9000, 1500, "None of 1500"),
    ],
)
def test_c_that_may_be_late_is_not_proven(
    prepare: int | None, execute: int | None, supply: int | None, taken: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(UndecidedPart) as error:
        times(Bound(prepare, execute, supply), monkeypatch)
    assert str(error.value) == f"the C may be late for a pulse: it takes {taken} cycles"
    assert times(Bound(1500, 0, 1500), monkeypatch), "as long as there is is in time"


def test_interrupts_are_masked_as_briefly_as_the_edges_are_proven_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bound = Bound(900, 100, 1500)
    for masked, text in ((9, ""), (10, "the C masks interrupts for 10 cycles, not for 9 at most")):
        bound.response = replace(bound.response, masked=masked)
        try:
            times(bound, monkeypatch)
        except UndecidedPart as error:
            assert str(error) == text
        else:
            assert not text


def test_a_command_is_executed_before_the_next_one_can_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands are 11 412 cycles apart, of which a slot may pass until the request: two slots of supply."""
    # The second slot begins 500 cycles late, and its pulse is prepared in cycle 600; 1400 more are 2000.
    assert times(Bound(100, 1400, 1000), monkeypatch)
    with pytest.raises(UndecidedPart) as error:
        times(Bound(100, 1401, 1000), monkeypatch)
    assert str(error.value) == "a command may end before the one before it is executed"


@pytest.mark.parametrize(
    ("rounds", "window"),
    # (11 412 - rounds * 256) // 256 - 1 rounds are left; three or fewer are not enough for a fall's.
    [(22, 21), (30, 13), (39, 4), (40, None)],
)
def test_where_less_than_a_slot_is_left_its_own_bound_counts(
    rounds: int, window: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    streamed = changed(layout=replace(ARM.layout, rounds=rounds))
    bound = Bound(1000, 500, 1500)
    interval = 3 * BYTE
    assert window is None or window == (interval - rounds * 256) // 256 - 1
    one = proof_of(streamed)
    monkeypatch.setattr(proof, "response", bound)
    if window is None:
        with pytest.raises(UndecidedPart, match="before it is executed"):
            one._check_command_in_time(bound.response, 1, interval, 7)
        assert bound.asked == []
        return
    one._check_command_in_time(bound.response, 1000, interval, 7)
    assert bound.asked == [(window, 7, interval)]
    with pytest.raises(UndecidedPart, match="before it is executed"):
        one._check_command_in_time(bound.response, 1001, interval, 7)


def test_exactly_a_slot_or_two_are_counted_as_such(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(proof, "response", None)
    response = Bound(0, 0, 1000).response
    for rounds, slots in ((21, 1), (20, 1), (14, 2), (13, 2)):
        one = proof_of(changed(layout=replace(ARM.layout, rounds=rounds)))
        one._check_command_in_time(response, 1000 * slots, 3 * BYTE, 7)
        with pytest.raises(UndecidedPart):
            one._check_command_in_time(response, 1000 * slots + 1, 3 * BYTE, 7)


def test_the_eeprom_is_written_before_it_is_read_again(monkeypatch: pytest.MonkeyPatch) -> None:
    bound = Bound(900, 100, 1500)
    written = JOB.device.max_eeprom_write_us
    frames = -(-written // ARM.layout.period) + 1
    assert times(bound, monkeypatch, changed(silence_frames=frames))
    with pytest.raises(UndecidedPart, match=r"^the fail-safe may read the EEPROM while it is written$"):
        times(bound, monkeypatch, changed(silence_frames=frames - 1))
    hold = replace(ARM.stream, fail_safe="hold")
    assert times(bound, monkeypatch, changed(silence_frames=0, stream=hold))


def test_a_trim_is_written_before_the_next_command_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """The sender waits for 25 ms (docs/firmware.md); the trim is executed within two slots."""
    # 2 * rounds * 256 - 11 412 cycles after the next command has begun, and then written.
    most = (25_000 - JOB.device.max_eeprom_write_us + 3 * BYTE) // 512
    bound = Bound(1, 1, 15_000)
    monkeypatch.setattr(_Proof, "_check_command_in_time", lambda *arguments: None)
    silent = replace(ARM.stream, transmit_pin=None)
    assert times(bound, monkeypatch, changed(layout=replace(ARM.layout, rounds=most), stream=silent))
    with pytest.raises(UndecidedPart) as error:
        times(bound, monkeypatch, changed(layout=replace(ARM.layout, rounds=most + 1), stream=silent))
    assert str(error.value) == "a command may end while a trim is still being written to the EEPROM"


def test_an_answer_is_sent_before_a_byte_begins_that_ends_20_ms_after_the_query(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two slots and a round until the query is executed, up to a bit until its answer of ten bits begins."""
    most = (20_000 - BYTE - 11 * 104 * 4 - 256) // 512
    bound = Bound(1, 1, 15_000)
    monkeypatch.setattr(_Proof, "_check_command_in_time", lambda *arguments: None)
    assert times(bound, monkeypatch, changed(layout=replace(ARM.layout, rounds=most)))
    with pytest.raises(UndecidedPart) as error:
        times(bound, monkeypatch, changed(layout=replace(ARM.layout, rounds=most + 1)))
    assert str(error.value) == "a byte that ends 20 ms after a query may begin during the answer"


@pytest.mark.parametrize("config", [0x3FF5, None])
def test_with_a_watchdog_nothing_is_proven_of_a_busy_line(config: int | None) -> None:
    """Bit 2 of the configuration word; an erased one, 0x3FFF, has it set (DS35007 register 6-1)."""
    found, _ = _proof(Image({}, config), EMPTY, JOB, ARM, lambda what: None)  # type: ignore[arg-type]
    assert found.reason == (
        "the watchdog is on: whether it is cleared while the line is busy is not examined"
    )
    found, _ = _proof(Image({}, WATCHDOG_OFF), EMPTY, JOB, ARM, lambda what: None)  # type: ignore[arg-type]
    assert "watchdog" not in found.reason and not found.proven


# samples


@dataclass
class Samples:
    """When each bit is sampled; the other numbers of a guarantee."""

    earliest: list[Fraction]
    latest: list[Fraction]
    rise, states, start_gap, bit_gap = 163, 77, 111, 128

    def earliest_sample(self, k: int, first_units: int, bit_units: int) -> Fraction:
        assert (first_units, bit_units) == (15, 104)
        return self.earliest[k]

    def latest_sample(self, k: int, first_units: int, bit_units: int) -> Fraction:
        assert (first_units, bit_units) == (15, 104)
        return self.latest[k]


BIT = Fraction(1_000_000, 2400)


def samples() -> Samples:
    """Each bit is sampled when a slow sender's begins, and when a fast one's ends; 2 % off."""
    return Samples(
        [k * BIT / Fraction(98, 100) for k in range(10)],
        [(k + 1) * BIT / Fraction(102, 100) for k in range(10)],
    )


def test_each_bit_is_sampled_while_it_lasts_for_every_sender() -> None:
    one = proof_of(ARM)
    one._check_samples(samples())  # type: ignore[arg-type]
    for k in range(10):
        for name, off in (("earliest", -1), ("latest", 1)):
            wrong = samples()
            getattr(wrong, name)[k] += Fraction(off, 1000)
            with pytest.raises(UndecidedPart) as error:
                one._check_samples(wrong)  # type: ignore[arg-type]
            assert str(error.value).startswith(f"bit {k} of a byte is sampled ")
    wrong = samples()
    wrong.earliest[3], wrong.latest[3] = Fraction(1200), Fraction(1500)
    with pytest.raises(UndecidedPart) as error:
        one._check_samples(wrong)  # type: ignore[arg-type]
    # 3 bits of 1250/3 cycles / 0.98 = 1275.5; 4 / 1.02 = 1634.0
    assert str(error.value) == (
        "bit 3 of a byte is sampled 1200 to 1500 cycles after its beginning; it lasts from 1275.5 to 1634.0"
    )


def test_the_edges_are_told_with_their_cycle_and_the_gaps(monkeypatch: pytest.MonkeyPatch) -> None:
    told = []

    def guarantee(listing: Listing, streamed: Any, tell: Any) -> Samples:
        assert streamed is ARM and listing is EMPTY
        tell("edges", 3, 256)
        return samples()

    monkeypatch.setattr(proof, "guarantee", guarantee)
    one = _Proof(EMPTY, JOB, ARM, None, told.append)  # type: ignore[arg-type]
    assert one._edges() == [
        "every edge is exact: a pulse begins in cycle 163 of its round; interrupts begin in 77 states",
        "samples of the line are at most 111 cycles apart before a start bit, 128 within a byte",
    ]
    assert told == ["edges: 3 of 256 cycles"]


# the words' names


def listing_of(words: dict[int, int], *, name: str = "x") -> Listing:
    return Listing(tuple(ListingRow(at, word, "", "1") for at, word in words.items()), (), ((12, name, 1),))


def test_a_program_differs_in_each_word_that_is_another_or_more() -> None:
    words = {n: n for n in range(10)}
    assert _unlike(Image(words), listing_of(words)) == 0
    assert _unlike(Image(words | {3: 7}), listing_of(words)) == 1
    assert _unlike(Image(words | {10: 0, 11: 0}), listing_of(words)) == 2
    # A word that is not there leaves nothing in common.
    shorter = {at: word for at, word in words.items() if at}
    assert _unlike(Image(shorter), listing_of(words)) == 19


def test_names_are_borrowed_from_the_program_that_differs_least(monkeypatch: pytest.MonkeyPatch) -> None:
    words = {n: n for n in range(100)}
    asked = []
    of_dialect = {"c2c": {5: 0, 6: 0}, "xc8": {5: 0}, "sdcc": dict.fromkeys(range(1, 50), 0)}

    def compiled(job: Any, streamed: Any, dialect: str) -> Any:
        asked.append(dialect)
        listing = listing_of(words | of_dialect[dialect], name=dialect)
        return SimpleNamespace(compilation=SimpleNamespace(listing=listing))

    monkeypatch.setattr(proof, "compiled", compiled)
    told: list[str] = []
    chosen = _listing(Image(words), None, JOB, ARM, told.append)
    assert asked == ["c2c", "xc8", "sdcc"] and told == [f"looking for its names: {name}" for name in asked]
    assert chosen.variables == ((12, "xc8", 1),)
    assert {row.address: row.word for row in chosen.rows} == words, "the words are those of the image"
    # A listing that is given is the only one.
    given = _listing(Image(words), listing_of(words | {7: 0}, name="own"), JOB, ARM, told.append)
    assert given.variables == ((12, "own", 1),) and len(asked) == 3


@pytest.mark.parametrize(("unlike", "known"), [(24, True), (25, False)])
def test_a_program_that_is_another_one_has_no_names(unlike: int, known: bool) -> None:
    words = {n: n + 1 for n in range(100)}
    listing = listing_of(words | dict.fromkeys(range(unlike), 0))
    if known:
        assert _listing(Image(words), listing, JOB, ARM, lambda what: None).rows
        return
    with pytest.raises(UndecidedPart) as error:
        _listing(Image(words), listing, JOB, ARM, lambda what: None)
    assert str(error.value) == (
        "the names of its variables are not known: the program is not one of servogen's for this job; "
        "give its C file instead"
    )


# answers


def test_the_assumptions_are_those_of_the_page_about_senders() -> None:
    assert _assumptions(ARM) == (
        "the line is idle for 25 ms after a trim: the EEPROM is being written",
        "a byte begins while the chip waits for one: after a byte, or after the line was high for ten bits",
        "a sender's rate is within 2 % of 2400 baud",
        "no byte ends within 20 ms of a query: the chip answers",
    )
    mute = replace(ARM.stream, transmit_pin=None, baud=9600)
    texts = _assumptions(changed(stream=mute))
    assert len(texts) == 3 and texts[2] == "a sender's rate is within 2 % of 9600 baud"


class Search:
    """A search that finds what it is given."""

    def __init__(self, first: object = None, about: object = None) -> None:
        self.found = {"first": first, "about": about}
        self.suspects: list[Suspect] = []

    def __call__(self, *arguments: object) -> Search:
        return self

    def first(self) -> object:
        return self.found["first"]

    def about(self, suspect: Suspect) -> object:
        self.suspects.append(suspect)
        return self.found["about"]


def answer_of(monkeypatch: pytest.MonkeyPatch, search: Search, outcome: Exception | list[str]) -> LineProof:
    pytest.importorskip("bitwuzla", reason="the solver is not installed")

    def prove(self: _Proof) -> list[str]:
        self.lemmas.suspect = Suspect(second=5)
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    monkeypatch.setattr(proof, "CounterexampleSearch", search)
    monkeypatch.setattr(_Proof, "prove", prove)
    words = {0: 0}
    return proof.prove_line(Image(words, WATCHDOG_OFF), listing_of(words), JOB, ARM, lambda what: None)


def test_a_proof_has_its_findings_and_assumptions(monkeypatch: pytest.MonkeyPatch) -> None:
    search = Search(about="not asked for")
    found = answer_of(monkeypatch, search, ["one", "two"])
    assert found == LineProof("", ("one", "two"), _assumptions(ARM))
    assert found.proven and search.suspects == []


def test_what_a_plain_line_shows_needs_no_lemma(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = SimpleNamespace(message="a wrong pulse")
    found = answer_of(monkeypatch, Search(first=shown), AssertionError("the lemmas are not asked"))
    assert (found.reason, found.counterexample, found.proven) == ("a wrong pulse", shown, False)


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (UndecidedPart("this"), "this"),
        (InterruptChanged("that"), "that"),
        (Fails("wrong"), "wrong"),
        (NotFollowed("far"), "far"),
        (GivenUp(), "the solver does not answer within 20 minutes"),
        (Undefined(), "the program has a word that no data sheet defines"),
        (LookupError("no st_take"), "the program is not laid out as a stream: no st_take"),
        (ValueError("two"), "the program is not laid out as a stream: two"),
    ],
)
def test_whatever_stops_the_lemmas_is_the_reason(
    error: Exception, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    search = Search()
    found = answer_of(monkeypatch, search, error)
    assert (found.reason, found.proven, found.counterexample) == (reason, False, None)
    assert search.suspects == [Suspect(second=5)], "what was being checked is suspected"
    shown = SimpleNamespace(message="not this one")
    found = answer_of(monkeypatch, Search(about=shown), error)
    assert (found.reason, found.counterexample) == (reason, shown)
    assert TIME_LIMIT_MS == 20 * 60 * 1000


def test_without_names_nothing_is_suspected(monkeypatch: pytest.MonkeyPatch) -> None:
    search = Search()
    monkeypatch.setattr(proof, "CounterexampleSearch", search)
    words = dict.fromkeys(range(25), 0)
    image = Image(dict.fromkeys(words, 1), WATCHDOG_OFF)
    found = proof.prove_line(image, listing_of(words), JOB, ARM, lambda what: None)
    assert found.reason.startswith("the names of its variables are not known")
    assert search.suspects == [NOBODY]


# what lemmas compare


def names_of(streamed: Any) -> Names:
    """Names for all variables, one after the other."""
    sizes = {
        **dict.fromkeys(("width_low", "width_high", "goal_low", "goal_high", "speed"), 3),
        **dict.fromkeys(("group", "waiting", "left", "slot", "silence", "value", "command", "rx_byte"), 1),
    }
    variables, at = [], 0x10
    for name, size in sizes.items():
        variables.append((at, name, size))
        at += size
    variables.append((0x0C, "W (temporary)", 1))
    return Names(Listing((), (), tuple(variables)), streamed)


def test_variables_are_found_by_name_and_temporaries_are_not() -> None:
    names = names_of(ARM)
    assert names.at("width_low") == 0x10 and names.at("width_high", 2) == 0x15 and names.at("group") == 0x1F
    assert names.has("group") and not names.has("mask") and not names.has("W (temporary)")
    with pytest.raises(LookupError, match=r"^no variable is called mask$"):
        names.at("mask")
    assert (names.servos, names.pins, names.two_ports) == (3, ["RB0", "RB1", "RB2"], False)
    # RA4 is bit 4 of PORTA, at address 5.
    assert names.line == (5, 4) and names.port("RB7") == 6
    assert [names.group_bit(n) for n in range(3)] == [0, 1, 2]


def test_the_parts_of_an_interrupt_are_found_by_its_words() -> None:
    """The body begins with clearing T0IF; the first store after the call of st_exactly makes the edge."""
    wait, other = 0x20, 0x24
    store, end = encode("MOVWF", f=6), encode("RETURN")
    interrupt = {
        0x04: encode("NOP"),
        0x05: encode("BCF", f=11, b=2),
        0x06: store,
        0x07: encode("CALL", k=other),
        0x08: store,
        0x09: encode("CALL", k=wait),
        0x0A: encode("MOVF", f=6, d=0),
        0x0B: store,
        0x0C: encode("CALL", k=wait),
        0x0D: store,
        0x0E: encode("RETFIE"),
    }
    words = {
        0: encode("GOTO", k=0x30), **interrupt,
        0x10: encode("BCF", f=11, b=2), wait: end, other: end, 0x30: encode("GOTO", k=0x30),
    }  # fmt: skip

    def names(words: dict[int, int]) -> Names:
        rows = tuple(ListingRow(at, word, "", "1") for at, word in words.items())
        return Names(Listing(rows, labels=(("st_exactly", wait),)), ARM)

    one = names(words)
    assert (one.body, one.edge) == (0x05, 0x0B)
    assert one.of_interrupt == (*interrupt, wait, other)
    # Where nothing waits, or nothing is stored after it, there is no edge.
    for at in ((0x09, 0x0C), (0x0B, 0x0D)):
        with pytest.raises(LookupError, match=r"^the interrupt makes no edge$"):
            _ = names(words | dict.fromkeys(at, encode("NOP"))).edge
    with pytest.raises(LookupError, match=r"^the interrupt does not begin with clearing its flag$"):
        _ = names(words | dict.fromkeys((0x05, 0x10), encode("BCF", f=11, b=1))).body


def with_pins(*pins: str) -> Any:
    schedule = ARM.plan.schedule
    channels = tuple(replace(channel, pin=pin) for channel, pin in zip(schedule.channels, pins, strict=True))
    return changed(plan=replace(ARM.plan, schedule=replace(schedule, channels=channels)))


def test_the_bits_of_groups_are_pins_or_numbers_if_there_are_two_ports() -> None:
    one, two = names_of(with_pins("RB7", "RB3", "RB5")), names_of(with_pins("RB7", "RA3", "RB5"))
    assert [one.group_bit(n) for n in range(3)] == [7, 3, 5] and not one.two_ports
    assert [two.group_bit(n) for n in range(3)] == [0, 1, 2] and two.two_ports


MORE = ("mask", "next_lo", "next_hi", "next_port", "due", "n", "x_lo", "x_hi", "sum_lo", "sum_hi")


def lemmas_of(streamed: Any) -> Lemmas:
    """Lemmas without a program, whose variables have addresses from 0x10 on; the others from 0x30 on."""
    listing = names_of(streamed).listing
    more = tuple((0x30 + n, name, 1) for n, name in enumerate(MORE))
    names = Names(replace(listing, variables=(*listing.variables, *more)), streamed)
    return Lemmas(names, None, None)  # type: ignore[arg-type]


def test_a_pulse_has_its_pin_and_port_and_one_of_no_width_none() -> None:
    for pins, port in ((("RB7", "RB3", "RB5"), None), (("RB7", "RA3", "RB5"), 5)):
        one = lemmas_of(with_pins(*pins))
        chip = StreamChip.after_reset(one.names.streamed, [byte(0xFF)] * 3)
        for width, mask, high, low in ((0x0512, 8, 5, 0x12), (0, 0, 1, 0), (0x0600, 8, 6, 0)):
            chip.widths[1] = Bits(16, width)
            at = {name: one.names.at(name) for name in ("mask", "next_hi", "next_lo", "next_port")}
            wanted = {at["mask"]: mask, at["next_hi"]: high, at["next_lo"]: low}
            wanted |= {} if port is None else {at["next_port"]: port}
            assert {place: bits.value for place, bits in one._pulse(chip, 1).items()} == wanted


def test_main_leaves_variables_ports_and_option_reg_as_they_are() -> None:
    for pins, ports in ((("RB7", "RB3", "RB5"), {6, 0x86}), (("RB7", "RA3", "RB5"), {5, 0x85, 6, 0x86})):
        one = lemmas_of(with_pins(*pins))
        same: Any = SimpleNamespace(initial=lambda place: -place)
        # Those of three bytes, those of one, and what is handed over; not what the C leaves to no step.
        kept = {*range(0x10, 0x10 + 5 * 3 + 8), *range(0x30, 0x35), *ports, 0x81}
        assert one._unchanged(same) == {place: -place for place in kept}


def test_a_look_sends_a_bit_on_its_pin_when_it_is_due() -> None:
    """RA3 is bit 3; all others of its port keep their levels."""
    mute = changed(stream=replace(ARM.stream, transmit_pin=None))
    values = (0x00, 0x08, 0xF7, 0xFF)
    for before, after in itertools.product(values, values):
        run: Any = SimpleNamespace(
            byte=lambda state, place, after=after: byte(after if place == 5 else 0x55),
            initial=lambda place, before=before: byte(before if place == 5 else 0x55),
        )
        for level, due in itertools.product((None, TRUE, FALSE), (TRUE, FALSE)):
            state: Any = SimpleNamespace(level=level, due=due)
            wanted = (
                before if level is None or due is FALSE else before | 8 if level is TRUE else before & 0xF7
            )
            assert lemmas_of(ARM)._latch_as_due(run, None, state).known is (after == wanted)  # type: ignore[arg-type]
            assert lemmas_of(mute)._latch_as_due(run, None, state) is TRUE  # type: ignore[arg-type]


def test_the_bytes_of_a_chip_are_its_variables() -> None:
    streamed = with_pins("RB7", "RB3", "RB5")
    names = names_of(streamed)
    chip = StreamChip.after_reset(streamed, [byte(1), byte(2), byte(3)])
    chip.widths, chip.goals = ([Bits(16, base + n) for n in range(3)] for base in (0x1234, 0x5678))
    chip.speeds = [byte(7), byte(8), byte(9)]
    chip.group, chip.waiting = [TRUE, FALSE, TRUE], [FALSE, TRUE, FALSE]
    chip.left, chip.silence = byte(20), byte(30)
    for starting, gathering, flags in ((TRUE, FALSE, 0x40), (FALSE, TRUE, 0x80), (TRUE, TRUE, 0xC0)):
        chip.starting, chip.gathering = starting, gathering
        content = {place: bits.value for place, bits in bytes_of(names, chip, byte(5)).items()}
        wanted = {
            **{names.at("width_low", n): 0x34 + n for n in range(3)},
            **{names.at("width_high", n): 0x12 for n in range(3)},
            **{names.at("goal_low", n): 0x78 + n for n in range(3)},
            **{names.at("goal_high", n): 0x56 for n in range(3)},
            **{names.at("speed", n): 7 + n for n in range(3)},
            **{EEPROM + n: 1 + n for n in range(3)},
            names.at("group"): 0b1010_0000,
            names.at("waiting"): 0b0000_1000,
            names.at("left"): 20,
            names.at("silence"): 30,
            names.at("slot"): flags | 5,
        }
        assert content == wanted
        back = Lemmas(names, None, None)._chip(lambda place: byte(content[place]))  # type: ignore[arg-type]  # noqa: B023
        assert [bits.value for bits in (*back.widths, *back.goals)] == [
            bits.value for bits in (*chip.widths, *chip.goals)
        ]
        assert [bits.value for bits in (*back.speeds, *back.trims)] == [7, 8, 9, 1, 2, 3]
        assert [truth.known for truth in (*back.group, *back.waiting)] == [
            True,
            False,
            True,
            False,
            True,
            False,
        ]
        assert (back.left.value, back.silence.value) == (20, 30)
        assert (back.starting.known, back.gathering.known) == (starting.known, gathering.known)
    hold = replace(streamed, stream=replace(ARM.stream, fail_safe="hold"))
    assert names.at("silence") not in bytes_of(names_of(hold), replace(chip, streamed=hold), byte(5))


@pytest.mark.parametrize(
    ("group", "waiting", "holds"), [(0xA8, 0xA8, True), (0xA9, 0, False), (0, 0x10, False)]
)
def test_bits_of_a_group_that_belong_to_no_servo_are_clear(group: int, waiting: int, holds: bool) -> None:
    streamed = with_pins("RB7", "RB3", "RB5")
    names = names_of(streamed)
    chip = StreamChip.after_reset(streamed, [byte(0xFF)] * 3)
    values = {names.at("group"): group, names.at("waiting"): waiting}
    assert between_steps(names, chip, lambda place: byte(values[place])).known is holds


def test_the_counts_of_the_receiver() -> None:
    """0 while it waits, 10 to 1 within a byte, with bit 6 while it sends; bit 7 after a broken byte."""
    assert receiver_counts(ARM) == [*range(11), *range(65, 75), 128]
    mute = replace(ARM.stream, transmit_pin=None)
    assert receiver_counts(changed(stream=mute)) == [*range(11), 128]
