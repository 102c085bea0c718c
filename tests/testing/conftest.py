"""The plugin's own tests run pytest inside this process, on projects in a temporary folder."""

from __future__ import annotations

pytest_plugins = ["pytester"]
