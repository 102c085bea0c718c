"""The check of a logic analyser's capture against a schedule."""
