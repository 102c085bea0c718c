"""The player: two servos per slot, keyframes in flash, interpolation on the chip; as numbers."""

from servogen.engines.player.fitting import Part
from servogen.engines.player.layout import Layout, Slot
from servogen.engines.player.playing import Playing, playing
from servogen.engines.player.soft_start import soft_start

__all__ = ["Layout", "Part", "Playing", "Slot", "playing", "soft_start"]
