"""Virtual devices: a chip, an analyser and a programmer that speak the real wire protocols."""
