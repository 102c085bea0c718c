"""What can be said of any program by itself: `Answer`s to questions, each with what it holds for.

In: an image, a listing where there is one, and a clock. Out: answers: the claim holds for everything that is
quantified over, or something was found, or it is not decided and why.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING

from servogen.errors import InputError, did_you_mean
from servogen.inputs import count_in
from servogen.pic.analysis.paths import Paths, PinWrite, explore, pin_text, place_text
from servogen.pic.analysis.times import CycleSpan, ProgramTimes
from servogen.pic.device import CONFIG_WATCHDOG_ON, PROGRAM_WORDS, STACK_LEVELS, WATCHDOG_US, masks
from servogen.pic.image import Image
from servogen.pic.isa import decode
from servogen.pic.listing import Listing
from servogen.units import Clock, counted

if TYPE_CHECKING:
    from servogen.answers import FindingAnswer

(PSA,) = masks("PSA")
EVERYTHING = (
    "every content of RAM and registers at power-up, every level of every input in every cycle, every moment "
    "of every enabled interrupt, and resets in any cycle"
)
"""The quantifiers of every answer."""


class Status(StrEnum):
    """How a question was answered."""

    HOLDS = "holds"
    FOUND = "found"
    NOT_DECIDED = "not decided"


@dataclass(frozen=True, slots=True)
class Finding:
    """A statement about one word of the program."""

    address: int
    source: str | None
    """File and line, if the program has a listing."""
    text: str

    def __str__(self) -> str:
        place = f"0x{self.address:03X}" if self.source is None else f"0x{self.address:03X} ({self.source})"
        return f"{place}: {self.text}"

    def to_json(self) -> FindingAnswer:
        return {"address": self.address, "source": self.source, "text": self.text}


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to one question."""

    question: str
    status: Status
    text: str
    over: str = EVERYTHING
    """The cases for which the answer holds."""
    findings: tuple[Finding, ...] = ()
    numbers: tuple[tuple[str, int | None], ...] = ()

    def to_json(self) -> dict[str, object]:
        return {
            "question": self.question,
            "status": str(self.status),
            "text": self.text,
            "over": self.over,
            "findings": [finding.to_json() for finding in self.findings],
            **dict(self.numbers),
        }


class Facts:
    """The answers about one program."""

    def __init__(
        self,
        image: Image,
        listing: Listing | None,
        clock: Clock,
        tell: Callable[[str], None] = lambda text: None,
    ) -> None:
        """Follow every path of a program; `tell` is given the progress."""
        self._image = image
        self._listing = listing
        self._clock = clock
        self.paths: Paths = explore(image.program, tell)

    @cached_property
    def _timing(self) -> ProgramTimes:
        return ProgramTimes(self._image.program, self.paths)

    @cached_property
    def _sources(self) -> dict[int, str]:
        rows = self._listing.rows if self._listing else ()
        return {row.address: f"{row.file}:{row.line}" for row in rows if row.line is not None}

    @cached_property
    def _names(self) -> dict[int, str]:
        variables = self._listing.variables if self._listing else ()
        return {
            address + offset: name if size == 1 else f"{name}[{offset}]"
            for address, name, size in variables
            for offset in range(size)
        }

    def _finding(self, address: int, text: str) -> Finding:
        return Finding(address, self._sources.get(address), text)

    # answers

    def answers(self) -> tuple[Answer, ...]:
        """Return the answers to all questions that need no marks."""
        return (
            self.followed(),
            self.stack(),
            self.unwritten_reads(),
            self.outputs(),
            self.unreachable(),
            self.watchdog(),
        )

    def followed(self) -> Answer:
        """Return whether every path could be followed: the other answers rely on it."""
        paths = self.paths
        gaps = [
            self._finding(address, f"{why}: paths were not followed beyond it")
            for address, why in paths.lost.items()
        ]
        gaps += [
            self._finding(
                address, f"a jump into the table 0x{first:03X} to 0x{last:03X}: assumed to stay in it"
            )
            for address, (first, last) in paths.tables.items()
        ]
        beyond = [
            self._finding(address, f"the index leads beyond the table of RETLWs after it, to 0x{target:03X}")
            for address, target in sorted(paths.beyond.items())
        ]
        gaps += [
            self._finding(address, "the pointer is unknown: assumed to address a byte of RAM")
            for address in sorted(paths.pointers)
        ]
        gaps += [
            self._finding(address, "no data sheet defines this word") for address in sorted(paths.undefined)
        ]
        question = "every path is followed"
        if beyond:
            text = f"{counted(len(beyond), 'computed jump')} may go beyond the table"
            return Answer(question, Status.FOUND, text, findings=(*beyond, *gaps))
        if not gaps:
            return Answer(question, Status.HOLDS, f"{len(paths.executed)} words on paths from reset")
        text = "the other answers hold if what is stated here is true"
        return Answer(question, Status.NOT_DECIDED, text, findings=tuple(gaps))

    @property
    def _lost(self) -> bool:
        return bool(self.paths.lost)

    def _decided(self, findings: Collection[Finding]) -> Status:
        if findings:
            return Status.FOUND
        return Status.NOT_DECIDED if self._lost else Status.HOLDS

    def stack(self) -> Answer:
        """Return the maximum depth of the stack, interrupts included."""
        paths = self.paths
        question = f"the stack never holds more than {STACK_LEVELS} return addresses"
        depth = max(paths.depth, paths.levels_when_interrupted)
        findings = [
            self._finding(address, "a call pushes a ninth return address; the calls before it are at "
                          + ", ".join(f"0x{(back - 1) % PROGRAM_WORDS:03X}" for back in stack if back >= 0))
            for address, stack in sorted(paths.overflows.items())
        ]  # fmt: skip
        findings += [
            self._finding(address, "a return finds the stack empty") for address in sorted(paths.underflows)
        ]
        findings += [
            self._finding(
                address, "interrupts are enabled inside the interrupt: they may nest without a bound"
            )
            for address in sorted(paths.nested_interrupts)[:1]
        ]
        numbers: tuple[tuple[str, int | None], ...]
        if findings:
            numbers = (("levels", None),)
            return Answer(question, Status.FOUND, "it may", findings=tuple(findings), numbers=numbers)
        numbers = (("levels", depth),)
        text = f"at most {depth} of {STACK_LEVELS} levels"
        if paths.levels_when_interrupted:
            text += (
                f": {paths.depth_when_interrupted} when an interrupt comes, "
                f"{max(1, paths.depth_of_interrupt)} by the interrupt"
            )
        if depth > STACK_LEVELS:
            return Answer(question, Status.FOUND, text, numbers=numbers)
        return Answer(question, self._decided(()), text, numbers=numbers)

    def unwritten_reads(self) -> Answer:
        """Return the reads of bytes that were not written on some path from reset."""
        reads = sorted(self.paths.unwritten_reads)
        findings = [
            self._finding(
                address, f"reads {place_text(place, self._names)}, not written on every path from reset"
            )
            for address, place in reads
        ]
        findings += [
            self._finding(address, f"makes {pins} outputs before their latches are written")
            for address, pins in _pins_by_address(self.paths.driven_unwritten)
        ]
        text = (
            f"{counted(len(findings), 'instruction')} may use values that were never written"
            if findings
            else "whatever is read was written before: RAM, W, FSR, C, DC, Z, TMR0 and the port latches"
        )
        return Answer(
            "nothing is read that was never written", self._decided(findings), text, findings=tuple(findings)
        )

    def outputs(self) -> Answer:
        """Return the writes to pins that are inputs, or never become outputs."""
        paths = self.paths
        question = "only outputs are written"
        certain = [pin for pin in paths.input_writes if pin.certain]
        certain += [pin for pin in paths.early_writes if pin.certain and pin.pin not in paths.outputs]
        never = [pin for pin in certain if pin.pin not in paths.outputs]
        findings = [
            self._finding(address, f"writes {pins}, never an output")
            for address, pins in _pins_by_address(never)
        ]
        sometimes = [pin for pin in certain if pin.pin in paths.outputs]
        findings += [
            self._finding(address, f"writes {pins}, which may be an input then")
            for address, pins in _pins_by_address(sometimes)
        ]
        if findings:
            text = f"pins that are inputs are written by {counted(len(findings), 'instruction')}"
            return Answer(question, Status.FOUND, text, findings=tuple(findings))
        uncertain = [pin for pin in paths.input_writes if not pin.certain]
        possible = [
            self._finding(address, f"may write {pins}, which may be inputs then")
            for address, pins in _pins_by_address(uncertain)
        ]
        if possible:
            text = "the values that are written are not known well enough"
            return Answer(question, Status.NOT_DECIDED, text, findings=tuple(possible))
        outputs = ", ".join(pin_text(pin) for pin in sorted(paths.outputs)) or "none"
        text = f"outputs: {outputs}; no other pin is set to 1, or changed by itself"
        return Answer(question, self._decided(()), text)

    def unreachable(self) -> Answer:
        """Return the programmed words that no path executes."""
        words = sorted(set(self._image.program) - self.paths.executed)
        ranges = list(_ranges(words))
        findings = tuple(
            self._finding(
                first,
                f"{last - first + 1} words to 0x{last:03X} are never executed"
                if first < last
                else "is never executed",
            )
            for first, last in ranges
        )
        text = f"{len(words)} of {len(self._image.program)} words are never executed" if words else (
            f"all {len(self._image.program)} words are on a path"
        )  # fmt: skip
        numbers = (("unreachable_words", len(words)),)
        status = Status.NOT_DECIDED if self._lost and words else Status.FOUND if words else Status.HOLDS
        return Answer("every word can be reached", status, text, findings=findings, numbers=numbers)

    def watchdog(self) -> Answer:
        """Return whether the watchdog is cleared in time on every path, interrupts included."""
        question = "the watchdog never times out"
        config = self._image.config
        if config is not None and not config & CONFIG_WATCHDOG_ON:
            return Answer(question, Status.HOLDS, "the configuration word leaves it off", "every path")
        feeds = sorted(
            address for address in self.paths.executed if _clears_watchdog(self._image.program.get(address))
        )
        limit_us = WATCHDOG_US[0] * min(
            1 << (option & 7) if option & PSA else 1 for option in self.paths.options
        )
        span = self._timing.without_ends((0, *feeds), feeds, interrupts=True)
        over = f"{EVERYTHING}; chips whose watchdog takes at least {WATCHDOG_US[0] // 1000} ms"
        if config is None:
            over += "; the file has no configuration word: the watchdog is assumed to be on"
        conditional = self._conditional()
        if span.maximum is None:
            reasons = ", ".join((*span.reasons, *conditional))
            findings = tuple(
                self._finding(address, "the time from here is not bounded") for address in span.addresses[:4]
            )
            return Answer(
                question=question,
                status=Status.NOT_DECIDED,
                text=reasons,
                over=over,
                findings=findings,
                numbers=(("cycles", None),),
            )
        micros = self._clock.us(span.maximum)
        text = (
            f"at most {span.maximum} cycles ({float(micros) / 1000:g} ms at {self._clock.hz} Hz) between two "
            f"clearings; the shortest period is {limit_us / 1000:g} ms"
        )
        status = Status.HOLDS if micros < limit_us else Status.FOUND
        if conditional and status is Status.HOLDS:
            status, text = Status.NOT_DECIDED, f"{text}; {', '.join(conditional)}"
        return Answer(question, status, text, over, numbers=(("cycles", span.maximum),))

    def _conditional(self) -> list[str]:
        conditions = [
            f"paths beyond 0x{address:03X} were not followed" for address in sorted(self.paths.lost)
        ]
        if self.paths.not_restored:
            conditions.append("the interrupt does not restore every register that it changes")
        return conditions

    def time(self, start: str, end: str, *, interrupts: bool) -> Answer:
        """Return the best and the worst time between two marks. Raises InputError for an unknown mark."""
        starts, ends = self.mark(start), self.mark(end)
        reached = [address for address in starts if address in self.paths.executed]
        question = f"the time from {start} to {end}"
        conditional = self._conditional()
        if not reached:
            status = Status.NOT_DECIDED if self._lost else Status.HOLDS
            return Answer(question, status, f"{start} is never reached")
        span = self._timing.between(reached, ends, interrupts=interrupts)
        counted = "interrupts included" if interrupts else "without the time of interrupts"
        over = f"every path from {start} to the first {end} after it, {counted}; {EVERYTHING}"
        numbers = (("minimum_cycles", span.minimum), ("maximum_cycles", span.maximum))
        if span.maximum is None or span.minimum is None:
            text = ", ".join((*span.reasons, *conditional))
            if span.minimum is not None:
                text = f"at least {span.minimum} cycles; no upper bound: {text}"
            return Answer(question, Status.NOT_DECIDED, text, over, numbers=numbers)
        text = f"{span.minimum} to {span.maximum} cycles"
        if conditional:
            return Answer(
                question, Status.NOT_DECIDED, f"{text}, if {', '.join(conditional)}", over, numbers=numbers
            )
        return Answer(question, Status.HOLDS, text, over, numbers=numbers)

    # marks

    def mark(self, text: str) -> list[int]:
        """Return the addresses of a mark: an address (0x12A), a label, a function, or a line (12 or
        main.c:12). Raises InputError.
        """
        if text.lower().startswith("0x"):
            return [_address(text)]
        listing = self._listing
        if listing is None:
            raise InputError(
                "unknown-name",
                f"'{text}' is not an address such as 0x12A",
                hint="labels and lines need C or assembly source",
            )
        labels = {address for name, address in listing.labels if name == text}
        labels |= {function.start for function in listing.functions if function.name == text}
        if labels:
            return sorted(labels)
        file, _, digits = text.rpartition(":")
        number = count_in(digits)
        if number is not None:
            lines = self._line_starts(file, number)
            if lines:
                return lines
            raise InputError("unknown-name", f"line {text} has no words")
        names = [name for name, _ in listing.labels] + [function.name for function in listing.functions]
        hint = did_you_mean(text, names)
        raise InputError("unknown-name", f"'{text}' is not a label, a line or an address", hint=hint)

    def _line_starts(self, file: str, number: int) -> list[int]:
        """Return where the words of a source line begin; a loop's line may have several beginnings."""
        assert self._listing is not None
        starts: list[int] = []
        last: int | None = None
        for row in self._listing.rows:
            if row.line == number and row.file is not None and (not file or row.file.endswith(file)):
                if last != row.address - 1:
                    starts.append(row.address)
                last = row.address
        return starts


def _address(text: str) -> int:
    try:
        address = int(text, 16)
    except ValueError:
        address = -1
    if not 0 <= address < PROGRAM_WORDS:
        raise InputError(
            "unknown-name", f"'{text}' is not an address from 0x000 to 0x{PROGRAM_WORDS - 1:03X}"
        )
    return address


def _pins_by_address(writes: Iterable[PinWrite]) -> list[tuple[int, str]]:
    """Return each address with the names of the pins that are written there."""
    by_address: dict[int, set[int]] = {}
    for write in writes:
        by_address.setdefault(write.address, set()).add(write.pin)
    return [(address, ", ".join(map(pin_text, sorted(pins)))) for address, pins in sorted(by_address.items())]


def _clears_watchdog(number: int | None) -> bool:
    """Return whether a word is CLRWDT or SLEEP: both set TO (DS35007 section 6.12)."""
    decoded = None if number is None else decode(number)
    return decoded is not None and "T" in decoded.instruction.flags


def _ranges(numbers: list[int]) -> Iterable[tuple[int, int]]:
    """Yield (first, last) of each run of consecutive numbers."""
    first = last = None
    for number in numbers:
        if last is not None and number == last + 1:
            last = number
            continue
        if first is not None and last is not None:
            yield first, last
        first = last = number
    if first is not None and last is not None:
        yield first, last


def decided_and_fine(answers: Iterable[Answer]) -> bool:
    """Return whether every answer is that the claim holds."""
    return all(answer.status is Status.HOLDS for answer in answers)


__all__ = ["Answer", "CycleSpan", "Facts", "Finding", "Status", "decided_and_fine"]
