; A seven-segment display on port B counts: the pattern comes from a table of RETLW.

        LIST    P=16F84
        #include "P16F84.INC"
        __CONFIG _HS_OSC & _WDT_OFF & _PWRTE_ON

digit   EQU     0x20

        ORG     0
        CLRF    digit
        BANKSEL TRISB
        CLRF    TRISB
        BANKSEL PORTB
again:  MOVLW   HIGH pattern
        MOVWF   PCLATH
        MOVFW   digit
        CALL    pattern
        MOVWF   PORTB
        INCF    digit, F
        MOVLW   .10
        SUBWF   digit, W
        SKPNC
        CLRF    digit
        GOTO    again

        ORG     0x100
pattern:
        ADDWF   PCL, F
        DT      B'00111111', B'00000110', B'01011011', B'01001111', B'01100110'
        DT      6D, 7D, 7, 7F, 6F

        IF      HIGH pattern != HIGH $
        ERROR   "the table crosses a boundary of 256 words"
        ENDIF
        END
