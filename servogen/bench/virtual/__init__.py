"""Devices that are not there: a chip, an analyser and a programmer that speak the real wire protocols."""
