"""Transformations of the intermediate form, one file each."""
