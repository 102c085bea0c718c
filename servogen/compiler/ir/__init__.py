"""The intermediate form: instructions with symbolic operands, and the functions that they make up."""
