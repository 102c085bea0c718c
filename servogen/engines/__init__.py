"""The engines: from a motion to the C and the firmware that plays it."""
