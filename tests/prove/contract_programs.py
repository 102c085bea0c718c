"""Contracts of programs that are not servo jobs: what a plain run shows of each, and what the prover says.

    python -m tests.prove.contract_programs                               # thirty of ours
    python -m tests.prove.contract_programs --repositories FOLDER         # thirty public ones

Ours are in `programs/`, in docs/testing-firmware.md and in docs/examples/ci. The public ones are read from
clones, FOLDER/OWNER/NAME, at the commits that public_programs.toml lists with the contracts that we wrote.
Each counterexample is repeated as `servogen verify --contract` would, from its stimulus file and its options.
Exit code 1 if one of them does not replay, or if a program is proven and its plain run violates the contract.
"""

from __future__ import annotations

import argparse
import sys
import time
import tomllib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from servogen.contract import Contract, ContractVerdict, parse_contract
from servogen.programs import DEFAULT_DEVICE, Program, read_program
from servogen.prove import Counterexample
from servogen.prove.contract import ContractProof, prove_contract
from servogen.prove.quantifiers import EVERYTHING
from servogen.simulator import SimulatorOptions, parse_stimuli
from servogen.units import Clock
from servogen.workflows.certificates import contract_witness
from servogen.workflows.contracts import contract_clock, judge_program
from tests.prove.contract_attack import CI, give_up
from tests.repositories import unpack
from tests.testing.page import PROGRAMS

HERE = Path(__file__).parent
MAX_STATES = 20_000
SECONDS = 2.0
"""Of the plain run."""


@dataclass(frozen=True)
class Case:
    """A program with its contract."""

    name: str
    program: Program
    text: str
    """The contract."""

    @property
    def contract(self) -> Contract:
        return parse_contract(self.text, f"{self.name}.toml")

    @property
    def clock(self) -> Clock:
        return contract_clock(self.contract, self.program, None)

    @property
    def board(self) -> SimulatorOptions:
        return SimulatorOptions(device=self.program.device or DEFAULT_DEVICE)

    def run(self, shown: Counterexample | None = None) -> ContractVerdict:
        """Judge a run from power-up: with no input, or as a counterexample's file and options say."""
        if shown is None:
            return judge_program(self.contract, self.program, self.clock, SECONDS, self.board)
        text = shown.stimulus(self.clock)
        stimulus = parse_stimuli(text, "counterexample.toml", self.clock) if text else None
        seconds = float(self.clock.seconds(shown.cycle)) + 0.01
        return judge_program(self.contract, self.program, self.clock, seconds, shown.options, stimulus)

    def proof(self, max_states: int = MAX_STATES) -> ContractProof:
        clauses = self.contract.clauses(self.clock)
        return prove_contract(
            self.program.image, clauses, self.clock, options=self.board, max_states=max_states
        )


def ours(names: Sequence[str] = ()) -> Iterator[Case]:
    """Return the programs that are kept here, or those with one of the names.

    Each has a contract beside its source, or with the name of a listing on the page about tests.
    """
    for path in (*sorted((HERE / "programs").glob("*.toml")), CI / "contract.toml"):
        source = CI / "dimmer.c" if path.parent == CI else path.with_suffix(".c")
        if not names or source.stem in names:
            yield Case(source.stem, _program(source), path.read_text())


def _program(source: Path) -> Program:
    for path in (source, source.with_suffix(".asm")):
        if path.exists():
            return read_program(path)
    with TemporaryDirectory() as scratch:
        listed = Path(scratch, source.name)
        listed.write_text(PROGRAMS[source.name])
        return read_program(listed)


def public(folder: Path, names: Sequence[str] = ()) -> Iterator[Case]:
    """Return the public programs, or those with a part of their names, from clones of their repositories."""
    listed = tomllib.loads((HERE / "public_programs.toml").read_text())["program"]
    for row in listed:
        repository, place = row["repository"], Path(row["path"])
        name = f"{repository}: {place}"
        if names and not any(part in name for part in names):
            continue
        with TemporaryDirectory() as scratch:
            parent = place.parent.as_posix().removeprefix(".")
            unpack(folder, repository, row["commit"], parent, Path(scratch))
            program = read_program(Path(scratch) / place.name)
        yield Case(name, program, row["contract"])


def first_breach(verdict: ContractVerdict) -> int | None:
    """Return the cycle of the first breach."""
    return min((each.first.cycle for each in verdict.clauses if each.first is not None), default=None)


def answer(case: Case, plain: ContractVerdict, max_states: int) -> tuple[str, str, bool]:
    """Return the verdict of the prover, its reason, and whether it is consistent with plain runs."""
    try:
        proof = case.proof(max_states)
    except TimeoutError as late:
        return "not decided", str(late), True
    if proof.proven:
        try:
            witness = contract_witness(proof, case.program.image, case.text, case.clock, EVERYTHING)
        except TimeoutError as late:
            return "proven", f"the checker takes {late}", not plain.violated
        word = "proven, checked" if witness.checked else "proven"
        return word, witness.not_covered or f"{proof.states} states", not plain.violated
    if proof.counterexample is None:
        return "not decided", proof.reason, True
    seen = first_breach(case.run(proof.counterexample))
    moment = f"cycle {proof.counterexample.cycle}: {proof.counterexample.message}"
    replays = seen is not None and seen <= proof.counterexample.cycle
    return "counterexample", moment if replays else f"DOES NOT REPLAY: {moment}", replays


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repositories", type=Path, help="clones of public repositories, OWNER/NAME")
    parser.add_argument("--max-states", type=int, default=MAX_STATES)
    parser.add_argument("--seconds", type=int, default=60, help="of processor time for each proof")
    parser.add_argument("names", nargs="*", help="names, or parts of public ones (default: all)")
    given = parser.parse_args()
    found, wrong = Counter[str](), 0
    cases = public(given.repositories, given.names) if given.repositories else ours(given.names)
    for case in cases:
        began, run = time.process_time(), case.run()
        give_up(given.seconds)
        word, why, consistent = answer(case, run, given.max_states)
        give_up(0)
        found[word] += 1
        wrong += not consistent
        print(
            f"{case.name}: one run {run.word}; {word}: {why} [{time.process_time() - began:.1f} s]",
            flush=True,
        )
    print(dict(found))
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
