"""The player: two servos a slot, keyframes in flash, interpolation on the chip; as numbers."""

from servogen.pulse.player.fitting import Part
from servogen.pulse.player.layout import Layout, Slot
from servogen.pulse.player.playing import Playing, playing
from servogen.pulse.player.room import Room
from servogen.pulse.player.soft_start import soft_start

__all__ = ["Layout", "Part", "Playing", "Room", "Slot", "playing", "soft_start"]
