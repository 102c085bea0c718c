"""Stored certificates of proofs for all inputs: the checker's verdict on a build's programs.

In: builds, a folder of certificates. Out: a verdict on each program's certificate.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from servogen.checker import Refused, check_certificate, read_certificate
from servogen.inputs import read_input
from servogen.pic.image import Image

MAX_CERTIFICATE_BYTES = 4 << 20


@dataclass(frozen=True, slots=True)
class CertificateVerdict:
    """The checker's verdict on one certificate."""

    text: str
    valid: bool
    missing: bool = False


def certificate_file(folder: Path, job: str, program: str) -> Path:
    """Return where the certificate of a job's program, a HEX file's name, is kept."""
    return folder / job / f"{program.removesuffix('.hex')}.cert.xz"


def checked(file: Path, image: Image, schedule: str) -> CertificateVerdict:
    """Return the checker's verdict on a certificate, if it exists. Raises InputError if it is malformed."""
    if not file.exists():
        return CertificateVerdict("no certificate", False, missing=True)
    claim = read_certificate(read_input(file, MAX_CERTIFICATE_BYTES), str(file))
    try:
        result = check_certificate(claim, image, schedule.encode(), "schedule.json")
    except Refused as refused:
        return CertificateVerdict(f"refused: {refused}", False)
    # The held line of a stream is part of the theorem: the schedule says nothing of other levels.
    held = ["with " + " and ".join(claim.held) + " held"] if result.restrictions else []
    return CertificateVerdict(", ".join(["proven", "checked", *held]), True)
