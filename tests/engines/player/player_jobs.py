"""Jobs and measures that the tests of the player share.

`python -m tests.engines.player.player_jobs [seconds]` runs ten minutes, or so long, of thirteen servos that
sweep slowly, each with its own widths, those that share a slot across each other.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from zlib import crc32

import numpy as np

from servogen.edges import HIGH, LOW, PINS, EdgeChunk
from servogen.engines.firmware import DIALECTS
from servogen.engines.player.engine import play
from servogen.job import PlannedJob, load, loads, plan_job
from servogen.pulse import PulseSchedule, Run
from servogen.units import Cycles
from servogen.workflows.engines import planned
from servogen.workflows.job_build import Build, judge_firmware
from servogen.workflows.verification import judge_edges, running

ROOT = Path(__file__).parents[3]
ALL_PINS = (*PINS[5:], *PINS[:5])
"""RB0 to RB7, then RA0 to RA4: two at a time they share the slots."""


def job_text(
    servos: int,
    motion: str,
    *,
    clock_hz: int = 4_000_000,
    limits: tuple[float, float] = (10, 160),
    frame: str = "",
    firmware: str = "",
) -> str:
    """A job of the player with servos s0, s1, … on `ALL_PINS`."""
    chip = "PIC16F84A" if clock_hz > 10_000_000 else "PIC16F84"
    rows = [
        f'[[servo]]\nname = "s{number}"\npin = "{pin}"\nmodel = "futaba-s3001"\n'
        f"min_deg = {limits[0]}\nmax_deg = {limits[1]}\n" + ("open_drain = true\n" if pin == "RA4" else "")
        for number, pin in enumerate(ALL_PINS[:servos])
    ]
    return (
        f'[chip]\ndevice = "{chip}"\nclock_hz = {clock_hz}\n{"".join(rows)}{motion}\n'
        f'[frame]\n{frame}\n[firmware]\nengine = "player"\n{firmware}\n'
    )


def poses(angles: Sequence[Sequence[float]], seconds: float, more: str = "") -> str:
    """[motion] through rows of angles, each reached in `seconds`."""
    rows = [
        "  { "
        + ", ".join(f"s{n}_deg = {angle:g}" for n, angle in enumerate(row))
        + f", move_s = {seconds:g} }},"
        for row in angles
    ]
    return f"[motion]\n{more}\nposes = [\n" + "\n".join(rows) + "\n]"


def sweep(servos: int, seconds: float, *, limits: tuple[float, float] = (10, 160)) -> str:
    """Every servo from one end of its own to another and back; neighbours cross."""
    low, span = limits[0], limits[1] - limits[0]
    there = [low + span * n / 15 for n in range(servos)]
    back = [low + span * (1 - n / 21) for n in range(servos)]
    return poses([there, back], seconds)


THIRTEEN = job_text(13, sweep(13, 10.24), firmware="soft_start_s = 0.32")


@cache
def built(name: str, *dialects: str) -> Build:
    """A job of the repository, built."""
    return _built(plan_job(load(ROOT / "jobs" / f"{name}.toml")), dialects or DIALECTS)


@cache
def built_text(text: str, *dialects: str) -> Build:
    """The text of a job, built for these dialects; without any for one, another for another text."""
    return _built(
        plan_job(loads(text, "job.toml")), dialects or (DIALECTS[crc32(text.encode()) % len(DIALECTS)],)
    )


def _built(job: PlannedJob, dialects: Sequence[str]) -> Build:
    played = planned(job)
    schedule = played.plan.schedule
    first, *others = (played.make(each) for each in dialects)
    programs = [
        judge_firmware(schedule, first, stored=True),
        *(judge_firmware(schedule, each) for each in others),
    ]
    return Build(played.job, played.engine, played.plan, tuple(programs))


def trimmed(schedule: PulseSchedule, trims: dict[int, int]) -> PulseSchedule:
    """The schedule with these cycles added to the pulses of these channels."""

    def run(each: Run) -> Run:
        pulses = tuple(
            pulse and replace(pulse, width=Cycles(pulse.width + trims.get(channel, 0)))
            for channel, pulse in enumerate(each.pulses)
        )
        return replace(each, pulses=pulses)

    return replace(
        schedule,
        lead_in=tuple(run(each) for each in schedule.lead_in),
        loop=tuple(run(each) for each in schedule.loop),
    )


def widths(chunk: EdgeChunk, pin: int, first: int = 0) -> list[int]:
    """The widths of the pulses of a pin that begin from cycle `first` on."""
    mine = (chunk.pin == pin) & (chunk.cycle >= first)
    cycle, level = chunk.cycle[mine], chunk.level[mine]
    start = int(np.argmax(level == HIGH))
    cycle, level = cycle[start:], level[start:]
    count = len(cycle) // 2
    assert (level[0 : 2 * count : 2] == HIGH).all() and (level[1 : 2 * count : 2] == LOW).all()
    found: list[int] = (cycle[1 : 2 * count : 2] - cycle[0 : 2 * count : 2]).tolist()
    return found


def first_frames(schedule: PulseSchedule, frames: int) -> tuple[Run, ...]:
    """The first `frames` frames as runs."""
    found: list[Run] = []
    for each in (*schedule.lead_in, *schedule.loop * (frames // schedule.loop_frames + 1)):
        left = frames - sum(run.frames for run in found)
        if left > 0:
            found.append(replace(each, frames=min(left, each.frames)))
    return tuple(found)


def crossings(done: Build) -> dict[tuple[int, ...], int]:
    """How often in a loop the widths of each pair that shares a slot change places."""
    loop = done.plan.schedule.loop
    played = play(done.job)[1]
    found = {}
    for slot in played.layout.slots:
        if len(slot.channels) == 2:
            pairs = [[each.pulses[channel] for channel in slot.channels] for each in loop]
            ahead = [one.width - other.width for one, other in pairs if one and other]
            signs = np.sign([each for each in ahead if each])
            found[slot.channels] = int((signs[1:] != signs[:-1]).sum())
    return found


def main(seconds: float) -> int:
    """Thirteen sweeping servos for so long; every edge compared."""
    done = built_text(THIRTEEN, *DIALECTS)
    schedule = done.plan.schedule
    span = schedule.clock.round_seconds(seconds)
    print(f"pairs of a slot cross, times in a loop of {schedule.loop_frames} frames: {crossings(done)}")
    exact = True
    for program in done.programs:
        verdict = judge_edges(schedule, running(schedule, program.image, span), span)
        pulses = sum(channel.observed for channel in verdict.channels)
        exact &= verdict.passed
        print(
            f"{program.firmware.dialect}: {seconds:g} s, {verdict.span.frames} frames, {pulses} pulses: "
            f"worst edge error {verdict.worst_edge_error} cycles, "
            f"{'exact' if verdict.passed else 'NOT EXACT'}"
        )
    return 0 if exact else 1


if __name__ == "__main__":
    sys.exit(main(float(sys.argv[1]) if len(sys.argv) > 1 else 600.0))
