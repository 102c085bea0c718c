"""What a program must do at its pins: a contract in TOML, and its judgement on edges."""

from servogen.contract.clauses import Clause, Contract, load_contract, parse_contract
from servogen.contract.judge import ClauseVerdict, ContractVerdict, judge_contract
from servogen.contract.proposal import proposed_contract

__all__ = [
    "Clause",
    "ClauseVerdict",
    "Contract",
    "ContractVerdict",
    "judge_contract",
    "load_contract",
    "parse_contract",
    "proposed_contract",
]
