"""Prints constraints.txt: the version of each package here, except servogen itself, pip and setuptools.

Run by `make constraints`, in an environment that was made for it.
"""

from __future__ import annotations

import platform
import re
from importlib.metadata import distributions

LEFT_OUT = {"servogen", "pip", "setuptools", "wheel"}

HEADER = """\
# What servogen and its extras resolved to on Python {python}; the tests pass with it.
# make installs from here, and so can you: pip install -c constraints.txt . (make constraints renews it)
"""


def main() -> None:
    pins = {re.sub(r"[-_.]+", "-", each.metadata["Name"]).lower(): each.version for each in distributions()}
    print(HEADER.format(python=platform.python_version()), end="")
    for name in sorted(pins.keys() - LEFT_OUT):
        print(f"{name}=={pins[name]}")


if __name__ == "__main__":
    main()
