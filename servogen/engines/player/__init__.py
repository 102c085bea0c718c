"""The player: two servos per slot, poses and a script in tables, laws between the poses on the chip."""

from servogen.engines.player.layout import SlotLayout
from servogen.engines.player.playing import Playing, playing

__all__ = ["Playing", "SlotLayout", "playing"]
