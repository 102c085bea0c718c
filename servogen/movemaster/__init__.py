"""The arm command language: from the text of a program to the trajectory of the arm that it moves."""

from servogen.movemaster.arm import Hand, Manipulator, manipulator
from servogen.movemaster.memory import Input, Output, input_of
from servogen.movemaster.parser import Source, parse, read
from servogen.movemaster.run import Budget, Run, run

__all__ = [
    "Budget", "Hand", "Input", "Manipulator", "Output", "Run", "Source", "input_of", "manipulator", "parse",
    "read", "run",
]  # fmt: skip
