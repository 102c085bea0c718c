"""PulseSchedule + Overheads -> the C of each dialect, through `templates/`."""

from servogen.csource.overheads import Overheads, Path
from servogen.csource.player import render_player
from servogen.csource.programs import Sequence
from servogen.csource.rendering import DIALECTS, render
from servogen.csource.sequencing import sequence
from servogen.csource.stream import render_stream

__all__ = [
    "DIALECTS",
    "Overheads",
    "Path",
    "Sequence",
    "render",
    "render_player",
    "render_stream",
    "sequence",
]
