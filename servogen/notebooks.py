"""Values as a notebook shows them: a small table in HTML.

In: a title, columns and rows of anything. Out: HTML in which every cell is text.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape


def table_html(title: str, columns: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return a table with a caption."""
    head = "".join(f"<th>{escape(column)}</th>" for column in columns)
    body = "".join(f"<tr>{''.join(f'<td>{escape(str(cell))}</td>' for cell in row)}</tr>\n" for row in rows)
    return f"<table>\n<caption>{escape(title)}</caption>\n<tr>{head}</tr>\n{body}</table>"
