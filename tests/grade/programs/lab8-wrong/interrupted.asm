; Three pulses are missing after every eighth one.
        LIST    P=16F84
        INCLUDE "P16F84.INC"
        __CONFIG _XT_OSC & _WDT_OFF

N       EQU     0x0C
I       EQU     0x0D
J       EQU     0x0E
K       EQU     0x0F
W1      EQU     0x10

        ORG     0
        BSF     STATUS, RP0
        CLRF    TRISB
        BCF     STATUS, RP0
AGAIN   MOVLW   .33             ; 1 ms + 33 x 5 us
        CALL    MOVE
        MOVLW   .2
        CALL    SECONDS
        MOVLW   .100            ; 1 ms + 500 us
        CALL    MOVE
        MOVLW   .5
        CALL    SECONDS
        MOVLW   .133
        CALL    MOVE
        MOVLW   .3
        CALL    SECONDS
        GOTO    AGAIN

MOVE    MOVWF   W1
        MOVLW   .100
        MOVWF   N
PULSE   BSF     PORTB, 0
        CALL    MS
        MOVF    W1, W
        MOVWF   K
FIVE    NOP
        NOP
        DECFSZ  K, F
        GOTO    FIVE
        BCF     PORTB, 0
        MOVLW   .18
        CALL    MANY
        MOVLW   .7
        ANDWF   N, W
        BTFSS   STATUS, Z
        GOTO    NODROP
        MOVLW   .80
        CALL    MANY
NODROP  DECFSZ  N, F
        GOTO    PULSE
        RETURN

SECONDS MOVWF   N
SECOND  MOVLW   .250
        CALL    MANY
        MOVLW   .250
        CALL    MANY
        MOVLW   .250
        CALL    MANY
        MOVLW   .250
        CALL    MANY
        DECFSZ  N, F
        GOTO    SECOND
        RETURN

MANY    MOVWF   J
NEXT    CALL    MS
        DECFSZ  J, F
        GOTO    NEXT
        RETURN

MS      MOVLW   .247            ; 247 x 4 us, the call and the return
        MOVWF   I
MSLOOP  NOP
        DECFSZ  I, F
        GOTO    MSLOOP
        NOP
        NOP
        NOP
        RETURN
        END
