"""python -m tests.compiler.size: the recorded sizes, lowered to what the compiler needs now, never raised.

Also prints these sizes and those of the sequence jobs in firmware/ beside what `before.json` holds.
"""

import json

from tests.compiler.size.measure import LEVELS, RECORD, before, measured, now, recorded


def main() -> None:
    record()
    compare()


def record() -> None:
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


def compare() -> None:
    """Print the words before and now: of the recorded programs, of each job, and in sum."""
    earlier, today = before(), now()
    jobs = [name for name in earlier if name.endswith(".hex")]
    programs = [name for name in earlier if name not in jobs]
    c2c = [name for name in jobs if name.endswith("/main.hex")]
    rows = [("recorded programs", programs), *((name, [name]) for name in jobs)]
    rows += [
        ("programs and jobs in C2C", [*programs, *c2c]),
        ("programs and jobs in all dialects", [*earlier]),
    ]
    for title, names in rows:
        old, new = (sum(words[name] for name in names) for words in (earlier, today))
        print(f"{title:34} {old:5} {new:5}  {100 * (new - old) / old:+5.1f} %")
    larger = [name for name, words in today.items() if words > earlier[name]]
    print(f"larger: {', '.join(larger) or 'none'}")


if __name__ == "__main__":
    main()
