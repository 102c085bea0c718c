"""A program that is a reader and writer of I²C by hand: SCL on RA0, driven, SDA on RA1, pulled low or let go.

`program` makes one from a list of what it does on the bus.
"""

from __future__ import annotations

from collections.abc import Sequence

from servogen.pic.image import Image
from tests.simulator.helpers import image

FIRST = 0x20
"""The address of the first byte that is read, or of the first acknowledge that is noted."""
HEAD = """
SCL equ 0
SDA equ 1
byte equ 0x0C
count equ 0x0D
 movlw 1
 movwf PORTA
 bsf STATUS, RP0
 movlw 0x1E
 movwf TRISA
 bcf STATUS, RP0
 movlw 0x20
 movwf FSR
 goto main
down bcf PORTA, SDA
 bsf STATUS, RP0
 bcf TRISA, SDA
 bcf STATUS, RP0
 return
up bsf STATUS, RP0
 bsf TRISA, SDA
 bcf STATUS, RP0
 return
start call up
 bsf PORTA, SCL
 call down
 bcf PORTA, SCL
 return
stop call down
 bsf PORTA, SCL
 call up
 return
send movwf byte
 movlw 8
 movwf count
bit rlf byte, f
 btfss STATUS, C
 call down
 btfsc STATUS, C
 call up
 bsf PORTA, SCL
 nop
 bcf PORTA, SCL
 decfsz count, f
 goto bit
 call up
 bsf PORTA, SCL
 movf PORTA, w
 bcf PORTA, SCL
 andlw 2
 return
note movwf INDF
 incf FSR, f
 return
take movlw 8
 movwf count
 call up
next bsf PORTA, SCL
 bcf STATUS, C
 btfsc PORTA, SDA
 bsf STATUS, C
 rlf byte, f
 bcf PORTA, SCL
 decfsz count, f
 goto next
 movf byte, w
 goto note
yes call down
no bsf PORTA, SCL
 nop
 bcf PORTA, SCL
 return
main
"""


def program(steps: Sequence[str | int]) -> Image:
    """Return a program of these steps: "start", "stop"; a number: it is sent; "note": whether the last one
    was not acknowledged (2, else 0) goes to RAM; "take": a byte goes to RAM; "yes", "no": the acknowledge
    after it; "poll": start and control byte 0xA0 until it is acknowledged.
    """
    lines = []
    for number, step in enumerate(steps):
        if isinstance(step, int):
            lines.append(f" movlw {step}\n call send\n")
        elif step == "poll":
            lines.append(f"p{number} call start\n movlw 0xA0\n call send\n andlw 2\n")
            lines.append(f" btfss STATUS, Z\n goto p{number}\n")
        else:
            lines.append(f" call {step}\n")
    return image(f"{HEAD}{''.join(lines)}end_ goto end_\n")
