"""A program that is looked into while it runs: any moment, breakpoints, and its source by name."""
