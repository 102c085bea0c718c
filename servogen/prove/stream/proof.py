"""The proof of a stream program for any waveform on its line: the lemmas, put together.

*For every* waveform on the receive pin, every content of the EEPROM and every value of the variables at a
reset, *assuming* of who sends what `sender_assumptions` says, a proven program

- makes every pulse in the cycle of its slot, exactly as wide as the C prepared it, which is always in time
  (`rounds`: the interrupt; `response`: the C's time);
- prepares the width that the specification `chip` says, and changes a goal only by a complete command or the
  fail-safe (`lemmas`; `sharing`: no interrupt comes between);
- samples every bit of a byte while it lasts, for every sender within the error of its rate (`samples`);
- executes a command before the next one can end, in two slots and a round (`LineTheorem.times`).

In: an image, its job's numbers, the listing if one is known. Out: `LineProof`: proven, with what was found
and what is assumed, or why it is not decided. docs/proof.md has the theorem in the words of its users.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction

from servogen.engines.firmware import DIALECTS
from servogen.engines.inputs.serial import HOLD
from servogen.engines.protocol import EngineJob
from servogen.engines.stream.firmware import compiled
from servogen.engines.stream.layout import LATEST, ROUND
from servogen.engines.stream.protocol import BITS, BYTES
from servogen.engines.stream.response import Response, response
from servogen.engines.stream.settings import BAUD_ERROR, MASKED, UNIT
from servogen.engines.stream.streaming import Streaming
from servogen.pic.device import CONFIG_WATCHDOG_ON
from servogen.pic.image import Image
from servogen.pic.known_values import Undefined
from servogen.pic.listing import Listing
from servogen.prove.counterexample import Counterexample
from servogen.prove.stream.bits import GivenUp, Solver
from servogen.prove.stream.chip import LEAST_TRIM, MOST_TRIM
from servogen.prove.stream.counterexample import NOBODY, CounterexampleSearch, Suspect
from servogen.prove.stream.execution import NotFollowed
from servogen.prove.stream.lemmas import Lemmas
from servogen.prove.stream.looks import InterruptChanged
from servogen.prove.stream.names import Names
from servogen.prove.stream.rounds import guarantee
from servogen.prove.stream.samples import SampleTimes
from servogen.prove.stream.sharing import Fails, MainAccesses, check_sharing, check_stack
from servogen.units import Cycles

MAX_DIFFERENCES = 24
"""Words in which a program may differ from servogen's own one, whose names it then borrows."""
AFTER_TRIM_MS, AFTER_QUERY_MS = 25, 20
"""The times for which a sender leaves the line idle after these commands (docs/firmware.md, "Protocol")."""

Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class LineProof:
    """The answer about any line."""

    reason: str
    """Why it is not proven; empty if it is."""
    findings: tuple[str, ...] = ()
    assumptions: tuple[str, ...] = ()
    counterexample: Counterexample | None = None
    """A plain run with a wrong pulse."""

    @property
    def proven(self) -> bool:
        return not self.reason


class UndecidedPart(Exception):
    """Raised where a part of the proof fails; says which and why."""


def prove_line(
    image: Image, listing: Listing | None, job: EngineJob, streamed: Streaming, tell: Tell
) -> LineProof:
    """Return the answer for a program. Raises ToolError without the solver."""
    search = CounterexampleSearch(image, job, streamed, tell)
    # Plain runs first: a fault that most lines show needs no lemma, and comes with its example.
    shown = search.first()
    if shown is not None:
        return LineProof(shown.message, counterexample=shown)
    answer, suspect = by_lemmas(image, listing, job, streamed, tell)
    shown = None if answer.proven else search.about(suspect)
    return answer if shown is None else LineProof(answer.reason, counterexample=shown)


def by_lemmas(
    image: Image, listing: Listing | None, job: EngineJob, streamed: Streaming, tell: Tell
) -> tuple[LineProof, Suspect]:
    """Return what the lemmas say, and what is suspected if one fails."""
    lemmas = None
    try:
        if image.chip_config & CONFIG_WATCHDOG_ON:
            raise UndecidedPart(
                "the watchdog is on: whether it is cleared while the line is busy is not examined"
            )
        names = Names(_named_words(image, listing, job, streamed, tell), streamed)
        lemmas = Lemmas(names, Solver(), lambda task, count, of: tell(f"{task}: {count} of {of}"))
        findings = LineTheorem(names.listing, job, streamed, lemmas, tell).prove()
        return LineProof("", tuple(findings), sender_assumptions(streamed)), NOBODY
    except (UndecidedPart, InterruptChanged, Fails, NotFollowed) as error:
        reason = str(error)
    except GivenUp:
        reason = "the solver does not answer within 20 minutes"
    except Undefined:
        reason = "the program has a word that no data sheet defines"
    except (LookupError, ValueError) as error:
        reason = f"the program is not laid out as a stream: {error}"
    return LineProof(reason), NOBODY if lemmas is None else lemmas.suspect


def sender_assumptions(streamed: Streaming) -> tuple[str, ...]:
    """Return what a proof takes for granted about who sends."""
    assumptions = [
        f"the line is idle for {AFTER_TRIM_MS} ms after a trim: the EEPROM is being written",
        "a byte begins while the chip waits for one: after a byte, or after the line was high for ten bits",
        f"a sender's rate is within {float(100 * BAUD_ERROR):g} % of {streamed.stream.baud} baud",
    ]
    if streamed.stream.transmit_pin is not None:
        assumptions.append(f"no byte ends within {AFTER_QUERY_MS} ms of a query: the chip answers")
    return tuple(assumptions)


def _named_words(
    image: Image, listing: Listing | None, job: EngineJob, streamed: Streaming, tell: Tell
) -> Listing:
    """Return a listing with the words of the image. Raises UndecidedPart.

    Without one, the names are those of the dialect whose program differs least from it.
    """
    candidates = [listing] if listing is not None else []
    for dialect in DIALECTS if listing is None else ():
        tell(f"looking for its names: {dialect}")
        candidates.append(compiled(job, streamed, dialect).compilation.listing)
    differences = [
        (_count_differences(image, candidate), number) for number, candidate in enumerate(candidates)
    ]
    fewest, number = min(differences)
    if fewest > MAX_DIFFERENCES:
        raise UndecidedPart(
            "the names of its variables are not known: the program is not one of servogen's for this job; "
            "give its C file instead"
        )
    chosen = candidates[number]
    rows = tuple(replace(row, word=image.program[row.address]) for row in chosen.rows)
    return replace(chosen, rows=rows)


def _count_differences(image: Image, listing: Listing) -> int:
    """Return in how many words an image differs from a listing."""
    listed = listing.words
    if listed.keys() - image.program.keys():
        return len(listed) + len(image.program)
    return sum(listed.get(address) != word for address, word in image.program.items())


@dataclass(slots=True)
class LineTheorem:
    """The parts of the proof; each returns what it found. Raises UndecidedPart where its limit is passed."""

    listing: Listing
    job: EngineJob
    streamed: Streaming
    lemmas: Lemmas
    tell: Tell

    def prove(self) -> list[str]:
        """Return what was found. Raises UndecidedPart, Fails, InterruptChanged, NotFollowed, GivenUp."""
        return [*self.widths(), *self._data(), *self.times(), *self.edges()]

    def widths(self) -> list[str]:
        """Check that every width of the lemmas fits its slot."""
        layout = self.streamed.layout
        least, most = (0, 0) if self.streamed.coarse else (LEAST_TRIM, MOST_TRIM)
        longest = max(travel.maximum for travel in self.streamed.travels) + most
        shortest = min(travel.minimum for travel in self.streamed.travels) + least
        if shortest < ROUND or longest > (layout.rounds - 1) * ROUND + LATEST:
            raise UndecidedPart(f"pulses of {shortest} to {longest} cycles do not fit {layout.rounds} rounds")
        return [f"pulses of {shortest} to {longest} cycles, in slots of {layout.rounds * ROUND}"]

    def times(self) -> list[str]:
        """Check that the C is in time, for pulses and for commands."""
        streamed, rounds = self.streamed, self.streamed.layout.rounds
        command, travel = BYTES * streamed.byte_cycles, streamed.farthest
        bound = response(self.listing, rounds, travel, command)
        # `response` counts one turn for each whole round of travel, and the last look at the remainder.
        if self.lemmas.divided > travel // ROUND + 1:
            raise UndecidedPart("the division of a distance takes more turns than the distance has rounds")
        if bound.masked > MASKED:
            raise UndecidedPart(
                f"the C masks interrupts for up to {bound.masked} cycles; the limit is {MASKED}"
            )
        worst = bound.after_command
        if worst is None or bound.supply is None or bound.execute is None:
            raise UndecidedPart("the C may be late for a pulse: no bound below the time between two is known")
        if worst > bound.supply:
            raise UndecidedPart(
                f"the C may be late for a pulse: it takes up to {worst} cycles, and has {bound.supply}"
            )
        self.check_command_in_time(bound, worst, command, travel)
        self._check_eeprom_and_answer()
        clock = streamed.plan.schedule.clock
        # A round more than two slots: the command is complete some cycles after the sample of its stop bit.
        after_us = clock.us(Cycles((2 * rounds + 1) * ROUND))
        latest_us = after_us + clock.us(streamed.layout.period)
        return [
            f"the C takes at most {worst} cycles to prepare a pulse; interrupts leave it {bound.supply} of "
            f"{rounds * ROUND}",
            f"a command takes effect in every pulse that begins {float(after_us):g} µs after its stop bit "
            f"or later: within {float(latest_us):g} µs",
        ]

    def _check_eeprom_and_answer(self) -> None:
        """Check that what takes longer than a command is over before a sender may begin the next."""
        streamed, slots = self.streamed, 2 * self.streamed.layout.rounds * ROUND
        clock, byte = streamed.plan.schedule.clock, streamed.byte_cycles
        written = self.job.device.max_eeprom_write_us
        if streamed.stream.fail_safe != HOLD:
            silent_us = clock.us(Cycles((streamed.silence_frames - 1) * streamed.layout.period))
            if silent_us < written:
                raise UndecidedPart("the fail-safe may read the EEPROM while it is written")
        # A query is executed within two slots and a round, and its answer begins up to a bit later.
        answered = slots + ROUND + (BITS + 1) * streamed.bit_units * UNIT
        answers = streamed.stream.transmit_pin is not None
        if answers and clock.us(Cycles(answered + byte)) > 1000 * AFTER_QUERY_MS:
            raise UndecidedPart(
                f"a byte that ends {AFTER_QUERY_MS} ms after a query may begin during the answer"
            )
        # A trim is executed within two slots; another command takes its time after the pause.
        if clock.us(Cycles(slots - BYTES * byte)) + written > 1000 * AFTER_TRIM_MS:
            raise UndecidedPart("a command may end while a trim is still being written to the EEPROM")

    def check_command_in_time(self, bound: Response, worst: int, interval: int, travel: int) -> None:
        """Check that a command is executed before the next one can end: then none is torn."""
        rounds = self.streamed.layout.rounds
        # The request that starts the execution comes up to a slot after the command. An interval that begins
        # at any phase contains one whole round less than it is long.
        window = (interval - rounds * ROUND) // ROUND - 1
        if window >= rounds:
            left = (window // rounds) * (bound.supply or 0)
        else:
            left = (response(self.listing, window, travel, interval).supply or 0) if window > 3 else 0
        if worst + (bound.execute or 0) > left:
            raise UndecidedPart("a command may end before the one before it is executed")

    def _data(self) -> list[str]:
        """Check what the words do with every byte."""
        lemmas = self.lemmas
        context = lemmas.context()
        lemmas.dispatch()
        lemmas.rise()
        lemmas.receive()
        accesses = MainAccesses(
            start=lemmas.start(), idle=lemmas.idle(), execute=lemmas.execute(), prepare=lemmas.prepare()
        )
        check_sharing(lemmas.names, accesses, context)
        check_stack(lemmas.names)
        return [
            f"every byte and every variable's value: {lemmas.runs} symbolic runs, "
            f"{lemmas.solver.questions} questions to the solver"
        ]

    def edges(self) -> list[str]:
        """Check the cycle of every edge, and that every bit is sampled within its time."""
        found = guarantee(
            self.listing,
            self.streamed,
            tell=lambda task, count, of: self.tell(f"{task}: {count} of {of} cycles"),
        )
        self.check_samples(found.samples)
        return [
            f"every edge is exact: a pulse begins in cycle {found.rise} of its round; interrupts "
            f"begin in {found.states} states",
            f"samples of the line are at most {found.samples.start_gap} cycles apart before a start bit, "
            f"{found.samples.bit_gap} within a byte",
        ]

    def check_samples(self, samples: SampleTimes) -> None:
        """Check that every bit is sampled while it lasts, for every sender."""
        streamed = self.streamed
        bit = streamed.plan.schedule.clock.cycles_per_second / Fraction(streamed.stream.baud)
        for k in range(BITS):
            latest = samples.latest(k, streamed.first_units, streamed.bit_units)
            earliest = samples.earliest(k, streamed.first_units, streamed.bit_units)
            # A slow sender's bits begin late, a fast sender's end early: a sample has to be within both.
            begins, ends = k * bit / (1 - BAUD_ERROR), (k + 1) * bit / (1 + BAUD_ERROR)
            if earliest < begins or latest > ends:
                raise UndecidedPart(
                    f"bit {k} of a byte is sampled {earliest} to {latest} cycles after its beginning; "
                    f"it lasts from {float(begins):.1f} to {float(ends):.1f}"
                )
