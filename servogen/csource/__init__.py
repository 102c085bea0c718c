"""PulseSchedule + Overheads -> the C of each dialect, through `templates/`."""

from servogen.csource.overheads import Overheads, Path
from servogen.csource.render import DIALECTS, render
from servogen.csource.sequence import Sequence, sequence

__all__ = ["DIALECTS", "Overheads", "Path", "Sequence", "render", "sequence"]
