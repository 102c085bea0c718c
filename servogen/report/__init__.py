"""What people read: the text report of a build."""

from servogen.report.text import BuildFacts, Overrun, ProgramFacts, report_text, timing_budgets_text

__all__ = ["BuildFacts", "Overrun", "ProgramFacts", "report_text", "timing_budgets_text"]
