"""Transformations of the intermediate form, one per file."""
