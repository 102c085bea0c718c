"""`Editor`: the job file of a page: checked while it is typed, saved, extended by poses, built and proven.

In: requests of a window with the text as it stands there. Out: answers, and after a build what is watched
from then on. Only this one file is ever read or written, whatever a request says.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from servogen.build.build import Build, build
from servogen.errors import Diagnostic, InputError, ServogenError
from servogen.inputs import read_input
from servogen.job import Job, PlannedJob, loads, plan_job
from servogen.outputs import write_text
from servogen.pic.image import to_hex
from servogen.plan_error import plan_words
from servogen.toml.edit import append_element
from servogen.watch.session import Message
from servogen.watch.subject import Setting, Subject, job_subject

DEGREES = 1
"""Decimals of a recorded angle."""
HOLD_S = 1
"""How long a recorded pose is held."""

Progress = Callable[[str], None]


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

    def handle(self, request: Mapping[str, Any], progress: Progress) -> tuple[Message, Subject | None]:
        """Do what a window asks for; return the answer and, after a build, the new subject."""
        text = str(request.get("text", ""))
        try:
            if request.get("do") == "record":
                return self._record(text, [float(angle) for angle in request["angles"]]), None
            job = plan_job(loads(text, str(self._path)))
            if request.get("do") == "check":
                return _checked((*job.warnings, *job.notes)), None
            write_text(self._path, text)
            if request.get("do") == "save":
                return {**_checked((*job.warnings, *job.notes)), "saved": True}, None
            return self._build(job, progress)
        except ServogenError as error:
            return _checked(error.diagnostics), None
        except (ValueError, TypeError, KeyError) as error:
            return {"is": "problem", "text": f"the request is wrong: {error}"}, None

    def _build(self, job: PlannedJob, progress: Progress) -> tuple[Message, Subject]:
        done = build(job, progress)
        return _built(done), job_subject(self._path, job, self._setting, progress)

    def _record(self, text: str, angles: list[float]) -> Message:
        """Return the text with one more pose: `angles` of the job's servos, in radians."""
        job = loads(text, str(self._path))
        if len(angles) != len(job.servos) or not all(map(math.isfinite, angles)):
            raise ValueError(f"{len(angles)} angles for {len(job.servos)} servos")
        element = _pose(job, angles)
        if "motion" in job.document.data:
            new = append_element(text, ("motion", "poses"), element)
        elif job.section is None:
            new = f"{text.rstrip()}\n\n[motion]\nposes = [\n    {element},\n]\n"
        else:
            raise InputError(
                "not-allowed",
                "this job does not move by poses: its servos follow another section",
                job.document.place("servo"),
            )
        return {"is": "editor", "name": self._path.name, "text": new, "saved": False}


def _pose(job: Job, angles: list[float]) -> str:
    """Return a pose as TOML writes it, each angle within its servo's limits."""
    parts = []
    for servo, angle in zip(job.servos, angles, strict=True):
        low, high = servo.limits
        degrees = round(math.degrees(min(max(angle, low), high)), DEGREES)
        parts.append(f"{servo.name}_deg = {degrees:g}")
    return f"{{ {', '.join(parts)}, hold_s = {HOLD_S} }}"


def _checked(diagnostics: tuple[Diagnostic, ...]) -> Message:
    """Return what is said of the text; it can be built if none of it is an error."""
    return {
        "is": "checked",
        "diagnostics": [diagnostic.to_json() for diagnostic in diagnostics],
        "good": all(diagnostic.severity != "error" for diagnostic in diagnostics),
    }


def _built(done: Build) -> Message:
    own = done.programs[0]
    return {
        "is": "built",
        "proven": done.proven,
        "frames": done.frames,
        "words": own.firmware.compilation.words,
        "distance": plan_words(done.plan.schedule.plan_error),
        "reasons": [reason for program in done.programs for reason in map(str, program.verdict.reasons)],
        "warnings": [warning.sentence for warning in done.warnings],
        "hex": to_hex(own.image),
        "hex_name": f"{done.job.name}.hex",
    }
