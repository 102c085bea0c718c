"""Checks a logic analyser's capture against a schedule."""
