"""The player: two servos per slot, poses and a script in tables, laws between the poses on the chip."""

from servogen.engines.player.layout import Slot, SlotLayout
from servogen.engines.player.playing import Playing, playing
from servogen.engines.player.soft_start import soft_start

__all__ = ["Playing", "Slot", "SlotLayout", "playing", "soft_start"]
