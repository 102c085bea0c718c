"""The player: two servos a slot, keyframes in flash, interpolation on the chip; as numbers."""

from servogen.pulse.player.layout import Layout, Slot
from servogen.pulse.player.playing import Part, Playing, playing
from servogen.pulse.player.soft_start import soft_start

__all__ = ["Layout", "Part", "Playing", "Slot", "playing", "soft_start"]
