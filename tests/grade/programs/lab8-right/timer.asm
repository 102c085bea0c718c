; Timer 0 measures the pulse and the rest of the frame; the program waits for its overflow.
        LIST    P=16F84
        INCLUDE "P16F84.INC"
        __CONFIG _XT_OSC & _WDT_OFF & _PWRTE_ON & _CP_OFF

FRAMES  EQU     0x0C
WIDTH   EQU     0x0D
AGAIN   EQU     0x0E

        ORG     0
        BSF     STATUS, RP0
        CLRF    TRISB
        MOVLW   B'00000010'     ; prescaler 1:8 for timer 0
        MOVWF   OPTION_REG
        BCF     STATUS, RP0
        CLRF    PORTB

ROUND   MOVLW   .256-.146       ; 146 x 8 us = 1168 us
        MOVWF   WIDTH
        MOVLW   .106            ; x 18.9 ms = 2 s
        CALL    HOLD
        MOVLW   .256-.187       ; 1496 us
        MOVWF   WIDTH
        MOVLW   .250
        CALL    HOLD
        MOVLW   .13
        CALL    HOLD
        MOVLW   .256-.208       ; 1664 us
        MOVWF   WIDTH
        MOVLW   .155
        CALL    HOLD
        GOTO    ROUND

HOLD    MOVWF   FRAMES
FRAME   BSF     PORTB, 0
        MOVF    WIDTH, W
        CALL    WAIT
        BCF     PORTB, 0
        MOVLW   .9              ; 8 x 2048 us, and a part
        MOVWF   AGAIN
REST    MOVLW   .256-.242
        CALL    WAIT
        DECFSZ  AGAIN, F
        GOTO    REST
        DECFSZ  FRAMES, F
        GOTO    FRAME
        RETURN

WAIT    MOVWF   TMR0
        BCF     INTCON, T0IF
LOOP    BTFSS   INTCON, T0IF
        GOTO    LOOP
        RETURN
        END
