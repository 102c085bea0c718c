"""Edges in files: CSV, JSON lines and VCD, selected by the file's suffix.

`write_edges` writes one trace to several files in one pass; `recorded` writes while another reads;
`read_edges` gives an EdgeTrace that reads the file, chunk by chunk, each time it is iterated.
"""

from servogen.traces.formats import SUFFIXES, edge_writer, read_edges, recorded, write_edges
from servogen.traces.inputs import NO_INPUTS, Inputs

__all__ = [
    "NO_INPUTS",
    "SUFFIXES",
    "Inputs",
    "edge_writer",
    "read_edges",
    "recorded",
    "write_edges",
]
