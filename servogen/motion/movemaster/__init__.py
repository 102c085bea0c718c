"""The arm command language: text of a program -> the trajectory of the arm that it moves."""

from servogen.motion.movemaster.arm import Manipulator, manipulator
from servogen.motion.movemaster.mover import Hand
from servogen.motion.movemaster.parse import Source, parse, read
from servogen.motion.movemaster.ports import Input, Output, input_of
from servogen.motion.movemaster.run import Budget, Run, run

__all__ = [
    "Budget", "Hand", "Input", "Manipulator", "Output", "Run", "Source", "input_of", "manipulator", "parse",
    "read", "run",
]  # fmt: skip
