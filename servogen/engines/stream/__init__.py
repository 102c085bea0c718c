"""The stream engine as numbers: its protocol, its baud rates, the frame, the chip's behaviour."""
