"""The code generator: from the typed tree to instructions."""
