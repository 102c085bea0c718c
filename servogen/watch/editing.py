"""`Editor`: the job file of a page: checked while it is typed, saved, extended by poses, built.

In: requests of a window with the text as it stands there. Out: answers, and after a build what is watched
from then on. A text is planned and built in a separate process, which ends as soon as nobody wants to know
any more: a text that was typed halfway may mean hours of motion. Only this one file is ever read or written,
whatever a request says.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from threading import Event
from typing import Any

from servogen.errors import Diagnostic, InputError, ServogenError
from servogen.inputs import read_input
from servogen.isolation import LimitExceeded, ProcessDied, Stopped, WorkLimits, run
from servogen.job import Job, PlannedJob, loads, plan_job
from servogen.job.schema import MotionTable
from servogen.outputs import write_text
from servogen.pic.image import to_hex
from servogen.plan_error import plan_text
from servogen.toml.edit import append_element, move_element, remove_element, set_in_element
from servogen.watch.motion import motion_runs, pose_lines
from servogen.watch.session import Message
from servogen.watch.subject import Setting, Subject, job_subject
from servogen.workflows.job_build import Build, build
from servogen.workflows.pair import PairBuild, build_pair

DEGREES, ROUNDING = 1, 1e-7
"""The number of decimals of a recorded angle in degrees, and of its last digit what rounding may be off."""
HOLD_S = 1
"""The time for which a recorded pose is held."""
POSES = ("motion", "poses")
TIMES = ("move_s", "hold_s", "pause_s")
SECONDS, MAX_S = 3, 100_000
"""The number of decimals of a pose's times in seconds, and the maximum time."""

LIMITS = WorkLimits(seconds=1800, memory_mb=1500, elapsed_s=7200, result_mb=64)
"""The limits of planning or building a text."""


class Editor:
    """The job file at `path`."""

    def __init__(self, path: Path, setting: Setting) -> None:
        self._path = path
        self._setting = setting

    def opened(self) -> Message:
        """Return the file's text, or why it cannot be read."""
        try:
            text = read_input(self._path).decode("utf-8-sig")
        except (ServogenError, UnicodeDecodeError) as error:
            return {"is": "problem", "text": str(error)}
        return {"is": "editor", "name": self._path.name, "text": text, "saved": True}

    def handle(self, request: Mapping[str, Any], stop: Event) -> tuple[Message, Subject | None]:
        """Do what a window asks for; return the answer and, after a build, the new subject.

        Ends early when another thread sets `stop`.
        """
        what, text, saved = request.get("do"), str(request.get("text", "")), False
        try:
            if what == "record":
                return self._record(text, [float(angle) for angle in request["angles"]]), None
            if what == "pose":
                return self._change(text, request), None
            found = run(partial(self._good_text, text), LIMITS, stop)
            if what == "check":
                return found, None
            changed = self._changed(text, request)
            if changed is not None:
                return changed, None
            write_text(self._path, text)
            saved = True
            if what == "save":
                return {**found, "saved": True}, None
            return run(partial(self._build, text), LIMITS, stop)
        except ServogenError as error:
            return {**_diagnostics_message(error.diagnostics), "failed": what in ("save", "build")}, None
        except Stopped:
            return {"is": "stopped", "saved": saved}, None
        except (LimitExceeded, ProcessDied) as error:
            return {"is": "problem", "text": f"the text of the job {error}", "about": what}, None
        except (ValueError, TypeError, KeyError, IndexError) as error:
            return {"is": "problem", "text": f"the request is wrong: {error}", "about": what}, None

    def _good_text(self, text: str) -> Message:
        return _good_text(plan_job(loads(text, str(self._path))))

    def _changed(self, text: str, request: Mapping[str, Any]) -> Message | None:
        """Return the file's text if it is neither what the window may overwrite nor what it would write."""
        there = self.opened()
        if there["is"] == "editor" and there["text"] not in (text, request.get("over")):
            return {**there, "is": "differs"}
        return None

    def _build(self, text: str) -> tuple[Message, Subject]:
        job = plan_job(loads(text, str(self._path)))
        answer = _pair_message(build_pair(job)) if job.chips else _build_message(build(job))
        return answer, job_subject(self._path, job, self._setting)

    def _record(self, text: str, angles: list[float]) -> Message:
        """Return the text with one more pose: `angles` of the job's servos, in radians."""
        job = loads(text, str(self._path))
        element = _pose(job, angles)
        if "motion" in job.document.data:
            new = _in_array(job, lambda: append_element(text, POSES, element))
        elif job.section is None:
            new = f"{text.rstrip()}\n\n[motion]\nposes = [\n    {element},\n]\n"
        else:
            raise InputError(
                "not-allowed",
                "this job does not move by poses: its servos follow another section",
                job.document.place("servo"),
            )
        return self._unsaved_text(new)

    def _change(self, text: str, request: Mapping[str, Any]) -> Message:
        """Return the text with one of its poses moved, removed, or with another time or other angles."""
        job = loads(text, str(self._path))
        kind, index = request["kind"], int(request["index"])
        if kind == "move":
            to = int(request["to"])
            new = _in_array(job, lambda: move_element(text, POSES, index, to))
        elif kind == "remove":
            new = _in_array(job, lambda: remove_element(text, POSES, index))
        elif kind == "time":
            key, seconds = str(request["key"]), _time(request["seconds"])
            if key not in TIMES:
                raise ValueError(f"'{key[:40]}' is not one of {', '.join(TIMES)}")
            new = _in_array(job, lambda: set_in_element(text, POSES, index, key, seconds))
        elif kind == "angles":
            new = text
            for name, degrees in _degrees(job, [float(angle) for angle in request["angles"]]):
                new = _in_array(job, partial(set_in_element, new, POSES, index, name, degrees))
        else:
            raise ValueError(f"'{str(kind)[:40]}' is not a change of a pose")
        return self._unsaved_text(new)

    def _unsaved_text(self, text: str) -> Message:
        return {"is": "editor", "name": self._path.name, "text": text, "saved": False}


def _in_array(job: Job, edit: Callable[[], str]) -> str:
    """Return the text that an edit of the job's poses makes. Raises InputError if they are not one array."""
    try:
        return edit()
    except KeyError as error:
        raise InputError(
            "not-allowed",
            "poses are changed here only where they are written as poses = [ { … }, { … } ]",
            job.document.place("motion"),
        ) from error


def _time(value: object) -> str | None:
    """Return seconds as TOML writes them; None stays None. Raises ValueError."""
    if value is None:
        return None
    seconds = round(float(str(value)), SECONDS)
    if not 0 <= seconds <= MAX_S:
        raise ValueError(f"{value} is not a time between 0 and {MAX_S} s")
    return f"{seconds:.10g}"  # MAX_S, and SECONDS decimals


def _degrees(job: Job, angles: Sequence[float]) -> Iterator[tuple[str, str]]:
    """Yield the key of each servo's angle in a pose, and the angle within the servo's limits."""
    if len(angles) != len(job.servos) or not all(map(math.isfinite, angles)):
        raise ValueError(f"{len(angles)} angles for {len(job.servos)} servos")
    for servo, angle in zip(job.servos, angles, strict=True):
        low, high = (math.degrees(limit) for limit in servo.limits)
        parts = 10.0**DEGREES
        # Limits are rounded inward: what is recorded at a limit can be built.
        least, most = math.ceil(low * parts - ROUNDING), math.floor(high * parts + ROUNDING)
        degrees = min(max(round(math.degrees(angle) * parts), least), most) / parts
        yield f"{servo.name}_deg", f"{degrees:g}"


def _pose(job: Job, angles: Sequence[float]) -> str:
    """Return a pose as TOML writes it."""
    parts = [f"{name} = {degrees}" for name, degrees in _degrees(job, angles)]
    return f"{{ {', '.join(parts)}, hold_s = {HOLD_S} }}"


def _good_text(job: PlannedJob) -> Message:
    """Return the diagnostics of a job that can be built, with its poses in seconds and radians."""
    tables = job.section.poses if isinstance(job.section, MotionTable) else ()
    poses = [
        {
            "name": table.name,
            "angles": pose.angles,
            "line": line,
            "lines": lines,
            **{key: None if (value := getattr(table, key)) is None else float(value) for key in TIMES},
        }
        for table, pose, (line, lines) in zip(tables, job.poses, pose_lines(job), strict=True)
    ]
    return {**_diagnostics_message((*job.warnings, *job.notes)), "poses": poses, "motion": motion_runs(job)}


def _diagnostics_message(diagnostics: tuple[Diagnostic, ...]) -> Message:
    """Return the diagnostics of the text; it can be built if none of them is an error."""
    return {
        "is": "checked",
        "diagnostics": [diagnostic.to_json() for diagnostic in diagnostics],
        "good": all(diagnostic.severity != "error" for diagnostic in diagnostics),
    }


def _build_message(result: Build) -> Message:
    own = result.programs[0]
    return {
        "is": "built",
        "exact": result.exact,
        "frames": result.frames,
        "words": own.firmware.compilation.words,
        "distance": plan_text(result.plan.schedule.plan_error),
        "reasons": [reason for program in result.programs for reason in map(str, program.verdict.reasons)],
        "warnings": [warning.sentence for warning in result.warnings],
        "files": {f"{result.job.name}.hex": to_hex(own.image)},
    }


def _pair_message(result: PairBuild) -> Message:
    parts = [_build_message(chip) for chip in result.chips]
    verdicts = result.verdicts.values()
    return {
        "is": "built",
        "exact": result.exact,
        "frames": parts[0]["frames"],
        "words": " and ".join(str(part["words"]) for part in parts),
        "distance": parts[0]["distance"],
        "reasons": [verdict.summary() for verdict in verdicts if not verdict.exact],
        "warnings": [warning for part in parts for warning in part["warnings"]],
        "files": {name: text for part in parts for name, text in part["files"].items()},
    }
