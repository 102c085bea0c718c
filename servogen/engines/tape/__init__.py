"""The tape engine: frames of widths in a serial EEPROM, read while the pulses run."""
