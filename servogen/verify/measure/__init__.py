"""Measures what a program does on its pins, from its edges alone."""
