"""A lab's task as data, the programs to compare with it, and the check of a program's pins."""

from servogen.grade.checks import ChipFacts, Fault
from servogen.grade.display import message, page_names, shell_word, shown_name, visible
from servogen.grade.handout import handout_html, handout_markdown
from servogen.grade.judge import Grade, judge, refused
from servogen.grade.lab import Check, Lab, load_lab
from servogen.grade.page import page
from servogen.grade.submissions import Submission, find_submissions

__all__ = [
    "Check",
    "ChipFacts",
    "Fault",
    "Grade",
    "Lab",
    "Submission",
    "find_submissions",
    "handout_html",
    "handout_markdown",
    "judge",
    "load_lab",
    "message",
    "page",
    "page_names",
    "refused",
    "shell_word",
    "shown_name",
    "visible",
]
