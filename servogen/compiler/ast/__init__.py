"""The typed tree: C types, expressions and statements, constant folding."""
