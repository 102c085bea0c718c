"""A counterexample as options and stimuli that repeat it, the chips that are tried, a certificate's bytes."""

from __future__ import annotations

import hashlib
import itertools
import json
import lzma
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from servogen.edges import PINS, edge_chunk
from servogen.pic.image import Image
from servogen.prove import counterexample
from servogen.prove.certificate import (
    certificate,
    compact_column,
    heard_text,
    image_digest,
    is_settled,
    place_key,
    row_cells,
)
from servogen.prove.chip import BASE, FIELD, FIELDS, AssumedBits
from servogen.prove.counterexample import (
    Case,
    Counterexample,
    concrete,
    flag_changes,
    judge_run,
    levels_of,
    path_to,
    pin_changes,
    slow_oscillator,
)
from servogen.prove.explore import SearchFinding, why_undecided
from servogen.prove.forks import Choices
from servogen.prove.nodes import Decision, Node
from servogen.prove.prover import endless_wait, held_assumptions, trims_text
from servogen.prove.quantifiers import EVERYTHING, ChipTrial, Quantifiers, trials
from servogen.prove.specification import BEFORE, IN_FRAME, OVER, Specification, SpecState, Violation
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import (
    ButtonRule,
    Channel,
    CodeLine,
    CommandRule,
    DirectionButtons,
    DirectionRuns,
    Input,
    Pulse,
    Run,
    StepButton,
)
from servogen.simulator import SimulatorOptions, layout, parse_stimuli
from servogen.units import Clock, Cycles

CLOCK = Clock(4_000_000)
PULSES = (Pulse(Cycles(0), Cycles(1500)), None)
SCHEDULE = PulseSchedule(
    CLOCK,
    Cycles(20_000),
    (Channel("one", "RB0", "x"), Channel("two", "RB6", "x")),
    (),
    (Run(1, PULSES),),
)
RB0, RB1, RA4 = (PINS.index(pin) for pin in ("RB0", "RB1", "RA4"))
PLAIN = SimulatorOptions()


def example(**changes: Any) -> Counterexample:
    return replace(Counterexample("wrong", 7, PLAIN, ()), **changes)


# what repeats it


def test_a_plain_chip_needs_no_options() -> None:
    assert example().arguments() == [] and example().stimulus(SCHEDULE.clock) == ""


def test_every_option_that_is_another_one_is_printed() -> None:
    options = SimulatorOptions(
        device="PIC16F84A",
        watchdog_us=7000,
        eeprom_write_us=99,
        floating=1,
        start_seed=5,
        tmr0_phase=3,
        start=(("w", 12), ("0x0C", 255)),
        ra4_pull_up=True,
    )
    assert options.device != PLAIN.device
    assert example(options=options, clock_hz=3_600_000).arguments() == [
        "--device", "PIC16F84A", "--watchdog-us", "7000", "--eeprom-write-us", "99", "--floating", "1",
        "--start-seed", "5", "--tmr0-phase", "3", "--start", "w=12", "--start", "0x0C=255",
        "--clock-hz", "3600000", "--ra4-pull-up",
    ]  # fmt: skip


def test_the_stimulus_states_levels_and_a_reset_in_microseconds() -> None:
    found = example(levels=(("RA4", ((0, 1), (5, 0))), ("RB1", ((0, 0),))), reset=9)
    assert found.stimulus(SCHEDULE.clock) == (
        '[[level]]\npin = "RA4"\nat_us = [0, 5]\nlevel = [1, 0]\n\n'
        '[[level]]\npin = "RB1"\nat_us = [0]\nlevel = [0]\n\n'
        "[[reset]]\npressed_us = 9\nreleased_us = 10\n"
    )
    # At 20 MHz a cycle is 0.2 µs.
    fast = replace(SCHEDULE, clock=Clock(20_000_000))
    assert "at_us = [0, 0.2, 1]\n" in example(levels=(("RA4", ((0, 1), (1, 0), (5, 1))),)).stimulus(
        fast.clock
    )
    # The file is read as the cycles that it was written from.
    for schedule in (SCHEDULE, fast):
        changes = ((0, 1), (7, 0), (8, 1), (12345, 0))
        text = example(levels=(("RB1", changes),)).stimulus(schedule.clock)
        assert parse_stimuli(text, "x.toml", schedule.clock)


def test_levels_begin_with_the_first_one_that_is_read() -> None:
    samples = [(30, RA4, 0), (10, RA4, 1), (20, RA4, 1), (15, RB1, 0)]
    assert levels_of(samples, {}) == (("RA4", ((0, 1), (30, 0))), ("RB1", ((0, 0),)))
    # A pin that is held begins as it is held; pins come in their order.
    held = levels_of([(10, RB1, 1)], {RB1: 0, RA4: 1})
    assert held == (("RA4", ((0, 1),)), ("RB1", ((0, 0), (10, 1))))
    assert levels_of([], {}) == ()


# the way to a finding


def node(parent: int, cycles: int, *decisions: tuple[int, Choices]) -> Node:
    made = tuple(Decision(cycle, choices) for cycle, choices in decisions)
    return Node((), 0, SpecState(IN_FRAME, 0, 0), parent, cycles, made, ((), 0))


def finding(number: int, cycle: int, *decisions: tuple[int, Choices], silent: bool = False) -> SearchFinding:
    made = tuple(Decision(at, choices) for at, choices in decisions)
    return SearchFinding(number, made, cycle, "wrong", True, 0, silent=silent)


def pin(number: int, level: int) -> AssumedBits:
    return AssumedBits("PINS", 1 << number, level << number)


def test_the_choices_of_a_way_are_those_of_its_nodes_and_count_from_reset() -> None:
    nodes = [
        node(-1, 0),
        node(0, 100, (10, (pin(RA4, 1), AssumedBits("TMR0_PHASE", 0, 2)))),
        node(0, 999, (5, (pin(RB1, 1),))),  # on another way
        node(1, 50, (20, (pin(RA4, 0), AssumedBits("INTCON", 3, 1))), (30, (AssumedBits("W", 0x0F, 0x05),))),
    ]
    last = finding(
        3,
        7,
        (3, (AssumedBits("INTCON_LATE", 2, 2), AssumedBits("WATCHDOG", 0, 0))),
        (4, (AssumedBits("INTCON", 3, 0), pin(RB1, 0))),
    )
    path = path_to(nodes, last)
    assert path.samples == [(10, RA4, 1), (120, RA4, 0), (154, RB1, 0)]
    # A flag in the second cycle of an instruction comes a cycle later; without a flag nothing comes.
    assert path.requests == [(120, 1), (154, 2)]
    assert (path.waits, path.tmr0_phase, path.end, path.start) == (1, 2, 157, {"w": 5})


def test_the_first_choice_of_a_bit_is_its_value_at_power_up() -> None:
    nodes = [
        node(-1, 0),
        node(0, 9, (1, (AssumedBits("W", 0x0F, 0x05),)), (2, (AssumedBits("W", 0xF3, 0xA2),))),
    ]
    chosen = finding(1, 1, (0, (AssumedBits("0x0C", 0x80, 0x80), AssumedBits("0x0C", 0x81, 0x01))))
    # 5 in the lower half; of the second choice only the upper half is new.
    assert path_to(nodes, chosen).start == {"w": 0xA5, "0x0C": 0x81}
    assert path_to([node(-1, 0)], finding(0, 1, (0, (AssumedBits("TMR0", 255, 5),)))).start == {}
    assert path_to([node(-1, 0)], finding(0, 1, (0, (AssumedBits("EE_DONE", 0, 1),)))).start == {}


def case(**changes: Any) -> Case:
    plain = Case(Image({}), SCHEDULE, Specification(SCHEDULE, None), PLAIN, EVERYTHING, {})
    return replace(plain, **changes)


def test_flags_of_pins_are_pulses_on_rb0_and_changes_of_a_free_pin() -> None:
    RBIF, INTF = 1, 2
    # RB6 is a servo's, so RB7 is the first free pin.
    rb7, rb5 = PINS.index("RB7"), PINS.index("RB5")
    assert flag_changes(case(), [], False) == []
    assert flag_changes(case(), [(10, INTF), (20, INTF)], False) == [
        (0, RB0, 0), (10, RB0, 1), (11, RB0, 0), (20, RB0, 1), (21, RB0, 0)
    ]  # fmt: skip
    assert flag_changes(case(), [(10, INTF)], True) == [(0, RB0, 1), (10, RB0, 0), (11, RB0, 1)]
    assert flag_changes(case(), [(10, RBIF), (20, RBIF), (30, RBIF)], False) == [
        (0, rb7, 0), (10, rb7, 1), (20, rb7, 0), (30, rb7, 1)
    ]  # fmt: skip
    assert flag_changes(case(held={rb7: 1}), [(10, RBIF)], False) == [(0, rb5, 0), (10, rb5, 1)]
    both = flag_changes(case(), [(10, RBIF | INTF)], False)
    assert {pin for _, pin, _ in both} == {RB0, rb7}
    taken = dict.fromkeys(range(rb7 - 3, rb7 + 1), 1)
    assert flag_changes(case(held=taken), [(10, RBIF)], False) == []


def test_a_run_is_judged_with_its_samples_and_its_end() -> None:
    spec = Specification(SCHEDULE, ButtonRule(None, Input("RA4", 0), True, 3))
    right = [(100, RB0, 1), (1600, RB0, 0), (20_100, RB0, 1), (21_600, RB0, 0)]
    samples = [(15_000, RA4, 1), (35_000, RA4, 1)]
    judge_run(spec, right, samples, 40_000)
    with pytest.raises(Violation) as wrong:
        judge_run(spec, [*right[:3], (21_605, RB0, 0)], samples, 40_000)
    assert (wrong.value.cycle, wrong.value.message) == (21_600, "the fall of RB0 comes 5 cycles late")
    with pytest.raises(Violation) as wrong:
        judge_run(spec, right, samples[:1], 40_101)
    assert wrong.value.message == "RA4 is not read in a frame"
    assert wrong.value.cycle == 40_100, "the end of the second frame, since reset"
    # RA0 is pin 0.
    first = Specification(SCHEDULE, ButtonRule(None, Input("RA0", 0), True, 3))
    judge_run(first, right, [(15_000, 0, 1), (35_000, 0, 1)], 40_100)
    spec = Specification(SCHEDULE, None)
    judge_run(spec, [], [], 50 * 20_000 - 1)
    with pytest.raises(Violation) as wrong:
        judge_run(spec, [], [], 50 * 20_000)
    assert (wrong.value.message, wrong.value.cycle) == ("no pulse comes", 50 * 20_000)


class Machines:
    """Chips whose edges are given; what was asked of them."""

    def __init__(self, edges: list[tuple[int, int, int]], right: list[tuple[int, int, int]] | None = None):
        self.edges, self.right = edges, right
        self.asked: list[tuple[ChipTrial, Any, int, int]] = []

    def machine(self, case: Case, trial: ChipTrial, levels: Any) -> Any:
        self.trial, self.levels = trial, levels
        return self

    def changes(self, machine: Any, begun: int, end: int, _: int | None = None) -> list[tuple[int, int, int]]:
        self.asked.append((self.trial, self.levels, begun, end))
        return self.right if self.right is not None and self.trial.reset is None else self.edges

    def install(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(counterexample, "trial_machine", self.machine)
        monkeypatch.setattr(counterexample, "pin_changes", self.changes)


RIGHT = [(n * 20_000 + cycle, RB0, level) for n in range(3) for cycle, level in ((100, 1), (1600, 0))]
WRONG = [*RIGHT[:3], (21_610, RB0, 0)]


def test_the_first_wrong_chip_is_the_counterexample(monkeypatch: pytest.MonkeyPatch) -> None:
    machines = Machines(WRONG)
    machines.install(monkeypatch)
    nodes = [node(-1, 0), node(0, 3000, (50, (AssumedBits("TMR0_PHASE", 0, 3),)), (60, (pin(RB1, 1),)))]
    found = concrete(case(held={RA4: 1}), nodes, finding(1, 500))
    assert found is not None
    assert (found.message, found.cycle) == ("the fall of RB0 comes 10 cycles late", 21_600)
    assert found.options == replace(PLAIN, tmr0_phase=3) and found.reset is None
    assert found.levels == (("RA4", ((0, 1),)), ("RB1", ((0, 1),)))
    # The path and two frames.
    ((_, _, begun, end),) = machines.asked
    assert (begun, end) == (0, 3500 + 2 * 20_000)
    found = concrete(case(), nodes, finding(1, 500, silent=True))
    assert machines.asked[-1][3] == 3500 + 50 * 20_000, "a first pulse has fifty frames"


def test_a_fault_after_a_reset_counts_from_the_reset_on(monkeypatch: pytest.MonkeyPatch) -> None:
    right = [*RIGHT, *((60_000 + cycle, RB0, level) for cycle, level in ((100, 1),))]
    machines = Machines(WRONG, right)
    machines.install(monkeypatch)
    found = concrete(case(), [node(-1, 0)], finding(0, 500, (60, (pin(RB1, 1),))))
    assert found is not None and found.reset == 20_000 // 5 + 7
    # The reset takes a cycle, and the fetch of the first instruction another one.
    begun = machines.asked[-1][2]
    assert begun == found.reset + 2
    assert found.cycle == begun + 21_600 and machines.asked[-1][3] == begun + 500 + 2 * 20_000
    assert found.levels == (("RB1", ((0, 1),)),)


def test_the_changes_of_pins_count_from_a_cycle_on_and_an_input_is_low() -> None:
    """RA0 is high before cycle 10 already; RB0 is let go while it is high; RB1 stays low."""
    asked: list[int] = []
    rows = [
        (0, 0, 1), (2, RB1, 0), (3, RB1, 2), (5, RB0, 1), (9, RB0, 2), (10, RB0, 1), (12, RB0, 1),
        (15, 0, 0), (15, RB1, 1), (20, RB0, 2), (21, RB0, 0), (30, RB1, 0),
    ]  # fmt: skip

    def stream(end: int) -> Any:
        asked.append(end)
        return [edge_chunk(*zip(*rows[:5], strict=True)), edge_chunk(*zip(*rows[5:], strict=True))]

    machine: Any = SimpleNamespace(stream=stream)
    late = [(0, RB0, 1), (5, 0, 0), (5, RB1, 1), (10, RB0, 0), (20, RB1, 0)]
    assert pin_changes(machine, 10, 40) == late and asked == [40]
    assert pin_changes(machine, 0, 40) == [(0, 0, 1), (5, RB0, 1), (9, RB0, 0)] + [
        (cycle + 10, pin, level) for cycle, pin, level in late
    ]


def test_the_chip_of_a_trial_has_its_levels_and_its_reset(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []

    def machine(image: Image, clock: Clock, options: SimulatorOptions, stimuli: Any) -> Any:
        made.append((options, stimuli))
        return SimpleNamespace()

    monkeypatch.setattr(counterexample, "Machine", machine)
    monkeypatch.setattr(counterexample, "Stimuli", list)
    levels = (("RB1", ((0, 1), (5, 0))),)
    for trial, sources in (
        (ChipTrial(PLAIN), 1),
        (ChipTrial(PLAIN, 70), 2),
    ):
        counterexample.trial_machine(case(), trial, levels)
        options, stimuli = made[-1]
        assert options is PLAIN and len(stimuli) == sources
    reset = made[-1][1][1]
    assert (reset.pressed, reset.released) == (70, 71)
    counterexample.trial_machine(case(), ChipTrial(PLAIN), ())
    assert made[-1][1] is None


def test_a_chip_of_which_the_specification_says_nothing_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    Machines(RIGHT).install(monkeypatch)
    assert concrete(case(), [node(-1, 0)], finding(0, 500)) is None
    spec = Specification(SCHEDULE, ButtonRule(None, Input("RA4", 0), True, 3))
    assert concrete(case(spec=spec), [node(-1, 0)], finding(0, 500)) is None


def test_requests_are_tried_on_both_edges(monkeypatch: pytest.MonkeyPatch) -> None:
    machines = Machines(RIGHT)
    machines.install(monkeypatch)
    asked = finding(0, 500, (60, (AssumedBits("INTCON", 2, 2),)))
    assert concrete(case(quantifiers=Quantifiers(resets=False)), [node(-1, 0)], asked) is None
    first, second = (levels for _, levels, _, _ in machines.asked[:2])
    assert first == (("RB0", ((0, 0), (60, 1), (61, 0))),)
    assert second == (("RB0", ((0, 1), (60, 0), (61, 1))),)


def test_a_slow_oscillator_makes_the_first_pulse_longer(monkeypatch: pytest.MonkeyPatch) -> None:
    machines = Machines([(50, RB1, 0), (100, RB0, 1), (150, RB1, 0), (1600, RB0, 0)])
    machines.install(monkeypatch)
    found = slow_oscillator(case())
    assert found is not None
    assert (found.clock_hz, found.cycle, found.options) == (3_600_000, 1600, PLAIN)
    # 1500 µs at nine tenths of the frequency are 1666.7 µs.
    assert found.message == (
        "an RC oscillator differs from chip to chip; one of 3600000 Hz makes the first pulse of RB0 "
        "1666.7 us long instead of 1500.0"
    )
    assert machines.asked[-1][2:] == (0, 50 * 20_000)
    for edges in ([], [(100, RB0, 1)], [(100, RB0, 0)]):
        Machines(edges).install(monkeypatch)
        assert slow_oscillator(case()) is None


# the chips that are tried


def test_the_likeliest_chips_come_first_and_all_quantifiers_have_some() -> None:
    board = replace(PLAIN, ra4_pull_up=True)
    every = list(trials(board, EVERYTHING, {"w": 5}, 20_000))
    assert every[0] == ChipTrial(board)
    assert every[1] == ChipTrial(replace(board, start=(("w", 5),)))
    assert [trial.options.start for trial in every[2:5]] == [(("ram", byte),) for byte in (0xFF, 0x55, 0xAA)]
    assert every[5].options == replace(board, floating=1)
    # DS35007, parameter 31: 7 to 33 ms.
    assert [trial.options.watchdog_us for trial in every[6:8]] == [7000, 33_000]
    writes = [trial.options.eeprom_write_us for trial in every[8:25]]
    longest = writes[-1]
    assert writes == [max(1, longest * n // 16) for n in range(17)]
    resets = every[25:49]
    assert [trial.reset for trial in resets] == [4000 * n + 7 * n for n in range(1, 25)]
    assert {trial.options.start for trial in resets} == {(("w", 5),)}
    seeds = every[49:177]
    assert [(t.options.start_seed, t.options.floating) for t in seeds] == [
        (seed, level) for seed in range(64) for level in (0, 1)
    ]
    rest = [trial.options.start for trial in every[177:]]
    assert rest == [(("w", 5), (name, byte)) for name in ("ram", "tmr0", "w") for byte in range(256)]
    assert all(trial.reset is None for trial in (*every[:25], *every[49:]))
    assert all(trial.options.ra4_pull_up for trial in every)


def test_what_is_not_quantified_over_is_not_tried() -> None:
    start = (("w", 9),)
    some = Quantifiers(resets=False, watchdog=False, eeprom_write=False, start=start)
    every = list(trials(PLAIN, some, {}, 20_000))
    assert len(every) == 1 + 3 + 1 + 128 + 768
    assert all(trial.options.start[-1:] == start and trial.reset is None for trial in every)
    assert {trial.options.watchdog_us for trial in every} == {PLAIN.watchdog_us}
    assert {trial.options.eeprom_write_us for trial in every} == {PLAIN.eeprom_write_us}


def test_a_certificate_is_about_every_start_reset_and_chip() -> None:
    assert EVERYTHING.complete and Quantifiers(inputs=False).complete
    for changes in (
        {"tmr0_phase": False},
        {"resets": False},
        {"watchdog": False},
        {"eeprom_write": False},
        {"any_eeprom": True},
        {"start": (("w", 0),)},
    ):
        assert not replace(EVERYTHING, **changes).complete, changes


# certificates


def test_a_digest_is_of_the_words_the_configuration_and_the_whole_eeprom() -> None:
    """The text that docs/proof.md states."""
    image = Image({1: 0x3FFF, 0: 0x0001}, config=0x3FF1, eeprom={63: 0x12, 0: 0xAB})
    text = "000 0001\n001 3fff\nconfig 3ff1\nab" + "ff" * 62 + "12\n"
    assert image_digest(image) == hashlib.sha256(text.encode()).hexdigest()
    none = "000 0001\nconfig none\n" + "ff" * 64 + "\n"
    assert image_digest(Image({0: 1}, config=None)) == hashlib.sha256(none.encode()).hexdigest()


def test_a_column_is_one_value_or_differences() -> None:
    assert compact_column([7, 7, 7]) == {"all": 7}
    assert compact_column([7, 7, 5, 9]) == {"delta": [7, 0, -2, 4]}


def test_a_proof_that_is_none_has_no_certificate() -> None:
    proof: Any = SimpleNamespace(proven=True, transitions=object(), quantifiers=EVERYTHING, nodes=())
    only = "^only a proof over every power-up, reset and chip has a certificate$"
    for changes in (
        {"proven": False},
        {"transitions": None},
        {"quantifiers": Quantifiers(resets=False)},
    ):
        wrong: Any = SimpleNamespace(**(vars(proof) | changes))
        with pytest.raises(ValueError, match=only):
            certificate(wrong, Image({}), SCHEDULE, b"")


def test_a_certificate_names_its_image_its_schedule_and_what_is_held() -> None:
    proof: Any = SimpleNamespace(
        proven=True,
        transitions=object(),
        quantifiers=EVERYTHING,
        asynchronous=False,
        # A start, and a state before the first pulse: neither is listed.
        nodes=(node(-1, 0), replace(node(0, 0), spec=SpecState(BEFORE, 0, 0))),
        held={RB1: 1, RA4: 0},
        assumptions=("this", "that"),
        cuts=(5, 9),
    )
    image = Image({0: 1})
    content = json.loads(lzma.decompress(certificate(proof, image, SCHEDULE, b"text")))
    columns = content.pop("columns")
    assert content == {
        "format": 2,
        "image": image_digest(image),
        "schedule": hashlib.sha256(b"text").hexdigest(),
        "clock_hz": 4_000_000,
        "held": {"RA4": 0, "RB1": 1},
        "assumptions": ["this", "that"],
        "cuts": [5, 9],
        "count": 0,
        "places": [],
    }
    assert {f"ram.{address:02x}" for address in range(0x0C, 0x50)} <= columns.keys()
    assert {"time", "frame", "place", "pc", "tmr0", "prescaler", "stack7", "watchdog_age"} <= columns.keys()


def test_a_certificate_lists_the_states_at_cuts_in_frames_and_after_them() -> None:
    """Neither a start, nor what comes before the first pulse, nor what stands still; each place once."""
    beside = {number: {"PC": 0x400 | number, "W": number} for number in range(6)}
    beside[4]["T0_AT"] = BASE + 1
    transitions = beside_ram(lambda number: fields_of(**beside[number]))
    cells = tuple(range(68))

    def listed(number: int, parent: int, spec: SpecState) -> Node:
        return replace(node(parent, 0), rest=number, spec=spec, ram=tuple(cell + number for cell in cells))

    stopped = SpecState(IN_FRAME, 7, 2, running=0)
    proof: Any = SimpleNamespace(
        proven=True, transitions=transitions, quantifiers=EVERYTHING, asynchronous=False, held={},
        assumptions=(), cuts=(),
        nodes=(
            listed(0, -1, SpecState(IN_FRAME, 1, 1)),
            listed(1, 0, SpecState(BEFORE, 0, 0)),
            listed(2, 0, SpecState(IN_FRAME, 5, 1)),
            listed(3, 2, stopped),
            listed(4, 2, stopped),
            listed(5, 3, SpecState(OVER, 0, 3)),
        ),
    )  # fmt: skip
    content = json.loads(lzma.decompress(certificate(proof, Image({0: 1}), SCHEDULE, b"text")))

    def column(name: str) -> list[int]:
        said = content["columns"][name]
        return [said["all"]] * content["count"] if "all" in said else [*itertools.accumulate(said["delta"])]

    assert content["count"] == 3 and content["places"] == [[[1, 1, 0, 0], 0, 0], [[0, 1, 0, 0], 0, 0]]
    wanted = {
        "pc": [2, 3, 5], "w": [2, 3, 5], "time": [5, 7, 0], "frame": [1, 2, -1], "place": [0, 1, 0],
        "ram.0c": [2, 3, 5], "ram.4f": [69, 70, 72], "depth": [0, 0, 0],
    }  # fmt: skip
    assert {name: column(name) for name in wanted} == wanted
    assert content["columns"]["depth"] == {"all": 0}
    assert sum(name.startswith("ram.") for name in content["columns"]) == 68


BUTTONS = ButtonRule(Input("RA2", 1), Input("RB7", 0), True, 3)


def test_a_place_has_the_memory_of_buttons_and_what_was_read_of_them() -> None:
    schedule = replace(SCHEDULE, buttons=BUTTONS)
    ra2, rb7 = PINS.index("RA2"), PINS.index("RB7")
    spec = SpecState(IN_FRAME, 5, 6, running=0, on=1, start_seen=2, stop_seen=3)
    assert place_key(spec, schedule, None) == ((0, 1, 2, 3), 0, 0)
    read = spec._replace(start_sample=1)
    assert place_key(read, schedule, None) == ((0, 1, 2, 3), 1 << ra2, 1 << ra2)
    read = spec._replace(start_sample=0, stop_sample=1)
    assert place_key(read, schedule, None) == ((0, 1, 2, 3), 1 << rb7, 1 << ra2 | 1 << rb7)
    assert place_key(spec._replace(stop_sample=0), schedule, None)[1:] == (0, 1 << rb7)
    only = replace(schedule, buttons=replace(BUTTONS, start=None))
    assert place_key(read, only, None)[1:] == (1 << rb7, 1 << rb7)
    assert place_key(spec, SCHEDULE, None) == ((0, 1, 2, 3), 0, 0)


def directions(*selectors: Any) -> tuple[DirectionRuns, ...]:
    return tuple(DirectionRuns(f"d{n}", selector, (), (), ()) for n, selector in enumerate(selectors))


def test_a_place_has_the_memory_of_what_commands_a_walk() -> None:
    ra4 = PINS.index("RA4")
    line = CommandRule(CodeLine(Input("RA4", 1), 3, 5), directions("01"))
    spec = SpecState(IN_FRAME, 5, 6, wanted=2, heard=0b1011, line_read=1)
    # A code of which 0, 1, 1 came after the start; then a run of levels that are none.
    assert place_key(spec, SCHEDULE, line) == ((2, "0011"), 0, 1 << ra4)
    assert place_key(spec._replace(heard=64 + 3, line_read=0), SCHEDULE, line) == ((2, "-000"), 0, 0)
    button = CommandRule(StepButton(Input("RA4", 0), 3), directions(None, None))
    assert place_key(spec._replace(heard=8 * 1 + 2), SCHEDULE, button) == ((2, 1, 2), 0, 1 << ra4)
    buttons = CommandRule(DirectionButtons(3), directions(Input("RA2", 0), Input("RB7", 1)))
    ra2, rb7 = 1 << PINS.index("RA2"), 1 << PINS.index("RB7")
    for read, levels, sampled in (
        (0, 0, 0),
        (2, ra2, ra2),  # not pressed: at the other level
        (6, 0, ra2),
        (2 << 2, 0, rb7),
        (6 << 2, rb7, rb7),
        (6 | 2 << 2, 0, ra2 | rb7),
    ):
        state = spec._replace(heard=8 * 2 + 1, line_read=read)
        assert place_key(state, SCHEDULE, buttons) == ((2, 1, 2), levels, sampled), read


@pytest.mark.parametrize(
    ("heard", "rest", "text"),
    [
        (0, 1, ""),
        (1, 1, "0"),
        (1, 0, "1"),
        (0b101, 1, "001"),
        (63, 1, "011111"),
        (64, 1, "-"),
        (65, 1, "-0"),
        (65, 0, "-1"),
        (127, 1, "-" + "0" * 63),
        (129, 1, "-1"),
        (130, 0, "-00"),
    ],
)
def test_a_memory_of_a_line_in_levels(heard: int, rest: int, text: str) -> None:
    assert heard_text(heard, rest) == text


# sentences of a proof


def test_why_a_pin_is_held() -> None:
    says = "as the schedule says: "
    assert held_assumptions({RB1: 1, RA4: 0}, SCHEDULE) == [
        f"RA4 is held at 0, {says}it does not say what another level does",
        f"RB1 is held at 1, {says}it does not say what another level does",
    ]
    assert held_assumptions({RB1: 1}, replace(SCHEDULE, buttons=BUTTONS)) == [
        f"RB1 is held at 1, {says}by request"
    ]
    commands = CommandRule(CodeLine(Input("RA4", 1), 3, 5), directions("01"))
    assert held_assumptions({RB1: 1}, replace(SCHEDULE, commands=commands)) == [
        f"RB1 is held at 1, {says}by request"
    ]
    assert held_assumptions({}, SCHEDULE) == []


def test_which_byte_of_the_eeprom_is_whose_trim() -> None:
    assert trims_text(SCHEDULE, {}) == "the EEPROM holds anything: no pulse depends on it"
    assert trims_text(SCHEDULE, {0: 7, 1: 0}) == (
        "the EEPROM holds anything; each pulse is longer than the schedule's by the byte that is its trim, "
        "in two's complement, 0xFF being none: byte 0 of RB6, 7 of RB0"
    )


def test_what_is_not_decided_names_its_place() -> None:
    search: Any = SimpleNamespace(nodes=[1, 2, 3], open_nodes=4)
    one = replace(finding(0, 1), message="too many ways", pc=0x1A)
    assert why_undecided(one, search) == "too many ways (address 0x01A, 3 states seen, 4 open)"


@pytest.mark.parametrize(
    ("waits", "node"),
    [
        ((), None),
        (((0, 1), (1, 2), (2, 3)), None),
        (((0, 1), (0, 2), (1, 3), (2, 3)), None),
        (((5, 5),), 5),
        (((0, 1), (1, 2), (2, 1)), {1, 2}),
    ],
)
def test_a_program_that_comes_back_to_a_state_without_a_pulse_waits_endlessly(waits: Any, node: Any) -> None:
    search: Any = SimpleNamespace(waits=[(*wait, 10) for wait in waits])
    found = endless_wait(search)
    assert found == node if not isinstance(node, set) else found in node


# what a certificate lists


def fields_of(**fields: int) -> tuple[int, ...]:
    beside = [0] * len(FIELDS)
    values = {"IRQ_AT": layout.NEVER, "T0_AT": BASE, "WDT_CLEARED": BASE} | fields
    for name, value in values.items():
        beside[FIELD[name]] = value
    return tuple(beside)


def beside_ram(rest: Callable[[int], tuple[int, ...]]) -> Any:
    """Transitions of a chip without a tape."""
    return SimpleNamespace(rest=rest, chip=SimpleNamespace(tape=None))


def row_of(**fields: int) -> dict[str, int]:
    transitions = beside_ram(lambda number: fields_of(**fields))
    return row_cells(transitions, 0)


def test_a_row_has_cells_of_values_unknown_bits_and_phi() -> None:
    """Bits 0 to 7 are the value, 8 to 15 mark unknown bits, which are 0, and bit 16 the bytes that add φ."""
    row = row_of(
        PC=0x7FF, W=0xA5, W_UNKNOWN=0x0F, FSR=7, FSR_UNKNOWN=layout.PHASED, STATUS=0x1F, STATUS_UNKNOWN=0x07,
        EEADR=9, PCLATH=3, OPTION=0x8F, DEPTH=2, STACK0=0x7FF, STACK7=0x123, WDT_CLEARED=BASE - 500,
    )  # fmt: skip
    assert (row["pc"], row["w"], row["fsr"]) == (0x3FF, 0xA0 | 0x0F00, 7 | 0x10000)
    assert (row["status"], row["eeadr"], row["option"]) == (0x18 | 0x0700, 9, 0x8F)
    assert (row["depth"], row["stack0"], row["stack7"], row["stack1"]) == (2, 0x3FF, 0x123, 0)
    assert row["watchdog_age"] == 500


def test_ports_are_five_and_eight_bits() -> None:
    row = row_of(TRIS=0x1FFF & ~(1 << 4 | 1 << 12), LATCH=0b1000_0001_10001, LATCH_UNKNOWN=0b0100_0000_00010)
    assert (row["trisa"], row["trisb"]) == (0x0F, 0x7F)
    assert (row["porta"], row["portb"]) == (0b10001 | 0b00010 << 8, 0x81 | 0x40 << 8)


def test_the_prescaler_is_its_count_below_its_ratio() -> None:
    for ps in range(8):
        used = 2 ** (ps + 1) - 1
        row = row_of(OPTION=ps, PRESCALER=0xFF, TMR0=5)
        assert (row["prescaler"], row["tmr0"]) == (used, 5)
        # Bits that do not reach TMR0 may be unknown; of the others none.
        row = row_of(OPTION=ps, PRESCALER=1, PRESCALER_UNKNOWN=0xFF & ~used, TMR0=5)
        assert (row["prescaler"], row["tmr0"]) == (1, 5)
        row = row_of(OPTION=ps, PRESCALER=0, PRESCALER_UNKNOWN=1 << ps, TMR0=5)
        assert (row["prescaler"], row["tmr0"]) == (0, 0xFF00)
        # The prescaler of the watchdog does not count for TMR0.
        row = row_of(OPTION=8 | ps, PRESCALER=3, PRESCALER_UNKNOWN=0xFF, TMR0=5)
        assert (row["prescaler"], row["tmr0"]) == (0, 5)


def test_states_within_an_interrupt_or_while_the_timer_stands_are_not_listed() -> None:
    def settled(**fields: int) -> bool:
        transitions = beside_ram(lambda number: fields_of(**fields))
        return is_settled(transitions, 0)

    assert settled() and settled(T0_AT=BASE - 9)
    assert not settled(T0_AT=BASE + 1) and not settled(IRQ_AT=BASE)
