"""The `sequence` engine: every edge is a port write; the overheads of the code are measured and subtracted
from the delays.
"""
