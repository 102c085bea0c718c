"""How the proof for any line is put together: its limits from both sides, its sentences, its reasons.

The lemmas are those of test_stream_lemmas.py; here the times that they are combined with are given.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import pytest

from servogen.engines.stream.engine import stream
from servogen.engines.stream.response import Response
from servogen.job import load, plan_job
from servogen.pic.image import Image
from servogen.pic.known_values import Undefined
from servogen.pic.listing import Listing, ListingRow
from servogen.prove.stream import proof
from servogen.prove.stream.bits import TIME_LIMIT_MS, GivenUp
from servogen.prove.stream.chip_bytes import receiver_counts
from servogen.prove.stream.counterexample import NOBODY, Suspect
from servogen.prove.stream.execution import NotFollowed
from servogen.prove.stream.looks import InterruptChanged
from servogen.prove.stream.proof import LineTheorem, UndecidedPart, by_lemmas, sender_assumptions
from servogen.prove.stream.rounds import Guarantee
from servogen.prove.stream.sharing import Fails
from servogen.units import Cycles
from tests.engines.stream.stream_soak import JOBS

JOB = plan_job(load(JOBS / "stream-arm.toml"))
ARM = stream(JOB)[1]
EMPTY = Listing(())
WATCHDOG_OFF = 0x3FF1
"""A configuration word: the crystal XT, bit 2 (WDTE) clear (DS35007 register 6-1)."""


def changed(**changes: Any) -> Any:
    return replace(ARM, **changes)


def proof_of(streamed: Any, divided: int = 0) -> LineTheorem:
    lemmas: Any = SimpleNamespace(divided=divided)
    return LineTheorem(EMPTY, JOB, streamed, lemmas, lambda what: None)


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
        assert one.widths() == [f"pulses of {low} to {high} cycles, in slots of 3328"]
    else:
        with pytest.raises(UndecidedPart) as error:
            one.widths()
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
    return proof_of(streamed).times()


def test_the_division_takes_no_more_turns_than_the_time_of_the_c_has(monkeypatch: pytest.MonkeyPatch) -> None:
    """A servo has 1000 cycles to go and 256 of its trim: four rounds, and a look at the remainder."""
    assert max(travel.maximum - travel.minimum for travel in ARM.travels) == 1000
    monkeypatch.setattr(proof, "response", Bound(900, 100, 1500))
    assert proof_of(ARM, divided=1256 // 256 + 1).times()
    more = r"^the division of a distance takes more turns than the distance has rounds$"
    with pytest.raises(UndecidedPart, match=more):
        proof_of(ARM, divided=1256 // 256 + 2).times()


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


UNKNOWN = "no bound below the time between two is known"


@pytest.mark.parametrize(
    ("prepare", "execute", "supply", "taken"),
    [
        # A command leaves 26 cycles of its slot to the next one; without another one they are made up for.
        (100, 50, 124, "it takes up to 126 cycles, and has 124"),
        (1501, 0, 1500, UNKNOWN),
        (900, 100, None, UNKNOWN),
        (None, 100, 1500, UNKNOWN),
        (900, None, 1500, UNKNOWN),
        (1000, 9000, 1500, UNKNOWN),
    ],
)
def test_c_that_may_be_late_is_not_proven(
    prepare: int | None, execute: int | None, supply: int | None, taken: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(UndecidedPart) as error:
        times(Bound(prepare, execute, supply), monkeypatch)
    assert str(error.value) == f"the C may be late for a pulse: {taken}"
    assert times(Bound(1500, 0, 1500), monkeypatch), "as long as there is is in time"


def test_interrupts_are_masked_as_briefly_as_the_edges_are_proven_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bound = Bound(900, 100, 1500)
    for masked, text in ((9, ""), (10, "the C masks interrupts for up to 10 cycles; the limit is 9")):
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
            one.check_command_in_time(bound.response, 1, interval, 7)
        assert bound.asked == []
        return
    one.check_command_in_time(bound.response, 1000, interval, 7)
    assert bound.asked == [(window, 7, interval)]
    with pytest.raises(UndecidedPart, match="before it is executed"):
        one.check_command_in_time(bound.response, 1001, interval, 7)


def test_exactly_a_slot_or_two_are_counted_as_such(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(proof, "response", None)
    response = Bound(0, 0, 1000).response
    for rounds, slots in ((21, 1), (20, 1), (14, 2), (13, 2)):
        one = proof_of(changed(layout=replace(ARM.layout, rounds=rounds)))
        one.check_command_in_time(response, 1000 * slots, 3 * BYTE, 7)
        with pytest.raises(UndecidedPart):
            one.check_command_in_time(response, 1000 * slots + 1, 3 * BYTE, 7)


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
    monkeypatch.setattr(LineTheorem, "check_command_in_time", lambda *arguments: None)
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
    monkeypatch.setattr(LineTheorem, "check_command_in_time", lambda *arguments: None)
    assert times(bound, monkeypatch, changed(layout=replace(ARM.layout, rounds=most)))
    with pytest.raises(UndecidedPart) as error:
        times(bound, monkeypatch, changed(layout=replace(ARM.layout, rounds=most + 1)))
    assert str(error.value) == "a byte that ends 20 ms after a query may begin during the answer"


@pytest.mark.parametrize("config", [0x3FF5, None])
def test_with_a_watchdog_nothing_is_proven_of_a_busy_line(config: int | None) -> None:
    """Bit 2 of the configuration word; an erased one, 0x3FFF, has it set (DS35007 register 6-1)."""
    found, _ = by_lemmas(Image({}, config), EMPTY, JOB, ARM, lambda what: None)  # type: ignore[arg-type]
    assert found.reason == (
        "the watchdog is on: whether it is cleared while the line is busy is not examined"
    )
    found, _ = by_lemmas(Image({}, WATCHDOG_OFF), EMPTY, JOB, ARM, lambda what: None)  # type: ignore[arg-type]
    assert "watchdog" not in found.reason and not found.proven


# samples


@dataclass
class Samples:
    """When each bit is sampled, and the gaps."""

    first: list[Fraction]
    last: list[Fraction]
    start_gap, bit_gap = 111, 128

    def earliest(self, k: int, first_units: int, bit_units: int) -> Fraction:
        assert (first_units, bit_units) == (15, 104)
        return self.first[k]

    def latest(self, k: int, first_units: int, bit_units: int) -> Fraction:
        assert (first_units, bit_units) == (15, 104)
        return self.last[k]


BIT = Fraction(1_000_000, 2400)


def samples() -> Samples:
    """Each bit is sampled when a slow sender's begins, and when a fast one's ends; 2 % off."""
    return Samples(
        [k * BIT / Fraction(98, 100) for k in range(10)],
        [(k + 1) * BIT / Fraction(102, 100) for k in range(10)],
    )


def test_each_bit_is_sampled_while_it_lasts_for_every_sender() -> None:
    one = proof_of(ARM)
    one.check_samples(samples())  # type: ignore[arg-type]
    for k in range(10):
        for name, off in (("first", -1), ("last", 1)):
            wrong = samples()
            getattr(wrong, name)[k] += Fraction(off, 1000)
            with pytest.raises(UndecidedPart) as error:
                one.check_samples(wrong)  # type: ignore[arg-type]
            assert str(error.value).startswith(f"bit {k} of a byte is sampled ")
    wrong = samples()
    wrong.first[3], wrong.last[3] = Fraction(1200), Fraction(1500)
    with pytest.raises(UndecidedPart) as error:
        one.check_samples(wrong)  # type: ignore[arg-type]
    # 3 bits of 1250/3 cycles / 0.98 = 1275.5; 4 / 1.02 = 1634.0
    assert str(error.value) == (
        "bit 3 of a byte is sampled 1200 to 1500 cycles after its beginning; it lasts from 1275.5 to 1634.0"
    )


def test_the_edges_are_told_with_their_cycle_and_the_gaps(monkeypatch: pytest.MonkeyPatch) -> None:
    told = []

    def guarantee(listing: Listing, streamed: Any, tell: Any) -> Guarantee:
        assert streamed is ARM and listing is EMPTY
        tell("edges", 3, 256)
        return Guarantee(163, samples(), states=77)  # type: ignore[arg-type]

    monkeypatch.setattr(proof, "guarantee", guarantee)
    one = LineTheorem(EMPTY, JOB, ARM, None, told.append)  # type: ignore[arg-type]
    assert one.edges() == [
        "every edge is exact: a pulse begins in cycle 163 of its round; interrupts begin in 77 states",
        "samples of the line are at most 111 cycles apart before a start bit, 128 within a byte",
    ]
    assert told == ["edges: 3 of 256 cycles"]


# the words' names


def listing_of(words: dict[int, int], *, name: str = "x") -> Listing:
    return Listing(tuple(ListingRow(at, word, "", "1") for at, word in words.items()), (), ((12, name, 1),))


# answers


def test_the_assumptions_are_those_of_the_page_about_senders() -> None:
    assert sender_assumptions(ARM) == (
        "the line is idle for 25 ms after a trim: the EEPROM is being written",
        "a byte begins while the chip waits for one: after a byte, or after the line was high for ten bits",
        "a sender's rate is within 2 % of 2400 baud",
        "no byte ends within 20 ms of a query: the chip answers",
    )
    mute = replace(ARM.stream, transmit_pin=None, baud=9600)
    texts = sender_assumptions(changed(stream=mute))
    assert len(texts) == 3 and texts[2] == "a sender's rate is within 2 % of 9600 baud"


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
    pytest.importorskip("bitwuzla", reason="the solver is not installed")

    def prove(self: LineTheorem) -> list[str]:
        self.lemmas.suspect = Suspect(second=5)
        raise error

    monkeypatch.setattr(LineTheorem, "prove", prove)
    words = {0: 0}
    found, suspect = by_lemmas(Image(words, WATCHDOG_OFF), listing_of(words), JOB, ARM, lambda what: None)
    assert (found.reason, found.proven, found.counterexample) == (reason, False, None)
    assert suspect == Suspect(second=5), "what was being checked is suspected"
    assert TIME_LIMIT_MS == 20 * 60 * 1000


def test_a_program_that_is_another_one_has_no_names_and_nothing_is_suspected() -> None:
    """More than 24 of its words are others."""
    words = dict.fromkeys(range(100), 0)
    for unlike, known in ((24, True), (25, False)):
        image = Image(words | dict.fromkeys(range(unlike), 1), WATCHDOG_OFF)
        found, suspect = by_lemmas(image, listing_of(words), JOB, ARM, lambda what: None)
        assert (not found.reason.startswith("the names of its variables are not known")) is known
        assert not found.proven and (known or suspect == NOBODY)


def test_the_counts_of_the_receiver() -> None:
    """0 while it waits, 10 to 1 within a byte, with bit 6 while it sends; bit 7 after a broken byte."""
    assert receiver_counts(ARM) == [*range(11), *range(65, 75), 128]
    mute = replace(ARM.stream, transmit_pin=None)
    assert receiver_counts(changed(stream=mute)) == [*range(11), 128]
