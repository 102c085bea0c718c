"""Exact means exact: whatever makes the simulator fast does what single steps do, and what a second chip
does.

Programs are random: any words, or pieces that count, wait, sleep and take interrupts; with timers, watchdog
and stimuli at random moments. `make test` runs some; all of them, 10 000 images:

    SERVOGEN_SIMULATOR_IMAGES=10000 .venv/bin/pytest tests/simulator/test_exact.py
"""

from __future__ import annotations

import os
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from servogen import native
from servogen.pic.image import Image
from servogen.simulator import LevelChange, Machine, Recorded, SimulatorOptions, Stimuli, core
from tests.campaigns import sampled
from tests.simulator.helpers import CLOCK
from tests.simulator.programs import random_stimuli, tame_image, timed_image, wild_image
from tests.simulator.reference import Chip, number

IMAGES = int(os.environ.get("SERVOGEN_SIMULATOR_IMAGES", "80"))
BATCH = 20
CYCLES = 2500
EEPROM_CYCLES = 50
WATCHDOGS = (18_000, 97, 400)

Edges = list[tuple[int, ...]]


class Case:
    """One program with its surroundings, for whoever runs it."""

    def __init__(self, seed: int, image: Image) -> None:
        self.image = image
        self.changes = random_stimuli(seed, CYCLES - 50) if seed % 3 else []
        self.watchdog = WATCHDOGS[seed % 3]
        self.pull_up = bool(seed & 4)
        self.tmr0_phase = seed >> 3 & 3

    def machine(self) -> Machine:
        options = SimulatorOptions(
            watchdog_us=self.watchdog,
            eeprom_write_us=EEPROM_CYCLES,
            ra4_pull_up=self.pull_up,
            tmr0_phase=self.tmr0_phase,
        )
        recorded = Recorded([LevelChange(*change) for change in self.changes])
        return Machine(self.image, CLOCK, options, Stimuli([recorded]) if self.changes else None)

    def reference(self) -> Chip:
        return Chip(
            self.image,
            watchdog_cycles=self.watchdog,
            eeprom_cycles=EEPROM_CYCLES,
            ra4_pull_up=self.pull_up,
            tmr0_phase=self.tmr0_phase,
            stimuli=self.changes,
        )


def cases(batch: int) -> list[Case]:
    seeds = range(batch * BATCH, (batch + 1) * BATCH)
    return [Case(seed, (tame_image if seed % 2 else wild_image)(seed)) for seed in seeds]


def timed_cases() -> list[Case]:
    return [Case(seed, timed_image(seed)) for seed in range(IMAGES // 2)]


def rows(chunk: tuple[object, ...]) -> Edges:
    return [tuple(row) for row in zip(*(column.tolist() for column in chunk), strict=True)]  # type: ignore[attr-defined]


def seen(machine: Machine) -> dict[str, object]:
    """Everything that a state says, but for how often an undefined word was met first."""
    state = machine.state()
    names = [name for name in state.__slots__ if name != "warnings"]
    return {name: getattr(state, name) for name in names} | {"fingerprint": machine.fingerprint()}


@pytest.mark.parametrize("batch", sampled(range(IMAGES // BATCH), 2))
def test_running_fast_is_the_same_as_single_steps(batch: int) -> None:
    for case in cases(batch):
        fast, slow = case.machine(), case.machine()
        fast_edges = rows(fast.run(CYCLES))
        slow_edges: Edges = []
        while slow.cycles < CYCLES:
            slow_edges += rows(slow.step())
        assert fast_edges == slow_edges
        assert seen(fast) == seen(slow)


@pytest.mark.campaign
def test_a_wait_for_tmr0_that_is_taken_in_one_step_is_the_same_as_single_steps_and_as_a_second_chip() -> None:
    """Wherever the run is cut, and whatever interrupts it."""
    for seed, case in enumerate(timed_cases()):
        fast, slow, parts, chip = case.machine(), case.machine(), case.machine(), case.reference()
        fast_edges, part_edges, slow_edges = rows(fast.run(CYCLES)), [], []
        while slow.cycles < CYCLES:
            slow_edges += rows(slow.step())
        for end in (1 + seed, 300 + 7 * seed, 301 + 7 * seed, 1111, CYCLES):
            part_edges += rows(parts.run(max(0, end - parts.cycles)))
        chip.run(CYCLES)
        chip.begin()
        assert fast_edges == slow_edges == part_edges == chip.edges
        assert seen(fast) == seen(slow) == seen(parts)
        assert registers_of(fast) == registers_of_chip(chip)


def test_the_random_programs_reach_what_is_taken_in_one_step() -> None:
    """The memory of regions is a detail; but without it in use the tests here would show little."""
    used = 0
    tame = [case for batch in range(4) for case in cases(batch)][1::2]
    for case in tame:
        machine = case.machine()
        machine.run(CYCLES)
        used += bool((machine.memo != -1).any())
    assert used > len(tame) // 3


@pytest.mark.parametrize("batch", sampled(range(IMAGES // BATCH), 2))
def test_the_simulator_is_the_same_as_a_second_chip(batch: int) -> None:
    for case in cases(batch):
        machine, chip = case.machine(), case.reference()
        edges = rows(machine.run(CYCLES))
        chip.run(CYCLES)
        chip.begin()
        assert edges == chip.edges
        assert registers_of(machine) == registers_of_chip(chip)


ALTERED = {
    "a flag": ("instructions.h", "(v & 15) >= (p->w & 15)", "(v & 15) > (p->w & 15)"),
    "a cycle": ("timer.h", "INHIBITED = 3", "INHIBITED = 2"),
}
"""Where the C is altered: the file, what stands there, and what then does."""


@pytest.mark.parametrize("what", sampled(ALTERED))
def test_an_altered_simulator_is_found(what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file, text, other = ALTERED[what]
    shutil.copytree(core.NATIVE.folder, tmp_path / "core", ignore=shutil.ignore_patterns("*.so"))
    source = (tmp_path / "core" / file).read_text("utf-8")
    assert source.count(text) == 1
    (tmp_path / "core" / file).write_text(source.replace(text, other), "utf-8")
    monkeypatch.setattr(native, "FLAGS", ("-O0", "-fPIC", "-shared"))
    altered = replace(core.NATIVE, folder=tmp_path / "core")
    altered.refresh()
    monkeypatch.setattr(core, "NATIVE", altered)
    core.loop.cache_clear()
    try:
        assert any(differs(case) for batch in range(IMAGES // BATCH) for case in cases(batch))
    finally:
        core.loop.cache_clear()


def differs(case: Case) -> bool:
    """Return whether the simulator differs from the second chip."""
    machine, chip = case.machine(), case.reference()
    edges = rows(machine.run(CYCLES))
    chip.run(CYCLES)
    chip.begin()
    return edges != chip.edges or registers_of(machine) != registers_of_chip(chip)


@pytest.mark.parametrize("batch", sampled(range(IMAGES // BATCH), 2))
def test_no_image_takes_the_machine_out_of_range(batch: int) -> None:
    for case in cases(batch):
        machine = case.machine()
        machine.run(40 * CYCLES)
        state = machine.state()
        assert 0 <= state.pc < 0x2000
        assert all(0 <= value < 256 for value in (state.w, state.status, *state.registers.values()))
        assert all(0 <= address < 0x2000 for address in state.stack)
        assert 0 <= state.stack_depth <= state.deepest_stack <= 8
        assert state.cycles >= 40 * CYCLES


@pytest.mark.parametrize("batch", sampled(range(IMAGES // BATCH), 2))
def test_a_run_may_be_cut_anywhere(batch: int) -> None:
    for seed, case in enumerate(cases(batch)):
        whole, parts = case.machine(), case.machine()
        edges = rows(whole.run(CYCLES))
        cut_edges: Edges = []
        for end in (1 + seed, 300 + 7 * seed, 301 + 7 * seed, 1111, CYCLES):
            cut_edges += rows(parts.run(max(0, end - parts.cycles)))
        assert edges == cut_edges
        assert seen(whole) == seen(parts)


def registers_of(machine: Machine) -> dict[str, object]:
    state = machine.state()
    names = ("cycles", "pc", "w", "status", "ram", "ram_written", "read_unwritten", "eeprom", "sleeping")
    names += ("stack", "stack_depth", "deepest_stack", "stack_wraps", "prescaler", "watchdog_at")
    names += ("interrupts", "wakes", "edges")
    told = {name: getattr(state, name) for name in names}
    causes = {name: count for name, count in state.resets.items() if name != "power_on"}
    return told | dict(state.registers) | causes


def registers_of_chip(chip: Chip) -> dict[str, object]:
    return {
        "cycles": max(chip.now, 0 if chip.asleep or chip.held else chip.busy_until),
        "pc": chip.pc, "w": chip.w, "status": chip.status, "ram": bytes(chip.ram),
        "stack": tuple(chip.stack[(chip.sp - 1 - i) % 8] for i in range(8)),
        "eeprom": bytes(chip.eeprom), "stack_wraps": chip.wraps, "interrupts": chip.interrupts,
        "sleeping": chip.asleep, "prescaler": chip.prescaler, "deepest_stack": chip.deepest,
        "stack_depth": chip.depth, "edges": len(chip.edges), "wakes": chip.wakes,
        "watchdog_at": chip.watchdog_at(),
        "ram_written": tuple(0x0C + place for place in range(68) if chip.written[place]),
        "read_unwritten": tuple(sorted(chip.read_unwritten)),
        "PCL": chip.pc & 0xFF, "EECON2": 0, "PORTA": number(chip.pins[:5]), "PORTB": number(chip.pins[5:]),
        "LATA": number(chip.latch[:5]), "LATB": number(chip.latch[5:]), "TRISA": number(chip.tris[:5]),
        "TRISB": number(chip.tris[5:]), "TMR0": chip.tmr0, "STATUS": chip.status, "FSR": chip.fsr,
        "EEDATA": chip.eedata, "EEADR": chip.eeadr, "PCLATH": chip.pclath, "INTCON": chip.intcon,
        "OPTION_REG": chip.option, "EECON1": chip.eecon1, **chip.resets,
    }  # fmt: skip
