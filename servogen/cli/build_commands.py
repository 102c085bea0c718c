"""Commands that build jobs: build, demo."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.options import JobFile, Json
from servogen.cli.show import as_json, print_lines, status, table, warn_of_all
from servogen.cli.widths import width_table
from servogen.engines.firmware import ResourceError
from servogen.errors import Diagnostic, InputError
from servogen.isolation import WorkLimits, each_here, run_each
from servogen.job import PlannedJob, load, plan_job
from servogen.pic.device import PROGRAM_WORDS, RAM_BYTES
from servogen.plan_error import plan_text
from servogen.report.text import timing_budgets_text
from servogen.units import counted
from servogen.workflows.certificates import (
    CertificateVerdict,
    beside,
    check_file,
    find_verdict,
    prove_unless_kept,
)
from servogen.workflows.job_build import Build, hex_name, program_facts, write
from servogen.workflows.job_build import build as built
from servogen.workflows.pair import build_pair, write_pair

if TYPE_CHECKING:
    from servogen.answers import BuildAnswer

BUILDING = WorkLimits(seconds=3600.0, memory_mb=8000, result_mb=256, open_files=256)
"""The limits for building one of several jobs: the user's own, so that they only end what hangs."""

_Made = tuple[Build, Sequence[CertificateVerdict]]

SHOWN_FIRST = "hexapod-tripod"
"""The job that is proposed after a demo: the one that moves most."""


def build(
    job: JobFile,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="The folder to write to (default: build/ and the job's name)."),
    ] = None,
    prove: Annotated[
        bool, "Also prove each program for every power-up, input and chip; may take minutes."
    ] = False,
    json: Json = False,
) -> None:
    """Build a job's firmware in every dialect, run it, compare every edge, and show what is proven of it.

    Exit code 1 if a program is not exact or, with --prove, not proven and checked.
    """
    loaded = plan_job(load(job))
    folder = output or Path("build") / loaded.name
    if loaded.chips:
        raise typer.Exit(_build_pair(loaded, folder, prove, json))
    with status(f"{loaded.name}: planning") as tell:
        result = built(loaded, lambda step: tell(f"{loaded.name}: {step}"))
        write(result, folder)
        theorems = _theorems(result, folder, None, prove, tell)
    if json:
        as_json(_build_to_json(result, folder, theorems), result.warnings)
    else:
        width_table(result.plan.widths, "report.txt")
        _program_table(result, theorems)
        print_lines(timing_budgets_text(program_facts(result), result.job.clock))
        plan = plan_text(result.plan.schedule.plan_error)
        print_lines(
            [f"{folder}: {'exact' if result.exact else 'NOT EXACT'}; {plan}; all of it in report.txt"]
        )
        print_lines(_theorem_lines(result, folder, theorems))
        print(f"next: servogen watch {job}, or servogen flash {folder / 'main.hex'}")
    warn_of_all(result.warnings)
    proven = all(verdict.valid or (verdict.missing and not prove) for verdict in theorems)
    raise typer.Exit(0 if result.exact and proven else 1)


def _build_pair(job: PlannedJob, folder: Path, prove: bool, json: bool) -> int:
    """Build both chips of a job and return the exit code."""
    with status(f"{job.name}: planning") as tell:
        result = build_pair(job, lambda step: tell(f"{job.name}: {step}"))
        write_pair(result, folder)
        proofs = result.proofs() if prove else {}
    if json:
        proven = {"proofs": {dialect: proof.to_json() for dialect, proof in proofs.items()}} if prove else {}
        as_json({"folder": str(folder), **result.to_json(), **proven}, job.warnings)
    else:
        print_lines(result.lines(folder))
        print_lines(f"{dialect}: {proof.summary()}" for dialect, proof in proofs.items())
        print(f"next: servogen {'verify' if prove else 'prove'} {folder}")
    warn_of_all(job.warnings)
    return 0 if result.exact and all(proof.checked for proof in proofs.values()) else 1


def demo(
    jobs: Annotated[list[Path], typer.Argument(help="Job files.", show_default=False)],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="The folder in which each job gets its own.")
    ] = Path("build"),
    certificates: Annotated[
        Path | None,
        "The folder of the certificates (JOB/main.cert.xz) that show what is proven "
        "(default: beside each HEX file, or in the cache).",
    ] = None,
    prove: Annotated[bool, "Prove what has no certificate yet, and write it; takes minutes."] = False,
    json: Json = False,
) -> None:
    """Build several jobs, each into its own folder, and print one table: what is exact, and what is proven.

    Exit code 1 if a program is not exact, a certificate is refused, or, with --prove, one is not proven.
    """
    with status("reading") as tell:
        shown = _Demo.of(jobs, output, certificates, prove, tell)
    if json:
        as_json({"jobs": shown.to_json()}, shown.diagnostics)
    else:
        _show_demo(shown)
    raise typer.Exit(InputError.exit_code if shown.unread else 0 if shown.fine else 1)


@dataclass(frozen=True, slots=True)
class _Demo:
    """The jobs that were built, and why the others were not."""

    output: Path
    built: list[tuple[Path, Build, Sequence[CertificateVerdict]]]
    """Of each job that fits: its file, its build, and what is proven of its programs."""
    refused: list[Diagnostic]
    """The jobs that do not fit."""
    unread: list[InputError]
    """The jobs with a mistake, which do not stop the others."""
    proves: bool = False
    """Whether every program must be proven."""

    @staticmethod
    def of(
        jobs: Sequence[Path], output: Path, proofs: Path | None, prove: bool, tell: Callable[[str], None]
    ) -> _Demo:
        """Build jobs into folders of `output`; their certificates are in `proofs`, or where they are kept."""
        made: dict[int, _Made | Exception] = {}
        total, at_once = counted(len(jobs), "job"), min(os.cpu_count() or 1, len(jobs))
        # The steps of several jobs at a time would be those of none.
        step = tell if at_once == 1 else lambda text: None
        works = [partial(_build_and_prove, job, output, proofs, not prove, step) for job in jobs]
        tell(f"0 of {total} built")
        for index, result in run_each(works, BUILDING, at_once) if at_once > 1 else each_here(works):
            made[index] = result
            tell(f"{len(made)} of {total} built")
        shown = _Demo(output, [], [], [], prove)
        for index, job in enumerate(jobs):
            match made[index]:
                case ResourceError() as error:
                    shown.refused.append(error.first)
                case InputError() as error:
                    shown.unread.append(error)
                case Exception() as error:
                    raise error
                case build, verdicts:
                    folder = output / build.job.name
                    write(build, folder)
                    if prove:
                        verdicts = _theorems(build, folder, proofs, prove, tell)
                    shown.built.append((job, build, verdicts))
        return shown

    @property
    def fine(self) -> bool:
        """Return whether every program is exact, and no certificate is refused."""
        return all(
            result.exact
            and all(verdict.valid or (verdict.missing and not self.proves) for verdict in verdicts)
            for _, result, verdicts in self.built
        )

    @property
    def diagnostics(self) -> Sequence[Diagnostic]:
        warnings = [warning for _, result, _ in self.built for warning in result.warnings]
        errors = [diagnostic for error in self.unread for diagnostic in error.diagnostics]
        return (*warnings, *self.refused, *errors)

    def to_json(self) -> list[BuildAnswer]:
        return [
            _build_to_json(result, self.output / result.job.name, verdicts)
            for _, result, verdicts in self.built
        ]


def _build_and_prove(
    file: Path, output: Path, certificates: Path | None, checks: bool, tell: Callable[[str], None]
) -> _Made:
    """Return a job's build and, if it `checks`, what is known of its programs. Raises what `build` raises."""
    job = plan_job(load(file))
    result = built(job, lambda step: tell(f"{job.name}: {step}"))
    return result, _theorems(result, output / job.name, certificates, False, tell) if checks else []


def _show_demo(shown: _Demo) -> None:
    """Print what was built, what was not, what that shows, and what to type next."""
    _demo_table([(result, verdicts) for _, result, verdicts in shown.built])
    for refusal in shown.refused:
        print(refusal.message)
    for _, result, _ in shown.built:
        if result.warnings:
            print(f"{result.job.name}: {counted(len(result.warnings), 'warning')} in its report.txt")
    if shown.built:
        programs = [program for _, result, _ in shown.built for program in result.programs]
        exact = sum(program.exact for program in programs)
        proven = sum(verdict.valid for _, _, verdicts in shown.built for verdict in verdicts)
        jobs = f"{counted(len(shown.built), 'job')}, {counted(len(programs), 'program')} in {shown.output}/"
        print_lines([f"{jobs}: {exact} exact in one run, {proven} proven for every power-up, input and chip"])
        files = [job for job, _, _ in shown.built]
        print(f"next: servogen watch {next((job for job in files if job.stem == SHOWN_FIRST), files[0])}")
    for error in shown.unread:
        print(error, file=sys.stderr)


def _demo_table(rows: Sequence[tuple[Build, Sequence[CertificateVerdict]]]) -> None:
    """Print a row for each job, whose dialects' programs differ in size only, unless it says otherwise."""

    def of_each(result: Build, words: Sequence[str]) -> str:
        if len(set(words)) == 1:
            return words[0]
        named = zip((program.firmware.dialect for program in result.programs), words, strict=True)
        return "; ".join(f"{dialect}: {word}" for dialect, word in named)

    table(
        "Jobs",
        ("job", "one run", "all runs", "from the plan", "engine", "words", "frames"),
        [
            (
                result.job.name,
                of_each(result, ["exact" if program.exact else "NOT EXACT" for program in result.programs]),
                of_each(result, [verdict.text for verdict in verdicts]),
                _from_plan(result),
                result.engine,
                max(program.firmware.compilation.words for program in result.programs),
                result.frames,
            )
            for result, verdicts in rows
        ],
        least=("frames", "words", "engine"),
    )


def _from_plan(result: Build) -> str:
    error = result.plan.schedule.plan_error
    return "?" if error is None else error.text()


def _theorems(
    result: Build, folder: Path, certificates: Path | None, prove: bool, tell: Callable[[str], None]
) -> list[CertificateVerdict]:
    """Return what is known of each program for every power-up, input and chip.

    That is what the checker says of its certificate in `certificates`, if given, or beside its HEX file in
    `folder`, or in the user's cache; or, with `prove`, of a proof that is made now. Raises InputError.
    """
    verdicts = []
    schedule = result.plan.schedule
    for program in result.programs:
        name, image = hex_name(result, program), program.image
        tell(f"{result.job.name}: {'proving' if prove else 'checking a proof of'} {program.firmware.dialect}")
        job = folder if certificates is None else certificates / result.job.name
        file = beside(job / name)
        if prove:
            verdicts.append(prove_unless_kept(file, image, schedule))
        elif certificates is not None:
            verdicts.append(check_file(file, image, schedule))
        else:
            verdicts.append(find_verdict([file], image, schedule))
    return verdicts


def _theorem_lines(result: Build, folder: Path, theorems: Sequence[CertificateVerdict]) -> Iterator[str]:
    """Yield what is proven of a build's programs, and the command that proves the others."""
    names = [hex_name(result, program) for program in result.programs]
    rows = sorted(zip(theorems, names, strict=True), key=lambda row: (not row[0].valid, row[0].text))
    for verdict, group in groupby(rows, key=lambda row: row[0]):
        files = [name for _, name in group]
        words = ["servogen", "prove", str(folder / files[0]), "--against", str(folder / "schedule.json")]
        how = f": {shlex.join(words)}, or build with --prove" if verdict.missing else ""
        yield f"every power-up, input and chip: {', '.join(files)}: {verdict.text}{how}"


def _program_table(result: Build, theorems: Sequence[CertificateVerdict]) -> None:
    table(
        f"Programs: engine {result.engine}, {counted(result.frames, 'frame')} compared",
        (
            *("dialect", "one run", "all runs", "worst edge error", "from the plan"),
            *("words", "words left", "RAM", "RAM left"),
        ),
        [
            (
                program.firmware.dialect,
                "exact" if program.exact else "NOT EXACT",
                verdict.text,
                f"{program.verdict.worst_edge_error} cycles",
                "?" if program.verdict.plan_error is None else program.verdict.plan_error.text(),
                program.firmware.compilation.words,
                PROGRAM_WORDS - program.firmware.compilation.words,
                program.firmware.compilation.ram_bytes,
                RAM_BYTES - program.firmware.compilation.ram_bytes,
            )
            for program, verdict in zip(result.programs, theorems, strict=True)
        ],
        least=("from the plan",),
    )


def _build_to_json(result: Build, folder: Path, theorems: Sequence[CertificateVerdict]) -> BuildAnswer:
    return {
        "folder": str(folder),
        **result.to_json(),
        "proven": all(verdict.valid for verdict in theorems),
        "all_runs": [verdict.text for verdict in theorems],
    }
