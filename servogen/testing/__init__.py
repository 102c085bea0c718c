"""Firmware tests with pytest: fixtures, and the targets on which a test runs."""
