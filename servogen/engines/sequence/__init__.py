"""The `sequence` engine: every edge a port write, every delay in cycles, overheads measured and taken off."""
