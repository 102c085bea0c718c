"""The stream's interrupt: cycles counted from its words over all paths, and edges against the timer."""

from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from servogen.engines.stream.layout import LATEST, RISE
from servogen.engines.stream.rendering import LAST, LATE, LATEST_SECOND, SECOND, tick
from servogen.engines.stream.settings import BIT_GAP, MASKED, SAMPLE_AFTER, STAMP, START_GAP, STOP_AFTER
from servogen.engines.stream.streaming import Streaming, streaming
from servogen.job import loads, plan_job
from servogen.pic.assembler import Assembly, assemble
from servogen.pic.isa import Decoded, decode

VARIABLES = (
    *("next_lo", "next_hi", "mask", "due", "next_port", "port", "todo", "value"),
    *("ticks", "rest", "fine", "t", "rx_bits", "rx_left", "rx_last", "rx_byte", "command"),
)
CHIP = '[chip]\ndevice = "PIC16F84"\nclock_hz = 4_000_000\n'
SERVO = '[[servo]]\nname = "{name}"\npin = "{pin}"\nmodel = "futaba-s3001"\n'
JOBS = {
    "two ports": CHIP + SERVO.format(name="a", pin="RB0") + SERVO.format(name="b", pin="RA0") + "[stream]\n",
    "answers": CHIP + SERVO.format(name="a", pin="RB0") + '[stream]\ntransmit_pin = "RA3"\n',
}
HALF = 128
TMR0, STATUS = 1, 3
C, Z = 0, 2

ENTRY = 16 + 8
"""TMR0 at the interrupt's first word at the latest: four cycles (DS33023 section 8), the context kept by the
compiler, and the cycles of the write to the EEPROM in which interrupts wait."""
TAKES_A_BIT, TAKES_NONE = True, False


_chosen = ["two ports"]


@pytest.fixture(params=list(JOBS), autouse=True)
def chosen(request: pytest.FixtureRequest) -> None:
    """Every test is of every kind of interrupt."""
    _chosen[0] = request.param


@cache
def _numbers(kind: str) -> Streaming:
    job = plan_job(loads(JOBS[kind], "job.toml"))
    assert job.stream
    return streaming(job.servos, job.frame, job.clock, job.stream, job.firmware.soft_start_s)


@cache
def _made(kind: str) -> Assembly:
    names = "\n".join(f"_{name} equ 0x{0x20 + number:02X}" for number, name in enumerate(VARIABLES))
    head = '    list p=16f84, r=dec\n    include "p16f84.inc"\n'
    return assemble(f"{head}{names}\n    org 0\nst_in:\n{tick(_numbers(kind))}\n    nop\n    end\n")


def numbers() -> Streaming:
    return _numbers(_chosen[0])


def made() -> Assembly:
    return _made(_chosen[0])


def label(name: str) -> int:
    return dict(made().labels)[name]


def word(at: int) -> Decoded:
    found = decode(made().image.program[at])
    assert found is not None
    return found


def ways(
    at: int,
    end: int,
    stack: tuple[int, ...] = (),
    seen: tuple[int, ...] = (),
    avoid: frozenset[int] = frozenset(),
) -> Iterator[tuple[int, frozenset[int]]]:
    """(cycles, addresses passed) of every way from `at` to `end` that avoids some addresses; a wait's loop is
    gone through once.
    """
    spent, passed = 0, set()
    while at != end:
        if at == label("st_out") or at in avoid:
            return
        each = word(at)
        name, step = each.instruction.mnemonic, at + 1
        passed.add(at)
        spent += each.instruction.cycles
        if name in ("BTFSS", "BTFSC", "DECFSZ", "INCFSZ"):
            for more, rest in ways(at + 2, end, stack, seen, avoid):
                yield spent + 1 + more, frozenset(passed) | rest
        elif name == "GOTO":
            step = each.k
            if step <= at:
                if step in seen:
                    return
                seen = (*seen, step)
        elif name == "CALL":
            stack, step = (*stack, at + 1), each.k
        elif name == "RETURN":
            if not stack:
                return
            stack, step = stack[:-1], stack[-1]
        at = step
    yield spent, frozenset(passed)


def kernel() -> range:
    """The words of an edge."""
    return range(label("st_before"), label("st_fallen"))


def calls(at: int, name: str) -> bool:
    return word(at).instruction.mnemonic == "CALL" and word(at).k == label(name)


def look(takes_a_bit: bool) -> int:
    """The longest look, its CALL and its RETURN included, that takes a bit from the line, or takes none."""
    call = after_look() - 1
    taken = next(
        at
        for at in range(label("st_look"), label("st_hunt"))
        if word(at).instruction.mnemonic == "MOVLW" and word(at).k == numbers().bit_units
    )
    return max(spent for spent, passed in ways(call, call + 1) if (taken in passed) == takes_a_bit)


def after_look() -> int:
    """Behind the look before an edge."""
    return next(at + 1 for at in kernel() if calls(at, "st_look"))


def run_exactly(now: int, target: int) -> int:
    """The cycle, TMR0's value never wrapped, in which st_exactly has returned; called in cycle `now`."""
    at, w, flags, ram = label("st_exactly"), target & 0xFF, {C: False, Z: False}, {}
    now += 2
    while True:
        each = word(at)
        name, f = each.instruction.mnemonic, each.f
        spent, step = each.instruction.cycles, 1
        if name == "MOVWF":
            ram[f] = w
        elif name == "MOVF":
            w = now & 0xFF if f == TMR0 else ram[f]
        elif name == "SUBWF":
            w = ram[f] - w & 0xFF
        elif name == "ADDLW":
            flags[C], w = w + each.k > 0xFF, w + each.k & 0xFF
        elif name in ("BTFSS", "BTFSC"):
            value = flags[each.b] if f == STATUS else bool(ram[f] >> each.b & 1)
            step = 2 if value == (name == "BTFSS") else 1
            spent += step == 2
        elif name == "GOTO":
            step = each.k - at
        elif name == "RETURN":
            return now + 2
        else:
            assert name == "NOP", name
        now += spent
        at += step


def test_the_wait_for_the_timer_ends_at_the_same_cycle_whenever_it_began() -> None:
    for target in (RISE, RISE + 63, RISE + 100, 256 + 7):
        assert len({run_exactly(target - early, target) - target for early in range(20, 220)}) == 1


def test_a_wait_that_begins_too_late_is_not_exact() -> None:
    assert run_exactly(RISE - 10, RISE) != run_exactly(RISE - 40, RISE)


def test_both_ways_from_the_wait_to_the_port_take_the_same_cycles() -> None:
    behind = next(at + 1 for at in kernel() if calls(at, "st_exactly"))
    port = next(at for at in range(behind, label("st_fallen")) if word(at).instruction.mnemonic == "MOVWF")
    assert {spent for spent, _ in ways(behind, port)} == {4}


def poll() -> int:
    """The wait for the next look: from the timer's read that sees it is time to the call."""
    read = next(at for at in range(label("st_before"), after_look()) if word(at).f == TMR0)
    return min(spent for spent, _ in ways(read, after_look() - 1))


def to_the_wait() -> int:
    """From the last look's end to the first read of the timer in st_exactly."""
    read = label("st_poll")
    return max(spent for spent, passed in ways(after_look(), read) if label("st_before") not in passed)


def between_looks() -> int:
    """From a look's end to the next read of the timer in the wait for the next."""
    read = next(at for at in range(label("st_before"), after_look()) if word(at).f == TMR0)
    avoid = frozenset({label("st_exactly")})
    return max(spent for spent, _ in ways(after_look(), read, avoid=avoid))


def test_the_last_look_leaves_time_for_the_edge_even_if_it_takes_a_bit() -> None:
    # Seen at most a turn late: then the look, then the way to the first read, 8 cycles before the edge.
    assert LAST - (7 + poll() + look(TAKES_A_BIT) + to_the_wait()) >= 8


def test_a_look_that_takes_a_bit_is_made_up_for_before_the_last_one() -> None:
    # Two bits are 390 cycles apart at least, so the look after a long one is short.
    late = max(0, between_looks() + poll() + look(TAKES_A_BIT) - 64)
    assert late + 7 + poll() + look(TAKES_NONE) + to_the_wait() <= LAST - 8


def first() -> int:
    """From the first word to the first read of the timer before a rise, without the first look."""
    read = next(at for at in range(label("st_before"), after_look()) if word(at).f == TMR0)
    take, hunt = label("st_in") + 4, label("st_quiet")
    assert calls(take, "st_take") and calls(hunt, "st_hunt")
    # A rise's `fine` is 0: there is no second look before the wait for the one that is LAST before it.
    far = next(at for at in range(hunt, read) if calls(at, "st_look"))
    edge = label("st_edge")
    avoid = frozenset({far, label("st_plain"), label("st_plain_quiet")})
    after = max(spent for spent, _ in ways(edge, read, avoid=avoid))
    before = [
        spent + more
        for call, other in ((take, hunt), (hunt, take))
        for spent, _ in ways(label("st_in"), call, avoid=frozenset({other}))
        for more, _ in ways(call + 1, edge, avoid=avoid)
    ]
    return max(before) + after


@pytest.mark.parametrize("bit_first", [True, False])
def test_a_rise_in_the_round_after_the_latest_fall_is_exact(bit_first: bool) -> None:
    edge = RISE + LATEST
    out = max(
        spent for spent, passed in ways(label("st_fallen"), label("st_out")) if label("st_look") not in passed
    )
    again = edge - 256 + out + ENTRY
    begun = max(ENTRY, again) + first() + look(bit_first)
    sight = max(begun, RISE - LAST + 7)
    assert begun - (RISE - LAST) < 64
    assert sight + poll() + look(not bit_first) + to_the_wait() <= RISE - 8


def samples(region: range) -> set[int]:
    """The cycles from the reading of the time to each sample of the line in a region of the words."""
    take = label("st_take")
    lines = [at for at in region if word(at).instruction.mnemonic in ("BTFSS", "BTFSC") and word(at).f == 5]
    assert lines and all(word(at).b == 4 for at in lines)
    return {spent for line in lines for spent, _ in ways(take, line)}


def test_the_time_stamp_of_a_start_bit_is_read_as_long_after_its_sample_as_the_receiver_is_reckoned_for() -> (
    None
):
    hunt = label("st_hunt")
    read = next(at for at in range(hunt, hunt + 5) if word(at).f == TMR0)
    # The sample is the first word; it skips the RETURN.
    assert word(hunt).instruction.mnemonic == "BTFSC" and read == hunt + 2 and STAMP == 2


def test_a_bit_is_sampled_as_long_after_its_time_stamp_as_the_receiver_is_reckoned_for() -> None:
    stop = samples(range(label("st_take"), label("st_what")))
    others = samples(range(label("st_bit"), label("st_data") + 4))
    assert SAMPLE_AFTER[0] <= min(stop) and max(stop) <= STOP_AFTER
    assert SAMPLE_AFTER[0] <= min(others) and max(others) <= SAMPLE_AFTER[1]


def test_samples_of_a_round_without_an_edge_are_no_further_apart_than_the_receiver_is_reckoned_for() -> None:
    # One interrupt to the next: 128 cycles, one more where the C executes an instruction of two.
    assert HALF + 1 <= BIT_GAP
    quiet = label("st_plain_quiet")
    again = next(at for at in range(quiet, quiet + 20) if calls(at, "st_hunt"))
    # CALL, the sample, RETURN; the decrement that does not skip; the path to the second call; CALL.
    (path,) = {spent for spent, _ in ways(quiet, again)}
    assert HALF + 1 - (1 + 2 + 1 + 2 + path + 2) <= START_GAP


def test_the_write_to_the_eeprom_masks_interrupts_no_longer_than_the_receiver_is_reckoned_for() -> None:
    text = (Path(__file__).parents[3] / "templates" / "stream" / "keep.asm").read_text()
    words = [line.split(";")[0].split() for line in text.splitlines() if line.split(";")[0].strip()]
    names = [each[0] for each in words]
    begin = next(n for n, each in enumerate(words) if each[:3] == ["bcf", "INTCON,", "7"])
    end = next(n for n, each in enumerate(words) if each[:3] == ["bsf", "INTCON,", "7"])
    # BCF, the test that skips (2 cycles) the GOTO, and the rest up to BSF, one cycle each.
    assert names[begin + 1 : begin + 3] == ["btfsc", "goto"]
    assert (end - begin) + 1 <= MASKED


def test_a_round_is_over_before_the_next_but_one_begins() -> None:
    # The latest edge, the way out, the context, and the next interrupt's first word that clears the flag.
    def out(fine: int) -> int:
        bits = {7: fine >> 7 & 1, 6: fine >> 6 & 1}
        return max(
            spent
            for spent, passed in ways(label("st_fallen"), label("st_out"))
            if (label("st_early") in passed) == (not bits[7])
        )

    assert RISE + 127 + out(0) + 2 * ENTRY < 512
    # A fall in the last quarter of its round has the next round's interrupt, too; one of two looks is short.
    whole = max(
        spent
        for spent, passed in ways(label("st_fallen"), label("st_out"))
        if label("st_whole_round") in passed
    )
    assert RISE + 255 + whole - (look(TAKES_A_BIT) - look(TAKES_NONE)) <= 512
    assert LATE < HALF - 20 and SECOND <= LATEST_SECOND
