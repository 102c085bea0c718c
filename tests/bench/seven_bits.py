"""Firmata's encoding of bytes, as its protocol describes it for the scheduler."""

from __future__ import annotations


def packed(data: bytes) -> str:
    """Return bytes as the scheduler takes them: their bits, the lowest first, seven at a time."""
    bits = "".join(f"{byte:08b}"[::-1] for byte in data)
    return " ".join(f"{int(bits[first : first + 7][::-1], 2):02x}" for first in range(0, len(bits), 7))
