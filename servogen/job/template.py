"""The commented job file that `servogen new` writes."""

from __future__ import annotations

from importlib.resources import files


def template() -> str:
    """A job that loads as it is; its comments say what else can be written."""
    return (files("servogen.job") / "template.toml").read_text(encoding="utf-8")
