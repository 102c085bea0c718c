{% macro wait(label, delay) %}
; {{ delay.cycles }} cycles: loops of 8.
    movlw   {{ delay.low }}
    movwf   _fine
    movlw   {{ delay.high }}
    movwf   _apart
{{ label }}:
    goto    $+1
    clrwdt
    decfsz  _fine, F
    goto    $+2
    decfsz  _apart, F
    goto    {{ label }}
{%- for line in delay.rest %}

    {{ line }}
{%- endfor %}
{%- endmacro %}
{% if not follows %}
; The other chip waits for a wire that is low for a frame: it has {{ frames }} frames for its own start and that.
    movlw   {{ frames }}
    movwf   _stay
pl_quiet:
{{ wait("pl_frame", frame) }}
    decfsz  _stay, F
    goto    pl_quiet
{% else %}
{% if own %}
; Joins the other chip's frames. In: the wire. Out: TMR0 is 0, so that the kernel awaits the wire's next rise {{ ahead }} ticks
; later.
{% else %}
; Joins the other chip's frames. In: the wire. Out: TMR0 is 0, so that the wire's next rise, {{ ahead }} ticks later, comes in
; the middle cycle of the kernel's look.
{% endif %}
;
; A wire that is low for longer than a frame: its next rise is the other chip's first. TMR0 is cleared while that is awaited,
; so that the time that this takes leaves no trace.
pl_wire:
    clrf    TMR0
    clrf    _count
pl_quiet:
    clrwdt
    btfsc   PORT{{ port }}, {{ bit }}
    goto    pl_wire
    movlw   {{ pause }}
    movwf   _apart
pl_pause:
    decfsz  _apart, F
    goto    pl_pause
    decfsz  _count, F
    goto    pl_quiet
pl_rise:
    clrwdt
    btfsc   PORT{{ port }}, {{ bit }}
    goto    pl_seen             ; seen 0 to {{ late }} cycles late, here
    clrf    TMR0
    btfss   PORT{{ port }}, {{ bit }}
    goto    pl_rise
    nop                         ; or here
pl_seen:
{% if not own %}
    movlw   {{ late }}
    movwf   _stay
pl_later:
{{ wait("pl_frame", frame) }}
    btfss   PORT{{ port }}, {{ bit }}            ; the cycle before the rise, unless it was seen late: then a cycle less
    goto    $+1
    decfsz  _stay, F
    goto    pl_later
{% endif %}
{{ wait("pl_last", last) }}
    clrf    TMR0
{% endif %}
