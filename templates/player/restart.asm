; 768 cycles.
    clrf    _count
pl_restart:
    decfsz  _count, F
    goto    pl_restart
