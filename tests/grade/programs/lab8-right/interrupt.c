// The timer interrupt says when a frame begins, a delay makes the pulse.
#include <xc.h>
#pragma config WDTE = OFF, FOSC = XT
#define _XTAL_FREQ 4000000
volatile unsigned char ticks, due;
void __interrupt() tick(void) {
  if (T0IF) {
    T0IF = 0;
    if (++ticks == 19) { ticks = 0; due = 1; }  // 19 x 1024 us = 19.456 ms
  }
}
static void hold(unsigned int frames, unsigned char which) {
  while (frames--) {
    while (!due) ;
    due = 0;
    GIE = 0;
    RB0 = 1;
    if (which == 0) __delay_us(1160);
    else if (which == 1) __delay_us(1494);
    else __delay_us(1660);
    RB0 = 0;
    GIE = 1;
  }
}
void main(void) {
  TRISB = 0;
  PORTB = 0;
  OPTION_REG = 0xC1;  // 1:4, so that 256 counts are 1024 us
  T0IE = 1;
  GIE = 1;
  while (1) {
    hold(103, 0);
    hold(257, 1);
    hold(154, 2);
  }
}
