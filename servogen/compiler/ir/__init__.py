"""The intermediate form: instructions with symbolic operands, and the functions made of them."""
