"""Proofs and their second witness: a theorem counts as proven once the checker has accepted its certificate.

In: a program and its schedule; proofs, or files of certificates. Out: what the checker says.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from servogen.checker import (
    Checked,
    Hints,
    NotCovered,
    Refused,
    check_certificate,
    check_contract,
    read_certificate,
)
from servogen.checker.certificate import Certificate, fingerprint
from servogen.edges import PINS
from servogen.errors import InputError, ToolError
from servogen.inputs import read_input
from servogen.outputs import write_bytes
from servogen.pic.image import Image
from servogen.prove import Proof, certificate, prove_for_all
from servogen.prove.contract import ContractProof
from servogen.prove.prover import MAX_STATES
from servogen.prove.quantifiers import Quantifiers
from servogen.pulse import PulseSchedule
from servogen.units import Clock

MAX_CERTIFICATE_BYTES = 4 << 20
CHECKED = "proven, checked"
SUFFIX = ".cert.xz"


@dataclass(frozen=True, slots=True)
class CertificateVerdict:
    """What is known of a program for every power-up, input and chip, in words."""

    text: str
    valid: bool
    missing: bool = False

    @property
    def sentence(self) -> str:
        """Return what a page says of it beside the verdict on one run."""
        return f"all runs: {self.text}" + (": servogen prove" if self.missing else "")


@dataclass(frozen=True, slots=True)
class Witnessed:
    """What the second witness says of a proof: what it checked, or what it does not cover."""

    certificate: bytes = b""
    checked: Checked | None = None
    not_covered: str = ""

    @property
    def text(self) -> str:
        """Return the verdict in words."""
        if self.checked is None:
            return f"proven by one engine: the checker does not cover {self.not_covered}"
        return CHECKED + "".join(f", with {text}" for text in self.checked.restrictions)


def second_witness(
    proof: Proof, image: Image, schedule: PulseSchedule, text: bytes, allow_held: bool = False
) -> Witnessed:
    """Return what the checker says of a proof against a schedule, the content `text` of its file.

    With `allow_held` the certificate may be about one level of each button only, which is less than the
    theorem. Raises ToolError where the checker refuses: one of the two witnesses is wrong.
    """
    try:
        packed = certificate(proof, image, schedule, text, allow_held)
    except ValueError as error:
        missing = restrictions(proof.quantifiers) + _held_buttons(proof, schedule)
        return Witnessed(not_covered=", ".join(missing) or f"it: {error}")
    try:
        claim = read_certificate(packed, "the certificate")
        held = claim.held if allow_held else ()
        checked = check_certificate(claim, image, text, "schedule.json", held, tape=tape_content(schedule))
    except InputError as error:
        return Witnessed(not_covered=f"it: {error.first.message}")
    except NotCovered as error:
        return Witnessed(not_covered=error.what)
    except Refused as error:
        raise ToolError(
            "internal-error",
            "two witnesses disagree: servogen.prove says proven, and servogen.checker refuses its "
            f"certificate: {error}",
            hint="this is a defect of servogen itself; please report it with the program and schedule.json",
        ) from None
    outside = _held_buttons(proof, schedule)
    return Witnessed(packed, None if outside else checked, ", ".join(outside))


def contract_witness(
    proof: ContractProof, image: Image, contract: str, clock: Clock, over: Quantifiers
) -> Witnessed:
    """Return what the checker says of a proof of a contract, the text of its file.

    A refusal is no breach: the checker's chip knows less of some programs than the prover's.
    """
    if restrictions(over):
        return Witnessed(not_covered=", ".join(restrictions(over)))
    try:
        return Witnessed(checked=check_contract(image, contract, clock, Hints(proof.cuts, proof.inputs)))
    except NotCovered as error:
        return Witnessed(not_covered=error.what)
    except Refused as error:
        return Witnessed(not_covered=f"it: {error}")


def restrictions(over: Quantifiers) -> list[str]:
    """Return what a proof assumes, or covers, that the checker's theorem does not."""
    named = {
        "known values at power-up (--start)": bool(over.start),
        "chips that are never reset (--no-resets)": not over.resets,
        "one period of the watchdog (--watchdog-us)": not over.watchdog,
        "one duration of EEPROM writes (--eeprom-write-us)": not over.eeprom_write,
        "one phase of TMR0 (--no-tmr0-phase)": not over.tmr0_phase,
        "any content of the EEPROM (--any-eeprom)": over.any_eeprom,
    }
    return [text for text, given in named.items() if given]


def _held_buttons(proof: Proof, schedule: PulseSchedule) -> list[str]:
    """Return the pins with a meaning in the schedule that a proof is about one level of."""
    if not (schedule.buttons or schedule.commands):
        return []
    return [f"one level of {PINS[pin]} (--hold-inputs)" for pin in sorted(proof.held)]


def prove_program(
    image: Image, schedule: PulseSchedule, text: bytes, max_states: int = MAX_STATES
) -> tuple[CertificateVerdict, Proof, Witnessed | None]:
    """Prove a program against a schedule, the content `text` of its file, for every power-up, input and chip,
    and have the proof checked. Raises ToolError.
    """
    proof = prove_for_all(image, schedule, max_states=max_states)
    if not proof.proven:
        shown = proof.counterexample
        why = f"counterexample: {shown.message}" if shown else f"not decided: {proof.reason}"
        return CertificateVerdict(f"NOT proven: {why}", False), proof, None
    witness = second_witness(proof, image, schedule, text)
    return CertificateVerdict(witness.text, witness.checked is not None), proof, witness


def prove_unless_kept(file: Path, image: Image, schedule: PulseSchedule) -> CertificateVerdict:
    """Return the verdict on a program: by the certificate that is kept of it, or else by proving it. The
    certificate is then also in `file`.

    Raises ToolError.
    """
    found, verdict = _find_certificate([file], image, schedule)
    if verdict.valid:
        if found != file and found is not None:
            file.parent.mkdir(parents=True, exist_ok=True)
            write_bytes(file, read_input(found, MAX_CERTIFICATE_BYTES))
        return verdict
    text = schedule.json_text().encode()
    verdict, _, witness = prove_program(image, schedule, text)
    if witness is not None and verdict.valid:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(file, witness.certificate)
        keep(witness, image, text, schedule)
    return verdict


def beside(program: Path) -> Path:
    """Return where the certificate beside a HEX file is."""
    return program.with_name(f"{program.name.removesuffix('.hex')}{SUFFIX}")


def tape_content(schedule: PulseSchedule) -> bytes:
    """Return the content of a schedule's tape; none without one."""
    return schedule.tape.content if schedule.tape else b""


def cache_path(image: Image, text: bytes, tape: bytes = b"") -> Path | None:
    """Return the path in the user's cache for the certificate of a program, a schedule's text and its tape;
    None if the user has no home folder.
    """
    base = Path(os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or "~/.cache")
    with suppress(RuntimeError):
        parts = fingerprint(image).encode(), hashlib.sha256(text).digest(), tape
        name = hashlib.sha256(b"".join(parts)).hexdigest()
        return base.expanduser() / "servogen" / "certificates" / f"{name}{SUFFIX}"
    return None


def keep(witness: Witnessed, image: Image, text: bytes, schedule: PulseSchedule) -> None:
    """Keep a checked certificate in the user's cache, where `build` finds it; a cache may be read-only."""
    path = cache_path(image, text, tape_content(schedule))
    if witness.checked is not None and path is not None:
        with suppress(OSError, ToolError, InputError):
            path.parent.mkdir(parents=True, exist_ok=True)
            write_bytes(path, witness.certificate)


def find_verdict(files: Iterable[Path], image: Image, schedule: PulseSchedule) -> CertificateVerdict:
    """Return the checker's verdict on the first of `files`, or in the cache, that is a certificate of exactly
    this program, schedule and tape.
    """
    return _find_certificate(files, image, schedule)[1]


def _find_certificate(
    files: Iterable[Path], image: Image, schedule: PulseSchedule
) -> tuple[Path | None, CertificateVerdict]:
    text, tape = schedule.json_text().encode(), tape_content(schedule)
    digest = hashlib.sha256(tape).hexdigest() if schedule.tape else ""
    own = fingerprint(image), hashlib.sha256(text).hexdigest(), digest
    cache = cache_path(image, text, tape)
    for file in (*files, *([] if cache is None else [cache])):
        with suppress(InputError):  # a broken file is none
            claim = _claim(file) if file.is_file() else None
            if claim and (claim.image, claim.schedule, claim.tape) == own:
                return file, _check(claim, image, schedule)
    return None, CertificateVerdict("not proven yet", False, missing=True)


def check_file(file: Path, image: Image, schedule: PulseSchedule) -> CertificateVerdict:
    """Return the checker's verdict on a certificate, if it exists. Raises InputError if it is malformed."""
    if not file.exists():
        return CertificateVerdict("no certificate", False, missing=True)
    return _check(_claim(file), image, schedule)


def _claim(file: Path) -> Certificate:
    return read_certificate(read_input(file, MAX_CERTIFICATE_BYTES), str(file))


def _check(claim: Certificate, image: Image, schedule: PulseSchedule) -> CertificateVerdict:
    text = schedule.json_text().encode()
    try:
        result = check_certificate(claim, image, text, "schedule.json", tape=tape_content(schedule))
    except Refused as refused:
        return CertificateVerdict(f"refused: {refused}", False)
    # The held line of a stream is part of the theorem: the schedule says nothing of other levels.
    held = ["with " + " and ".join(claim.held) + " held"] if result.restrictions else []
    return CertificateVerdict(", ".join([CHECKED, *held]), True)
