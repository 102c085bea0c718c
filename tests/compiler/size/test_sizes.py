"""The compiler's code may get smaller, never larger."""

import pytest

from servogen.compiler import Options, Source, compile_sources
from tests.campaigns import sampled
from tests.compiler.size.measure import HERE, LEVELS, TESTS, before, now, programs, recorded, words


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("name", sampled(programs(), 10))
def test_no_program_grows(name: str, level: str) -> None:
    most = recorded().get(name)
    assert most is not None, "run `python -m tests.compiler.size`"
    assert words(*programs()[name], level) <= most[level]


def test_what_shares_code_is_never_larger() -> None:
    assert all(each["size"] <= each["speed"] for each in recorded().values())
    assert sum(each["size"] for each in recorded().values()) < sum(
        each["speed"] for each in recorded().values()
    )


def test_programs_and_sequence_jobs_are_8_percent_smaller_than_before_and_none_is_larger() -> None:
    """Both with the jobs in one dialect and in all three; `make test` holds firmware/ to the compiler."""
    earlier, today = before(), now()
    assert [name for name, words in today.items() if words > earlier[name]] == []
    page = (TESTS.parent / "docs" / "compiler.md").read_text()
    for jobs in ("/main.hex", ".hex"):
        names = [name for name in earlier if name.endswith((".c", jobs))]
        old, new = (sum(words[name] for name in names) for words in (earlier, today))
        assert new <= 0.92 * old
        assert f"{old} words before and {new} now" in page or f"{old} before and {new} now" in page


def test_what_is_recorded_exists() -> None:
    assert recorded().keys() == programs().keys()


@pytest.mark.parametrize("path", sampled(sorted(HERE.glob("*.c")), 4), ids=lambda path: path.stem)
def test_they_compile_without_a_warning(path: object) -> None:
    text = path.read_text()  # type: ignore[attr-defined]
    found = compile_sources([Source(text, "size.c")], Options(dialect=path.name[:3], clock_hz=4_000_000))  # type: ignore[attr-defined]
    assert not found.diagnostics, "\n".join(map(str, found.diagnostics))
