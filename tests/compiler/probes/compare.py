"""Programs of probes on both sides: what this compiler makes of them, and what the judges say."""

from __future__ import annotations

import traceback
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from servogen.compiler import Options, Source, compile_sources
from servogen.compiler.diagnostics import Reporter
from servogen.compiler.frontend.preprocessor import preprocess
from servogen.errors import InputError
from servogen.pic.device import RAM_FIRST
from servogen.simulator import Machine
from tests.compiler.probes.declarators import functions, shapes, variables
from tests.compiler.probes.formats import formats
from tests.compiler.probes.initialisers import objects
from tests.compiler.probes.judges import Bytes, bytes_of, normal, tokens_of
from tests.compiler.probes.literals import characters, integers, strings
from tests.compiler.probes.macros import Text, written
from tests.compiler.probes.probe import SHOWN, Dice, Program
from tests.compiler.random.compare import CLOCK, MACHINE, MAX_CYCLES, stores
from tests.compiler.random.target_c import CHECK, DONE, FINISHED

LEVELS = ("none", "speed", "none", "size")
TOGETHER = 6
"""Programs that are compiled as one."""


@dataclass(frozen=True)
class Outcome:
    """`kind`: "same", "wrong", "refused" (with the `code` of the error), "crash", or "not judged"."""

    seed: int
    kind: str
    text: str
    code: str = ""
    message: str = ""

    @property
    def bad(self) -> bool:
        return self.kind in ("wrong", "crash")


def is_text(seed: int) -> bool:
    return seed % 4 == 3


def program(seed: int) -> Program:
    """The program of a seed. 64 in a row are of one dialect and level, to be compiled together."""
    dice = Dice(seed)
    dialect, level = ("xc8", "sdcc")[seed // 64 % 2], LEVELS[seed // 128 % 4]
    if seed % 4 == 2:
        return Program(seed, dialect, level, [formats(dice)])
    kind = dice.randrange(6)
    if kind < 3:
        probe = (integers, characters, strings)[kind](dice)
    else:
        probe = objects(dice) if kind == 3 else dice.choice([variables, functions, shapes])(dice, dialect)
    return Program(seed, dialect, level, [probe])


def text(seed: int) -> Text:
    return written(Dice(seed))


def compare(seeds: Sequence[int]) -> list[Outcome]:
    """The outcome of each seed; each judge is asked once for all."""
    texts = {seed: text(seed) for seed in seeds if is_text(seed)}
    programs = [program(seed) for seed in seeds if not is_text(seed)]
    tokens, values = tokens_of(texts), bytes_of(programs)
    found = [tokens_compared(seed, each, tokens.get(seed)) for seed, each in texts.items()]
    for alike in _alike(programs):
        found += _together(alike, [values.get(each.seed) for each in alike])
    return sorted(found, key=lambda outcome: outcome.seed)


def _alike(programs: Sequence[Program]) -> Iterator[list[Program]]:
    """Yield groups of programs of one dialect and level, those with formats apart."""
    rows: dict[tuple[str, str, bool], list[Program]] = {}
    for each in programs:
        row = rows.setdefault((each.dialect, each.level, "format" in each.kinds), [])
        row.append(each)
        if len(row) == TOGETHER:
            yield row.copy()
            row.clear()
    yield from filter(None, rows.values())


def _together(programs: Sequence[Program], expected: Sequence[Bytes | None]) -> list[Outcome]:
    """The outcomes of programs that are compiled as one; where that is not right, of each alone."""
    first = programs[0]
    probes = [probe for program in programs for probe in program.probes]
    if None not in expected and len(programs) > 1:
        whole = Program(first.seed, first.dialect, first.level, probes)
        if values_compared(whole, sum(expected, ())).kind == "same":  # type: ignore[arg-type]
            return [Outcome(each.seed, "same", "") for each in programs]
    return [values_compared(*row) for row in zip(programs, expected, strict=True)]


def _refused(seed: int, source: str, error: InputError) -> Outcome:
    first = next(each for each in error.diagnostics if each.severity == "error")
    return Outcome(seed, "refused", source, first.code, first.message)


def tokens_compared(seed: int, given: Text, expected: list[str] | None) -> Outcome:
    """The outcome of a text, given the judge's tokens."""
    source = "\n".join([*given.lines, *(f"// {name}\n{inside}" for name, inside in given.files.items())])
    if expected is None:
        return Outcome(seed, "not judged", source)
    reporter = Reporter()
    try:
        made = preprocess(
            "\n".join(given.lines) + "\n",
            "main.c",
            defines={},
            headers={},
            reporter=reporter,
            blocks=[],
            resolver=lambda name, _: (name, given.files[name]) if name in given.files else None,
        )
        reporter.stop_on_error()
    except InputError as error:
        return _refused(seed, source, error)
    except Exception:
        return Outcome(seed, "crash", source, message=traceback.format_exc(limit=-2))
    got = normal(" ".join(token.text for token in made.tokens))
    if got == expected:
        return Outcome(seed, "same", source)
    return Outcome(seed, "wrong", source, message=f"gcc  {' '.join(expected)}\nchip {' '.join(got)}")


def values_compared(given: Program, expected: Bytes | None) -> Outcome:
    """The outcome of a program, given the judge's bytes; a difference is told by its expression."""
    source = given.chip()
    if expected is None:
        return Outcome(given.seed, "not judged", source)
    options = Options(dialect=given.dialect, clock_hz=CLOCK.hz, optimise=given.level)
    try:
        image = compile_sources([Source(source, "main.c")], options).image
    except InputError as error:
        return _refused(given.seed, source, error)
    except Exception:
        return Outcome(given.seed, "crash", source, message=traceback.format_exc(limit=-2))
    machine = Machine(image, CLOCK, MACHINE)
    for cycles in (20_000, 500_000, MAX_CYCLES):
        machine.run(cycles)
        state = machine.state()
        if state.ram[DONE - RAM_FIRST] == FINISHED:
            break
    at = CHECK - RAM_FIRST
    total = mix = 0
    for byte in expected:
        total = total + byte & 0xFF
        mix = mix + total & 0xFF
    if state.ram[DONE - RAM_FIRST] == FINISHED and tuple(state.ram[at : at + 3]) == (
        total,
        mix,
        len(expected) & 0xFF,
    ):
        return Outcome(given.seed, "same", source)
    shown = stores(image, {SHOWN}, int(machine.cycles))[1::2]
    return Outcome(given.seed, "wrong", source, message=_differences(given, expected, shown))


def _differences(given: Program, expected: Bytes, shown: tuple[int, ...]) -> str:
    values = [f"{probe.kind}: {value}" for probe in given.probes for value in probe.values]
    rows = [
        f"{value}: right {right}, chip {chip}"
        for value, right, chip in zip(values, expected, shown, strict=False)
        if right != chip
    ]
    return "\n".join(rows or [f"{len(expected)} bytes expected, {len(shown)} output"])
