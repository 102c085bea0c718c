"""The text report of a build; the other modules hold pages, pictures, films and tables for people."""

from servogen.report.text import BuildFacts, Overrun, ProgramFacts, report_text, timing_budgets_text

__all__ = ["BuildFacts", "Overrun", "ProgramFacts", "report_text", "timing_budgets_text"]
