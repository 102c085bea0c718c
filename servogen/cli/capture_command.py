"""`servogen capture`: what the chip's pins do, seen by a logic analyser, in a file."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.options import Json
from servogen.cli.show import as_json, progress, status, warn
from servogen.errors import InputError
from servogen.programs import read_schedule
from servogen.units import counted

if TYPE_CHECKING:
    from servogen.bench.analysers.memory import Wanted
    from servogen.build.capture import Captured

RATE = 1_000_000
MOST_DRIFT = Fraction(1, 1000)
"""A chip whose crystal is so much too slow still shows in a capture what is wanted."""


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
    from servogen.build.capture import Looking, check_rate, wanted_of
    from servogen.build.capture import capture as captured

    schedule = None if against is None else read_schedule(against)
    if sigrok is not None:
        if schedule is not None:
            check_rate(rate)
        _look_by_sigrok(sigrok, rate, wanted_of(schedule, seconds), wire or [], rle, output, against, json)
        return
    if port is None:
        raise InputError(
            "missing-option",
            "there is no analyser to look with",
            hint="--port /dev/ttyACM0, or --sigrok fx2lafw",
        )
    looking = Looking(rate, rle, memory, trigger, wire or (), stitch)
    done = captured(output, port, schedule, seconds, looking, progress)
    if done.seen.unseen and seconds is None:
        looks = len(done.seen.records)
        warn(f"{done.seen.unseen} of the loop's different frames were not seen whole in {looks} captures")
    _tell(done, output, against, json)


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


def _tell(done: Captured, output: Path, against: Path | None, json: bool) -> None:
    device, planned, seen = done.analyser, done.plan, done.seen
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
