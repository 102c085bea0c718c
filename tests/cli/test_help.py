"""What `--help` says is what was written."""

from collections.abc import Iterator
from typing import Any

import typer
from rich.text import Text

from servogen.cli.main import app


def helps(command: Any) -> Iterator[str]:
    """The help of a command, of its options and of its sub-commands."""
    yield command.help or ""
    for each in command.params:
        yield getattr(each, "help", None) or ""
    for sub in getattr(command, "commands", {}).values():
        yield from helps(sub)


def test_no_help_has_brackets_that_are_taken_for_markup() -> None:
    """The help is shown as rich's markup, in which [word] is a style and vanishes."""
    assert Text.from_markup("the job's [stream]").plain == "the job's "
    texts = list(helps(typer.main.get_command(app)))
    assert len(texts) > 100
    assert [text for text in texts if Text.from_markup(text).plain != text] == []
