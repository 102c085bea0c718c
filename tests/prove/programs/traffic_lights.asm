; traffic_lights.asm: red RB2, yellow RB1 and green RB0; RA0 low asks for green, which else never comes.
        list    p=16f84
        include <p16f84.inc>
        __config _XT_OSC & _WDT_OFF & _PWRTE_ON & _CP_OFF
        cblock  0x20
state, inner, outer
        endc

        org     0
        clrf    PORTB
        bsf     STATUS, RP0
        clrf    TRISB
        bcf     STATUS, RP0
        clrf    state
loop    movf    state, w
        call    lights
        movwf   PORTB
        call    second
        movf    state, w
        btfss   STATUS, Z
        goto    next
        btfsc   PORTA, 0
        goto    loop
next    incf    state, f
        btfsc   state, 2
        clrf    state
        goto    loop
lights  addwf   PCL, f
        retlw   b'100'
        retlw   b'110'
        retlw   b'001'
        retlw   b'010'

second  movlw   .194                    ; 194 * (256 * 20 + 3) cycles are 0.994 s
        movwf   outer
        clrf    inner
wait    goto    $+1
        goto    $+1
        goto    $+1
        goto    $+1
        goto    $+1
        goto    $+1
        goto    $+1
        goto    $+1
        nop
        decfsz  inner, f
        goto    wait
        decfsz  outer, f
        goto    wait
        return
        end
