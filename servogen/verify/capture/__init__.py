"""The check of what a logic analyser saw against a schedule."""
