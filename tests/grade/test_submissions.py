"""A student's program includes only regular files of the student's own; what lies elsewhere stays unread."""

import errno
import os
import socket
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import pytest

from servogen.cli.grade_commands import IMAGES, SOURCES
from servogen.errors import Diagnostic, InputError, Location
from servogen.grade import Submission, find_submissions, load_lab, submissions
from servogen.grade.submissions import Submissions
from servogen.isolation import WorkLimits
from servogen.programs import read_submission
from servogen.workflows.grading import GradingTask, grade_submissions

PROGRAMS = Path(__file__).parent / "programs"
SOLUTION = (PROGRAMS / "lab8-right" / "delays.c").read_text()
ASSEMBLY_SOLUTION = (PROGRAMS / "lab8-right" / "timer.asm").read_text()
OUTSIDE = "is outside the student's own folder"
NOT_REGULAR = "is not a regular file"


def find(*given: Path, level: int = 1) -> Submissions:
    return find_submissions(given, SOURCES, IMAGES, level)


def names(found: Submissions) -> list[str]:
    return [each.name for each in found.submissions]


def compiled(submission: Submission) -> NoReturn:
    """As servogen reads; what is read is not run as well."""
    read_submission(submission)
    raise InputError("compiled", "it is compiled")


def reasons(*given: Path, level: int = 1, only: str = "") -> dict[str, str]:
    """Name of each program, or of that one only -> why it cannot be compiled; empty where it can."""
    task = GradingTask(load_lab("lab8-exercise"), compiled, WorkLimits(seconds=5, elapsed_s=100))
    found = [each for each in find(*given, level=level).submissions if each.name == only or not only]
    graded = grade_submissions(found, task)
    assert not any(each.defect for each in graded)
    why = {each.submission.name: "\n".join(each.grade.reasons) for each in graded}
    return {name: "" if "it is compiled" in reason else reason for name, reason in why.items()}


@pytest.fixture
def classroom(tmp_path: Path) -> Path:
    """Dan has solved the exercise in C, Eva in assembly; the teacher's solution lies beside the class."""
    for path, text in (
        ("secret/solution.c", SOLUTION),
        ("secret/solution.asm", ASSEMBLY_SOLUTION),
        ("class/dan/main.c", SOLUTION),
        ("class/eva/main.asm", ASSEMBLY_SOLUTION),
    ):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    (tmp_path / "class" / "ana").mkdir()
    return tmp_path / "class"


def reason_of_ana(classroom: Path, text: str, file: str = "main.c") -> str:
    (classroom / "ana" / file).parent.mkdir(exist_ok=True)
    (classroom / "ana" / file).write_text(text)
    return reasons(classroom, only=f"ana/{file}")[f"ana/{file}"]


@pytest.mark.parametrize(
    "name",
    [
        "../../secret/solution.c",
        "../dan/main.c",
        "..//./dan/../dan/main.c",
        "/etc/passwd",
        "/dev/stdin",
        "/dev/zero",
        "/proc/self/environ",
        "/proc/self/fd/0",
        "../nothing-there.c",
    ],
)
def test_nothing_outside_is_included_and_not_even_looked_for(classroom: Path, name: str) -> None:
    reason = reason_of_ana(classroom, f'#include "{name}"\n')
    assert f"main.c:1:1: error: include file '{name}' {OUTSIDE}" in reason
    assert "root:" not in reason


def test_an_absolute_path_from_a_macro_is_refused(classroom: Path) -> None:
    secret = classroom.parent / "secret" / "solution.c"
    assert OUTSIDE in reason_of_ana(classroom, f'#define FILE "{secret}"\n#include FILE\n')


@pytest.mark.parametrize(
    "name",
    ["../../secret/solution.asm", "../eva/main.asm", "..\\eva\\MAIN.ASM", "/etc/passwd", "/dev/stdin"],
)
def test_assembly_includes_nothing_outside(classroom: Path, name: str) -> None:
    reason = reason_of_ana(classroom, f'  include "{name}"\n  end\n', "main.asm")
    assert "main.asm:1:" in reason
    assert OUTSIDE in reason


def test_a_link_out_of_the_folder_is_not_followed(classroom: Path) -> None:
    (classroom / "ana" / "lib.h").symlink_to(classroom / "dan" / "main.c")
    (classroom / "ana" / "far").symlink_to(classroom / "dan")
    assert OUTSIDE in reason_of_ana(classroom, '#include "lib.h"\n')
    assert OUTSIDE in reason_of_ana(classroom, '#include "far/main.c"\n')


def test_a_program_that_is_a_link_out_of_the_folder_is_not_read(classroom: Path) -> None:
    (classroom / "ana" / "main.c").symlink_to("../dan/main.c")
    assert OUTSIDE in reasons(classroom, only="ana/main.c")["ana/main.c"]


def test_a_header_of_ones_own_may_not_lead_outside_either(classroom: Path) -> None:
    (classroom / "ana" / "lib.h").write_text('#include "../dan/main.c"\n')
    reason = reason_of_ana(classroom, '#include "lib.h"\n')
    assert "lib.h:1:1: error: include file '../dan/main.c' is outside" in reason


def test_ones_own_files_are_included(classroom: Path) -> None:
    """From a folder above, through a link within the student's folder, and in other capitals in assembly."""
    (classroom / "ana" / "inc").mkdir()
    (classroom / "ana" / "inc" / "delays.h").write_text(SOLUTION)
    (classroom / "ana" / "link.h").symlink_to("inc/delays.h")
    (classroom / "ana" / "timer.inc").write_text(ASSEMBLY_SOLUTION)
    assert reason_of_ana(classroom, '#include "../inc/delays.h"\n', "src/main.c") == ""
    assert reason_of_ana(classroom, '#include "link.h"\n') == ""
    assert reason_of_ana(classroom, '  include "TIMER.INC"\n', "main.asm") == ""


def fifo(path: Path) -> None:
    os.mkfifo(path)


def unix_socket(path: Path) -> None:
    here = Path.cwd()
    os.chdir(path.parent)  # a socket's path has at most 107 bytes
    try:
        with socket.socket(socket.AF_UNIX) as made:
            made.bind(path.name)
    finally:
        os.chdir(here)


@pytest.mark.parametrize(
    "make",
    [fifo, unix_socket, Path.mkdir, lambda path: path.symlink_to(path)],
    ids=["fifo", "socket", "dir", "loop"],
)
def test_only_regular_files_are_included(classroom: Path, make: Callable[[Path], None]) -> None:
    make(classroom / "ana" / "odd.h")
    reason = reason_of_ana(classroom, '#include "odd.h"\n')
    assert NOT_REGULAR in reason or "cannot be read" in reason


def test_programs_that_are_not_files_have_their_lines(classroom: Path) -> None:
    fifo(classroom / "ana" / "main.c")
    unix_socket(classroom / "ana" / "socket.c")
    (classroom / "ana" / "link.c").symlink_to("gone.c")
    found = reasons(classroom)
    for name in ("main.c", "socket.c", "link.c"):
        reason = found[f"ana/{name}"]
        assert NOT_REGULAR in reason or "there is no such file" in reason
    assert (found["dan/main.c"], found["eva/main.asm"]) == ("", "")


def test_a_name_with_a_nul_is_not_found(classroom: Path) -> None:
    assert "was not found" in reason_of_ana(classroom, '#include "a\0b.h"\n')


def test_a_name_longer_than_names_may_be_is_refused(classroom: Path) -> None:
    reason = reason_of_ana(classroom, f'#include "{"a" * 260}"\n')
    assert f"include file '{'a' * 260}' cannot be read: File name too long" in reason


def test_programs_beside_others_include_nothing(classroom: Path) -> None:
    (classroom / "eva.c").write_text(SOLUTION)
    (classroom / "ana.c").write_text('#include "eva.c"\n')
    (classroom / "ion.c").write_text('#include "dan/main.c"\n')
    (classroom / "leo.c").write_text('#include "missing.h"\n')
    (classroom / "mia.c").write_text('#include "mia.c"\n')
    found = {
        name: reasons(classroom, only=name)[name] for name in ("ana.c", "eva.c", "ion.c", "leo.c", "mia.c")
    }
    for name in ("ana.c", "ion.c", "mia.c"):
        assert "is not included: other programs lie beside this one" in found[name]
        assert "--level 0" in found[name]
    assert "'missing.h' was not found" in found["leo.c"]
    assert found["eva.c"] == ""


def test_files_that_are_given_one_by_one_include_no_other(classroom: Path) -> None:
    (classroom / "eva.c").write_text(SOLUTION)
    (classroom / "ana.c").write_text('#include "eva.c"\n')
    for given in ([classroom / "ana.c"], [classroom / "ana.c", classroom / "eva.c"]):
        assert "is not included" in reasons(*given)["ana.c"]


def test_a_single_program_includes_what_lies_beside_it(tmp_path: Path) -> None:
    (tmp_path / "lib.h").write_text(SOLUTION)
    (tmp_path / "main.c").write_text('#include "lib.h"\n')
    assert reasons(tmp_path / "main.c") == {"main.c": ""}
    assert reasons(tmp_path) == {"main.c": ""}


def test_the_level_says_whose_a_folder_is(tmp_path: Path) -> None:
    """Groups of students: a level deeper. A student's folder alone: no level at all."""
    for name in ("ana", "dan"):
        (tmp_path / "group" / name).mkdir(parents=True)
    (tmp_path / "group" / "dan" / "lib.c").write_text(SOLUTION)
    (tmp_path / "group" / "dan" / "main.c").write_text('#include "lib.c"\n')
    (tmp_path / "group" / "ana" / "main.c").write_text('#include "../dan/lib.c"\n')
    assert reasons(tmp_path, only="group/ana/main.c")["group/ana/main.c"] == ""
    found = reasons(tmp_path, level=2)
    assert OUTSIDE in found["group/ana/main.c"]
    assert found["group/dan/main.c"] == ""
    assert reasons(tmp_path / "group" / "dan", level=0) == {"lib.c": "", "main.c": ""}


# What is found.


def test_folders_are_searched_in_order_and_links_to_folders_are_not(classroom: Path) -> None:
    (classroom / "ana" / "loop").symlink_to(classroom)
    (classroom / "ana" / "b.c").mkdir()
    (classroom / "ana" / "b.c" / "a.c").write_text("")
    (classroom / "ana" / "notes.txt").write_text("")
    found = find(classroom)
    assert names(found) == ["ana/b.c/a.c", "dan/main.c", "eva/main.asm"]
    assert [str(each) for each in found.warnings] == [
        f"{classroom}/ana/loop: warning: not searched: it is a link to a folder [not-searched]"
    ]


def test_a_hex_file_beside_its_source_is_left_out(classroom: Path) -> None:
    (classroom / "dan" / "main.hex").write_text("")
    (classroom / "dan" / "other.HEX").write_text("")
    found = find(classroom)
    assert names(found) == ["dan/main.c", "dan/other.HEX", "eva/main.asm"]
    assert [str(each) for each in found.warnings] == [
        f"{classroom}/ana: warning: not graded: it holds no program [not-searched]",
        f"{classroom}/dan/main.hex: warning: not graded, as its source lies beside it [not-searched]",
    ]


def test_one_student_does_not_take_everybodys_time(classroom: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(submissions, "MAX_PROGRAMS", 3)
    monkeypatch.setattr(submissions, "MAX_FOLDERS", 4)
    monkeypatch.setattr(submissions, "MAX_ENTRIES", 5)
    for number in range(5):
        (classroom / "ana" / f"{number}.c").write_text("")
        (classroom / "ion" / f"{number}").mkdir(parents=True)
    for number in range(6):
        (classroom / "leo" / f"{number}").mkdir(parents=True)
    deep = classroom / "mia" / "/".join("deep" for _ in range(500))
    deep.mkdir(parents=True)
    found = find(classroom)
    assert names(found) == ["ana/0.c", "ana/1.c", "ana/2.c", "dan/main.c", "eva/main.asm"]
    assert [str(each) for each in found.warnings] == [
        f"{classroom}/ana: warning: only the first 3 of 5 programs are graded [not-searched]",
        f"{classroom}/ion: warning: only the first 4 folders were searched [not-searched]",
        f"{classroom}/leo: warning: not searched: it holds more than 5 files [not-searched]",
        f"{classroom}/mia: warning: only the first 4 folders were searched [not-searched]",
    ]


def test_two_of_one_name_are_told_apart_by_their_paths(classroom: Path) -> None:
    dan, other = classroom / "dan", classroom.parent / "other"
    other.mkdir()
    (other / "main.c").write_text("")
    assert names(find(dan, other)) == [f"{dan}/main.c", f"{other}/main.c"]
    assert names(find(dan / "main.c", dan / "main.c")) == [f"{dan}/main.c"]


def test_a_folder_without_a_program_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no program"):
        find(tmp_path)


def said(found: Submissions) -> list[tuple[str, str]]:
    return [(str(each.location and each.location.file), each.message) for each in found.warnings]


def test_what_does_not_exist_and_empty_folders_are_errors_beside_the_programs(tmp_path: Path) -> None:
    """Without any program at all, nothing can be graded."""
    (tmp_path / "a.c").write_text("")
    (tmp_path / "empty").mkdir()
    (tmp_path / "link.c").symlink_to("nowhere")
    absent = [tmp_path / name for name in ("gone.c", "empty", "link.c")]
    with pytest.raises(InputError, match="there is no such file or folder") as caught:
        find(*absent)
    assert [each.location and each.location.file for each in caught.value.diagnostics] == [*map(str, absent)]
    found = find(absent[0], tmp_path / "a.c", *absent[1:])
    assert names(found) == ["a.c"]
    assert [(str(each.location), each.severity, each.code) for each in found.errors] == [
        (str(path), "error", "no-program") for path in absent
    ]
    assert [each.message.split(" (")[0] for each in found.errors] == [
        "there is no such file or folder",
        "holds no program",
        "there is no such file or folder",
    ]


def test_a_link_that_is_given_itself_is_read_and_one_that_is_found_leads_not_outside(tmp_path: Path) -> None:
    (tmp_path / "secret.c").write_text("")
    (tmp_path / "class").mkdir()
    link = tmp_path / "class" / "a.c"
    link.symlink_to(tmp_path / "secret.c")
    (tmp_path / "class" / "b.c").symlink_to("real.txt")
    (tmp_path / "class" / "real.txt").write_text("")
    (given,) = find(link).submissions
    given.require_readable()
    outside, inside = find(tmp_path / "class").submissions
    assert (outside.given, outside.folder) == (False, None)
    inside.require_readable()
    with pytest.raises(InputError, match=f"{link}: error: {OUTSIDE}"):
        outside.require_readable()


def test_a_file_that_is_given_owns_its_folder_if_no_other_program_is_beside_it(tmp_path: Path) -> None:
    """Its own image or a text is no other program; at level 0 even another one belongs to the student."""
    for name in ("main.c", "main.hex", "notes.txt"):
        (tmp_path / name).write_text("")
    main = tmp_path / "main.c"
    assert find(main).submissions[0].folder == tmp_path.resolve()
    (tmp_path / "other.HEX").write_text("")
    assert find(main).submissions[0].folder is None
    assert find(main, level=0).submissions[0].folder == tmp_path.resolve()


def test_a_folder_with_one_program_directly_in_it_is_its_students(tmp_path: Path) -> None:
    (tmp_path / "main.c").write_text("")
    (tmp_path / "ana").mkdir()
    (only,) = find(tmp_path).submissions
    assert only.folder == tmp_path.resolve()
    assert said(find(tmp_path)) == []  # ana/ may hold what main.c includes
    (tmp_path / "ana" / "a.c").write_text("")
    above = next(each for each in find(tmp_path).submissions if each.name == "main.c")
    assert above.folder is None
    (tmp_path / "ana" / "a.c").rename(tmp_path / "next.c")
    assert [each.folder for each in find(tmp_path).submissions] == [None, None]


def test_hidden_folders_without_a_program_are_not_worth_a_warning(classroom: Path) -> None:
    (classroom / ".git").mkdir()
    assert said(find(classroom)) == [(f"{classroom}/ana", "not graded: it holds no program")]


def test_a_folder_that_cannot_be_searched_has_one_warning(
    classroom: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scan = os.scandir

    def refusing(path: Path) -> object:
        if Path(path).name == "ana":
            raise PermissionError(13, "Permission denied")
        return scan(path)

    monkeypatch.setattr(submissions.os, "scandir", refusing)
    found = find(classroom)
    assert said(found) == [(f"{classroom}/ana", "not searched: Permission denied")]
    assert names(found) == ["dan/main.c", "eva/main.asm"]
    (classroom / "ana" / "main.c").write_text("")
    (given,) = find(classroom / "ana" / "main.c").submissions
    assert given.folder is None  # whatever may lie beside it


def test_as_many_programs_folders_and_files_as_are_allowed_are_all_found(
    classroom: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(submissions, "MAX_PROGRAMS", 3)
    monkeypatch.setattr(submissions, "MAX_FOLDERS", 4)
    monkeypatch.setattr(submissions, "MAX_ENTRIES", 5)
    for folder in ("ana/a", "ana/b", "ana/c"):  # with ana/ itself four
        (classroom / folder).mkdir()
        (classroom / folder / "main.c").write_text("")
    for number in range(5):
        (classroom / "eva" / f"{number}.txt").write_text("")
    (classroom / "eva" / "main.asm").unlink()
    found = find(classroom)
    assert names(found) == ["ana/a/main.c", "ana/b/main.c", "ana/c/main.c", "dan/main.c"]
    assert said(found) == [(f"{classroom}/eva", "not graded: it holds no program")]


def test_the_folder_that_is_given_may_hold_any_number_of_students(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(submissions, "MAX_ENTRIES", 2)
    for name in "abcd":
        (tmp_path / name).mkdir()
        (tmp_path / name / "main.c").write_text("")
    assert names(find(tmp_path)) == ["a/main.c", "b/main.c", "c/main.c", "d/main.c"]


def test_programs_are_found_by_their_suffix_in_any_capitals_and_in_order(tmp_path: Path) -> None:
    for name in ("b.C", "a.txt", "a", "c.Asm", "A.hEx", "c.hex"):
        (tmp_path / name).write_text("")
    found = find(tmp_path)
    assert names(found) == ["A.hEx", "b.C", "c.Asm"]
    assert said(found) == [(f"{tmp_path}/c.hex", "not graded, as its source lies beside it")]


def test_an_included_name_is_found_as_it_is_written_or_in_other_capitals(tmp_path: Path) -> None:
    (tmp_path / "main.asm").write_text("")
    (tmp_path / "Delay.INC").write_text("")
    (program,) = find(tmp_path).submissions
    main = str(tmp_path / "main.asm")
    assert program.included("Delay.INC", main) == tmp_path / "Delay.INC"
    assert program.included("delay.inc", main) is None
    assert program.included("delay.inc", main, in_any_case=True) == tmp_path / "Delay.INC"
    (tmp_path / "delay.inc").write_text("")
    assert program.included("delay.inc", main, in_any_case=True) == tmp_path / "delay.inc"
    assert program.included("other.inc", main, in_any_case=True) is None
    assert program.included("no/other.inc", main, in_any_case=True) is None
    assert program.included("main.asm/other.inc", main) is None
    (tmp_path / "FAR.INC").symlink_to("/etc/passwd")
    with pytest.raises(InputError, match=OUTSIDE):
        program.included("far.inc", main, in_any_case=True)


def refusal(program: Submission, name: str) -> Diagnostic:
    """Why the program must not include a file."""
    with pytest.raises(InputError) as refused:
        program.included(name, str(program.file))
    return refused.value.first


def test_a_program_without_a_folder_of_its_own_is_told_how_to_get_one(classroom: Path) -> None:
    """What is not there is not found, for whoever asks; a link that leads nowhere is there."""
    (classroom / "eva.c").write_text(SOLUTION)
    (classroom / "gone.h").symlink_to("nowhere")
    program = Submission("ana.c", classroom / "ana.c", None)
    assert program.included("missing.h", str(program.file)) is None
    for name in ("eva.c", "gone.h"):
        told = refusal(program, name)
        assert (told.code, told.location) == ("include-refused", Location(f"{classroom}/{name}"))
        assert told.message.startswith("is not included: other programs lie beside this one")
        assert told.hint is not None and "--level 0" in told.hint


@pytest.mark.parametrize("make", [fifo, unix_socket, Path.mkdir], ids=["fifo", "socket", "dir"])
def test_what_is_not_a_regular_file_is_not_opened(classroom: Path, make: Callable[[Path], None]) -> None:
    odd = classroom / "ana" / "odd.h"
    make(odd)
    told = refusal(Submission("main.c", classroom / "ana" / "main.c", classroom / "ana"), "odd.h")
    assert (told.code, told.message, told.location) == ("not-a-file", NOT_REGULAR, Location(str(odd)))
    with pytest.raises(InputError, match=NOT_REGULAR):
        Submission("odd.h", odd, classroom / "ana").require_readable()


def test_a_file_that_cannot_be_looked_at_says_why(classroom: Path) -> None:
    """255 bytes are the longest name on Linux; of a shorter one that is not there nothing is said."""
    program = Submission("main.c", classroom / "ana" / "main.c", classroom / "ana")
    assert program.included("a" * 255, str(program.file)) is None
    told = refusal(program, "a" * 256)
    assert (told.code, told.message) == ("unreadable-file", "cannot be read: File name too long")
    assert told.location == Location(f"{classroom}/ana/{'a' * 256}")


def test_a_link_that_cannot_be_followed_is_no_folder(
    classroom: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Such as one to a device that fails: the search goes on, and the link is judged as a program."""
    is_dir, link = Path.is_dir, classroom / "ana" / "main.c"
    link.symlink_to("../dan/main.c")

    def failing(self: Path) -> bool:
        if self == link:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return is_dir(self)

    monkeypatch.setattr(Path, "is_dir", failing)
    assert names(find(classroom)) == ["ana/main.c", "dan/main.c", "eva/main.asm"]
