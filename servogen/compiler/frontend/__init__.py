"""From source text to pycparser's syntax tree: preprocessing, the dialects' extensions, parsing."""
