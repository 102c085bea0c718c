"""TOML whose every value remembers its location: reading, checking, and errors with a line."""
