"""`servogen capture`: records the chip's pins."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from servogen.cli.files import read_any_schedule
from servogen.cli.options import Json, sampling_rate_option
from servogen.cli.show import as_json, next_step, progress, status, warn
from servogen.errors import Diagnostic, InputError, Location
from servogen.programs import is_built_pair, read_pair
from servogen.units import counted
from servogen.workflows.capture import Captured, CaptureSettings, capture_by_sigrok
from servogen.workflows.capture import capture as captured

DEFAULT_RATE = 1_000_000
"""Samples per second: one for each instruction cycle of a chip with a 4 MHz clock."""


@dataclass(frozen=True, slots=True)
class CaptureOptions:
    """The logic analyser, and how it is connected."""

    port: Annotated[
        str | None, typer.Option("--port", "-p", help="The analyser's serial port, such as /dev/ttyACM0.")
    ] = None
    sigrok: Annotated[
        str | None, "Capture through sigrok-cli with this driver, such as fx2lafw, to a .sr file."
    ] = None
    rate: Annotated[
        int | None,
        sampling_rate_option("Sampling rate in Hz (default: 1 MHz; with --sigrok less if it has to fit)."),
    ] = None
    rle: Annotated[
        bool,
        typer.Option("--rle/--no-rle", help="Let the analyser compress equal samples (run-length encoding)."),
    ] = True
    memory: Annotated[
        int | None, typer.Option(min=8, help="The analyser's memory in bytes, if it does not report it.")
    ] = None
    trigger: Annotated[str | None, "Start when this pin rises (default: the first servo's)."] = None
    wire: Annotated[
        list[str] | None,
        "CHANNEL=PIN, such as 0=RB3 (default: 0 to 7 are RB0 to RB7, 8 to 12 are RA0 to RA4).",
    ] = None
    stitch: Annotated[
        bool,
        typer.Option(
            "--stitch/--no-stitch",
            help="With --against: join several captures of whole frames if one is too short.",
        ),
    ] = True


def capture(
    output: Annotated[Path, typer.Option("--output", "-o", help="The capture to write (.vcd).")],
    analyser: CaptureOptions,
    against: Annotated[
        Path | None,
        "The job, build or schedule.json that the program follows: it names the servos and sets "
        "the duration.",
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(min=0.001, help="Duration (default: one loop of --against, or 1 s).")
    ] = None,
    json: Json = False,
) -> None:
    """Record the chip's pins with a logic analyser that speaks SUMP (Logic Sniffer, Bus Pirate, …)."""
    schedule, second = None, None
    if against is not None and is_built_pair(against):
        schedule, second = read_pair(against)[0]
    elif against is not None:
        schedule = read_any_schedule(against)
    looking = CaptureSettings(
        rate=analyser.rate or DEFAULT_RATE,
        fixed_rate=analyser.rate is not None,
        rle=analyser.rle,
        memory=analyser.memory,
        trigger=analyser.trigger,
        wire=analyser.wire or (),
        stitch=analyser.stitch,
    )
    if analyser.sigrok is not None:
        with status("capturing with sigrok-cli"):
            seen = capture_by_sigrok(output, analyser.sigrok, schedule, seconds, looking)
        if seen.shortage is not None:
            hint = "an analyser with more memory, fewer channels or a lower --rate"
            warn(Diagnostic("warning", "short-capture", seen.shortage, Location(str(output)), hint))
        if json:
            as_json(seen.to_json())
            return
        print(f"{output}: {seen.seconds:g} s at {int(seen.rate)} samples a second")
        _suggest_verify(output, against)
        return
    if analyser.port is None:
        raise InputError(
            "missing-option",
            "no analyser is given",
            hint="--port /dev/ttyACM0, or --sigrok fx2lafw",
        )
    recorded = captured(output, analyser.port, schedule, seconds, looking, progress, second)
    if recorded.seen.unseen and seconds is None and second is None:
        looks = len(recorded.seen.records)
        text = (
            f"{recorded.seen.unseen} of the loop's different frames were not seen whole in {looks} captures"
        )
        warn(Diagnostic("warning", "frames-unseen", text, Location(str(output))))
    _show_capture(recorded, output, against, json)


def _show_capture(recorded: Captured, output: Path, against: Path | None, json: bool) -> None:
    if json:
        as_json(recorded.to_json())
        return
    print(
        f"{output}: {recorded.seconds:g} s at {int(recorded.plan.rate)} samples a second "
        f"from {recorded.analyser.name}"
    )
    if recorded.captures > 1:
        print(
            f"stitched from {recorded.captures} captures, because one holds "
            f"{counted(recorded.plan.frames, 'frame')}; the time between two is not known"
        )
    _suggest_verify(output, against)


def _suggest_verify(output: Path, against: Path | None) -> None:
    print(next_step("verify", output, "--against", against) if against else next_step("measure", output))
