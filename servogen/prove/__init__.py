"""Proof that a program follows its schedule for every power-up, input and chip.

In: an image and a schedule. Out: a `Proof`, of which `certificate` makes what an independent checker repeats.
"""

from servogen.prove.certificate import certificate
from servogen.prove.counterexample import Counterexample
from servogen.prove.prover import Proof, prove_for_all
from servogen.prove.quantifiers import Quantifiers

__all__ = ["Counterexample", "Proof", "Quantifiers", "certificate", "prove_for_all"]
