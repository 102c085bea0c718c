"""The command `prove`: what holds for every path of a program, or that it follows a schedule."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.files import read_program
from servogen.cli.options import ClockHz, Json
from servogen.cli.prove_schedule import Request, prove_schedule
from servogen.cli.show import as_json
from servogen.errors import InputError
from servogen.programs import clock_of

if TYPE_CHECKING:
    from servogen.pic.analysis.facts import Answer

FOUND = 1
"""The exit code where something was found, or not decided."""


class Interrupts(StrEnum):
    """Whether the time of interrupts counts."""

    INCLUDED = "included"
    EXCLUDED = "excluded"


def register(app: typer.Typer) -> None:
    app.command()(prove)


def prove(
    file: Annotated[Path, typer.Argument(help="A HEX, C or assembly file.", show_default=False)],
    against: Annotated[
        Path | None,
        typer.Option("--against", help="Prove that it follows this schedule.json, for all inputs."),
    ] = None,
    certificate: Annotated[
        Path | None, typer.Option("--certificate", help="With --against: write what the proof found.")
    ] = None,
    counterexample: Annotated[
        Path,
        typer.Option("--counterexample", help="With --against: where the inputs of a wrong run are written."),
    ] = Path("counterexample.toml"),
    hold_inputs: Annotated[
        bool, typer.Option("--hold-inputs", help="With --against: the inputs stay as the schedule says.")
    ] = False,
    plain_tmr0: Annotated[
        bool,
        typer.Option(
            "--no-tmr0-phase", help="With --against: TMR0 counts at once after OPTION_REG is written."
        ),
    ] = False,
    max_states: Annotated[
        int | None, typer.Option("--max-states", min=1, help="With --against: give up after so many states.")
    ] = None,
    start: Annotated[
        list[str] | None,
        typer.Option(
            "--from",
            metavar="MARK",
            help="Where a time begins: an address (0x12A), a label, a function, a line (12 or main.c:12). "
            "Repeatable, with as many --to.",
        ),
    ] = None,
    end: Annotated[
        list[str] | None, typer.Option("--to", metavar="MARK", help="Where it ends, the first time after it.")
    ] = None,
    interrupts: Annotated[
        Interrupts, typer.Option("--interrupts", help="Whether times between marks include interrupts.")
    ] = Interrupts.INCLUDED,
    clock_hz: ClockHz = None,
    device: Annotated[
        str | None,
        typer.Option("--device", help="PIC16F84 or PIC16F84A (default: the schedule's, else PIC16F84)."),
    ] = None,
    json: Json = False,
) -> None:
    """Show what holds for every path of a program: stack, unwritten bytes, pins, dead code, watchdog, times.

    With --against: that every edge is the schedule's for every power-up, input and chip.

    Exit code 0: proven, or decided and nothing found; 1: something was found or is not decided.
    """
    if against is not None:
        if start or end or clock_hz is not None:
            raise InputError(
                "conflicting-options", "--from, --to and --clock-hz are for a program without --against"
            )
        request = Request(against, certificate, counterexample, not hold_inputs, not plain_tmr0, max_states)
        raise typer.Exit(prove_schedule(file, device, request, json))
    if certificate is not None or hold_inputs or plain_tmr0 or max_states is not None:
        raise InputError("conflicting-options", "this option needs --against")
    from servogen.pic.analysis.facts import Facts, decided_and_fine
    from servogen.pic.device import DEVICES

    marks = _marks(start or [], end or [])
    program = read_program(file, device or DEVICES[0].name)
    facts = Facts(program.image, program.listing, clock_of(program, clock_hz))
    answers = [
        *facts.answers(),
        *(facts.time(a, b, interrupts=interrupts is Interrupts.INCLUDED) for a, b in marks),
    ]
    if json:
        as_json({"file": str(file), "answers": [answer.to_json() for answer in answers]})
    else:
        print("\n".join(_text(answer) for answer in answers))
    if not decided_and_fine(answers):
        raise typer.Exit(FOUND)


def _marks(starts: list[str], ends: list[str]) -> list[tuple[str, str]]:
    """Return the pairs of --from and --to. Raises InputError."""
    if len(starts) != len(ends):
        raise InputError(
            "missing-option",
            f"{len(starts)} --from and {len(ends)} --to: every time needs both",
            hint="--from MARK --to MARK",
        )
    return list(zip(starts, ends, strict=True))


def _text(answer: Answer) -> str:
    lines = [f"{answer.question}: {answer.status}", f"  {answer.text}", f"  over {answer.over}"]
    return "\n".join([*lines, *(f"  {finding}" for finding in answer.findings)])
