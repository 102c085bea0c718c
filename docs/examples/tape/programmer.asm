; A PIC16F84 at 4 MHz that writes a serial EEPROM: bytes come over a serial line, 9600 baud, 8N1, 5 V.
;
; RB0 in, RB1 out (idle high); SCL RA3, SDA RA4, as in a job with a [tape].
; A block is 35 bytes: address, high and low byte; 32 bytes; the sum of these 34, modulo 256.
; The answer is K once the EEPROM has written it, E if the sum is wrong or the EEPROM does not acknowledge.
        list    p=16f84a, r=dec
        include <p16f84a.inc>
        __config _XT_OSC & _WDT_OFF & _PWRTE_ON

        cblock  0x0C
        byte, bits, wait, sum, left, tries, lost
        endc
block   equ     0x20            ; the 34 bytes

SCL     equ     0x08
SDA     equ     0x10

        org     0
        movlw   SDA
        movwf   PORTA
        movlw   2
        movwf   PORTB
        bsf     STATUS, RP0
        clrf    TRISA ^ 0x80
        movlw   0xFD
        movwf   TRISB ^ 0x80
        bcf     STATUS, RP0

next_block
        clrf    sum
        movlw   block
        movwf   FSR
        movlw   34
        movwf   left
in_loop call    receive
        movwf   INDF
        addwf   sum, f
        incf    FSR, f
        decfsz  left, f
        goto    in_loop
        call    receive
        xorwf   sum, w
        movlw   'E'
        btfss   STATUS, Z
        goto    answer
        call    write
        movlw   'K'
        btfss   STATUS, C
        movlw   'E'
answer  call    transmit
        goto    next_block

; Writes the block; the carry is set if every byte was acknowledged and the write has ended.
write   clrf    lost
        call    start
        movlw   0xA0
        call    give
        movlw   block
        movwf   FSR
        movlw   34
        movwf   left
out     movf    INDF, w
        call    give
        incf    FSR, f
        decfsz  left, f
        goto    out
        call    stop
        bcf     STATUS, C
        movf    lost, f
        btfss   STATUS, Z
        return
        clrf    tries
poll    clrf    lost            ; no acknowledge until it has written: up to 5 ms
        call    start
        movlw   0xA0
        call    give
        movf    lost, f
        btfsc   STATUS, Z
        goto    written
        decfsz  tries, f
        goto    poll
        bcf     STATUS, C
        return
written call    stop
        bsf     STATUS, C
        return

; A start; the EEPROM lets go of SDA within nine clocks.
start   movlw   10
        movwf   bits
free    movlw   SCL | SDA
        movwf   PORTA
        btfsc   PORTA, 4
        goto    fall
        movlw   SDA
        movwf   PORTA
        decfsz  bits, f
        goto    free
        bsf     lost, 0
fall    movlw   SCL
        movwf   PORTA
        nop
        clrf    PORTA
        return

stop    clrf    PORTA
        movlw   SCL
        movwf   PORTA
        movlw   SCL | SDA
        movwf   PORTA
        return

; W to the EEPROM; lost is not 0 after a byte that was not acknowledged.
give    movwf   byte
        movlw   8
        movwf   bits
give_1  rlf     byte, f
        movlw   0
        btfsc   STATUS, C
        movlw   SDA
        movwf   PORTA
        iorlw   SCL
        movwf   PORTA
        andlw   SDA
        movwf   PORTA
        decfsz  bits, f
        goto    give_1
        movlw   SDA
        movwf   PORTA
        movlw   SCL | SDA
        movwf   PORTA
        movf    PORTA, w
        andlw   SDA
        iorwf   lost, f
        movlw   SDA
        movwf   PORTA
        return

; A byte from the line, in W and byte. A bit is 104 cycles; the first is sampled 1.5 bits after the edge.
receive btfsc   PORTB, 0
        goto    receive
        movlw   8
        movwf   bits
        movlw   49              ; 147 cycles
        call    delay
sample  rrf     byte, f
        bcf     byte, 7
        btfsc   PORTB, 0
        bsf     byte, 7
        movlw   30              ; 90 cycles
        call    delay
        nop
        decfsz  bits, f
        goto    sample
        movf    byte, w
        return                  ; in the stop bit

; W to the line.
transmit
        movwf   byte
        movlw   9
        movwf   bits
        bcf     STATUS, C       ; the start bit
bit     btfsc   STATUS, C
        bsf     PORTB, 1
        btfss   STATUS, C
        bcf     PORTB, 1
        movlw   29
        call    delay
        goto    $+1
        rrf     byte, f
        decfsz  bits, f
        goto    bit
        nop
        bsf     PORTB, 1        ; the stop bit
        movlw   40
        goto    delay

; 3 W + 4 cycles, with the call.
delay   movwf   wait
        decfsz  wait, f
        goto    $-1
        return
        end
