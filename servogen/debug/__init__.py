"""Examines a running program: any moment, breakpoints, and the names of its source."""
