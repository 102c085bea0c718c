"""Many small cases in one test: each takes less time than pytest needs to set it up."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

Test = Callable[..., None]


def every(names: str | Sequence[str], rows: Iterable[Any]) -> Callable[[Test], Test]:
    """Call a test with every row, as `pytest.mark.parametrize` does; an error names its row.

    Two of these decorators call the test with every pair of their rows.
    """
    keys = (names,) if isinstance(names, str) else tuple(names)
    all_rows = [(row,) if isinstance(names, str) else tuple(row) for row in rows]

    def decorate(test: Test) -> Test:
        def run(**others: Any) -> None:
            for row in all_rows:
                given = dict(zip(keys, row, strict=True))
                try:
                    test(**others, **given)
                except BaseException as error:
                    error.add_note(f"with {given}")
                    raise

        run.__name__, run.__doc__, run.__module__ = test.__name__, test.__doc__, test.__module__
        return run

    return decorate
