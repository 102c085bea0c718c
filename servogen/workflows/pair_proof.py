"""Two chips -> what is proven of both, and of the pair: "Two chips" in docs/proof.md.

In: schedules and programs. Out: `PairProof`. Each chip is proven against its own schedule and checked; that
the wire's edges, which are in the first one's schedule, are what the second one's theorem is about, is
arithmetic.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil
from typing import TYPE_CHECKING

from servogen.pic.image import Image
from servogen.programs import PAIR_FOLDERS
from servogen.prove import Proof
from servogen.prove.prover import EXACT_CRYSTAL, INPUTS_CHANGE, MAX_STATES
from servogen.prove.wire import NEAR
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import drift, seldom
from servogen.workflows.certificates import CHECKED, CertificateVerdict, Witnessed, prove_program
from servogen.workflows.own_crystals import jitter, outwards

if TYPE_CHECKING:
    from servogen.answers import PairProofFacts

Answer = tuple[CertificateVerdict, Proof, Witnessed | None]
"""What is known of a program, its proof, and what the checker says of it; None where it is not proven."""


@dataclass(frozen=True, slots=True)
class PairProof:
    """The answers on both chips, and why their theorems do not make one of the pair, if they do not."""

    schedules: tuple[PulseSchedule, PulseSchedule]
    chips: tuple[Answer, Answer]
    misfits: tuple[str, ...]
    late: int
    """The cycles by which the second chip may begin after the first."""

    @property
    def proven(self) -> bool:
        """Return whether all of it is proven, by one engine at least."""
        return not self.misfits and all(witness is not None for _, _, witness in self.chips)

    @property
    def checked(self) -> bool:
        """Return whether the checker has accepted both certificates, too."""
        return self.proven and all(verdict.valid for verdict, _, _ in self.chips)

    def summary(self) -> str:
        """Return the verdict on both in a line."""
        if self.checked:
            return f"both chips: {CHECKED}"
        for name, (verdict, _, _) in zip(PAIR_FOLDERS, self.chips, strict=True):
            if not verdict.valid:
                return f"both chips: {verdict.text.replace('NOT proven: ', '')} ({name})"
        return f"both chips: not decided: {'; '.join(self.misfits)}"

    def lines(self) -> list[str]:
        """Return the answer as text."""
        rows = [self.summary()]
        wire = self.schedules[1].wire
        restarts = [f"{RESTARTS} ({wire.restart} of chip2)"] if wire and wire.restart else []
        if self.proven:
            rows += [f"  {text}" for text in self._theorem()]
        for name, (verdict, proof, _) in zip(PAIR_FOLDERS, self.chips, strict=True):
            rows += [f"{name}: {verdict.text}", f"  {proof.states} states, {proof.runs} runs"]
        ppm = wire.crystal_ppm if wire else 0
        crystals = OWN_CRYSTALS.format(ppm) if ppm else ONE_CRYSTAL
        inputs = INPUTS_CHANGE if ppm else EXACT_CRYSTAL  # each chip is proven in cycles of its own
        of_chips = (each for _, proof, _ in self.chips for each in proof.assumptions)
        chips = (inputs if each == EXACT_CRYSTAL else each for each in of_chips)
        assumed = [crystals, *ASSUMED, *restarts, *chips]
        return [*rows, "assumed:", *(f"  {each}" for each in dict.fromkeys(assumed))] if self.proven else rows

    def _theorem(self) -> Iterator[str]:
        first, second = self.schedules
        rule = second.wire
        assert rule is not None
        late = float(first.clock.us(self.late)) / 1000
        yield "for every power-up, input, chip and wire: every edge of chip1 is its schedule's; chip2 has"
        when = "time, each from the look that sees it" if rule.crystal_ppm else "cycle"
        yield f"whole frames of its schedule, those in which the wire rises in its {when}, and no other pulse"
        of = "either chip" if rule.restart else "chip1"
        if rule.crystal_ppm:
            early, most = (each * second.clock.cycle_us for each in jitter(rule, second.period))
            yield f"its pulses come {outwards(early, most)} from their places in chip1's time"
        after = "the look that sees the wire's" if rule.crystal_ppm else "the wire's"
        yield f"from each reset of {of} on, chip2's first edge comes {rule.cycles} cycles after {after}"
        if rule.restart:
            yield f"rise {rule.frames}, counted from 0: a chip2 that begins resets chip1 before it joins"
            return
        yield f"rise {rule.frames}, counted from 0, if chip2 begins no later than {late:.0f} ms after chip1"
        yield "a chip2 that begins later, or is reset alone, has no pulses until chip1 begins anew"

    def to_json(self) -> PairProofFacts:
        rule = self.schedules[1].wire
        at_any_time = rule is not None and rule.restart is not None
        return {
            "answer": "proven" if self.checked else self.summary().removeprefix("both chips: "),
            "proven": self.checked,
            "misfits": list(self.misfits),
            "second_begins_late_cycles": self.late if self.proven and not at_any_time else None,
            "chips": [verdict.text for verdict, _, _ in self.chips],
        }


ONE_CRYSTAL = "both chips count the cycles of one crystal"
OWN_CRYSTALS = "the crystal of each chip is off by {} ppm or less"
ASSUMED = (
    "the wire has a pull-down and passes every level on",
    "no pulse of at most 10 cycles on the wire before the first chip's first frame, beside its reset",
)
RESET_US = 2
"""The shortest low level at MCLR that resets a chip: parameter 30 of DS35007; 1 us in DS30430."""
RESTARTS = f"the MCLR of chip1 has a pull-up, and {RESET_US} us of a low level there reset it"


def prove_pair(
    schedules: tuple[PulseSchedule, PulseSchedule],
    images: tuple[Image, Image],
    texts: tuple[bytes, bytes] | None = None,
    max_states: int = MAX_STATES,
) -> PairProof:
    """Prove both chips and the pair; `texts` are the contents of the schedules' files, by default those that
    `servogen build` writes. Raises ToolError.
    """
    if texts is None:
        texts = schedules[0].json_text().encode(), schedules[1].json_text().encode()
    first, second = (
        prove_program(image, schedule, text, max_states)
        for image, schedule, text in zip(images, schedules, texts, strict=True)
    )
    late = _late(schedules, first)
    misfits = (*_misfits(*schedules), *(_too_soon(*schedules, late) if first[2] is not None else ()))
    return PairProof(schedules, (first, second), misfits, late)


def _late(schedules: tuple[PulseSchedule, PulseSchedule], first: Answer) -> int:
    """Return the cycles by which the second chip may begin after the first, which may be negative."""
    _, proof, witness = first
    known = [proof.silence, witness.checked.silence if witness and witness.checked else None]
    silence = min((each for each in known if each is not None), default=0)
    rule, period = schedules[1].wire, schedules[1].period
    # Up to its first look, from there to a low level, and beyond `quiet` to the next look, a frame each.
    late = silence - 3 * period - (rule.quiet if rule else 0) - NEAR
    # In the cycles of either chip: with two crystals they may differ.
    return late - ceil(silence * drift(rule.crystal_ppm)) if rule else late


def _too_soon(first: PulseSchedule, second: PulseSchedule, late: int) -> Iterator[str]:
    """Yield why a second chip that still follows, or joins, what the first did before its reset may not be
    ready for what it does after it.
    """
    rule = second.wire
    needed = rule.frames * second.period + 2 + rule.early(second.period) if rule else 0
    if late < needed:
        yield f"chip1 begins its motion {needed - late} cycles too soon after a reset: chip2 needs them"


def _misfits(first: PulseSchedule, second: PulseSchedule) -> Iterator[str]:
    """Yield why the wire's edges in the first one's schedule are not those of the second one's theorem."""
    rule = second.wire
    if rule is None:
        yield "chip2 follows no wire"
        return
    faster = 1 + drift(rule.crystal_ppm)
    if (first.clock, first.period) != (second.clock, second.period):
        yield "the chips have different clocks or frames"
    if first.buttons or first.commands or first.wire:
        yield "something steers chip1, of which chip2 knows nothing"
    if rule.restart and second.clock.us(rule.pulled) < RESET_US * faster:
        yield f"chip2 resets chip1 for {float(second.clock.us(rule.pulled)):g} us; {RESET_US} are needed"
    names = [channel.pin for channel in first.channels]
    runs = (*first.lead_in, *first.loop)
    wires = {run.pulses[names.index(rule.source)] for run in runs} if rule.source in names else {None}
    pulses = [pulse for pulse in wires if pulse is not None]
    if None in wires or len({pulse.rise for pulse in pulses}) != 1:
        yield f"{rule.source} of chip1 does not rise in the same cycle of every frame"
    if rule.quiet < second.period * faster:
        yield f"chip2 takes a wire for quiet that is low for {rule.quiet} cycles, less than a frame"
    near = max(NEAR + 2 * rule.early(second.period), ceil(seldom(second.period) * faster))
    if any(not near <= pulse.width <= first.period - near for pulse in pulses):
        yield f"a pulse of {rule.source} of chip1, or the time between two, is shorter than {near} cycles"
    if first.lead_in_frames - second.lead_in_frames != rule.frames or first.loop_frames != second.loop_frames:
        yield f"chip2's frames are not those of chip1 from its frame {rule.frames} on"
