/* A controller with proportional, integral and differential part; set point on port B, output by PWM on RA0. */
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#include <xc.h>
#include <stdint.h>
#define _XTAL_FREQ 4000000

#define KP 12
#define KI 3
#define KD 20

static int16_t integral, before;

static uint8_t control(uint8_t wanted, uint8_t measured)
{
    int16_t error = (int16_t)wanted - measured;
    int16_t change = error - before;
    int32_t sum;

    before = error;
    integral += error;
    if (integral > 2000)
        integral = 2000;
    else if (integral < -2000)
        integral = -2000;
    sum = (int32_t)error * KP + (int32_t)integral * KI + (int32_t)change * KD;
    sum /= 16;
    if (sum < 0)
        return 0;
    if (sum > 255)
        return 255;
    return (uint8_t)sum;
}

static uint8_t measure(void)
{
    uint8_t count = 0;
    PORTAbits.RA1 = 1;
    while (!PORTAbits.RA2 && count < 255)
        count++;
    PORTAbits.RA1 = 0;
    return count;
}

void main(void)
{
    PORTA = 0;
    TRISA = 0x1C;
    TRISB = 0xFF;
    while (1) {
        uint8_t on = control(PORTB, measure()), n = 0;
        do {
            PORTAbits.RA0 = n < on;
        } while (++n);
    }
}
