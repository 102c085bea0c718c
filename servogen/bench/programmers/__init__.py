"""Programming a chip, and reading it back."""
