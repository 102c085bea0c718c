"""Proof for all time: the machine's complete state repeats, the schedule repeats, and both agree long enough.

In: a `PulseSchedule` and an `Image`. Out: a `Forever`: the verdict over a span after which nothing new can
happen, or the reason why there is no such span within reach.

    machine   ├ its lead-in ┤├──── its loop ────┤├──── its loop ────┤ …
    schedule  ├ lead-in ┤├─ loop ─┤├─ loop ─┤├─ loop ─┤├─ loop ─┤ …
    checked   ├ the longer lead-in ┤├ a common multiple of both loops ┤
"""

from __future__ import annotations

from dataclasses import dataclass
from math import lcm

from servogen.build.proof import prove_image
from servogen.edges import PINS
from servogen.engines.board import board_of, inputs_of
from servogen.pic.image import Image
from servogen.pic.listing import Listing
from servogen.plan_error import plan_words
from servogen.pulse import PulseSchedule
from servogen.pulse.expected import expected
from servogen.simulator import NoRepeat, Options, find_repeat
from servogen.units import Cycles
from servogen.verify import Verdict


@dataclass(frozen=True, slots=True)
class Forever:
    """`verdict` is over `lead_in` and `loop` frames; where `reason` is not empty, over the time looked at."""

    verdict: Verdict
    lead_in: int
    loop: int
    reason: str = ""

    @property
    def proven(self) -> bool:
        return self.verdict.proven and not self.reason

    def text(self) -> str:
        """One line: what is proven, or why not."""
        if self.proven:
            return (
                f"proven for all time: lead-in {self.lead_in} frames, loop {self.loop} frames; "
                f"0 cycles from the schedule; {plan_words(self.verdict.plan_error)}"
            )
        if self.reason:
            seconds = float(self.verdict.clock.seconds(self.verdict.span.compared))
            why = f"{self.reason}; covered {seconds:g} s"
        else:
            why = "the edges are not the schedule's"
        return f"NOT proven for all time: {why}; {plan_words(self.verdict.plan_error)}"

    def to_json(self) -> dict[str, object]:
        return {
            "proven_for_all_time": self.proven,
            "reason": self.reason,
            "lead_in_frames": self.lead_in,
            "loop_frames": self.loop,
            "verdict": self.verdict.to_json(),
        }


def prove_forever(
    schedule: PulseSchedule,
    image: Image,
    limit: Cycles,
    listing: Listing | None = None,
    options: Options = Options(),  # noqa: B008 - frozen
) -> Forever:
    """Looks for a repeat of the machine's state within `limit` cycles from reset, and checks all of it."""
    first = next(chunk for chunk in expected(schedule).chunks if len(chunk.cycle))
    found = find_repeat(
        image,
        schedule.clock,
        pin=int(first.pin[0]),
        limit=limit,
        period=schedule.period,
        options=board_of(schedule, options),
        stimulus=inputs_of(schedule),
    )
    if isinstance(found, NoRepeat):
        span = Cycles(max(found.covered, schedule.period))
        verdict = prove_image(schedule, image, span, listing, options)
        return Forever(verdict, 0, 0, found.reason.replace("the pin", PINS[int(first.pin[0])]))
    lead_in = max(found.lead_in_frames, schedule.lead_in_frames)
    loop = lcm(found.loop_frames, schedule.loop_frames)
    span = Cycles((lead_in + loop) * schedule.period)
    return Forever(prove_image(schedule, image, span, listing, options), lead_in, loop)
