"""`servogen capture`: what the chip's pins do, seen by a logic analyser, in a file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.options import Json
from servogen.cli.show import as_json, progress, status, warn
from servogen.errors import Diagnostic, InputError, Location
from servogen.programs import read_schedule
from servogen.units import counted

if TYPE_CHECKING:
    from servogen.build.capture import Captured

RATE = 1_000_000


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
    """Record the chip's pins with a logic analyser that speaks SUMP (Logic Sniffer, Bus Pirate, …)."""
    from servogen.build.capture import Looking, capture_by_sigrok
    from servogen.build.capture import capture as captured

    schedule = None if against is None else read_schedule(against)
    looking = Looking(rate, rle, memory, trigger, wire or (), stitch)
    if sigrok is not None:
        with status("sigrok-cli is looking"):
            seen = capture_by_sigrok(output, sigrok, schedule, seconds, looking)
        if json:
            as_json(seen.to_json())
            return
        print(f"{output}: {seen.seconds:g} s at {rate} samples a second")
        _say_next(output, against)
        return
    if port is None:
        raise InputError(
            "missing-option",
            "there is no analyser to look with",
            hint="--port /dev/ttyACM0, or --sigrok fx2lafw",
        )
    done = captured(output, port, schedule, seconds, looking, progress)
    if done.seen.unseen and seconds is None:
        looks = len(done.seen.records)
        text = f"{done.seen.unseen} of the loop's different frames were not seen whole in {looks} captures"
        warn(Diagnostic("warning", "frames-unseen", text, Location(str(output))))
    _tell(done, output, against, json)


def _tell(done: Captured, output: Path, against: Path | None, json: bool) -> None:
    if json:
        as_json(done.to_json())
        return
    print(f"{output}: {done.seconds:g} s at {int(done.plan.rate)} samples a second from {done.analyser.name}")
    if done.captures > 1:
        print(
            f"stitched of {done.captures} captures, as one holds {counted(done.plan.frames, 'frame')}; "
            "the time between two is not known"
        )
    _say_next(output, against)


def _say_next(output: Path, against: Path | None) -> None:
    if against is not None:
        print(f"next: servogen verify {output} --against {against}")
