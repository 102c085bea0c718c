"""A stream program on any serial line: what its words do with every byte, and in every cycle."""
