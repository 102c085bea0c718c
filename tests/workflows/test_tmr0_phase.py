"""TMR0's phase after a write of OPTION_REG, which no data sheet gives, moves the pulses of no job's firmware
against each other.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from servogen.cli.files import read_image
from servogen.edges import EdgeTrace, join
from servogen.engines.board import machine_of
from servogen.pic.image import Image
from servogen.programs import read_schedule
from servogen.pulse import PulseSchedule
from servogen.simulator import SimulatorOptions
from servogen.units import Cycles
from servogen.workflows.verification import checked_cycles, judge_edges
from tests.campaigns import sampled
from tests.simulator.helpers import image

ROOT = Path(__file__).parents[2]
FOLDERS = sorted(path.parent for path in (ROOT / "firmware").glob("*/schedule.json"))
PHASES = range(4)


def edges(schedule: PulseSchedule, program: Image, span: Cycles, phase: int) -> EdgeTrace:
    limit = schedule.run_cycles(span)
    machine = machine_of(schedule, program, SimulatorOptions(tmr0_phase=phase))
    return EdgeTrace(schedule.clock, machine.stream(limit), limit)


def test_every_job_with_firmware_is_asked() -> None:
    jobs = {path.stem for path in (ROOT / "jobs").glob("*.toml")}
    assert {folder.name for folder in FOLDERS} == {
        name for name in jobs if (ROOT / "firmware" / name).is_dir()
    }
    assert len(FOLDERS) > 10


@pytest.mark.parametrize("folder", sampled(FOLDERS, 4), ids=lambda folder: folder.name)
def test_the_pulses_of_a_jobs_firmware_are_the_schedules_at_every_phase(folder: Path) -> None:
    """The verdict counts from the first edge on, so it allows one constant shift of all edges."""
    schedule = read_schedule(folder / "schedule.json")
    for hex_file in sorted(folder.glob("*.hex")):
        program = read_image(hex_file)
        for phase in PHASES if hex_file.name == "main.hex" else PHASES[-1:]:
            span = checked_cycles(schedule)
            verdict = judge_edges(schedule, edges(schedule, program, span, phase), span)
            assert verdict.passed, (hex_file.name, phase, verdict.reasons)


REWRITTEN = """
        clrf    PORTB
        bsf     STATUS, RP0
        clrf    TRISB
        bcf     STATUS, RP0
frame   clrf    TMR0
        bsf     PORTB, 0
        bsf     STATUS, RP0
        movlw   0x88
        movwf   OPTION_REG      ; TMR0 counts the instruction clock, without prescaler
        bcf     STATUS, RP0
        bcf     INTCON, T0IF
        btfss   INTCON, T0IF
        goto    $-1
        bcf     PORTB, 0
        bsf     STATUS, RP0
        movlw   0xA8
        movwf   OPTION_REG      ; TMR0 stands still
        bcf     STATUS, RP0
        goto    frame
"""


def test_the_phase_does_change_pulses_that_are_timed_from_a_write_of_option_reg() -> None:
    """Without this the test above might hold because the option does nothing."""
    schedule = read_schedule(ROOT / "firmware" / "lab8-exercise" / "schedule.json")
    widths = []
    for phase in PHASES:
        chunk = join(edges(schedule, image(REWRITTEN), Cycles(5000), phase).driven())
        rises, falls = (chunk.cycle[(chunk.pin == 5) & (chunk.level == level)].tolist() for level in (1, 0))
        later = [fall for fall in falls if fall > rises[0]]
        widths.append({fall - rise for rise, fall in zip(rises, later, strict=False)})
    assert all(len(each) == 1 for each in widths)
    # The flag is polled every three cycles: standing still for three is one more poll.
    assert widths[3] == {width + 3 for width in widths[0]}
