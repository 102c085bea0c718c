"""python -m tools.superoptimiser FOLDER …: find shorter sequences for the windows of C programs.

Adds what it finds to servogen/compiler/passes/rules.json, and removes the rules that none of the programs
has a place for.
"""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import typer

from servogen.compiler.passes import superoptimise
from servogen.compiler.passes.superoptimise import Rule
from tools.superoptimiser.corpus import collected, compile_all, files_in
from tools.superoptimiser.enumeration import Behaviours, Enumeration, Sequence_, Sought
from tools.superoptimiser.proof import can_be_proven, differing, holds, names_in

TARGET = Path(superoptimise.__file__).with_name("rules.json")


def main(
    folders: list[Path],
    longest_new: int = 4,
    longest_old: int = 8,
    minutes: float = 60,
    fewest: int = 1,
) -> None:
    began = time.process_time()
    sources, found = files_in(folders), list(superoptimise.rules())
    windows = collected(sources, longest_old)
    sought = [each for each, count in windows.items() if count >= fewest]
    behaviours = Behaviours(sought)
    print(f"{len(sources)} programs, {len(sought)} different windows; {time.process_time() - began:.0f} s")
    Enumeration(longest_new, behaviours, minutes * 60, frequencies(windows), say).run()
    for size in range(2, longest_old + 1):  # short rules first: they also shorten what longer ones would
        for each, _ in collected(sources, size).most_common():
            if len(each.old) != size or any(covers(rule, each) for rule in found):
                continue
            new = proven(each, behaviours.candidates.get(each, ()))
            if new is not None:
                found.append(Rule(each.old, new, frozenset(differing(each.old, new))))
        found = without_special_cases(found)
        write(found)
        say(f"up to {size} instructions: {len(found)} rules; {time.process_time() - began:.0f} s")
    uses = applied(sources)
    write([rule for rule in found if rule in uses])
    say(f"{len(uses)} of them apply, at {uses.total()} places; {time.process_time() - began:.0f} s")


def say(text: str) -> None:
    print(text, flush=True)


def frequencies(windows: Mapping[Sought, int]) -> Counter[Sequence_]:
    """Return how often each part of a window occurs."""
    found: Counter[Sequence_] = Counter()
    for each, count in windows.items():
        found[each.old] += count
    return found


def proven(sought: Sought, candidates: Iterable[Sequence_]) -> Sequence_ | None:
    """Return the first candidate, shortest first, that does the same for all values; None if none does."""
    known = names_in(sought.old)
    for new in sorted(candidates, key=len):
        if names_in(new) <= known and can_be_proven(sought.old, new) and holds(sought.old, new, sought.dead):
            return new
    return None


def applied(sources: Sequence[tuple[str, str, str]]) -> Counter[Rule]:
    """Return how often each rule is applied in programs."""
    found: Counter[Rule] = Counter()
    best_match = superoptimise.best_match

    def observed(*arguments: Any) -> superoptimise.Match | None:
        match = best_match(*arguments)
        if match is not None:
            found[match.rule] += 1
        return match

    superoptimise.best_match = observed
    try:
        compile_all(sources)
    finally:
        superoptimise.best_match = best_match
    return found


def covers(rule: Rule, sought: Sought) -> bool:
    """Return whether a rule already applies wherever one for what is sought would."""
    return rule.old == sought.old and rule.dead <= sought.dead


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
    superoptimise.rules.cache_clear()
    superoptimise._tree.cache_clear()


if __name__ == "__main__":
    typer.run(main)
