"""The theorem of the player's kernel for every compiler: its two bounds to the cycle, and hostile builds."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import pytest

from servogen.edges import HIGH, EdgeChunk
from servogen.engines.board import machine_of
from servogen.engines.player.engine import play
from servogen.engines.player.firmware import CHECK, DONE
from servogen.engines.player.layout import TAIL, Slot, SlotLayout, to_rise
from servogen.engines.player.theorem import KERNEL, KernelChanged, allowances
from servogen.job import load, plan_job
from servogen.pic.device import RAM_FIRST, RAM_LAST
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.pic.known_values import word_of
from servogen.pic.listing import Listing
from servogen.simulator import Machine
from servogen.workflows.job_build import report
from tests.engines.player.hostile import Base, base, outcome, played_by, run
from tests.engines.player.player_jobs import ROOT, built, built_text, job_text, sweep

LONGEST = dict.fromkeys(range(12), 127)
"""Trims that make every pulse 127 cycles longer: the longest that the layout allows for."""


def simple() -> Base:
    found = base("c2c", "speed", 0)
    assert found is not None
    return found


def delayed(base: Base, cycles: int) -> Image:
    """Return the program with so many cycles more after every slot, at least 7."""
    listing = base.compilation.listing
    kernel = next(each for each in listing.functions if each.name == KERNEL)
    words = dict(base.image.program)
    assert words[kernel.end - 1] == encode("RETURN")
    used = {at for at, _, _ in listing.variables}
    counter = next(at for at in range(0x4F, 0x0C, -1) if at not in used)
    at = max(words) + 1
    words[kernel.end - 1] = encode("GOTO", k=at)
    left = cycles - 2  # the GOTO
    code: list[int] = []
    while left >= 7:
        turns = min(255, (left - 1) // 3)
        start = at + len(code)
        code += [encode("MOVLW", k=turns), encode("MOVWF", f=counter)]
        code += [encode("DECFSZ", f=counter, d=1), encode("GOTO", k=start + 2)]
        left -= 2 + 3 * turns - 1
    code += [encode("NOP")] * left + [encode("RETURN")]
    words |= {at + number: word for number, word in enumerate(code)}
    return replace(base.image, program=words, eeprom=LONGEST)


def cycles_left(layout: SlotLayout, slot: Slot, following: Slot) -> int:
    """The layout's own sum: the kernel must have read the timer by the cycle before the next slot's
    beginning.
    """
    return following.ticks * layout.tick - 1 - to_rise(layout.tick) - slot.longest - TAIL


@pytest.mark.campaign
def test_n_is_the_time_that_the_layout_has_reserved_for_the_same_kernel() -> None:
    """The layout's sum is its own; the pins of a slot that do not rise one by one do so a cycle sooner."""
    for name in ("hexapod-tripod", "scara-pick"):
        done = built(name, "xc8")
        layout = _layout(name)
        between_frames = cycles_left(layout, layout.slots[-1], layout.slots[0])
        between_slots = min(cycles_left(layout, one, other) for one, other in pairwise(layout.slots))
        for program in done.programs:
            slots, frames = program.firmware.timing_budgets
            assert (slots.room, frames.room) == (between_slots + 1, between_frames + 1)


def _layout(name: str) -> SlotLayout:
    return play(plan_job(load(ROOT / "jobs" / f"{name}.toml")))[1].layout


@dataclass(frozen=True)
class Gap:
    """From a slot with pulses to the next one."""

    slot: int
    rise: int
    fall: int
    done: int
    check: int
    overrun: bool
    """Whether the bit was set when the next slot had ended."""


def gaps(found: Base, image: Image, frames: int = 3) -> list[Gap]:
    """Return the slots with pulses of some frames, up to the first that comes too late."""
    _, played = played_by()
    slots = played.layout.slots  # type: ignore[attr-defined]
    machine = machine_of(played.plan.schedule, image)  # type: ignore[attr-defined]
    listing = found.compilation.listing
    check, done = listing.label(CHECK), listing.label(DONE)
    bit = found.address("overrun") - RAM_FIRST
    result: list[Gap] = []
    last: tuple[int, int, int, int] | None = None
    for number in range(frames * len(slots)):
        machine.run_until(pc=check, limit=100_000)
        looked = machine.cycles
        edges = _edges_until(machine, done)
        overrun = bool(machine.state().ram[bit] & 1)
        if last is not None:
            result.append(Gap(*last, looked, overrun))
        if overrun:
            return result
        rises, falls = edges.cycle[edges.level == HIGH], edges.cycle[edges.level != HIGH]
        last = None
        if len(rises):
            last = (number % len(slots), int(rises[0]), int(falls[-1]), machine.cycles)
    return result


def _edges_until(machine: Machine, address: int) -> EdgeChunk:
    machine.breakpoints = {address}
    edges = machine.run(100_000)
    machine.breakpoints = set()
    return edges


def test_the_kernel_ends_as_long_after_its_pulses_as_the_theorem_reckons_with() -> None:
    found = simple()
    _, played = played_by()
    layout = played.layout  # type: ignore[attr-defined]
    spent = layout.slots[1].ticks * layout.tick - 1 - layout.slots[0].longest
    spent -= allowances(found.compilation.listing, _two_slots(layout))[0].same_edges
    to_rise = 3 * layout.tick + 6  # docs/firmware.md: three ticks of lock, and the way to the write
    after = [gap.done - gap.fall + to_rise for gap in gaps(found, found.image, 20)]
    assert max(after) == spent


def _two_slots(layout: SlotLayout) -> SlotLayout:
    return replace(layout, slots=layout.slots[:2])


def test_the_bit_is_set_from_the_first_cycle_that_is_too_late() -> None:
    """Late is a look at the timer in the next slot's tick or after it, whatever the C did."""
    found = simple()
    _, played = played_by()
    layout = played.layout  # type: ignore[attr-defined]
    to_rise = 3 * layout.tick + 6
    reference = run(found, found.image)
    spare = found.slots.same_edges - reference[2]
    in_time, late = [], []
    delays = {*range(spare, spare + 300, 15)}
    while delays:
        more = delays.pop()
        for gap in gaps(found, delayed(found, more), 1):
            following = layout.slots[(gap.slot + 1) % len(layout.slots)]
            left = following.ticks * layout.tick - 1 - (gap.check - gap.rise + to_rise)
            if more == spare:  # each slot at its last cycle that is in time, and at the next
                delays |= {spare + left, spare + left + 1}
            assert gap.overrun == (left < 0)
            (late if left < 0 else in_time).append(left)
    assert max(late) == -1
    assert min(in_time) == 0


def changed(listing: Listing, change: Callable[[dict[int, int]], None]) -> Listing:
    words = listing.words
    change(words)
    return replace(listing, rows=tuple(replace(row, word=words[row.address]) for row in listing.rows))


def test_a_kernel_whose_lock_or_loops_are_changed_has_no_theorem() -> None:
    found = simple()
    listing = found.compilation.listing
    _, played = played_by()
    kernel = next(each for each in listing.functions if each.name == KERNEL)
    goto_next = {at: encode("GOTO", k=at + 1) for at in range(kernel.start, kernel.end)}
    refused, kept = 0, []
    for at in range(listing.label("pl_poll"), listing.label(DONE)):
        if found.image.program[at] == goto_next[at]:  # two cycles become one
            broken = changed(listing, lambda words, at=at: words.update({at: encode("NOP")}))  # type: ignore[misc]
            try:
                allowances(broken, played.layout)  # type: ignore[attr-defined]
                kept.append(at)
            except KernelChanged:
                refused += 1
    assert refused >= 10
    # All slots begin a cycle sooner, or it is a wait between increments: still a kernel, as its edges show.
    for at in kept:
        edges, overrun, *_ = run(
            found, replace(found.image, program={**found.image.program, at: encode("NOP")})
        )
        assert not overrun
        assert all((one == other).all() for one, other in zip(edges, found.edges, strict=True))


@pytest.mark.parametrize(
    ("word", "message"),
    [
        (encode("SLEEP"), "SLEEP at 0x{:03X} is not followed"),
        (encode("OPTION"), "OPTION at 0x{:03X} is not followed"),
        (encode("TRIS", f=6), "TRIS at 0x{:03X} is not followed"),
        (encode("CALL", k=0), "CALL at 0x{:03X} is not followed"),
        (encode("CLRF", f=6), "CLRF at 0x{:03X} is not followed"),
        (encode("BSF", f=3, b=5), "BSF at 0x{:03X} is not followed"),
        (encode("BSF", f=0, b=3), "BSF at 0x{:03X} is not followed"),
        (encode("BTFSC", f=0x4F, b=0), "0x{:03X} tests what is not the kernel's"),
        (encode("BTFSC", f=5, b=0), "0x{:03X} tests what is not the kernel's"),
        (encode("CLRF", f=1), "0x{:03X} writes the timer"),
        (encode("INCF", f=1, d=1), "0x{:03X} writes the timer"),
    ],
)
def test_a_kernel_with_a_word_that_is_not_followed_has_no_theorem(word: int, message: str) -> None:
    """The NOP before the first pulse's loops, and the clearing of the watchdog before both."""
    listing = simple().compilation.listing
    _, played = played_by()
    assert 0x4F not in {at for at, _, _ in listing.variables}
    for at in (listing.label("pl_loop1") - 1, listing.label("pl_loops")):
        other = changed(listing, lambda words, at=at: words.update({at: word}))  # type: ignore[misc]
        with pytest.raises(KernelChanged, match=f"^{message.format(at)}$"):
            allowances(other, played.layout)  # type: ignore[attr-defined]


def test_a_kernel_with_other_pulses_or_without_an_end_has_no_theorem() -> None:
    """Each write of the port is needed as it is: W, which is a mask, or 0."""
    listing = simple().compilation.listing
    _, played = played_by()
    words = listing.words
    writes = encode("MOVWF", f=0), encode("CLRF", f=0)
    mutants = [
        ({at: word}, r"^a pulse of \d+ cycles lasts (\d+|None)$")
        for at in range(listing.label("pl_poll"), listing.label(DONE))
        if words[at] in writes
        for word in {*writes, encode("NOP")} - {words[at]}
    ]
    assert len(mutants) == 2 * 14
    circle = listing.label("pl_loops")
    mutants.append(({circle: encode("GOTO", k=circle)}, r"^it does not end$"))
    for changes, message in mutants:
        other = changed(listing, lambda words, changes=changes: words.update(changes))  # type: ignore[misc]
        with pytest.raises(KernelChanged, match=message):
            allowances(other, played.layout)  # type: ignore[attr-defined]


def test_the_allowances_are_the_smallest_of_all_pairs_of_slots() -> None:
    listing = simple().compilation.listing
    _, played = played_by()
    layout = played.layout  # type: ignore[attr-defined]
    three = replace(layout, slots=layout.slots[:3])
    pairs = [allowances(listing, replace(layout, slots=pair))[0] for pair in pairwise(three.slots)]
    assert len({*pairs}) > 1, "they differ"
    smallest = allowances(listing, three)[0]
    assert smallest.same_edges == min(pair.same_edges for pair in pairs)
    assert smallest.late_is_seen == min(pair.late_is_seen for pair in pairs)


def test_the_words_behind_the_pulses_restore_what_the_next_slot_needs() -> None:
    """`target` was moved by 3 while the kernel waited; `overrun` is for the C."""
    listing = simple().compilation.listing
    _, played = played_by()
    done = listing.label("pl_done")
    words = listing.words
    assert [words[done + n] for n in (0, 1)] == [encode("CLRWDT"), encode("MOVLW", k=3)]
    overrun = listing.variable("overrun")
    for at, word in ((1, encode("MOVLW", k=2)), (2, encode("NOP")), (0, encode("CLRF", f=overrun))):
        changes = {done + at: word}
        other = changed(listing, lambda words, changes=changes: words.update(changes))  # type: ignore[misc]
        with pytest.raises(KernelChanged, match=r"^the end changes what the next slot needs$"):
            allowances(other, played.layout)  # type: ignore[attr-defined]


def test_a_kernel_that_takes_every_slot_for_late_has_no_theorem() -> None:
    listing = simple().compilation.listing
    _, played = played_by()
    check = listing.label("pl_check")  # SUBWF, ADDWF, BTFSS C, BSF overrun
    early = changed(listing, lambda words: words.update({check + 2: encode("BTFSC", f=3, b=0)}))
    ticks = played.layout.slots[1].ticks  # type: ignore[attr-defined]
    with pytest.raises(KernelChanged, match=rf"^\d+ of {ticks} ticks are taken for too many$"):
        allowances(early, played.layout)  # type: ignore[attr-defined]


@pytest.mark.campaign
def test_every_hostile_build_of_a_sample_is_exact_or_sets_the_bit() -> None:
    found = Counter(outcome(seed) for seed in range(20))
    assert not [result for result in found if result.isupper() or result.startswith("FAULT")]
    assert found["exact"] >= 4
    assert found["overrun"] >= 2


def test_build_prints_both_bounds() -> None:
    done = built_text(job_text(2, sweep(2, 0.16), firmware="soft_start_s = 0.08"))
    slots, frames = done.programs[0].firmware.timing_budgets
    text = " ".join(report(done).split())
    assert (
        f"the same edges with at most {slots.room} between two slots and {frames.room} between two frames"
        in text
    )
    assert (
        f"overrun is set, with at most {slots.seen} between two slots and {frames.seen} between two frames"
        in text
    )
    assert slots.to_json()["late_is_seen_up_to_cycles"] == slots.seen


def test_late_c_is_seen_up_to_the_second_bound_and_not_a_cycle_longer() -> None:
    """256 ticks after the slot before, the timer looks as it did in that slot: not late."""
    found = simple()
    _, played = played_by()
    layout = played.layout  # type: ignore[attr-defined]
    first = gaps(found, delayed(found, 100), 1)[0]
    last_seen = 256 * layout.tick - 1 - (first.check - first.rise + 3 * layout.tick + 6) + 100
    assert gaps(found, delayed(found, last_seen), 1)[0].overrun
    assert not gaps(found, delayed(found, last_seen + 1), 1)[0].overrun
    following, slot = layout.slots[1], layout.slots[0]
    slots = allowances(found.compilation.listing, _two_slots(layout))[0]
    assert slots.late_is_seen - slots.same_edges == (256 - following.ticks) * layout.tick
    # This slot's pulses were shorter than the longest, and its end so much sooner.
    c_of_first = first.check - first.done + last_seen - 100
    assert 0 <= c_of_first - slots.late_is_seen <= slot.longest


def test_a_look_at_the_timer_in_the_last_cycle_changes_no_edge() -> None:
    """The loop that waits then reads the timer three cycles into its tick; five would be too late, unseen."""
    found = simple()
    _, played = played_by()
    layout = played.layout  # type: ignore[attr-defined]
    cycles = layout.slots[1].ticks * layout.tick
    first = gaps(found, delayed(found, 100), 1)[0]
    left = cycles - 1 - (first.check - first.rise + 3 * layout.tick + 6) + 100
    exact = gaps(found, delayed(found, left), 1)
    assert not exact[0].overrun
    assert exact[1].rise - exact[0].rise == cycles
    assert gaps(found, delayed(found, left + 1), 1)[0].overrun


def test_a_kernel_that_records_nothing_sees_no_lateness() -> None:
    found = simple()
    _, played = played_by()
    bit = encode("BSF", f=found.address("overrun"), b=0)
    listing = found.compilation.listing
    silent = changed(
        listing, lambda words: words.update({at: encode("NOP") for at, word in words.items() if word == bit})
    )
    slots, frames = allowances(silent, played.layout)  # type: ignore[attr-defined]
    assert (slots.late_is_seen, frames.late_is_seen) == (slots.same_edges, frames.same_edges)
    assert (slots.same_edges, frames.same_edges) == (found.slots.same_edges, found.frames.same_edges)


def test_a_kernel_does_the_same_at_any_address_with_its_variables_anywhere() -> None:
    """Kernels of programs that differ only in these share what is reckoned of one of them."""
    listing = simple().compilation.listing
    _, played = played_by()
    kernel = next(each for each in listing.functions if each.name == KERNEL)
    by = 0x180
    words = {}
    for row in listing.rows:
        decoded = word_of(row.word)
        word = row.word
        if decoded.has_f and RAM_FIRST <= decoded.f <= RAM_LAST:  # mirrored: the order is another one
            word = word & ~0x7F | RAM_FIRST + RAM_LAST - decoded.f
        elif decoded.flow == "jump" and kernel.start <= decoded.k < kernel.end:
            word = encode("GOTO", k=decoded.k + by)
        words[row.address + by] = word
    moved = replace(
        listing,
        rows=tuple(
            replace(row, address=row.address + by, word=words[row.address + by]) for row in listing.rows
        ),
        functions=tuple(replace(each, start=each.start + by) for each in listing.functions),
        labels=tuple((name, at + by) for name, at in listing.labels),
        variables=tuple((RAM_FIRST + RAM_LAST - at, name, size) for at, name, size in listing.variables),
    )
    assert allowances(moved, played.layout) == allowances(listing, played.layout)  # type: ignore[attr-defined]
    wait = listing.label("pl_poll") + by
    broken = changed(moved, lambda words: words.update({wait + 4: encode("NOP")}))
    with pytest.raises(KernelChanged):
        allowances(broken, played.layout)  # type: ignore[attr-defined]
