"""python -m tests.compiler.size: the recorded sizes, lowered to what the compiler needs now, never raised."""

import json

from tests.compiler.size.measure import LEVELS, RECORD, measured, recorded


def main() -> None:
    old, new = recorded(), measured()
    for name, levels in new.items():
        for level, words in levels.items():
            before = old.get(name, {}).get(level)
            if before is not None and words > before:
                print(f"{name}, {level}: {words} words, {before} are recorded; it is kept")
                levels[level] = before
    RECORD.write_text(json.dumps(dict(sorted(new.items())), indent=4) + "\n")
    for level in LEVELS:
        now, before = (sum(each[level] for each in found.values() if level in each) for found in (new, old))
        print(f"{len(new)} programs, {level}: {now} words; {before} before")


if __name__ == "__main__":
    main()
