"""A small robot whose two servos are on one chip or on two, with both signals on RB0."""

ONE = '[chip]\ndevice = "PIC16F84"\nclock_hz = 4_000_000\n'
TWO = "".join(f'[{ONE[:6]}]{ONE[6:]}wire = "{pin}"\n' for pin in ("RB0", "RA1"))
ARM = """
[robot]
name = "theta1-theta2"

[[servo]]
name = "shoulder"
pin = "RB0"
model = "futaba-s3001"
joint = "q1"

[[servo]]
name = "elbow"
pin = "{elbow}"
model = "futaba-s3001"
joint = "q2"

[motion]
poses = [
    {{ shoulder_deg = 60, elbow_deg = 110, hold_s = 0.4 }},
    {{ shoulder_deg = 90, elbow_deg = 70, hold_s = 0.4 }},
]
"""
