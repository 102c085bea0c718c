"""A lab's task as data, and the check of what a program's pins do against it."""

from servogen.grade.chip import ChipFacts
from servogen.grade.grade import Grade, Row, refused
from servogen.grade.judge import judge
from servogen.grade.lab import Lab, load_lab, names
from servogen.grade.page import page

__all__ = ["ChipFacts", "Grade", "Lab", "Row", "judge", "load_lab", "names", "page", "refused"]
