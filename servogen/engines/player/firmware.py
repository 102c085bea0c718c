"""The C of the player, compiled, with the worst-case time between its pulses.

In: a motion as the player plays it, and a dialect. Out: the firmware, and the maximum number of cycles that
its C takes from the end of one slot until the kernel reads the timer for the next, over all paths of the
program's words.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

from servogen.compiler import WORDS_NEEDED, Options
from servogen.engines.firmware import Firmware, ResourceError, TimingBudget
from servogen.engines.fitting import compiled_to_fit
from servogen.engines.inputs import given
from servogen.engines.inputs.buttons import ControlButtons
from servogen.engines.inputs.wire import FrameWire
from servogen.engines.parts import part_texts
from servogen.engines.player import Playing, SlotLayout
from servogen.engines.player.rendering import OVERRUN, render_player
from servogen.engines.player.theorem import allowances
from servogen.engines.protocol import EngineJob
from servogen.engines.stored_script import Stored, in_eeprom, in_flash
from servogen.errors import Diagnostic, InputError
from servogen.pic.device import PROGRAM_WORDS
from servogen.pic.listing import Listing
from servogen.pic.wcet import TimedProgram

CHECK, DONE, WIDTHS, JOIN = "pl_check", "pl_done", "pl_between", "pl_wire"
"""Labels of the assembly: the kernel's reading of the timer, its end; the code that only runs between
frames; the wait for a quiet wire.
"""

HINT = "fewer parts: let more of the motion repeat"
"""The hint if the chip is too small."""


def compiled(job: EngineJob, played: Playing, dialect: str) -> Firmware:
    """Return the firmware in `dialect`, with its script in flash, or, if flash is too small, in the EEPROM.

    Raises ResourceError if the chip is too small for both.
    """
    script = played.encoded.script.data
    buttons = given(job.inputs, ControlButtons) or ControlButtons()
    parts = tuple(part_texts(job))

    def with_script(stored: Stored) -> Firmware:
        wire = given(job.inputs, FrameWire)
        text = render_player(played, stored, buttons, dialect, job.device, job.name, wire, parts)
        return replace(firmware(text, job, played.layout, dialect), script=stored)

    try:
        return with_script(in_flash(script))
    except ResourceError as error:
        stored = in_eeprom(script, len(played.order))
        needed = error.details.get(WORDS_NEEDED)
        # Even without the bytes that go to the EEPROM it is too large: not compiled again.
        if not isinstance(needed, int) or needed - len(stored.eeprom) > PROGRAM_WORDS:
            raise
        try:
            return with_script(stored)
        except ResourceError as larger:
            why = larger.__cause__
            assert isinstance(why, InputError)
            message = (
                f"{error.message}; with its script in the EEPROM, as far as it fits there, {why.message}"
            )
            refusal = ResourceError("does-not-fit", message, hint=HINT)
            refusal.details = error.details
            raise refusal from error


def firmware(text: str, job: EngineJob, layout: SlotLayout, dialect: str) -> Firmware:
    """Return a player's compiled C with its timing budgets. Raises ResourceError if the chip is too small."""
    file = f"main.{dialect}.c"
    options = Options(dialect=dialect, device=job.device)
    built = compiled_to_fit(text, file, options, job.name, "the player", HINT)
    budgets = timing_budgets(built.listing, layout)
    return Firmware(
        dialect,
        file,
        text,
        built,
        budgets,
        built.listing.variable(OVERRUN),
        tuple(cautions(budgets)),
    )


def timing_budgets(listing: Listing, layout: SlotLayout) -> tuple[TimingBudget, ...]:
    """Return the time that the C takes between two slots and between two frames, and the time it has."""
    program = TimedProgram(listing.words, listing.functions)
    maximum = partial(program.longest, listing.label(DONE), {listing.label(CHECK)})
    slots, frames = allowances(listing, layout)
    # What begins anew at the wire has no time that it must not exceed.
    anew = {listing.label(JOIN)} if layout.looking else set()
    return (
        TimingBudget(
            "two slots", maximum(without={listing.label(WIDTHS)} | anew), slots.same_edges, slots.late_is_seen
        ),
        TimingBudget("two frames", maximum(without=anew), frames.same_edges, frames.late_is_seen),
    )


def cautions(budgets: tuple[TimingBudget, ...]) -> Iterator[Diagnostic]:
    """Yield a warning for C that may take too long, even if the simulated motion is exact."""
    for budget in budgets:
        if budget.left is None:
            yield Diagnostic(
                "warning",
                "player-room",
                f"the worst-case time of the C between {budget.between} is not known",
            )
        elif budget.left < 0:
            yield Diagnostic(
                "warning",
                "player-room",
                f"the C between {budget.between} may take {budget.worst} cycles, "
                f"{-budget.left} more than it has",
            )
