"""The arm command language: from the text of a program to the trajectory of the arm that it moves."""

from servogen.movemaster.arm import Hand, Manipulator, manipulator
from servogen.movemaster.memory import PortInput, input_of
from servogen.movemaster.parser import parse, read
from servogen.movemaster.run import Budget, ProgramRun, run

__all__ = [
    "Budget",
    "Hand",
    "Manipulator",
    "PortInput",
    "ProgramRun",
    "input_of",
    "manipulator",
    "parse",
    "read",
    "run",
]  # fmt: skip
