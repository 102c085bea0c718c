"""What people read: the text report of a build."""

from servogen.report.text import BuildFacts, Overrun, ProgramFacts, report_text, rooms_text

__all__ = ["BuildFacts", "Overrun", "ProgramFacts", "report_text", "rooms_text"]
