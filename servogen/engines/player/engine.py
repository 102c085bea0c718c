"""The player of a job: planned, compiled, and the C between its pulses counted.

In: a job and a dialect. Out: the firmware, with the most cycles that its C takes from one slot's end to the
moment when the kernel looks at the timer for the next, counted from the program's words over all paths.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache, partial

from servogen.compiler import Options
from servogen.engines.firmware import Firmware, TimingBudget, compiled_to_fit
from servogen.engines.player import Layout, Playing, playing, soft_start
from servogen.engines.player.buttons import waited, waited_motion
from servogen.engines.player.rendering import OVERRUN, render_player
from servogen.engines.player.theorem import allowances
from servogen.engines.protocol import Engine, EngineJob, EnginePlan
from servogen.errors import Diagnostic
from servogen.motion import JointTrajectory
from servogen.pic.listing import Listing
from servogen.pic.wcet import Program

CHECK, DONE, WIDTHS = "pl_check", "pl_done", "pl_between"
"""Labels of the assembly: where the kernel reads the timer, its end, the part that runs only between two
frames.
"""

TITLE = "the player"
HINT = "fewer parts: let more of the motion repeat"
"""The hint if the chip is too small."""


def play(job: EngineJob) -> tuple[JointTrajectory, Playing]:
    """Return the motion with its lead-in, and how the player plays it. Raises InputError."""
    frames = round(job.firmware.soft_start_s / job.clock.seconds(job.trajectory.period))
    begun = soft_start(job.trajectory, job.servos, frames)
    soft = len(begun.angles) - len(job.trajectory.angles)
    played = playing(begun, job.servos, job.frame, soft)
    buttons = job.firmware.buttons
    waiting = waited(played.plan.schedule, buttons.waiting)
    schedule = replace(waiting, inputs=buttons.inputs, buttons=buttons.rule)
    plan = replace(played.plan, schedule=schedule)
    return waited_motion(begun, buttons.waiting), replace(played, plan=plan)


def compiled(job: EngineJob, played: Playing, dialect: str) -> Firmware:
    """Return the firmware in `dialect`. Raises ResourceError if the chip is too small."""
    text = render_player(played, job.firmware.buttons, dialect, job.device, job.name)
    return firmware(text, job, played.layout, dialect)


def firmware(text: str, job: EngineJob, layout: Layout, dialect: str) -> Firmware:
    """Return the compiled C of a player with its timing budgets. Raises ResourceError."""
    file = f"main.{dialect}.c"
    options = Options(dialect=dialect, device=job.device)
    compilation = compiled_to_fit(text, file, options, job.name, TITLE, HINT)
    budgets = timing_budgets(compilation.listing, layout)
    return Firmware(
        dialect,
        file,
        text,
        compilation,
        budgets,
        compilation.listing.variable(OVERRUN),
        tuple(cautions(budgets)),
    )


def timing_budgets(listing: Listing, layout: Layout) -> tuple[TimingBudget, ...]:
    """Return the timing budgets of the C between two slots and between two frames."""
    program = Program({row.address: row.word for row in listing.rows}, listing.functions)
    most = partial(program.longest, listing.label(DONE), {listing.label(CHECK)})
    slots, frames = allowances(listing, layout)
    return (
        TimingBudget(
            "two slots", most(without={listing.label(WIDTHS)}), slots.same_edges, slots.late_is_seen
        ),
        TimingBudget("two frames", most(), frames.same_edges, frames.late_is_seen),
    )


def cautions(budgets: tuple[TimingBudget, ...]) -> Iterator[Diagnostic]:
    """Yield a warning for C that may take too long: the simulated motion may be exact, another may not."""
    for budget in budgets:
        if budget.left is None:
            yield Diagnostic(
                "warning", "player-room", f"the C between {budget.between}: its longest time is not known"
            )
        elif budget.left < 0:
            yield Diagnostic(
                "warning",
                "player-room",
                f"the C between {budget.between} may take {budget.worst} cycles, "
                f"{-budget.left} more than it has",
            )


class PlayerEngine:
    """Plays keyframes from flash and interpolates on the chip."""

    title = TITLE

    def plan(self, job: EngineJob) -> EnginePlan:
        """Plan the job's frames; a dialect's C is compiled when its firmware is requested."""
        motion, played = play(job)
        make = cache(lambda dialect: compiled(job, played, dialect))
        return EnginePlan(motion, played.plan, make)


ENGINE: Engine = PlayerEngine()
