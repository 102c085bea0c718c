"""Composition of the packages: from a job to HEX files with a verdict."""
