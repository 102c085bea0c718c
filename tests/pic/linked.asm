        list p=16f84a
        global duty
        udata_shr
duty    res 1
count   res 2
go      code 0
main    movlw 42
        movwf duty
loop    call delay
        goto loop
delay   movlw 7
        movwf count
        return
        end
