"""The stream engine: its protocol, its baud rates, the frame, the chip's behaviour."""
