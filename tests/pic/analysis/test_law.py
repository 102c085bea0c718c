"""The law: whatever a random program does on the simulator under random inputs, the analysis allows."""

import random
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from servogen.pic.analysis.demand import Graph, SplitPlan
from servogen.pic.analysis.facts import Facts, Status
from servogen.pic.analysis.paths import PathExplorer
from servogen.pic.analysis.times import ProgramTimes
from servogen.programs import compile_program
from servogen.simulator import Machine, Observation, SimulatorOptions
from servogen.simulator.machine import Packed
from servogen.units import Clock
from tests.campaigns import sampled
from tests.pic.analysis.containment import compared
from tests.pic.analysis.programs import CLOCK, assembled, random_player, random_program

CYCLES = 12_000


class Noise:
    """Levels of RB0 to RB7 that change at random cycles."""

    def __init__(self, seed: int) -> None:
        rng = random.Random(seed)
        cycles = sorted(rng.sample(range(CYCLES), 300))
        self._rows = np.array(
            [cycle << 8 | rng.randrange(5, 13) << 2 | rng.randrange(2) for cycle in cycles], dtype=np.int64
        )

    def changes(self, clock: Clock):  # type: ignore[no-untyped-def]
        yield CYCLES, self._rows


@cache
def observed(seed: int) -> tuple[Facts, Machine, Packed]:
    """Return the answers about a random program, the chip after a run, and its (cycle, address) rows."""
    made = assembled(random_program(seed))
    machine = Machine(made.image, CLOCK, SimulatorOptions(start_seed=seed), stimulus=Noise(seed))
    rows = np.concatenate(
        [rows for _, rows in machine.observe(CYCLES, Observation(trace=np.zeros((4096, 4), dtype=np.int64)))]
    )
    return Facts(made.image, made.listing, CLOCK), machine, rows


def spans(rows: Packed, start: int, end: int) -> list[int]:
    """Return the cycles from each execution of `start` to the next one of `end`."""
    found, since = [], []
    for cycle, address in rows[:, :2].tolist():
        if address == end:
            found += [cycle - each for each in since]
            since = []
        if address == start:
            since.append(cycle)
    return found


@pytest.mark.parametrize("seed", sampled(range(10), 3))
def test_no_run_leaves_the_paths_on_which_indices_are_kept_apart(seed: int) -> None:
    _, _, rows = observed(seed)
    words = assembled(random_program(seed)).image.program
    first = PathExplorer(words)
    first.explore()
    graph = Graph(first.words, first.visits)
    paths = PathExplorer(words, SplitPlan.of(graph, graph.indices(), pins=True)).explore()
    assert set(rows[:, 1].tolist()) <= paths.executed


@pytest.mark.parametrize("seed", sampled(range(30), 10))
def test_no_run_exceeds_what_the_analysis_allows(seed: int) -> None:
    facts, machine, rows = observed(seed)
    state = machine.state()
    levels = dict(facts.stack().numbers)["levels"]
    assert levels is not None
    assert state.deepest_stack <= levels
    assert set(rows[:, 1].tolist()) <= facts.paths.executed
    allowed = {place for _, place in facts.paths.unwritten_reads}
    assert set(state.read_unwritten) <= allowed
    answer = facts.time("start", "done", interrupts=True)
    measured = spans(rows, facts.mark("start")[0], facts.mark("done")[0])
    numbers = dict(answer.numbers)
    if answer.status is Status.HOLDS and measured:
        assert numbers["minimum_cycles"] is not None
        assert numbers["maximum_cycles"] is not None
        assert numbers["minimum_cycles"] <= min(measured)
        assert max(measured) <= numbers["maximum_cycles"]


@pytest.mark.parametrize(
    "last",
    [
        " movlw 10\n movwf 0x20\n decfsz 0x20, f\n goto $-1\n",
        " movlw 10\n movwf 0x20\n decf 0x20, f\n btfss STATUS, 2\n goto $-2\n",
        " movlw 10\n addlw 0xFF\n btfss STATUS, 2\n goto $-2\n",
        " call short\n",
        " call within\n",
    ],
)
def test_behind_its_last_word_a_program_goes_on_at_its_first(last: str) -> None:
    """DS35007 section 2.1: the 1024 words repeat. A loop or a call ends there, with the mark inside a
    called function or after it.
    """
    words = last.count("\n")
    text = (
        f" goto $+1\n nop\n goto on\nshort\n nop\n return\nwithin\n nop\n{{0}}\n return\n"
        f"on\n nop\n{{1}}\n nop\n goto start\n org {0x400 - words - 1}\nstart\n nop\n{last}"
    ).format(*(("done\n nop", "") if "within" in last else ("", "done\n nop")))
    made = assembled(text)
    found = Facts(made.image, made.listing, CLOCK)
    machine = Machine(made.image, CLOCK, SimulatorOptions())
    rows = np.concatenate(
        [rows for _, rows in machine.observe(500, Observation(trace=np.zeros((512, 4), dtype=np.int64)))]
    )
    (measured,) = {*spans(rows, found.mark("start")[0], found.mark("done")[0])}
    answer = found.time("start", "done", interrupts=True)
    assert answer.status is Status.HOLDS, answer.text
    assert dict(answer.numbers) == {"minimum_cycles": measured, "maximum_cycles": measured}


@pytest.mark.campaign
def test_the_programs_of_the_law_reach_its_bounds() -> None:
    """A law of loose bounds proves little: some run must reach each of them exactly."""
    stack = least = most = unwritten = decided = 0
    for seed in range(60):
        facts, machine, rows = observed(seed)
        levels = dict(facts.stack().numbers)["levels"]
        stack += machine.state().deepest_stack == levels
        allowed = {place for _, place in facts.paths.unwritten_reads if place >= 0x0C}
        unwritten += bool(allowed) and set(machine.state().read_unwritten) == allowed
        timing = ProgramTimes(assembled(random_program(seed)).image.program, facts.paths)
        start, done = facts.mark("start"), facts.mark("done")
        span = timing.between(start, done, interrupts=False)
        measured = spans(rows, start[0], done[0])
        if span.maximum is not None and measured:
            decided += 1
            least += min(measured) == span.minimum
            most += max(measured) >= span.maximum
    assert decided > 30
    assert min(stack, least, most, unwritten) > 10, (stack, least, most, unwritten)


@pytest.mark.campaign
@pytest.mark.parametrize(("seed", "decided"), [(0, True), (1, False)])
def test_every_state_of_a_player_s_run_is_one_that_the_analysis_allows(seed: int, decided: bool) -> None:
    """The script of the second leads beyond its table."""
    run = compared(random_player(seed), seed, 250)
    assert run.outside == []
    assert run.compared > 200
    assert (run.decided, run.refined) == (decided, True)


PERIODIC = """
        goto    main
        org     4
        movwf   0x40
        swapf   STATUS, w
        movwf   0x41
        {test}
        movlw   {added}
        addwf   TMR0, f
        {work}
        bcf     INTCON, T0IF
back    swapf   0x41, w
        movwf   STATUS
        swapf   0x40, f
        swapf   0x40, w
        retfie
main    bsf     STATUS, RP0
        movlw   {option}
        movwf   OPTION_REG
        bcf     STATUS, RP0
        movlw   77
        movwf   TMR0
        movlw   0xA0
        movwf   INTCON
start   movlw   {turns}
        movwf   0x20
        decfsz  0x20, f
        goto    $-1
done    nop
        goto    start
"""
IF_SET, IF_CLEAR = "btfss INTCON, T0IF\n goto back", "btfsc INTCON, T0IF\n goto $+2\n goto back"


def periodic(**options: object) -> str:
    return PERIODIC.format(**{"test": IF_SET, "work": "nop", "option": 0x88, "turns": 20} | options)


@pytest.mark.parametrize("added", sampled([9, 156, 180]))
@pytest.mark.parametrize(("option", "turns"), [(0x88, 3), (0x88, 40), (0x88, 255), (0x80, 120)])
@pytest.mark.parametrize("test", [IF_SET, IF_CLEAR])
def test_an_interrupt_that_asks_for_its_flag_and_adds_to_tmr0_is_bounded(
    added: int, option: int, turns: int, test: str
) -> None:
    """An overflow comes every 256 - n counts on average; the bound is above what runs take, but not far."""
    made = assembled(periodic(added=added, option=option, turns=turns, test=test))
    found = Facts(made.image, made.listing, CLOCK)
    answer = found.time("start", "done", interrupts=True)
    assert answer.status is Status.HOLDS, answer.text
    most = dict(answer.numbers)["maximum_cycles"]
    measured = []
    for seed in (1, 2):
        machine = Machine(made.image, CLOCK, SimulatorOptions(start_seed=seed, tmr0_phase=seed))
        trace = Observation(trace=np.zeros((1 << 15, 4), dtype=np.int64))
        rows = np.concatenate([rows for _, rows in machine.observe(25_000, trace)])
        measured += spans(rows, found.mark("start")[0], found.mark("done")[0])
    assert most is not None and max(measured) <= most
    prescale = 1 if option == 0x88 else 2
    one, period = 32, (256 - added) * prescale
    late = (most + 3 * added * prescale) // period - max(measured) // period
    assert most <= max(measured) + one * (2 + late)


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"test": IF_SET.replace("T0IF", "INTF")}, "may return without clearing T0IF"),
        ({"test": IF_SET.replace("btfss", "btfsc")}, "may return without clearing T0IF"),
        ({"test": IF_CLEAR.replace("btfsc", "btfss")}, "may return without clearing T0IF"),
        ({"work": "addwf TMR0, f"}, "may add 256 to TMR0"),
        ({"work": "movwf TMR0"}, "adds to TMR0, and also writes it"),
        ({"work": "movf 0x30, w\n addwf TMR0, f"}, "what the program writes to TMR0 is not known"),
        ({"work": "btfsc PORTB, 0\n goto $-2"}, "may add to TMR0 more than once"),
        ({"turns": "20\nnop\n movlw 3\n addwf TMR0, f"}, "adds to TMR0 outside its interrupt"),
        ({"added": 250}, "leaves no time"),
        ({"work": "here goto here"}, "the interrupt: loop at"),
    ],
)
def test_what_keeps_an_interrupt_that_adds_to_tmr0_from_a_bound(changes: dict[str, str], why: str) -> None:
    made = assembled(periodic(**{"added": 156} | changes))
    answer = Facts(made.image, made.listing, CLOCK).time("start", "done", interrupts=True)
    assert answer.status is not Status.HOLDS
    assert why in answer.text


def test_the_handler_of_the_docs_is_bounded(tmp_path: Path) -> None:
    """`if (T0IF) { TMR0 += n; T0IF = 0; ... }`: two interrupts may come, and the answer is the page's."""
    docs = Path(__file__).parents[3] / "docs"
    page = (docs / "testing-firmware.md").read_text()
    text = next(each for each in page.split("```") if "// interrupt.c:" in each)
    file = tmp_path / "interrupt.c"
    file.write_text(text.removeprefix("c\n"))
    program = compile_program(file)
    answer = Facts(program.image, program.listing, CLOCK).time("main", "interrupt.c:21", interrupts=True)
    assert answer.status is Status.HOLDS, answer.text
    assert f"prints `{answer.text}`" in (docs / "program-facts.md").read_text()
