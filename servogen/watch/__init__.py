"""Running programs and recordings in a browser: time machine, server, and the values that it shows."""
