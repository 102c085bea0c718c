"""python -m tools.superoptimiser FOLDER …: find shorter sequences for the windows of C programs.

Adds what it finds to servogen/compiler/passes/rules.json.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Sequence
from pathlib import Path

import typer

from servogen.compiler.passes import rules as rule_file
from servogen.compiler.passes import superoptimise
from servogen.compiler.passes.rules import Rule
from tools.superoptimiser.corpus import collected, files_in
from tools.superoptimiser.search import Finder, catalogue, differing, twins

TARGET = Path(rule_file.__file__).with_name("rules.json")


def main(folders: list[Path], longest_new: int = 3, longest_old: int = 6, fewest: int = 1) -> None:
    began = time.monotonic()
    all_sequences = catalogue(longest_new)
    for length, count, doubled in twins(all_sequences):
        share = f"{100 * doubled / count:.0f} %"
        print(f"{length} instructions: {count} sequences, {share} have a twin that is no longer")
    print(f"{time.monotonic() - began:.0f} s", flush=True)
    finder, sources = Finder.of(all_sequences), files_in(folders)
    found = list(rule_file.rules())
    for size in range(2, longest_old + 1):  # short rules first: they also shorten what longer ones would
        windows = collected(sources, size)
        for (old, dead), count in windows.most_common():
            if len(old) != size or count < fewest:
                continue
            new = finder.proven(old, dead)
            if new is None:
                continue
            needed = differing(old, new)
            if not any(covers(rule, old, needed) for rule in found):
                found.append(Rule(old, new, frozenset(needed)))
        found = without_special_cases(found)
        write(found)
        print(f"up to {size} instructions: {len(found)} rules, {time.monotonic() - began:.0f} s", flush=True)


def covers(rule: Rule, old: Sequence[object], dead: Iterable[str]) -> bool:
    """Return whether a rule already applies wherever one for `old` with `dead` would."""
    return rule.old == old and rule.dead <= set(dead)


def without_special_cases(found: Sequence[Rule]) -> list[Rule]:
    """Return the rules without those for a literal that another has for all."""
    general = {(rule.old, rule.dead) for rule in found}
    kept = []
    for rule in found:
        literals = {each.k for each in rule.old if each.k is not None} - {"k"}
        form = tuple(each if each.k is None else type(each)(each.op, k="k") for each in rule.old)
        special = len(literals) == 1 and any((form, dead) in general for dead in subsets(rule.dead))
        if not special:
            kept.append(rule)
    return kept


def subsets(names: frozenset[str]) -> list[frozenset[str]]:
    found = [frozenset[str]()]
    for name in names:
        found += [each | {name} for each in found]
    return found


def write(found: Sequence[Rule]) -> None:
    """Write the rules, one per line, and make the pass use them."""
    rows = [
        json.dumps({"from": [*map(str, rule.old)], "to": [*map(str, rule.new)], "dead": sorted(rule.dead)})
        for rule in sorted(found, key=lambda rule: (len(rule.old), [*map(str, rule.old)], sorted(rule.dead)))
    ]
    TARGET.write_text("[\n" + ",\n".join(rows) + "\n]\n")
    rule_file.rules.cache_clear()
    superoptimise._table.cache_clear()


if __name__ == "__main__":
    typer.run(main)
