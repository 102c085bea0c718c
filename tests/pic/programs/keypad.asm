; A button on RB4 with pull-up steps a running light on RB0 to RB3: debounce, sleep, wake-up on change.

        LIST P=16F84,R=HEX
        INCLUDE <P16F84.INC>

        IFNDEF  DEBOUNCE
#DEFINE DEBOUNCE 14
        ENDIF
        CONSTANT LIGHTS=4, FIRST=1
        VARIABLE MASK=0
        WHILE   MASK < (1<<LIGHTS)
MASK    += FIRST
        ENDW
MASK    -= FIRST                        ; 0x0F

        __CONFIG _RC_OSC & _WDT_OFF & _PWRTE_ON
LIGHT   EQU     0C
COUNT   EQU     0D

        ORG     0
        GOTO    START
        ORG     4
        BCF     INTCON,RBIF
        RETFIE

START   BSF     STATUS,RP0
        MOVLW   ~MASK
        MOVWF   TRISB
        BCF     OPTION_REG,NOT_RBPU
        BCF     STATUS,RP0
        MOVLW   FIRST
        MOVWF   LIGHT
NEXT    MOVFW   LIGHT
        MOVWF   PORTB
        BSF     INTCON,RBIE
        SLEEP
        NOP
        BCF     INTCON,RBIE
        MOVLW   DEBOUNCE
        MOVWF   COUNT
STILL   DECFSZ  COUNT
        GOTO    STILL
        BTFSC   PORTB,4
        GOTO    NEXT
        CLRC
        RLF     LIGHT
        TSTF    LIGHT
        BTFSC   LIGHT,LIGHTS
        GOTO    START
        IF      DEBOUNCE > 10
        GOTO    NEXT
        ELSE
        LGOTO   START
        ENDIF
        END
