"""The second witness: checks what `servogen prove` has found without its help."""

from servogen.checker.certificate import Certificate, read_certificate
from servogen.checker.check import Checked, NotCovered, Refused, check_certificate
from servogen.checker.contract import Hints, check_contract

__all__ = [
    "Certificate",
    "Checked",
    "Hints",
    "NotCovered",
    "Refused",
    "check_certificate",
    "check_contract",
    "read_certificate",
]
