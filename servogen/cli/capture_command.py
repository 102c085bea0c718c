"""`servogen capture`: what the chip's pins do, seen by a logic analyser, in a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.files import read_schedule
from servogen.cli.options import Json
from servogen.cli.show import as_json, progress, status, warn
from servogen.errors import InputError, Place, ToolError

if TYPE_CHECKING:
    from servogen.bench.analysers.memory import Plan, Wanted
    from servogen.bench.analysers.stitching import Stitched
    from servogen.bench.analysers.sump_client import Analyser, Seen
    from servogen.bench.ports import Port as Line
    from servogen.pulse import PulseSchedule, Run

RATE = 1_000_000
MOST_DRIFT = Fraction(1, 1000)
"""A chip whose crystal is so much too slow still shows in a capture what is wanted."""
SECONDS = 1.0
SLACK = 1.25
PATIENCE_S = 5.0
"""Beyond the time that the capture itself takes."""


def capture(
    output: Annotated[Path, typer.Option("--output", "-o", help="The capture, a .vcd file.")],
    port: Annotated[
        str | None, typer.Option("--port", "-p", help="The analyser's port, as /dev/ttyACM0.")
    ] = None,
    sigrok: Annotated[
        str | None,
        typer.Option(
            "--sigrok", help="Look through sigrok-cli with this driver, as fx2lafw; -o is a .sr file."
        ),
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option("--against", help="The schedule.json: what is to be seen, and the servos' names."),
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option("--seconds", min=0.001, help="How long (default: the loop of --against once, or 1 s)."),
    ] = None,
    rate: Annotated[int, typer.Option("--rate", min=1, help="Samples a second.")] = RATE,
    rle: Annotated[bool, typer.Option("--rle/--no-rle", help="Let the analyser count equal samples.")] = True,
    memory: Annotated[
        int | None, typer.Option("--memory", min=8, help="Its bytes of memory, if it does not say them.")
    ] = None,
    trigger: Annotated[
        str | None, typer.Option("--trigger", help="Begin when this pin rises (default: the first servo's).")
    ] = None,
    wire: Annotated[
        list[str] | None,
        typer.Option(
            "--wire", help="CHANNEL=PIN, as 0=RB3 (default: 0 to 7 RB0 to RB7, 8 to 12 RA0 to RA4)."
        ),
    ] = None,
    stitch: Annotated[
        bool,
        typer.Option(
            "--stitch/--no-stitch",
            help="With --against: join several captures, each of whole frames, where one is too short.",
        ),
    ] = True,
    json: Json = False,
) -> None:
    """Look at the chip's pins with a logic analyser that speaks SUMP (Logic Sniffer, Bus Pirate, …)."""
    from servogen.bench.analysers.memory import plan
    from servogen.bench.analysers.request import check_name, stitched, write_capture
    from servogen.bench.analysers.sump_client import BAUD, identify
    from servogen.bench.analysers.wires import channel_of, wires
    from servogen.bench.ports import open_port

    schedule = None if against is None else read_schedule(against)
    wanted = _wanted(schedule, seconds)
    if schedule is not None:
        _check_rate(rate)
    if sigrok is not None:
        _look_by_sigrok(sigrok, rate, wanted, wire or [], rle, output, against, json)
        return
    if port is None:
        raise InputError("there is no analyser to look with", hint="--port /dev/ttyACM0, or --sigrok fx2lafw")
    check_name(output)
    wired = wires(wire or ())
    pin = trigger or (schedule.channels[0].pin if schedule else "RB0")
    channel = channel_of(pin, wired)
    with open_port(port, BAUD) as line:
        device = identify(line)
        several = stitch and schedule is not None
        fastest = min(rate, device.fastest or rate)
        if schedule is not None:
            _check_rate(fastest)
        planned = plan(memory or device.memory, fastest, rle, wanted, several)
        seen = _looks(line, planned, wanted.frames, channel, wired, schedule, seconds is None)
    servos = {each.pin: each.name for each in schedule.channels} if schedule else {}
    path = write_capture(
        output, int(planned.rate), stitched(seen.records, int(planned.rate)), servos, seen.missing
    )
    if seen.missing is not None:
        raise ToolError(seen.missing, Place(port), f"what came is kept, marked as not whole, in {path}")
    if seen.unseen and seconds is None:
        looks = len(seen.records)
        warn(f"{seen.unseen} of the loop's different frames were not seen whole in {looks} captures")
    _tell(device, planned, seen, output, against, json)


def _check_rate(rate: int) -> None:
    """Raise InputError where a capture of so many samples a second would prove nothing."""
    from servogen.verify import Sampling, Tolerances

    Sampling(1e6 / rate, True).check(Tolerances().glitch_us, Place(key="--rate"))


def _looks(
    line: Line,
    planned: Plan,
    frames: int,
    channel: int,
    wired: Mapping[int, int],
    schedule: PulseSchedule | None,
    whole_loop: bool,
) -> Stitched:
    """One look; or, where it is shorter than what is wanted, as many as that needs."""
    from servogen.bench.analysers.request import Record, edges
    from servogen.bench.analysers.stitching import Stitched, stitch
    from servogen.pulse.expected import expected

    if schedule is None or planned.frames >= frames:
        seen = _look(line, planned, channel, "capture")
        return Stitched((Record(edges(seen.runs, wired), seen.runs.end),), seen.missing, 0)
    about = -(-frames // planned.frames)
    return stitch(
        lambda plan, number: _look(line, plan, channel, f"capture {number} of about {about}"),
        planned,
        frames,
        whole_loop,
        expected(schedule),
        wired,
    )


def _look(line: Line, planned: Plan, channel: int, label: str) -> Seen:
    from servogen.bench.analysers.sump_client import Look
    from servogen.bench.analysers.sump_client import capture as captured

    patience = SLACK * float(planned.seconds) + PATIENCE_S
    look = Look(planned.rate, planned.words, planned.rle, channel, patience)
    with progress(label, planned.words) as done:
        return captured(line, look, done)


def _wanted(schedule: PulseSchedule | None, seconds: float | None) -> Wanted:
    """What is to be seen: by default the whole loop of the schedule, and a lead-in before it."""
    from math import ceil

    from servogen.bench.analysers.memory import FEWEST_EDGES, USUAL_EDGES, USUAL_PERIOD_S, Wanted

    if schedule is None:
        frames = ceil(_exact(seconds or SECONDS) / USUAL_PERIOD_S)
        return Wanted(USUAL_PERIOD_S, Fraction(USUAL_EDGES), frames, Fraction(FEWEST_EDGES), USUAL_EDGES)
    period = schedule.clock.seconds(schedule.period)
    loop, most = _edges(schedule.loop)
    begin, more = _edges(schedule.lead_in)
    if seconds is None:
        frames = schedule.lead_in_frames + schedule.loop_frames
        return Wanted(period, max(loop, begin), frames, min(loop, begin or loop), max(most, more))
    frames = ceil(_exact(seconds) / period)
    return Wanted(period, Fraction(max(most, more)), frames, min(loop, begin or loop), max(most, more))


def _edges(runs: Sequence[Run]) -> tuple[Fraction, int]:
    """Moments of change in a frame: on average, at least a tenth, and at most; 0 where there is no frame."""
    moments = [
        (each.frames, len({time for p in each.pulses if p for time in (p.rise, p.rise + p.width)}))
        for each in runs
    ]
    if not moments:
        return Fraction(0), 0
    total = sum(frames * edges for frames, edges in moments)
    mean = max(Fraction(1, 10), Fraction(total, sum(frames for frames, _ in moments)))
    return mean, max(1, *(edges for _, edges in moments))


def _exact(seconds: float) -> Fraction:
    """The decimal number that was typed."""
    return Fraction(str(seconds))


def _look_by_sigrok(
    driver: str,
    rate: int,
    wanted: Wanted,
    wire: list[str],
    rle: bool,
    output: Path,
    against: Path | None,
    json: bool,
) -> None:
    """Look for two frames more than is wanted, as sigrok begins anywhere, and for a slow crystal's share."""
    from math import ceil

    from servogen.bench.analysers.sigrok import SigrokLook, sigrok_wires
    from servogen.bench.analysers.sigrok import capture as captured

    samples = ceil(rate * (wanted.frames + 2) * wanted.period_s * (1 + MOST_DRIFT))
    counts = rle and driver.partition(":")[0] == "ols"  # the one driver that has it
    look = SigrokLook(driver, rate, samples, sigrok_wires(wire), counts)
    with status("sigrok-cli is looking"):
        captured(look, output)
    if json:
        seconds = samples / rate
        as_json({"file": str(output), "analyser": driver, "samples_per_second": rate, "seconds": seconds})
        return
    print(f"{output}: {samples / rate:g} s at {rate} samples a second")
    if against is not None:
        print(f"next: servogen verify {output} --against {against}")


def _tell(
    device: Analyser, planned: Plan, seen: Stitched, output: Path, against: Path | None, json: bool
) -> None:
    from servogen.verify.reasons import counted

    captures = len(seen.records)
    seconds = sum(record.end for record in seen.records) / float(planned.rate)
    if json:
        as_json(
            {
                "file": str(output),
                "analyser": device.name,
                "memory_bytes": device.memory,
                "samples_per_second": int(planned.rate),
                "rle": planned.rle,
                "seconds": seconds,
                "captures": captures,
            }
        )
        return
    print(f"{output}: {seconds:g} s at {int(planned.rate)} samples a second from {device.name}")
    if captures > 1:
        print(
            f"stitched of {captures} captures, as one holds {counted(planned.frames, 'frame')}; "
            "the time between two is not known"
        )
    if against is not None:
        print(f"next: servogen verify {output} --against {against}")
