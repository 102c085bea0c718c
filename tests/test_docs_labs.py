"""docs/labs.md: every command of the page is run, and prints the answers that stand below it.

The answers are the labs' numbers and hand calculations, not copies of the output: an answer is a part of one
line, with as many digits as are known, and the lines come in order.
"""

import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import pytest

from servogen.cli import main
from tests.campaigns import sampled

ROOT = Path(__file__).parent.parent
SECTIONS = [*(f"Lab {number}" for number in range(1, 11)), "Lecture notes"]
PAGE = (ROOT / "docs" / "labs.md").read_text("utf-8")
SYMBOLIC = "--symbolic"
NUMBER = re.compile(r"([+-]?\d+(?:\.(\d+))?)(\D*)")
NOISE = 1e-4
"""What a whole number of an answer may be off: the last digit that the commands print."""


@dataclass(frozen=True)
class Exercise:
    lab: str
    command: str
    answers: tuple[str, ...]


def exercises() -> list[Exercise]:
    found = []
    for section in PAGE.split("\n## ")[1:]:
        for block in re.findall(r"^```console\n\$ servogen (.*?)^```", section, re.M | re.S):
            command, *answers = block.splitlines()
            found.append(Exercise(re.split(":|\n", section)[0], command, tuple(answers)))
    return found


def files() -> dict[str, str]:
    """The files that the page shows, by the name that stands before each."""
    found = {}
    for text, block in re.findall(r"((?:(?!```)[\s\S])*?)^```toml\n(.*?)^```", PAGE, re.M | re.S):
        found[re.findall(r"`([\w-]+\.toml)`", text.replace("lab8-tiny.toml", ""))[-1]] = block
    return found


def agrees(answer: str, shown: str) -> bool:
    """Whether a word of an answer is that of the output: a number to the digits that it has."""
    one, other = NUMBER.fullmatch(answer.rstrip(",;:")), NUMBER.fullmatch(shown.rstrip(",;:"))
    if one is None or other is None:
        return answer.rstrip(",;:") == shown.rstrip(",;:")
    digits = len(one[2] or "")
    tolerance = 0.5000001 * 10.0**-digits if digits else NOISE
    return one[3] == other[3] and abs(float(one[1]) - float(other[1])) <= tolerance


def stands_in(answer: str, line: str) -> bool:
    words, shown = answer.split(), line.split()
    return any(
        all(map(agrees, words, shown[start : start + len(words)]))
        for start in range(len(shown) - len(words) + 1)
    )


def missing(answers: tuple[str, ...], output: str) -> str | None:
    """The first answer that the output does not give, in order."""
    lines = iter(output.splitlines())
    return next((answer for answer in answers if not any(stands_in(answer, line) for line in lines)), None)


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the page names: jobs, the labs' programs and the page's files."""
    folder = tmp_path_factory.mktemp("labs")
    (folder / "jobs").symlink_to(ROOT / "jobs")
    (folder / "tests").symlink_to(ROOT / "tests")
    for name, text in files().items():
        (folder / name).write_text(text)
    (folder / "lab8-tiny.toml").write_text(files()["lab8.toml"].replace("futaba-s3001", "mpx-tiny-s"))
    return folder


def words_of(command: str) -> list[str]:
    return [quoted or plain for quoted, plain in re.findall(r"'([^']*)'|(\S+)", command)]


def test_the_page_has_every_lab_and_no_block_that_is_not_run() -> None:
    labs = dict.fromkeys(exercise.lab for exercise in exercises())
    assert list(labs) == SECTIONS
    assert len(exercises()) == PAGE.count("```console") > 60
    assert all(exercise.answers for exercise in exercises())
    assert set(files()) == {"lab6.toml", "lab8.toml", "lab10.toml", "lab10-turns.toml", "touch.toml"}


Check = Callable[[Exercise], None]


@pytest.fixture
def check(checkout: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Check:
    """Runs the command of an exercise and looks for its answers."""
    monkeypatch.chdir(checkout)

    def run(exercise: Exercise) -> None:
        monkeypatch.setattr(sys, "argv", ["servogen", *words_of(exercise.command)])
        with pytest.raises(SystemExit) as ended:
            main()
        shown = capsys.readouterr()
        assert not ended.value.code, shown.err
        answer = missing(exercise.answers, shown.out)
        assert answer is None, f"servogen {exercise.command}\ndoes not print: {answer}\n{shown.out}"

    return run


@pytest.mark.parametrize("lab", sampled(SECTIONS, 4))
def test_every_command_of_a_lab_prints_its_answers(lab: str, check: Check) -> None:
    for exercise in exercises():
        if exercise.lab == lab and SYMBOLIC not in exercise.command:
            check(exercise)


def test_every_command_with_symbols_prints_its_answers(check: Check) -> None:
    pytest.importorskip("sympy")
    symbolic = [exercise for exercise in exercises() if SYMBOLIC in exercise.command]
    assert {exercise.lab for exercise in symbolic} == {"Lab 3", "Lab 7"}
    for exercise in symbolic:
        check(exercise)


@pytest.mark.parametrize(
    ("answers", "output"),
    [
        (("point 4 7 5.1",), "point  4.0000  7.0000  5.0000"),
        (("point 4 7 6",), "point  4.0000  7.0000  5.0000"),
        (("4 5",), "point  4.0000  7.0000  5.0000"),
        (("q1 30.000°",), "q1 30.001°"),
        (("q1 30.000°",), "q1 30.000 mm"),
        (("0 1", "1 0"), "1 0\n0 1"),
        (("1 0", "1 0"), "1 0"),
        (("RB0: 153 pulses",), "RB0: 152 pulses"),
    ],
)
def test_a_wrong_answer_is_seen(answers: tuple[str, ...], output: str) -> None:
    assert missing(answers, output) is not None


def test_a_right_answer_has_the_digits_that_are_known() -> None:
    assert missing(("4 7 5", "-0.866 0.5"), "point  4.0000  7.0000  5.0000\n  -0.86603  0.50000") is None
    assert all(missing((f"{one:.3f}",), f"{other:.5f}") for one, other in pairwise((0.1, 0.102, 0.2)))
