"""The second witness: checks the certificates of `servogen prove` without its help."""

from servogen.checker.certificate import Certificate, read_certificate
from servogen.checker.check import Checked, NotCovered, Refused, check_certificate

__all__ = ["Certificate", "Checked", "NotCovered", "Refused", "check_certificate", "read_certificate"]
