"""From the typed tree to instructions."""
