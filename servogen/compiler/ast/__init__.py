"""The typed syntax tree: C types, expressions and statements, constant folding."""
