"""servogen: from a robot's job file to a PIC16F84 HEX whose every servo pulse edge is proven."""

__version__ = "0.1.0"
