"""The bench: a programmer and a logic analyser on serial ports, and virtual ones around the simulator.

`ports` opens a port, `sump_client` captures, `flashing` programs; `virtual` holds devices that speak the same
protocols on pseudo-terminals.
"""
