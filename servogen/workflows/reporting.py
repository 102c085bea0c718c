"""From a job to its HTML page: builds the job, records its edges, compares a capture with its plan.

In: a planned job, optionally a capture. Out: the page and its verdicts. If no engine can hold the motion, the
page shows only the plan.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from servogen.edges import EdgeTrace
from servogen.engines.firmware import ResourceError
from servogen.errors import Diagnostic
from servogen.job import PlannedJob
from servogen.plan_error import PlanError
from servogen.pulse import PulsePlan, PulseSchedule, plan
from servogen.report.html import CaptureFacts, PageFacts, html_page
from servogen.traces.captures import Capture, is_capture, read_capture, sampled_at
from servogen.traces.vcd import read_vcd
from servogen.twin import TwinVerdict
from servogen.twin.pictures import page_facts
from servogen.verify import CaptureVerdict
from servogen.verify.capture.check import split
from servogen.workflows.certificates import beside as certificate_of
from servogen.workflows.certificates import find_verdict
from servogen.workflows.engines import with_end_error
from servogen.workflows.job_build import Build, Progress, build, hex_name, program_facts
from servogen.workflows.twinning import twin_of_build
from servogen.workflows.verification import hidden_by, judge_capture, judge_file, motion_cycles

if TYPE_CHECKING:
    from servogen.answers import ReportFactsAnswer


@dataclass(frozen=True, slots=True)
class ReportPage:
    """A page, whether all programs' edges are exact and, if no program was built, the reason."""

    html: str
    programs_exact: bool
    not_built: Diagnostic | None
    plan_error: PlanError | None = None
    capture: CaptureVerdict | None = None
    twin: TwinVerdict | None = None

    def to_json(self) -> ReportFactsAnswer:
        """Return the verdicts, without the page itself."""
        return {
            "exact": self.programs_exact,
            "plan_error": self.plan_error.to_json() if self.plan_error else None,
            "capture": self.capture.to_json() if self.capture else None,
            "twin": self.twin.to_json() if self.twin else None,
        }


def build_page(
    job: PlannedJob,
    capture: Path | None = None,
    progress: Progress = lambda step: None,
    rate: int | None = None,
    twin: bool = False,
    wires: Mapping[str, str] | None = None,
) -> ReportPage:
    """Build the job and return its page; `rate` is a capture's samples per second. Raises InputError.

    With `twin` the page shows what the robot does in the physics; raises ToolError if MuJoCo is missing.
    """
    try:
        result = build(job, progress)
    except ResourceError as error:
        planned = with_end_error(job, plan(job.trajectory, job.servos, job.frame))
        beside = capture_facts(planned.schedule, capture, rate, wires) if capture else None
        facts = PageFacts(
            job, planned, (*job.warnings, *planned.warnings), capture=beside, not_built=error.message
        )
        seen = beside.verdict if beside else None
        return ReportPage(
            html=html_page(facts),
            programs_exact=False,
            not_built=error.first,
            plan_error=planned.schedule.plan_error,
            capture=seen,
        )
    moved = None
    if twin:
        progress("moving the robot")
        moved = twin_of_build(job, result)
    progress("checking a proof")
    theorem = _theorem(result)
    progress("writing the page")
    beside = capture_facts(result.plan.schedule, capture, rate, wires) if capture else None
    seen = beside.verdict if beside else None
    facts = replace(_facts(result, beside), twin=page_facts(moved) if moved else None, theorem=theorem)
    return ReportPage(
        html=html_page(facts),
        programs_exact=result.exact,
        not_built=None,
        plan_error=result.plan.schedule.plan_error,
        capture=seen,
        twin=moved,
    )


def _theorem(result: Build) -> str:
    """Return what is proven of the job's own program, if one run of it is exact."""
    own = result.programs[0]
    if not own.exact:
        return ""
    file = Path("build") / result.job.name / hex_name(result, own)
    verdict = find_verdict([certificate_of(file)], own.image, result.plan.schedule)
    return f"one run: exact; {verdict.sentence}"


def _facts(result: Build, capture: CaptureFacts | None) -> PageFacts:
    own = result.programs[0]
    return PageFacts(
        job=result.job,
        plan=result.plan,
        warnings=result.warnings,
        programs=program_facts(result),
        listing=own.firmware.compilation.listing,
        trace=_once(result.plan, result),
        capture=capture,
    )


def _once(planned: PulsePlan, result: Build) -> EdgeTrace:
    """Return the edges of the job's own program for one pass of the motion."""
    schedule, edges = planned.schedule, result.programs[0].edges
    assert edges is not None
    return edges.until(schedule.run_cycles(motion_cycles(schedule))).stored()


def capture_facts(
    schedule: PulseSchedule,
    path: Path,
    rate: int | None = None,
    wires: Mapping[str, str] | None = None,
) -> CaptureFacts:
    """Return the facts shown about a capture; of several in one file the longest, because its time is
    known.
    """
    capture = read_capture(path, wires)
    if rate is not None:
        capture = sampled_at(capture, rate)
    capture = replace(capture, trace=capture.trace.stored())
    verdict = verdict_on(schedule, capture, path, wires)
    if not verdict.pieces:
        return CaptureFacts(path.name, capture.trace, verdict)
    longest = max(range(len(verdict.pieces)), key=lambda number: verdict.pieces[number].frames)
    name = f"{path.name}, piece {longest + 1} of {len(verdict.pieces)}"
    trace = tuple(split(capture.trace, capture.pieces))[longest]
    return CaptureFacts(name, trace, replace(verdict, first_frame=verdict.pieces[longest].first_frame))


def verdict_on(
    schedule: PulseSchedule, capture: Capture, path: Path, wires: Mapping[str, str] | None
) -> CaptureVerdict:
    """Return the verdict on a capture; edges in cycles of a chip are additionally compared cycle by cycle."""
    verdict = judge_capture(schedule, capture)
    if is_capture(path):
        return verdict
    hidden = hidden_by(path, schedule.clock, wires)
    trace = read_vcd(path, schedule.clock, wires=wires)
    exact = judge_file(schedule, trace, tells_end=True, hidden=hidden)
    return verdict if exact.agrees and not hidden else verdict.but(exact.reasons[0])
