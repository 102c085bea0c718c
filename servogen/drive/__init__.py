"""Positions sent live to a chip with the `stream` engine, or to any controller that speaks Mini SSC."""
