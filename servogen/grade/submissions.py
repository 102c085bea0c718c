"""Finds the programs to grade, the student of each, and the files that each may include.

In: the files and folders given to `servogen grade`. Out: `Submission`s. Programs come from strangers: a link
that leads out of the student's own folder, a pipe or a device is not opened.

    class/ana/main.c        level 1: each folder in class/ is one student's
    class/dan/src/main.c    includes what lies in class/dan/, nothing else
    class/eva.c             has no folder of its own and includes nothing
"""

from __future__ import annotations

import os
import stat
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

from servogen.errors import Diagnostic, InputError, Location

MAX_PROGRAMS = 200
MAX_FOLDERS = 1000
MAX_ENTRIES = 10_000
"""Limits per student: programs, folders, files in a folder; so that no student takes all the time."""


@dataclass(frozen=True, slots=True)
class Submission:
    """A program to grade. `name` is its path below the folder given."""

    name: str
    file: Path
    folder: Path | None
    """The student's own folder, without links in its path; None: the program has none."""
    given: bool = False
    """Whether the file itself was given rather than a folder that contains it; it may then be a link."""

    def require_readable(self) -> None:
        """Raise InputError if the program must not be opened."""
        if not self.given:
            _require_inside(self.file, self.folder or self.file.parent.resolve())
        if not _is_file(self.file):
            raise InputError(
                "unreadable-file", "cannot be read: there is no such file", Location(str(self.file))
            )

    def included(self, name: str, including: str, in_any_case: bool = False) -> Path | None:
        """Return the file that the file `including` includes as `name`; None if there is none.

        `in_any_case`: the name may be written in other capitals, as sources for DOS write it. Raises
        InputError if the file must not be included.
        """
        path = Path(including).parent / name
        if "\0" in name:
            return None
        if self.folder is not None:
            _require_inside(path, self.folder)
            if in_any_case and not _is_file(path):
                path = _in_any_case(path)
                _require_inside(path, self.folder)
            return path if _is_file(path) else None
        if not os.path.lexists(path):
            return None
        raise InputError(
            "include-refused",
            "is not included: other programs lie beside this one, so the file may be another student's",
            Location(str(path)),
            "give each student a folder of their own; --level 0: a folder given is one student's",
        )


@dataclass(slots=True)
class Submissions:
    """The programs to grade, a warning for each file and folder that is omitted, and an error for each path
    given that holds none.
    """

    submissions: list[Submission] = field(default_factory=list)
    warnings: list[Diagnostic] = field(default_factory=list)
    errors: list[Diagnostic] = field(default_factory=list)


def find_submissions(
    given: Sequence[Path], sources: Collection[str], images: Collection[str], level: int = 1
) -> Submissions:
    """Return the programs among the files and folders `given`, by their suffixes.

    Each folder `level` levels below a folder given is one student's; 0: the folder given itself is. A file of
    `images` (HEX) beside one of `sources` of the same name is omitted, because it was built from that source.
    A path that does not exist and a folder without a program are errors of the result, so that they do not
    keep the other programs from being graded. Raises InputError where there is no program at all.
    """
    result = Submissions()
    for path in given:
        absent = _why_absent(path)
        if absent is not None:
            result.errors.append(Diagnostic("error", "no-program", absent, Location(str(path))))
        elif path.is_dir():
            search = _Search(path, frozenset((*sources, *images)), level, result.warnings)
            programs = search.programs()
            if not programs:
                text = f"holds no program ({', '.join((*sources, *images))})"
                result.errors.append(Diagnostic("error", "no-program", text, Location(str(path))))
            result.submissions += _sources_first(programs, images, result.warnings)
        else:
            own = level == 0 or not _has_others(path, frozenset((*sources, *images)))
            folder = path.parent.resolve() if own else None
            result.submissions.append(Submission(path.name, path, folder, given=True))
    if not result.submissions:
        raise InputError.of(result.errors)
    count = Counter(submission.name for submission in result.submissions)
    named = (
        submission if count[submission.name] == 1 else replace(submission, name=submission.file.as_posix())
        for submission in result.submissions
    )
    result.submissions = list({submission.name: submission for submission in named}.values())
    return result


@dataclass(frozen=True, slots=True)
class _Search:
    """The search through one folder given."""

    folder: Path
    suffixes: frozenset[str]
    level: int
    warnings: list[Diagnostic]

    def programs(self) -> list[Submission]:
        """Return every program in the folder, by path."""
        above: list[Path] = []
        students = [self.folder]
        for _ in range(self.level):
            inside = [self._entries(folder, None) for folder in students]
            above += [file for files, _ in inside for file in files]
            students = [folder for _, folders in inside for folder in folders]
        submissions = []
        for student in students:
            warned = len(self.warnings)
            files = self._programs_in(student)
            if not (files or above or student.name.startswith(".") or len(self.warnings) > warned):
                self._warn(student, "not graded: it holds no program")
            submissions += [self._submission(file, student.resolve()) for file in files]
        alone = len(above) == 1 and not submissions
        submissions += [self._submission(file, self.folder.resolve() if alone else None) for file in above]
        return sorted(submissions, key=lambda submission: submission.file)

    def _warn(self, path: Path, text: str) -> None:
        self.warnings.append(Diagnostic("warning", "not-searched", text, Location(str(path))))

    def _submission(self, file: Path, owner: Path | None) -> Submission:
        return Submission(file.relative_to(self.folder).as_posix(), file, owner)

    def _programs_in(self, student: Path) -> list[Path]:
        """Return the programs in a student's folder, at any depth."""
        programs: list[Path] = []
        waiting, searched = [student], 0
        while waiting:
            if searched == MAX_FOLDERS:
                self._warn(student, f"only the first {MAX_FOLDERS} folders were searched")
                break
            files, folders = self._entries(waiting.pop(), MAX_ENTRIES)
            searched += 1
            programs += files
            waiting += reversed(folders)
        if len(programs) > MAX_PROGRAMS:
            self._warn(student, f"only the first {MAX_PROGRAMS} of {len(programs)} programs are graded")
        return programs[:MAX_PROGRAMS]

    def _entries(self, folder: Path, limit: int | None) -> tuple[list[Path], list[Path]]:
        """Return the programs and the folders directly in `folder`, by name."""
        try:
            with os.scandir(folder) as scan:
                entries = list(islice(scan, None if limit is None else limit + 1))
        except OSError as error:
            self._warn(folder, f"not searched: {error.strerror}")
            return [], []
        if limit is not None and len(entries) > limit:
            self._warn(folder, f"not searched: it holds more than {limit} files")
            return [], []
        files, folders = [], []
        for entry in sorted(entries, key=lambda item: item.name):
            path = folder / entry.name
            if entry.is_dir(follow_symlinks=False):
                folders.append(path)
            elif entry.is_symlink() and _leads_to_folder(path):
                self._warn(path, "not searched: it is a link to a folder")
            elif path.suffix.lower() in self.suffixes:
                files.append(path)
        return files, folders


def _sources_first(
    submissions: Sequence[Submission], images: Collection[str], warnings: list[Diagnostic]
) -> Iterator[Submission]:
    """Yield the programs, without images that lie beside a source of the same name."""
    sources = {
        submission.file.with_suffix("")
        for submission in submissions
        if submission.file.suffix.lower() not in images
    }
    for submission in submissions:
        if submission.file.suffix.lower() in images and submission.file.with_suffix("") in sources:
            text = "not graded, as its source lies beside it"
            warnings.append(Diagnostic("warning", "not-searched", text, Location(str(submission.file))))
        else:
            yield submission


def _why_absent(path: Path) -> str | None:
    """Return why there is nothing at `path` that could be opened; None if there is."""
    try:
        path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return "there is no such file or folder"
    except OSError as error:
        return f"cannot be read: {error.strerror}"
    return None


def _has_others(path: Path, suffixes: frozenset[str]) -> bool:
    """Return whether there are other programs beside `path` than itself under another suffix."""
    try:
        with os.scandir(path.parent) as entries:
            beside = [Path(entry.name) for entry in entries]
    except OSError:
        return True
    return any(other.suffix.lower() in suffixes and other.stem != path.stem for other in beside)


def _require_inside(path: Path, folder: Path) -> None:
    if not Path(os.path.realpath(path)).is_relative_to(folder):
        raise InputError("include-refused", "is outside the student's own folder", Location(str(path)))


def _is_file(path: Path) -> bool:
    """Return whether there is a regular file. Raises InputError if there is something else."""
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return False
    except OSError as error:
        raise InputError(
            "unreadable-file", f"cannot be read: {error.strerror}", Location(str(path))
        ) from error
    if not stat.S_ISREG(mode):
        raise InputError("not-a-file", "is not a regular file", Location(str(path)))
    return True


def _in_any_case(path: Path) -> Path:
    """Return the file beside `path` whose name differs only in capitals; `path` if there is none."""
    try:
        with os.scandir(path.parent) as entries:
            names = sorted(entry.name for entry in islice(entries, MAX_ENTRIES))
    except OSError:
        return path
    return next((path.with_name(name) for name in names if name.lower() == path.name.lower()), path)


def _leads_to_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except OSError:
        return False
