"""Names and messages of strangers stay text, wherever they are shown; pages never overwrite each other."""

import hashlib
import json
import os
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from servogen.grade import load_lab, message, page, page_names, refused, shell_word, shown_name, visible
from servogen.grade.display import markdown
from tests.bench.conftest import START, Run, run  # noqa: F401 - a fixture
from tests.campaigns import sampled

RIGHT = Path(__file__).parent / "programs" / "lab8-right" / "delays.c"
WRONG = "int x = ;\n"
LAB = load_lab("lab8-exercise")

NAMES = st.text("aAbB.-+%~ /_\u00e9e\u0301\udcff\x1b\n", min_size=1, max_size=8)
"""Few letters, so that names are often alike."""


def folded(name: str) -> str:
    """As a file system that ignores case takes it."""
    return name.casefold()


@settings(max_examples=30)
@given(st.lists(NAMES, unique=True, max_size=8))
@example(["a-b/c.c", "a/b-c.c", "a/b/c.c", "a-b-c.c", "a+b/c.c", "a%2Bb/c.c"])
@example(["Main.c", "main.c", "MAIN.c"])
@example(["\u00e9.c", "e\u0301.c"])
@example(["x" * 400 + "1.c", "x" * 400 + "2.c"])
def test_no_two_programs_share_a_page(names: list[str]) -> None:
    pages = page_names(names)
    assert len({folded(each) for each in pages}) == len(names)
    for each in pages:
        assert len(os.fsencode(each)) <= 255
        assert "/" not in each
        assert each.endswith(".md")
        assert each.isprintable()


def test_a_page_is_named_by_its_program() -> None:
    assert page_names(["ana/main.c", "a b/c.c", "\udcff.c"]) == ["ana+main.c.md", "a%20b+c.c.md", "%FF.c.md"]


def test_pages_of_different_folders_do_not_collide(run: Run, tmp_path: Path) -> None:  # noqa: F811
    for name in ("a-b/c.c", "a/b-c.c"):
        (tmp_path / "class" / name).parent.mkdir(parents=True)
        (tmp_path / "class" / name).write_text(WRONG)
    done = run("grade", "lab8-exercise", tmp_path / "class", "--pages", tmp_path / "pages", "--json")
    rows = json.loads(done.out)["programs"]
    assert sorted(file.name for file in (tmp_path / "pages").glob("*.md")) == ["a+b-c.c.md", "a-b+c.c.md"]
    for row in rows:
        assert (tmp_path / "pages" / row["page"]).read_text().startswith(f"# {row['program']}: not passed")


def test_a_page_that_cannot_be_written_costs_no_other_its_page(run: Run, tmp_path: Path) -> None:  # noqa: F811
    for name in ("ana.c", "dan.c"):
        (tmp_path / name).write_text(WRONG)
    (tmp_path / "ana.c.md").mkdir()
    done = run("grade", "lab8-exercise", tmp_path, "--pages", tmp_path)
    assert (done.code, "0 of 2 passed" in done.out) == (2, True)
    assert "ana.c.md: error: is a directory" in done.err
    assert (tmp_path / "dan.c.md").read_text().startswith("# dan.c: not passed")


def test_a_link_in_the_folder_of_the_pages_is_not_written_through(run: Run, tmp_path: Path) -> None:  # noqa: F811
    (tmp_path / "diary").write_text("dear diary")
    (tmp_path / "class").mkdir()
    (tmp_path / "class" / "ana.c").write_text(WRONG)
    (tmp_path / "class" / "ana.c.md").symlink_to("../diary")
    assert run("grade", "lab8-exercise", tmp_path / "class", "--pages", tmp_path / "class").code == 1
    assert (tmp_path / "diary").read_text() == "dear diary"
    assert (tmp_path / "class" / "ana.c.md").read_text().startswith("# ana.c: not passed")


@settings(max_examples=30)
@given(st.text())
@example("<script>alert(1)</script>")
@example("[x](javascript:alert(1))")
@example("![x](http://example.org/x.png)")
@example("a|b`c`**d**_e_~~f~~")
def test_text_in_a_page_has_no_markup(text: str) -> None:
    shown = markdown(text)
    for sign in "<>":
        assert sign not in shown
    for index, sign in enumerate(shown):
        if sign in "`*[]|~":
            assert shown[index - 1] == "\\"
    assert "://" not in shown
    assert "www." not in shown.lower()
    assert "@" not in shown


class Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.found.append(tag)

    def handle_data(self, data: str) -> None:
        self.text += data


def test_a_name_and_a_message_stay_text_in_html() -> None:
    parser = Tags()
    parser.feed(page(LAB, "<img src=x onerror=alert(1)>.c", refused("lab", "<b>passed</b> & <i>all")))
    assert parser.found == []
    assert "<b>passed</b> & <i>all" in parser.text


def test_a_message_cannot_end_its_block() -> None:
    lines = page(LAB, "a.c", refused("lab", "wrong:\n```\n# ana: passed\n````\n<b>")).splitlines()
    fences = [index for index, line in enumerate(lines) if line.strip() == "`````"]
    assert len(fences) == 2
    assert lines[fences[0] + 1 : fences[1]] == ["  ```", "  # ana: passed", "  ````", "  <b>"]


def test_a_name_cannot_make_a_second_heading() -> None:
    text = page(LAB, "a\n# dan: passed\n.c", refused("lab", "wrong"))
    assert [line for line in text.splitlines() if line.startswith("# ")] == [
        "# a\\\\x0a\\# dan: passed\\\\x0a.c: not passed"
    ]


def test_what_moves_the_cursor_is_written_out() -> None:
    assert visible("a\x1b[2Jb\u202ec\r\ud83d\udcff\td\n") == "a\\x1b[2Jb\\u202ec\\x0d\\ud83d\\xff\td\n"


@settings(max_examples=30)
@given(st.lists(NAMES, unique=True, max_size=8))
@example(["\udcff", "\\xff"])
@example(["a\n", "a\\x0a"])
def test_two_names_never_look_alike(names: list[str]) -> None:
    shown = [shown_name(each) for each in names]
    assert len(set(shown)) == len(names)
    assert all(each.isprintable() or not each for each in shown)
    for each in shown:
        each.encode()


@pytest.mark.campaign
@pytest.mark.parametrize(("locale", "tables"), sampled([("C.UTF-8", False), ("C", True)]))
def test_names_that_are_not_utf8_work(tmp_path: Path, locale: str, tables: bool) -> None:
    """In the table, in JSON, as pages and in a compiler's message."""
    folder = tmp_path / "class" / os.fsdecode(b"\xff\x1b[31m")
    folder.mkdir(parents=True)
    (folder / os.fsdecode(b"\xfe.c")).write_bytes(RIGHT.read_bytes())
    (folder / os.fsdecode(b"wr\xf6ng.c")).write_bytes(b"int x = ;\n")
    command = [sys.executable, "-c", START, "grade", "lab8-exercise", "class", "--pages", "pages"]
    environment = {**os.environ, "LC_ALL": locale, "PYTHONUTF8": "0"}
    for options in ([], ["--json"])[not tables :]:
        done = subprocess.run([*command, *options], cwd=tmp_path, capture_output=True, env=environment)
        assert done.returncode == 1, done.stderr
        assert b"Traceback" not in done.stderr
        assert b"\x1b" not in done.stdout
    rows = json.loads(done.stdout)["programs"]
    assert [(row["program"], row["passed"]) for row in rows] == [
        ("\\xff\\x1b[31m/wr\\xf6ng.c", False),
        ("\\xff\\x1b[31m/\\xfe.c", True),
    ]
    assert "class/\\xff\\x1b[31m/wr\\xf6ng.c:1" in rows[0]["reasons"][0]
    assert sorted(file.name for file in (tmp_path / "pages").glob("*.md")) == sorted(
        row["page"] for row in rows
    )


@pytest.mark.skipif(not Path("/bin/bash").exists(), reason="there is no bash here")
def test_a_shell_takes_a_name_for_one_argument_and_nothing_else() -> None:
    names = [
        "a.c",
        "a b/c.c",
        "-x.c",
        "$(id).c",
        "`id`'\";&|\\.c",
        "\x1b[2J\n.c",
        "'\udcff\\'.c",
        "\u202eé.c",
    ]
    words = [shell_word(name) for name in names]
    assert all(word.isprintable() for word in words)
    command = ["/bin/bash", "-c", "LC_ALL=C; printf '%s\\0' " + " ".join(words)]
    done = subprocess.run(command, capture_output=True, check=True)
    wanted = [name if name[0] != "-" else f"./{name}" for name in names]
    assert done.stdout == b"".join(os.fsencode(name) + b"\0" for name in wanted)


def test_a_message_may_have_sixty_lines_of_five_hundred_columns() -> None:
    whole = "\n".join(["x" * 500] * 60)
    assert message(whole) == whole
    assert message(whole + "\nlast") == whole + "\n… and 1 more lines"
    assert message("x" * 501) == "x" * 500 + " …"
    assert message("\n".join("abc")) == "a\nb\nc"


def test_a_page_s_name_may_have_two_hundred_bytes() -> None:
    """An é has two bytes of UTF-8; what is shortened ends in a digest of the whole name."""
    fits, longer = "é" * 100, "é" * 100 + "a"
    assert page_names([fits]) == [f"{fits}.md"]
    (shortened,) = page_names([longer])
    digest = hashlib.sha256(longer.encode()).hexdigest()[:32]
    assert shortened == f"{'é' * 50}~{digest}.md"
    assert page_names(["a b/c$.c"]) == ["a%20b+c%24.c.md"]
    one, other = page_names(["A.c", "a.c"])  # one file where capitals make no difference
    assert one.startswith("A.c~") and other.startswith("a.c~") and one.lower() != other.lower()


def test_what_cannot_be_printed_has_as_many_digits_as_it_needs() -> None:
    assert visible("\x1b\x9f\u202e\U000e0001\udcff") == "\\x1b\\x9f\\u202e\\U000e0001\\xff"
    assert visible("\u0100 a\n\tb") == "\u0100 a\n\tb"
    assert shown_name("a\\b\nc\td") == "a\\\\b\\x0ac\\x09d"
