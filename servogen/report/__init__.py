"""What people read: the text report of a build."""

from servogen.report.text import BuildFacts, ProgramFacts, report_text

__all__ = ["BuildFacts", "ProgramFacts", "report_text"]
