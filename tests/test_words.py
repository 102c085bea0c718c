"""`proven` is said of the theorem over every power-up, input and chip, and of nothing else.

One run of the simulator is exact, and a capture agrees. Every line of the source, the templates and the pages
that has a word of this family is about the theorem: it stands in a file that is, or it is allowed here.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
WORD = re.compile(r"\b(?:un)?prov(?:en|e|es|ed|ing)\b|\bproofs?\b", re.IGNORECASE)
ABOUT_IT = (
    "servogen/prove/",
    "servogen/checker/",
    "servogen/cli/prove_command.py",
    "servogen/cli/schedule_proof.py",
    "servogen/cli/certificate_command.py",
    "servogen/cli/contracts.py",
    "servogen/workflows/certificates.py",
    "servogen/workflows/pair_proof.py",
    "docs/proof.md",
)
"""Files about the theorem, or the program that finds it."""
NAMES = re.compile(
    r"servogen[ .]prove\b|`(?:make )?prove\b[^`]*`|`prove$|^prove\b|(?:docs/)?proof\.md|--prove\b|prove/"
    r"|make prove\b|servogen\.build\.certificates|prove_command|schedule_proof|tests[./]prove\b"
)
"""Names of commands, packages and files, which say nothing of a program."""
ALLOWED = {
    "README.md": (
        "**proven**: so does every run",
        "accepted the proof ([docs",
        "what is exact and what is proven",
        "--prove               # the HEX file, exact and proven",
        "The proof covers the HEX file",
        "The proof does not include",
    ),
    "docs/commands.md": (
        "`proven, checked`), is omitted",
        "shows what is proven of it, `--prove` proves it",
        "in `--certificates DIR`, proven",
        "proves that a program follows the schedule for every power-up",
        "checks the certificate of a proof",
    ),
    "Makefile": (
        "one table: exact, and proven",
        ".PHONY",
        "prove: $(READY)",
        "prove the programs of firmware/",
    ),
    "docs/design.md": ("→ `Proof`", "finds the proof"),
    "docs/contracts.md": ("proof", "proven by one engine", "prove less"),
    "docs/firmware.md": (
        "These 19 pairs are",
        "`servogen prove` proves this for every",
        "### What is proven",
        "proves that",
        "than the proof prints",
        "this proves that no slot",
        "proves both programs, for every power-up and every wire",
        "the checker and the prover judge them",
    ),
    "docs/diagnostics.md": ("is proven by one engine only", "prove it without"),
    "tools/answers.py": ("prove firmware/",),
    "tools/tape_mutants.py": ("prov", "proof", "Proof", "PROVEN"),  # it attacks both witnesses
    "servogen/cli/app.py": ('"prove_command": ("prove",)',),
    "servogen/cli/doctor_command.py": ("to build a job and prove it",),
    "servogen/cli/build_commands.py": ("prove", "proven", "proof"),  # `build --prove` and its column
    "servogen/report/text.py": ("servogen prove",),
    # The certificate's answer, beside a verdict on one run.
    "servogen/watch/subject.py": ("Return what is proven of", "two chips, what is proven of the one"),
    "servogen/answers.py": ("proven", "It proves", "proofs"),  # the keys of these answers
    "servogen/workflows/output_schema.py": ('"prove": (',),
    "servogen/workflows/pair.py": ("PairProof", "Return what is proven of both programs"),
    "docs/job.md": ("prove both, and [what they do together](proof.md#two-chips)",),
    "servogen/watch/server.py": ("what is proven of it",),
    "servogen/workflows/reporting.py": ("checking a proof", "what is proven of the job's own program"),
    "servogen/cli/signal_commands.py": ('next_step("prove"',),
    "docs/watch.md": ("what is [proven](proof.md) of all runs",),
    "docs/your-robot.md": ("build my.toml --prove",),
    "docs/platforms.md": ("the chip of the proof checker",),
    "CONTRIBUTING.md": ("for every analysis and proof",),
}
"""Lines about the theorem in files about other things, by a part of them."""


def pages() -> Iterator[Path]:
    """Yield the source, the templates, what users read, and the files that describe the project."""
    for pattern in ("servogen/**/*.py", "templates/**/*", "docs/**/*.md", "docs/**/*.py", "tools/**/*.py"):
        yield from (path for path in ROOT.glob(pattern) if path.is_file())
    yield from (ROOT / name for name in ("README.md", "CONTRIBUTING.md", "Makefile", "pyproject.toml"))
    yield from (ROOT / name for name in ("mkdocs.yml", "action.yml", "Dockerfile"))
    yield from ROOT.glob("jobs/*.toml")
    yield from ROOT.glob("firmware/*/report.txt")


def claims(text: str, allowed: tuple[str, ...] = ()) -> list[str]:
    """Return the lines that have a word of the family, otherwise than in a name or as allowed."""
    return [
        line.strip()
        for line in text.splitlines()
        if WORD.search(NAMES.sub("", line)) and not any(part in line for part in allowed)
    ]


def test_only_the_theorem_is_called_proven() -> None:
    wrong = []
    for path in pages():
        name = path.relative_to(ROOT).as_posix()
        if "__pycache__" in name or name.startswith(ABOUT_IT) or path.suffix in (".png", ".gif"):
            continue
        wrong += [f"{name}: {line}" for line in claims(path.read_text(), ALLOWED.get(name, ()))]
    assert wrong == []


@pytest.mark.parametrize(
    "line",
    ["every pulse edge is proven", "main.hex: NOT PROVEN", "unproven", "a capture proves what it shows"],
)
def test_a_claim_about_one_run_is_found(line: str) -> None:
    assert claims(f"good\n{line}\n") == [line]


def test_the_name_of_a_command_is_no_claim() -> None:
    assert (
        claims("`servogen prove main.hex` or `prove --any-line`, see docs/proof.md; improve, provide") == []
    )


def test_what_is_allowed_is_there() -> None:
    """A line that no longer exists is no longer an exception."""
    for name, parts in ALLOWED.items():
        text = (ROOT / name).read_text()
        assert [part for part in parts if part not in text] == []
